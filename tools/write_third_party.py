"""Licences of the packages that an installation brings along, as their own metadata state them.

    python tools/write_third_party.py

writes docs/third-party.md for the pinned sets of the vehicle and the laboratory; run it where both are
installed.
"""

import re
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import Any, Final, NamedTuple

ROOT: Final = Path(__file__).parent.parent
PAGE: Final = ROOT / "docs/third-party.md"
UNSTATED: Final = {"colorama": "BSD-3-Clause (Windows alone)", "graphemeu": "MIT"}
"""Not installed on Linux; the text of the licence in place of its name."""
SETS: Final = {"onboard": "on the vehicle", "lab": "laboratory"}


class Pin(NamedTuple):
    """One version of a package in a pinned set."""

    name: str
    version: str
    marker: str
    """Pythons or systems that it is for, empty: all."""
    sha256: tuple[str, ...]
    """Of the files that may be installed."""


def pins(name: str) -> list[Pin]:
    """Return what a pinned set holds, sorted."""
    text = (ROOT / f"requirements/{name}.txt").read_text("utf-8").replace("\\\n", " ")
    found = re.findall(r"^([\w.\-]+)==([^\s;]+)(?: ; (.+?))?\s+(--hash.*)$", text, re.MULTILINE)
    return sorted(
        Pin(package, version, marker, tuple(sorted(re.findall(r"sha256:([0-9a-f]{64})", hashes))))
        for package, version, marker, hashes in found
    )


def pinned(name: str) -> list[str]:
    """Return the packages of a pinned set, each once."""
    return sorted({pin.name for pin in pins(name)})


def licence(package: str) -> str:
    """Return the licence that a package's metadata state, on one line."""
    if package in UNSTATED:
        return UNSTATED[package]
    try:
        about: Any = metadata(package)
    except PackageNotFoundError:
        return "not installed where this page was written"
    classified = [
        one.rpartition(" :: ")[2]
        for one in about.get_all("Classifier") or []
        if one.startswith("License ::") and one.count("::") > 1
    ]
    stated = str(about.get("License-Expression") or "") or ", ".join(classified)
    return " ".join((stated or str(about.get("License") or "not stated").splitlines()[0]).split())


def page_text() -> str:
    """Return the page."""
    vehicle = set(pinned("onboard"))
    lines = [
        "# Third-party licences",
        "",
        "brake-ecu is under the [Apache License 2.0](../LICENSE) and contains no code of others. What is",
        "installed, or in a Docker image, brings these along, each under its own licence, unchanged, as",
        "a library. The extras `mdf` (asammdf, LGPL-3.0-or-later), `fleet` and `learn` bring more.",
        "",
        "Databases and recorded drives of cars have notices beside them: `dbc/cars/LICENSE.opendbc`,",
        "`tests/data/LICENSE.*`.",
        "",
        "[brake-ecu.cdx.json](../requirements/brake-ecu.cdx.json) is the bill of materials (SBOM,",
        "CycloneDX 1.6) for tools that look for known vulnerabilities or judge licences: versions, hashes of",
        "all files that may be installed, licences. The wheel has it in `brake_ecu-….dist-info/sboms/`.",
        "",
        "Written by `python tools/write_third_party.py` and `python tools/write_sbom.py` from the pinned",
        "versions and the packages' metadata.",
        "",
        "| package | licence | part of |",
        "| --- | --- | --- |",
    ]
    for name in sorted({*vehicle, *pinned("lab")}):
        lines.append(f"| {name} | {licence(name)} | {SETS['onboard' if name in vehicle else 'lab']} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page_text(), "utf-8")
    print(PAGE)
