import pytest

from brakelab.rig import command


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the page of each drive, which is most of a rig's work; tests/brakelab/report looks at it."""
    monkeypatch.setattr(command, "report", lambda *arguments: None)
