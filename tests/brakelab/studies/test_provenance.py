"""The line on a page of results that says what it was measured on."""

import pytest

from brakelab.studies import provenance
from ecu.settings.config import config_hash, load_config
from ecu.settings.resources import resource


@pytest.mark.parametrize(
    ("head", "changes", "commit"),
    [
        ("1a2b3c4", "", "1a2b3c4"),
        ("1a2b3c4", " M ecu/algorithm/step.py", "1a2b3c4-dirty"),
        ("", "", "unknown"),
    ],
    ids=["clean", "changed", "outside a checkout"],
)
def test_measured_on(monkeypatch: pytest.MonkeyPatch, head: str, changes: str, commit: str) -> None:
    monkeypatch.setattr(provenance, "_git", lambda word, *rest: head if word == "rev-parse" else changes)
    configuration = config_hash(load_config(resource("config/suv.toml")))[:12]
    assert provenance.measured_on() == f"Measured on commit {commit}, config/suv.toml {configuration}."
