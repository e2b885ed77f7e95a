"""Tables of the studies that give the same each time, as committed: of two cars, or all that a study has.

Those of a minute are studies for `make studies`; energy, thermal, wear, dust, cycles, compensation, lab,
stops, vehicle and lies take longer still, `observers` prints times. See `reference.py`.
"""

import json

import pytest

from ecu import cli

from .reference import ROUNDED, check


@pytest.mark.parametrize(
    "name",
    [
        "friction",
        *(
            pytest.param(name, marks=pytest.mark.study)
            for name in ("failures", "recorded", "margins", "bound", "blending", "blocks", "ablation")
        ),
    ],
)
def test_a_study_gives_the_committed_tables(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["bench", name, "--seeds", "2", "--json"]) == 0
    tables = json.loads(capsys.readouterr().out)["tables"]
    parts = {
        table["title"]: "\n".join(map("\t".join, [table["columns"], *table["rows"]])) for table in tables
    }
    check(f"bench {name}", parts, ROUNDED)
