"""Bill of materials (SBOM) of an installation, CycloneDX 1.6: the pinned sets and their packages' metadata.

    python tools/write_sbom.py

writes requirements/brake-ecu.cdx.json: the packages of the vehicle ("required") and of the laboratory
("optional") with versions, licences and the hashes of the files that may be installed. The same sets and
metadata give the same file: it has no date, no serial number and no address. Run it where both are installed.
"""

import json
import re
import tomllib
from typing import Any, Final

from write_third_party import ROOT, UNSTATED, Pin, licence, pins

BILL: Final = ROOT / "requirements/brake-ecu.cdx.json"
IDENTIFIERS: Final = {"MIT License": "MIT", "ISC License (ISCL)": "ISC"}
"""SPDX, where a classifier leaves no doubt; "BSD License" does."""
EXPRESSION: Final = re.compile(r"[\w.+-]+( (AND|OR|WITH) [\w.+-]+)*")


def purl(name: str, version: str) -> str:
    """Return the package URL, by which tools look for known vulnerabilities."""
    return f"pkg:pypi/{re.sub(r'[-_.]+', '-', name).lower()}@{version}"


def stated_licence(package: str) -> dict[str, Any]:
    """Return the licence as CycloneDX has it: an SPDX expression, or a name where none is stated."""
    text = licence(package)
    if package in UNSTATED:
        text = text.partition(" (")[0]
    text = IDENTIFIERS.get(text, text)
    return {"expression": text} if EXPRESSION.fullmatch(text) else {"license": {"name": text}}


def component(pin: Pin, scope: str) -> dict[str, Any]:
    """Return a package."""
    marker = [{"name": "brake-ecu:marker", "value": pin.marker}] if pin.marker else []
    reference = purl(pin.name, pin.version)
    return {
        "type": "library",
        "bom-ref": reference,
        "name": pin.name,
        "version": pin.version,
        "scope": scope,
        "hashes": [{"alg": "SHA-256", "content": one} for one in pin.sha256],
        "licenses": [stated_licence(pin.name)],
        "purl": reference,
        **({"properties": marker} if marker else {}),
    }


def bill() -> dict[str, Any]:
    """Return the bill of materials."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    vehicle = pins("onboard")
    on_board = {(pin.name, pin.version) for pin in vehicle}
    laboratory = [pin for pin in pins("lab") if (pin.name, pin.version) not in on_board]
    found = [component(pin, "required") for pin in vehicle]
    found += [component(pin, "optional") for pin in laboratory]
    direct = {re.split(r"[\[>=<]", one)[0] for one in project["dependencies"]}
    itself = purl(project["name"], project["version"])
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": itself,
                "name": project["name"],
                "version": project["version"],
                "description": project["description"],
                "licenses": [{"expression": project["license"]}],
                "purl": itself,
            }
        },
        "components": sorted(found, key=lambda one: str(one["bom-ref"])),
        "dependencies": [
            {
                "ref": itself,
                "dependsOn": [purl(pin.name, pin.version) for pin in vehicle if pin.name in direct],
            }
        ],
    }


def bill_text() -> str:
    """Return the file."""
    return json.dumps(bill(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    BILL.write_text(bill_text(), "utf-8")
    print(BILL)
