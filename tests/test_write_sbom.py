"""The bill of materials: valid CycloneDX, everything that is pinned, nothing that changes by itself."""

import json
import re
import zipfile
from pathlib import Path
from typing import Any

import pytest

import write_sbom as sbom
from write_third_party import pins

BILL = json.loads(sbom.BILL.read_text("utf-8"))
COMPONENTS = {(one["name"], one["version"]): one for one in BILL["components"]}


def without_licences(bill: dict[str, Any]) -> dict[str, Any]:
    """Metadata of another installed version may say the same licence in other words."""
    return {**bill, "components": [{**one, "licenses": []} for one in bill["components"]]}


def test_the_file_is_what_the_pinned_sets_say() -> None:
    assert without_licences(BILL) == without_licences(sbom.bill()), "run python tools/write_sbom.py"


def test_a_package_is_there_with_version_hashes_licence_and_part() -> None:
    can = COMPONENTS["python-can", "4.6.1"]
    assert can["purl"] == "pkg:pypi/python-can@4.6.1"
    assert can["scope"] == "required"
    assert can["licenses"] == [{"expression": "LGPL-3.0-only"}]
    assert [one["alg"] for one in can["hashes"]] == ["SHA-256", "SHA-256"]
    assert {one["scope"] for (name, _), one in COMPONENTS.items() if name in ("bokeh", "pymoo")} == {
        "optional"
    }
    older, newer = (one["properties"][0]["value"] for (name, _), one in COMPONENTS.items() if name == "numpy")
    assert (older, newer) == ("python_full_version < '3.12'", "python_full_version >= '3.12'")


@pytest.mark.parametrize("lock", ["onboard", "lab"])
def test_every_hash_of_a_lock_is_in_the_bill(lock: str) -> None:
    text = (sbom.ROOT / f"requirements/{lock}.txt").read_text("utf-8")
    entries = re.findall(r"^([\w.\-]+)==", text, re.MULTILINE)
    assert len(entries) == len(pins(lock))
    listed = {one["content"] for part in COMPONENTS.values() for one in part["hashes"]}
    assert set(re.findall(r"sha256:([0-9a-f]{64})", text)) <= listed


def test_the_same_sets_give_the_same_file() -> None:
    """No date, no number drawn at random, no address; sorted."""
    text = sbom.BILL.read_text("utf-8")
    assert sbom.bill_text() == sbom.bill_text()
    assert not re.search(r"timestamp|serialNumber|https?:|/(simple|packages)/|\b20\d\d-\d\d-\d\d", text)
    references = [one["bom-ref"] for one in BILL["components"]]
    assert references == sorted(set(references))
    assert all(
        one["hashes"] == sorted(one["hashes"], key=lambda h: h["content"]) for one in BILL["components"]
    )


def test_it_is_valid_cyclonedx_and_its_licences_are_spdx() -> None:
    validation = pytest.importorskip(
        "cyclonedx.validation.json", reason="cyclonedx-python-lib is not installed"
    )
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.spdx import is_expression

    validator = validation.JsonStrictValidator(SchemaVersion.V1_6)
    assert validator.validate_str(sbom.BILL.read_text("utf-8")) is None
    assert validator.validate_str(json.dumps({**BILL, "dated": True})) is not None
    stated = [one["licenses"][0] for one in BILL["components"]]
    expressions = [one["expression"] for one in stated if "expression" in one]
    assert [one for one in expressions if not is_expression(one)] == []
    assert len(expressions) > 40
    assert not [one for one in stated if one.get("license", {"name": "-"})["name"] in ("", "not stated")]


def test_the_wheel_brings_it_along(tmp_path: Path) -> None:
    wheel = pytest.importorskip("hatchling.builders.wheel", reason="hatchling is not installed")
    built = Path(
        next(wheel.WheelBuilder(str(sbom.ROOT)).build(directory=str(tmp_path), versions=["standard"]))
    )
    with zipfile.ZipFile(built) as archive:
        found = [name for name in archive.namelist() if name.endswith(".cdx.json")]
        assert found == ["brake_ecu-0.1.0.dist-info/sboms/brake-ecu.cdx.json"]
        assert json.loads(archive.read(found[0])) == BILL
