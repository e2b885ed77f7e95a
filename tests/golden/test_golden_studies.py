"""Tables of the studies that give the same each time, as committed: of two cars, or all that a study has.

Their pictures are drawn. Energy, thermal, wear, dust, cycles, compensation, lab, stops, tuning, vehicle and
lies take longer than a minute or two, `observers` prints times. See `reference.py`.
"""

from importlib import import_module
from pathlib import Path

import pytest

from brakelab.bench.registry import MODULES
from brakelab.studies.study import Asked, Study

from .reference import ROUNDED, check

pytestmark = pytest.mark.study

STUDIES = (
    "blocks",
    "blending",
    "bound",
    "ablation",
    "failures",
    "loggers",
    "recorded",
    "margins",
    "friction",
)
"""The longest first."""


@pytest.mark.parametrize("name", STUDIES)
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
