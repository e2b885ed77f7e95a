"""The bench of the observers with a car or two: what counts, what is carried over, whether figures agree."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.bench import command
from brakelab.bench import observers as bench
from brakelab.results.text_table import markdown
from brakelab.simulation.closed_loop import Drive
from brakelab.simulation.configured import configured, shipped
from brakelab.studies import output
from brakelab.studies.accuracy.observers import (
    JOINT,
    NEVER,
    Row,
    Sample,
    Task,
    counted,
    drive_car,
    observer_rows,
    settling,
    tasks,
)
from brakelab.studies.accuracy.observers_cases import (
    ACCURACY,
    CASES,
    DRY_FALL,
    EVENTS,
    LONGEST_EFFECT,
    ROBUSTNESS,
    TRANSDUCERS,
    WRONG_START,
    Setup,
)
from brakelab.studies.accuracy.observers_picture import HEIGHT, LEFT, TOP, Consistency, write_picture
from brakelab.studies.accuracy.observers_table import finite, observer_tables
from brakelab.studies.measure import Figure
from brakelab.studies.study import Asked
from ecu.contract.params import OBSERVERS
from ecu.contract.records import FRAME, new_record
from ecu.contract.signals import CORNERS

pytestmark = pytest.mark.study

STOP = "stop #1"


@pytest.fixture(scope="module")
def rows() -> dict[bool, Row]:
    todo = [Task(JOINT, seed, (STOP,)) for seed in (0, 1)]
    return {row.adapted: row for row in observer_rows(todo)}


def test_a_stop_with_two_cars(rows: dict[bool, Row]) -> None:
    assert set(rows) == {False, True}
    for row in rows.values():
        for reached, nominal in zip(row.nrmse, row.nominal, strict=True):
            assert 0.0 < reached.low < reached.high < nominal.low  # two cars, both better than the constant
        # Linings have 0.85 and 1.10 of the 0.45 configured, and lose friction as they warm up.
        assert 5.0 < row.nominal[0].median < 20.0 < row.nominal[1].median < 30.0
        assert all(0.0 <= share <= 100.0 for share in row.inside_2_sigma)
        assert np.isnan(row.seconds.median)
    for axle in (0, 1):  # the same cars, but known
        cold, adapted = rows[False], rows[True]
        assert cold.nominal[axle].median == pytest.approx(adapted.nominal[axle].median, rel=0.05)
        assert cold.nrmse[axle] != adapted.nrmse[axle]


def test_only_what_the_store_keeps_is_carried_over() -> None:
    ordinary, stop = (Setup(shipped(name), configured()) for name in ("ordinary", "stop-1"))
    _, learned = drive_car(ordinary, JOINT, 0)
    once, _ = drive_car(stop, JOINT, 0)
    known, _ = drive_car(stop, JOINT, 0, learned)
    assert np.all(np.abs(learned["mu_b"] / 0.45 - 1.0) > 0.02)
    # The first cycle holds the friction of the drive before; without it the nominal one.
    before = np.array([known.outputs[f"mu_b_{corner}"][0] for corner in CORNERS])
    np.testing.assert_allclose(before, learned["mu_b"][0], rtol=1e-12)
    assert {once.outputs[f"mu_b_{corner}"][0] for corner in CORNERS} == {0.45}


def _drive(pressure: NDArray[np.float64], speed: NDArray[np.float64], error: NDArray[np.float64]) -> Drive:
    truth = {f"calliper_pressure_{corner}": pressure.copy() for corner in CORNERS} | {"vehicle_speed": speed}
    truth |= {f"mu_b_{corner}": np.full(len(speed), 0.4) for corner in CORNERS}
    outputs = {f"mu_b_{corner}": 0.4 * (1.0 + error) for corner in CORNERS}
    return Drive(0.01 * np.arange(len(speed), dtype=np.float64), {}, outputs, truth, new_record(FRAME, 0))


def test_rows_count_after_0_8_s_of_pressure_on_every_wheel_above_15_kmh() -> None:
    pressure = np.where((np.arange(600) >= 100) & (np.arange(600) != 300), 20.0, 0.0)
    drive = _drive(pressure, np.linspace(20.0, 0.0, 600), np.zeros(600))
    drive.truth["calliper_pressure_rr"][400:] = 1.0
    found = np.flatnonzero(counted(drive))
    assert found[0] == 100 + 80
    assert list(found[np.flatnonzero(np.diff(found) > 1)]) == [299]  # a gap in pressure begins it anew
    assert found[-1] == 399
    assert 300 + 81 in found
    assert 300 + 80 not in found
    drive.truth["calliper_pressure_rr"][:] = pressure
    # (1 - k / 599) 20 m/s > 15 km/h
    assert np.flatnonzero(counted(drive))[-1] == int(599 * (1.0 - 15.0 / 3.6 / 20.0))


@pytest.mark.parametrize(
    ("error", "against", "seconds"),
    [
        (lambda k: np.where(k < 400, 0.20, 0.04), None, 1.00),  # 20 % until a second after row 300
        (lambda k: np.where(k < 400, 0.04, 0.20), None, NEVER),
        (lambda k: np.full(len(k), 0.20), 300, 0.00),  # was so before
        (lambda k: np.where((k >= 300) & (k < 330), -0.20, 0.10), 300, 0.30),
    ],
)
def test_settling(
    error: Callable[[NDArray[np.int_]], NDArray[np.float64]], against: int | None, seconds: float
) -> None:
    k = np.arange(600)
    drive = _drive(np.full(600, 20.0), np.full(600, 20.0), error(k))
    assert settling(drive, 300, against) == pytest.approx(seconds)


def test_every_case_is_driven_by_whom_it_is_for() -> None:
    todo = tasks(seeds=8)
    driven: dict[tuple[str, str], list[int]] = {}
    for task in todo:
        for name in task.cases:
            driven.setdefault((name, task.observer), []).append(task.seed)
    for name in (*ACCURACY, *EVENTS):
        for observer in OBSERVERS:
            assert sorted(driven[name, observer]) == list(range(8))
    for name in ROBUSTNESS:
        assert sorted(driven[name, JOINT]) == [0, 1]  # of either sign
        assert (name, "observer2") not in driven
    for name in TRANSDUCERS:
        assert {observer for one, observer in driven if one == name} == {"observer1"}


def test_a_tyre_of_another_form_is_one() -> None:
    case = ROBUSTNESS["tyre of another form (Burckhardt)"]
    stop = Setup(case.scenario.model_copy(update={"phase": case.scenario.phase[:1]}), configured())
    setup = case.change(stop, 1.0)
    magic, burckhardt = (drive_car(one, JOINT, 0)[0].truth["slip_rl"] for one in (stop, setup))
    assert not np.array_equal(magic, burckhardt)
    assert setup.form == (("burckhardt_fall", DRY_FALL),)


@pytest.mark.parametrize(
    ("name", "section", "key", "share"),
    [
        ("mass ±10 %", "vehicle", "mass", 0.1),
        ("tyre stiffness ±30 %", "rear", "slip_stiffness", 0.3),
        ("pitch gradient ±30 %", "vehicle", "pitch_gradient", 0.3),
        ("centre of gravity height ±10 %", "vehicle", "cog_height", 0.1),
        (WRONG_START, "front", "mu_nominal", 1.25 * 0.85 - 1.0),
    ],
)
def test_what_is_wrong_in_the_configuration(name: str, section: str, key: str, share: float) -> None:
    case = CASES[name]
    changed = case.change(Setup(case.scenario, configured()), 1.0)
    ratio = getattr(getattr(changed.config, section), key) / getattr(getattr(configured(), section), key)
    assert ratio == pytest.approx(1.0 + share)
    assert (changed.scenario, changed.car) == (case.scenario, ())


def _samples(nrmse: float) -> list[Sample]:
    """Return a made-up result: every observer has `nrmse` [%] everywhere, the constant 10 %."""
    return [
        Sample(name, observer, known, (nrmse, nrmse), (0.95, 1.0), (10.0, 10.0), 0.2, 5.0)
        for name in CASES
        for observer in OBSERVERS
        for known in (False, True)
    ]


def _pages(samples: list[Sample]) -> dict[str, dict[str, tuple[str, ...]]]:
    found = observer_rows([Task(JOINT, 0, ())], lambda drive, todo: [samples])
    half = np.array([0.0, 1.0])
    car = Consistency((half, half), (np.zeros((2, 2)),) * 2, (np.ones((5, 2)),) * 2)
    tables = observer_tables(found, {JOINT: Figure(2.0, 1.0, 3.0)}, [car], "nominal")
    return {table.title.split(":")[0]: {line[0]: line for line in table.rows} for table in tables}


def test_verdicts() -> None:
    pages = _pages(_samples(1.0))
    accuracy = pages["Joint observer"]
    assert accuracy["stop #2"][5:] == ("met", "1.00/1.00 (1.0/1.0)", "1.2/1.2", "met")
    assert accuracy["stop #1"][5] == "met"
    assert accuracy["stop #1"][8] == "missed: front by 0.2, rear by 0.1"  # 0.8 and 0.9
    assert accuracy["stop #3"][8] == "missed: front by 0.1"  # 0.9, 1.0
    assert pages["Truth inside 2σ [%]"]["all"][3] == "missed: rear large by 1"
    robust = pages["Joint observer, disturbed"]
    assert {line[-1] for line in robust.values()} == {"met"}
    events = pages["How long it takes"]
    longest = {name: events[f"{name}, joint, cold"][5] for name in LONGEST_EFFECT}
    assert longest == {
        "tyre stiffness × 0.67": "missed: time by 0.1, force by 2.5",  # 0.2 s, no better than Observer 2
        "low-grip patch": "missed: force by 2.5",
    }
    worse = _pages(_samples(11.0))
    missed = "missed: cold front by 1, cold rear by 1, adapted front by 9.4, adapted rear by 9.2"
    assert worse["Joint observer, disturbed"]["mass ±10 %"][-1] == missed
    assert worse["Joint observer"]["0.7 m/s²"][4:6] == ("constant", "missed: front by 1, rear by 1")


def test_json_has_null_for_what_is_not_finite() -> None:
    assert finite({"a": [1.0, NEVER], "b": Figure(float("nan"), 0.0, 1.0)}) == {
        "a": [1.0, None],
        "b": {"median": None, "low": 0.0, "high": 1.0},
    }


def test_page_and_picture(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "docs" / "results" / "images").mkdir(parents=True)
    t = np.linspace(0.0, 6.0, 100)
    car = Consistency((t, t), (np.full((2, 100), 0.5),) * 2, (np.ones((5, 20)),) * 2)
    monkeypatch.setattr(output, "resource", lambda name: tmp_path / name)
    monkeypatch.setattr(bench, "tasks", lambda seeds, draw: [])
    found = observer_rows([Task(JOINT, 0, ())], lambda drive, todo: [_samples(1.0)])
    monkeypatch.setattr(bench, "observer_rows", lambda todo, spread: found)
    monkeypatch.setattr(bench, "new_pool", ThreadPoolExecutor)
    monkeypatch.setattr(bench, "consistency_of", lambda seed: car)
    monkeypatch.setattr(bench, "step_times", lambda: {JOINT: Figure(2.0, 1.0, 3.0)})
    assert command.bench("observers", Asked(seeds=1), write=True) == 0
    page = (tmp_path / "docs" / "results" / "observers.md").read_text(encoding="utf-8")
    assert "seeds 0–0" in page
    for table in observer_tables(found, {JOINT: Figure(2.0, 1.0, 3.0)}, [car], "wide"):
        assert markdown(table).rstrip() in page
    picture = (tmp_path / "docs" / "results" / "images" / "observers.svg").read_text(encoding="utf-8")
    middle = TOP + 0.5 * HEIGHT
    # 0.5 of 2σ, up, in a panel whose edges are at 2.
    assert f"{LEFT:.0f},{middle - 0.25 * 0.5 * HEIGHT:.1f} " in picture
    write_picture(tmp_path / "nowhere" / "observers.svg", [car])
    assert not (tmp_path / "nowhere").exists()
