"""A drive in real time, without its processes."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from brakelab.rig import live


def test_the_ring_is_read_once_more_when_the_daemon_has_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    happened: list[str] = []

    class Ended:
        """Processes whose drive is over at the second question."""

        def __init__(self, bus: Any, config: Path, out: Path, log: Any) -> None:
            self.truth = out / "truth.parquet"
            self.daemons = [SimpleNamespace(poll=lambda: None)]
            self._turns = iter([True, False])

        def start_vehicle(self, scenario: Path, seed: int, plant: str | None) -> None: ...

        def start_daemon(self, *options: str) -> Any:
            return object()

        def departure(self) -> float:
            return 0.0

        def driving(self) -> bool:
            return next(self._turns)

        def end(self) -> list[int]:
            happened.append("end")
            self.truth.touch()
            return [0]

    monkeypatch.setattr(live, "Processes", Ended)
    bus: Any = SimpleNamespace(wire=None)
    live.drive(bus, Path(), Path(), [], tmp_path, 0, lambda ring: happened.append("look"))
    assert happened == ["look", "end", "look"]
