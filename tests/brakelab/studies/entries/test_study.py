"""Scoring by entries whose error is known: one that knows nothing, cheats, fails; and by real stops."""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.arrays import Vector
from brakelab.simulation.configured import configured, shipped
from brakelab.studies.entries.drives import NAMES, SETS, CarTracks, Track, applications, drive_track
from brakelab.studies.entries.inputs import Inputs
from brakelab.studies.entries.observer import EntryError, load_class
from brakelab.studies.entries.ours import OURS, Configured, EcuObserver
from brakelab.studies.entries.player import new_entry, play, reset
from brakelab.studies.entries.study import ADAPTED, COLD, EVERYDAY, CarScore, force_error, judge, judge_all
from brakelab.studies.entries.table import entry_tables, standings
from ecu.contract.signals import INPUT
from ecu.settings.config import Config

pytestmark = pytest.mark.study

ROOT = Path(__file__).parents[4]
TRUE = np.array([0.40, 0.40, 0.50, 0.50])
BRAKINGS, EACH, ON = 4, 600, slice(200, 500)


def made_up(name: str) -> Track:
    """Return a drive with constant friction and `BRAKINGS` applications."""
    n = BRAKINGS * EACH
    values = np.full((n, len(NAMES)), np.nan)
    values[::2, INPUT["accel_x"]] = -3.0
    values[:, INPUT["wheel_force_x_fl"]] = -1000.0
    rows = np.zeros(n, np.bool_)
    for first in range(0, n, EACH):
        rows[first + ON.start : first + ON.stop] = True
    pressure = np.where(rows[:, np.newaxis], 30.0, 0.0) * np.ones(4)
    return Track(name, configured(), values, np.tile(TRUE, (n, 1)), pressure, rows)


class Cheat:
    """Knows the truth, up to `factor`."""

    factor, sigma = 1.0, 0.01

    def reset(self, config: Config) -> None:
        self.resets = getattr(self, "resets", 0) + 1

    def step(self, inputs: Inputs) -> tuple[Any, Any]:
        return self.factor * TRUE, np.full(4, self.sigma)


class FivePercentOff(Cheat):
    factor, sigma = 1.05, 0.022
    """Off by 0.02 in front, inside 1 sigma, and 0.025 at the rear, inside 2."""


@pytest.fixture(scope="module")
def car() -> CarTracks:
    stops = [made_up("stop-1"), made_up("stop-2")]
    return CarTracks(made_up("ordinary"), stops, [made_up(name) for name in SETS])


def score(kind: type, car: CarTracks, monkeypatch: pytest.MonkeyPatch) -> CarScore | str:
    monkeypatch.setitem(OURS, "x", kind)
    return judge_all(["x"], car)["x"]


def test_a_cheat_has_no_error_anywhere(car: CarTracks, monkeypatch: pytest.MonkeyPatch) -> None:
    found = score(Cheat, car, monkeypatch)
    assert isinstance(found, CarScore)
    for group in (COLD, ADAPTED, EVERYDAY):
        for drive in found.drives[group]:
            assert drive.nrmse == pytest.approx((0.0, 0.0), abs=1e-9)
            assert drive.inside == (100.0, 100.0)
    assert found.recorded == pytest.approx((0.0, 0.0), abs=1e-9)
    assert [len(drives) for drives in found.drives.values()] == [2, 2, 1]


def test_an_error_of_five_percent_is_one(car: CarTracks, monkeypatch: pytest.MonkeyPatch) -> None:
    found = score(FivePercentOff, car, monkeypatch)
    assert isinstance(found, CarScore)
    drive = found.drives[COLD][0]
    assert drive.nrmse == pytest.approx((5.0, 5.0))
    assert drive.inside == (50.0, 100.0)
    assert found.recorded == pytest.approx((5.0, 5.0))


def test_who_knows_nothing_has_the_error_of_the_configuration(car: CarTracks) -> None:
    entry = Configured()
    entry.reset(configured())
    stop = car.stops[0]
    drive = judge(play(entry, stop), stop)
    assert drive.nrmse == pytest.approx((100.0 * (0.45 / 0.40 - 1.0), 100.0 * (1.0 - 0.45 / 0.50)))
    assert np.isnan(drive.inside).all()


def test_only_what_was_known_before_a_braking_counts_for_recorded_cars() -> None:
    track = made_up(SETS[0])
    assert [rows.start for rows in applications(track)] == [EACH * k + ON.start for k in range(BRAKINGS)]

    class Late(Cheat):
        """Learns at the end of the third application, so the fourth alone is known."""

        def step(self, inputs: Inputs) -> tuple[Any, Any]:
            return TRUE * (1.0 if inputs.t > 0.01 * (2 * EACH + ON.stop) else 1.2), np.full(4, 0.01)

    assert force_error(play(new_entry(Late), track), track) == pytest.approx((20.0 + 0.0) / 2)


def _raise(inputs: Inputs) -> None:
    raise ValueError("no idea\nsecond line")


def _exit(inputs: Inputs) -> None:
    sys.exit("enough")


@pytest.mark.parametrize(
    ("answer", "line"),
    [
        (_raise, "step raised ValueError: no idea, ordinary, t = 1.00 s"),
        (_exit, "step raised SystemExit: enough, ordinary, t = 1.00 s"),
        (lambda inputs: None, "no pair of friction and sigma"),
        (lambda inputs: (0.4, 0.01), r"friction of shape \(\), not \(4,\)"),
        (lambda inputs: (TRUE[:2], TRUE), r"friction of shape \(2,\)"),
        (lambda inputs: (TRUE, [0.1] * 3), r"sigma of shape \(3,\)"),
        (lambda inputs: ("rough", TRUE), "not four numbers"),
        (lambda inputs: (TRUE * np.nan, TRUE), "friction that is not finite"),
        (lambda inputs: (TRUE, -TRUE), "sigma below 0"),
        (lambda inputs: inputs.values.fill(0.0), "read-only"),
    ],
)
def test_who_fails_is_out_by_one_line(answer: Callable[[Inputs], Any], line: str) -> None:
    class Fails(Cheat):
        def step(self, inputs: Inputs) -> tuple[Any, Any]:
            return answer(inputs) if inputs.t >= 1.0 else super().step(inputs)  # type: ignore[no-any-return]

    with pytest.raises(EntryError, match=line) as error:
        play(Fails(), made_up("ordinary"))
    assert "\n" not in str(error.value)


def test_wheel_forces_are_withheld_unless_asked_for() -> None:
    heard: list[bool] = []

    class Listens(Cheat):
        def step(self, inputs: Inputs) -> tuple[Any, Any]:
            heard.append(bool(np.isfinite(inputs.wheel_force_x[0]) and "wheel_force_x_fl" in inputs.signals))
            return super().step(inputs)

    class Measures(Listens):
        wheel_transducers = True

    play(Listens(), made_up("ordinary"))
    assert not any(heard)
    heard.clear()
    play(Measures(), made_up("ordinary"))
    assert all(heard)


def test_the_best_is_first_and_who_failed_last(car: CarTracks, monkeypatch: pytest.MonkeyPatch) -> None:
    class Raises(Cheat):
        def reset(self, config: Config) -> None:
            raise RuntimeError("not today")

    for name, kind in {"a failure": Raises, "5 % off": FivePercentOff, "cheat": Cheat}.items():
        monkeypatch.setitem(OURS, name, kind)
    names = ("a failure", "5 % off", "configured", "cheat")
    tables = entry_tables(standings([judge_all(names, car)] * 2, {}), 2, "")
    assert [row[:2] for row in tables[0].rows] == [
        ("cheat", "1"), ("5 % off", "2"), ("configured", "3"), ("a failure", "out"),
    ]  # fmt: skip
    assert "a failure: reset raised RuntimeError: not today." in tables[0].below
    assert tables[0].rows[1][2:] == ("5.0/5.0",) * 4
    assert tables[1].rows[1][1:3] == ("50.0", "100.0")
    assert all(len(row) == len(table.columns) for table in tables for row in table.rows)


def example(tmp_path: Path) -> str:
    """Return the class of docs/benchmark.md as `--observer` names it."""
    code = re.search(r"```python\n(.*?)```", (ROOT / "docs/benchmark.md").read_text("utf-8"), re.DOTALL)
    assert code
    (tmp_path / "ratio.py").write_text(code[1])
    return f"{tmp_path}/ratio.py:Ratio"


@pytest.fixture(scope="module")
def stops() -> list[Track]:
    stop = shipped("stop-1").model_copy(update={"draw": "wide", "wheel_transducers": True})
    return [drive_track("stop-1", stop, seed) for seed in (0, 1)]


def test_everybody_hears_the_same_two_stops(stops: list[Track], tmp_path: Path) -> None:
    kinds = OURS | {"example": load_class(example(tmp_path))}
    errors: dict[str, Vector] = {}
    for name, kind in kinds.items():
        found = []
        for stop in stops:
            entry = new_entry(kind)
            reset(entry, stop.config)
            found.append(judge(play(entry, stop), stop).nrmse)
        errors[name] = np.array(found)
    nothing = errors.pop("configured")
    np.testing.assert_allclose(errors.pop("running average"), nothing, rtol=0.01)  # of no earlier braking
    for name in ("joint observer", "Observer 1, measuring wheels"):
        assert (errors[name] < 5.0).all(), name
    assert 0.3 * nothing.mean() < errors.pop("example").mean() < nothing.mean()
    for name, found in errors.items():
        assert found.mean() < 0.5 * nothing.mean(), name


def test_an_entry_of_ours_keeps_between_drives_what_the_store_would(stops: list[Track]) -> None:
    entry = EcuObserver()
    entry.reset(configured())
    cold = judge(play(entry, stops[0]), stops[0])
    warm = play(entry, stops[0])
    assert np.mean(judge(warm, stops[0]).nrmse) < np.mean(cold.nrmse)
    assert abs(warm.mu[0] / stops[0].mu[stops[0].rows].mean(axis=0) - 1.0).max() < 0.1
    entry.reset(configured())
    np.testing.assert_allclose(play(entry, stops[0]).mu[0], 0.45)
