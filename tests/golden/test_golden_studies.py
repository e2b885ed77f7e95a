"""Tables of the studies that give the same each time, as committed: of two cars, or all that a study has.

Their pictures are drawn. Those of a minute are studies for `make studies`; energy, thermal, wear, dust,
cycles, compensation, lab, stops, tuning, vehicle and lies take longer still, `observers` prints times. See
`reference.py`.
"""

from importlib import import_module
from pathlib import Path

import pytest

from brakelab.bench.registry import MODULES
from brakelab.studies.study import Asked, Study

from .reference import ROUNDED, check

STUDIES = ("failures", "loggers", "recorded", "margins", "bound", "blending", "blocks", "ablation")


@pytest.mark.parametrize(
    "name",
    [
        "friction",
        *(pytest.param(name, marks=pytest.mark.study) for name in STUDIES),
    ],
)
def test_a_study_gives_the_committed_tables(name: str, tmp_path: Path) -> None:
    study: Study = import_module(f"brakelab.{MODULES[name]}").STUDY
    measured = study.run(Asked(seeds=2))
    parts = {
        table.title: "\n".join(map("\t".join, [table.columns, *table.rows])) for table in measured.tables
    }
    check(f"bench {name}", parts, ROUNDED)
    if measured.draw is not None:
        measured.draw(tmp_path)
        assert list(tmp_path.iterdir())
