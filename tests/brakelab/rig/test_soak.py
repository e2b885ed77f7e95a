"""The long run, short: it passes, and it notices what it is there for."""

from pathlib import Path

import pytest

from brakelab.rig import soak
from brakelab.rig.soak import Check, soak_virtual


def short(monkeypatch: pytest.MonkeyPatch, folder: Path) -> dict[str, Check]:
    """Forty seconds of virtual time: four `hours`, two lives."""
    monkeypatch.setattr(soak, "HOUR", 1000)
    monkeypatch.setattr(soak, "RESTART", 2000)
    monkeypatch.setattr(soak, "GROWTH_MB", 8.0)  # pages of two rings, which are read for the first time
    return {check.what: check for check in soak_virtual(4.0, 1, folder)}


def test_forty_seconds_of_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    checks = short(monkeypatch, tmp_path)
    wrong = [check for check in checks.values() if not check.good]
    assert not wrong
    assert checks["lives of the ECU, each with what the one before stored"].seen == "2"
    assert checks["periods missed"].seen == "4, overslept 4"


def test_a_recorder_that_is_too_slow_is_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    create = soak.create_ring
    monkeypatch.setattr(soak, "create_ring", lambda *what: create(*what, slots=100, frames=4096))
    checks = short(monkeypatch, tmp_path)
    assert not checks["cycles and frames that the recorder lost"].good


def test_frames_that_are_spoilt_are_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    drain = soak.Rig.drain

    def spoil(rig: soak.Rig, frames, start: int) -> int:
        count = drain(rig, frames, start)
        if rig.periods == 1500:
            frames["data"][start, 0] ^= 1
        return count

    monkeypatch.setattr(soak.Rig, "drain", spoil)
    checks = short(monkeypatch, tmp_path)
    assert checks["frames that either side did not accept"].seen == "1"
    assert not checks["frames that either side did not accept"].good


def test_growing_memory_is_reported() -> None:
    assert soak._growth("x", [50.0, 100.0, 101.0, 103.9], 1).good
    assert not soak._growth("x", [50.0, 100.0, 101.0, 104.1], 1).good
