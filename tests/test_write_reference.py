"""The reference of configurations, maps, scenarios and frames is that of the code; every key is described."""

import re
import runpy
import tomllib
from pathlib import Path

import pytest

import write_reference as reference
from brakelab.results.files import BRAKE_SCHEMA, ROW_SCHEMA
from columns_page import PAGE as COLUMNS
from columns_page import columns_text
from contract_page import EXAMPLE, contract_text
from diagnostics_tables import PAGE as DIAGNOSTICS
from diagnostics_tables import with_tables
from ecu.contract.signals import CORNERS
from requirements_page import PAGE as REQUIREMENTS
from requirements_page import SAFETY, proofs, requirements, requirements_text
from xcp_tables import PAGE as XCP
from xcp_tables import with_xcp_tables

ROOT = Path(__file__).parent.parent
TESTS = [path for path in (ROOT / "tests").rglob("test_*.py") if path != Path(__file__)]
OF_THE_SIGNAL = {
    "noise",
    "resolution",
    "scale",
    "bias",
    "drift",
    "floor",
    "offset",
    "sentinels",
    "amount",
    "invalid",
}
"""In the unit of a signal that the file names."""
SAID = {"delay", "drift_time", "dropout", "dropout_length", "period", "stuck_from", "lost_from"} | {
    *("drag_torque", "drag_growth", "lowest_speed", "ratios", "share_front", "rate", "limit")
}
"""The simulated vehicle knows no units of the ECU; they stand in the meaning."""
FREE = {"constants", "car"}
"""Tables whose keys are names: of a database's signals, of the car's parameters."""
MIXED = {"coefficients", "numbers", "low", "high", "factor", "below", "above"} | {"at_most", "at_least"}


@pytest.mark.parametrize("name", reference.PAGES)
def test_a_page_is_written_from_the_models_as_they_are(name: str) -> None:
    page = (reference.DOCS / name).read_text("utf-8")
    assert page == reference.page_text(name), "run python tools/write_reference.py"


@pytest.mark.parametrize("name", reference.PAGES)
def test_every_key_is_described_and_every_number_has_a_unit(name: str) -> None:
    rows = re.findall(
        r"^\| `(\w+)` \| (.*?) ?\| (.*?) \| (.*?) ?\| (.*?) ?\|$", reference.page_text(name), re.M
    )
    assert len(rows) > 15
    for key, unit, values, _, meaning in rows:
        assert meaning, key
        if re.search(r"number|[<>≥≤]", values) and key not in OF_THE_SIGNAL | SAID | MIXED:
            assert unit, key


@pytest.mark.parametrize(
    ("page", "files"),
    [
        ("reference-config.md", "config/*.toml"),
        ("reference-maps.md", "config/maps/*.toml"),
        ("reference-scenarios.md", "config/scenarios/**/*.toml"),
    ],
)
def test_every_key_of_a_shipped_file_is_listed(page: str, files: str) -> None:
    listed = set(re.findall(r"^\| `(\w+)` ", reference.page_text(page), re.M))

    def keys(content: object) -> set[str]:
        if isinstance(content, list):
            return {key for one in content for key in keys(one)}
        if not isinstance(content, dict):
            return set()
        named = {key for key, value in content.items() if not isinstance(value, dict)}
        return named.union(*(keys(value) for key, value in content.items() if key not in FREE))

    for path in ROOT.glob(files):
        assert keys(tomllib.loads(path.read_text("utf-8"))) <= listed, path


def test_a_row_of_the_reference_says_what_the_model_does() -> None:
    page = reference.page_text("reference-config.md")
    assert "| `piston_diameter` | m | > 0.01, < 0.15 | **needed** | Of one piston. |" in page
    assert "## `[front]`, `[rear]`" in page
    scenarios = reference.page_text("reference-scenarios.md")
    assert "| `until_speed` | m/s | ≥ 0 |  | The phase ends when the speed passes it. |" in scenarios


def test_the_contract_is_that_of_database_and_code() -> None:
    page = (reference.DOCS / "contract.md").read_text("utf-8")
    assert page == contract_text(), "run python tools/write_reference.py"


def test_every_column_of_a_result_is_listed_once_with_unit_and_meaning() -> None:
    page = COLUMNS.read_text("utf-8")
    assert page == columns_text(), "run python tools/write_reference.py"
    rows, _, brakes = page.partition("## Brake applications")
    for part, schema in ((rows, ROW_SCHEMA), (brakes, BRAKE_SCHEMA)):
        listed = re.findall(r"^\| `(\w+\*?)` \| (.+?) \| (.+?) \|", part, re.M)
        names = [
            name
            for one, _, _ in listed
            for name in ([one[:-1] + corner for corner in CORNERS] if "*" in one else [one])
        ]
        assert names == [field.name for field in schema]
        units = {name: unit for name, unit, _ in listed}
        assert all(units.get(field.name, "") in ("", field.metadata[b"unit"].decode()) for field in schema)


def test_the_tables_of_diagnostics_are_those_of_the_code() -> None:
    page = DIAGNOSTICS.read_text("utf-8")
    assert page == with_tables(page), "run python tools/write_reference.py"


def test_the_tables_of_xcp_are_those_of_the_code() -> None:
    page = XCP.read_text("utf-8")
    assert page == with_xcp_tables(page), "run python tools/write_reference.py"


def test_every_requirement_has_a_proof_and_every_proof_a_requirement() -> None:
    required, found = requirements(), list(proofs())
    assert len(required) > 30
    assert len(required) == len(re.findall(r"^\| REQ-", SAFETY.read_text("utf-8"), re.M)), "given twice"
    assert {one.requirement for one in found} == {*required}
    named = sum(path.read_text("utf-8").count("@pytest.mark.requirement(") for path in TESTS)
    assert named == len({one[1:] for one in found}), "above a function of a module, where the page finds it"


def test_the_page_of_requirements_is_that_of_the_tests() -> None:
    assert REQUIREMENTS.read_text("utf-8") == requirements_text(), "run python tools/write_reference.py"


def test_the_worked_example_of_the_checksum_is_right() -> None:
    page = contract_text()
    found = re.search(r"`(crc\(.+?\))` gives byte 0\s+as (0x\w\w)\.", page)
    assert found
    example = runpy.run_path(str(EXAMPLE))
    assert eval(found[1], example) == int(found[2], 16) == 0xCC
    code = re.search(r"```python\n(.+?)```", page, re.S)
    assert code
    assert code[1].strip() in EXAMPLE.read_text("utf-8")
