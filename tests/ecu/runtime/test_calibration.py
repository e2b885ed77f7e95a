"""A calibration that another process asks for: when the loop takes it over, and what of the run stays."""

from types import SimpleNamespace

import numpy as np
import pytest

from ecu.algorithm.step import new_state
from ecu.contract.records import INPUTS, OUTPUTS, new_record
from ecu.contract.work import Kind, Work
from ecu.recording.calibration import add_note, ask, check_of, in_force, read_notes
from ecu.recording.ring import RingReader, create_ring
from ecu.runtime.calibration import consider

TABLES = {"control": {"max_pressure_rate": 2000.0}}
NOW, LATER = 1_000, 2_000
NEW_PADS = Work(Kind.NEW_PADS, {"fl": 0.0})


@pytest.fixture
def ring(tmp_path):
    return create_ring(tmp_path / "x.ring", {}, b"", slots=4, frames=4)


@pytest.fixture
def ecu(params):
    """A shadow at rest."""
    params = params.copy()
    params["transmit"] = 0
    state = new_state(params)
    state["estimate"]["started"] = 1
    records = {"inputs": new_record(INPUTS), "outputs": new_record(OUTPUTS)}
    return SimpleNamespace(params=params, state=state, estimate=state["estimate"], **records)


def wanted(params):
    """Return parameters as another process makes them: all inputs mapped, of a car that is armed."""
    other = params.copy()
    other["max_pressure_rate"], other["transmit"], other["mapped"] = 2e8, 1, 1
    return other


@pytest.mark.parametrize(
    ("armed", "standing_s", "started", "speed", "taken"),
    [
        (0, 0.0, 1, 30.0, True),  # a shadow, whatever it does
        (1, 0.0, 1, 30.0, False),
        (1, 0.0, 1, 0.0, False),  # a wheel that locks for a moment stands too
        (1, 0.49, 1, 0.0, False),
        (1, 0.5, 1, 0.0, True),
        (1, 9.9, 1, 0.3, False),  # wheels that stand on ice
        (1, 9.9, 1, float("nan"), False),
        (1, 9.9, 0, 0.0, False),  # no speed is known
    ],
)
def test_it_is_taken_over_by_a_shadow_or_standing(ring, ecu, armed, standing_s, started, speed, taken):
    ecu.params["transmit"] = armed
    ecu.state["demand"]["standing_s"], ecu.estimate["started"], ecu.estimate["speed"] = (
        standing_s,
        started,
        speed,
    )
    before = ecu.params.tobytes()
    number = ask(ring, wanted(ecu.params), TABLES, LATER)
    consider(ring, ecu, 70, NOW)
    assert ring.header["answered"] == number
    assert (ecu.params["max_pressure_rate"] == 2e8) == taken
    assert (in_force(ring) is not None) == taken
    if not taken:
        assert ecu.params.tobytes() == before


@pytest.mark.requirement("REQ-WORK-1")
@pytest.mark.parametrize("armed", [0, 1])
@pytest.mark.parametrize(
    ("standing_s", "started", "speed", "asked", "braking", "done"),
    [
        (0.5, 1, 0.0, 0.0, 0, True),
        (0.49, 1, 0.0, 0.0, 0, False),
        (9.9, 1, 0.3, 0.0, 0, False),
        (9.9, 1, 30.0, 0.0, 0, False),
        (9.9, 1, float("nan"), 0.0, 0, False),
        (9.9, 0, 0.0, 0.0, 0, False),
        (9.9, 1, 0.0, 0.05, 0, False),  # somebody is at the pedal, or holds the car
        (9.9, 1, 0.0, float("nan"), 0, False),  # whether, nobody knows
        (9.9, 1, 0.0, 0.0, 1, False),
    ],
)
def test_a_workshop_works_on_a_car_that_stands_with_released_brakes(
    ring, ecu, armed, standing_s, started, speed, asked, braking, done
):
    ecu.params["transmit"], ecu.state["demand"]["standing_s"] = armed, standing_s
    ecu.estimate["started"], ecu.estimate["speed"] = started, speed
    ecu.outputs["decel_demand_total"], ecu.state["application"]["braking"] = asked, braking
    before = ecu.state.tobytes()
    number = ask(ring, ecu.params, {}, LATER, NEW_PADS)
    consider(ring, ecu, 70, NOW)
    assert ring.header["answered"] == number
    assert in_force(ring) == ((1, 70, {}, NEW_PADS) if done else None)
    assert ecu.state["learned"]["wear"]["told"].tolist() == [[done, 0, 0, 0]]
    assert (ecu.state.tobytes() == before) is not done
    consider(ring, ecu, 80, NOW)
    assert ring.header["calibrated_from"] == (70 if done else 0)


def test_work_that_is_none_is_a_calibration(ring, ecu):
    """Of another version: the loop neither does it nor ends."""
    number = ask(ring, wanted(ecu.params), TABLES, LATER)
    page = int(ring.asked["page"][0])
    ring.pages["work"]["kind"][page] = 99
    ring.asked["check"] = check_of(ring, page)
    consider(ring, ecu, 70, NOW)
    assert ring.header["answered"] == number
    assert in_force(ring).work is None


def test_what_is_the_runs_own_stays(ring, ecu):
    ecu.params["mapped"][0, :3] = 0
    mapped = ecu.params["mapped"].copy()
    ask(ring, wanted(ecu.params), TABLES, LATER)
    consider(ring, ecu, 70, NOW)
    assert ecu.params["transmit"] == 0
    assert np.array_equal(ecu.params["mapped"], mapped)
    assert in_force(ring) == (1, 70, TABLES, None)


def test_without_a_question_nothing_happens(ring, ecu):
    before = ring.header.tobytes()
    consider(ring, ecu, 70, NOW)
    assert ring.header.tobytes() == before


def test_half_a_page_is_waited_for_and_in_the_end_refused(ring, ecu):
    number = ask(ring, wanted(ecu.params), TABLES, LATER)
    page = int(ring.asked["page"][0])
    ring.pages["params"]["mass"][page] = 1.0
    consider(ring, ecu, 70, NOW)
    assert ring.header["answered"] == 0
    consider(ring, ecu, 80, LATER)
    assert ring.header["answered"] == number
    assert in_force(ring) is None
    assert ecu.params["mass"] != 1.0


def test_one_that_is_asked_for_too_late_is_refused(ring, ecu):
    """Who asked has given up: nobody would know of it."""
    ask(ring, wanted(ecu.params), TABLES, LATER)
    consider(ring, ecu, 70, LATER)
    assert in_force(ring) is None


def test_one_that_is_refused_leaves_the_one_before_readable(ring, ecu):
    ask(ring, wanted(ecu.params), TABLES, LATER)
    consider(ring, ecu, 70, NOW)
    for _ in range(3):
        ecu.params["transmit"] = 1
        ask(ring, ecu.params, {"control": {}}, LATER)
        consider(ring, ecu, 90, NOW)
        assert in_force(ring) == (1, 70, TABLES, None)
    ecu.params["transmit"] = 0
    ask(ring, ecu.params, {"sensors": {}}, LATER)
    consider(ring, ecu, 100, NOW)
    assert in_force(ring) == (2, 100, {"sensors": {}}, None)


def test_only_who_asks_may_write(ring):
    with pytest.raises(ValueError, match="read-only"):
        RingReader(ring.path).ring.asked["number"] = 1
    RingReader(ring.path, asks=True).ring.asked["number"] = 1
    assert ring.asked["number"] == 1


def test_notes_read_back(tmp_path, ring, ecu):
    assert read_notes(tmp_path) == []
    ecu.state["demand"]["standing_s"] = 9.0
    works = {1: None, 2: Work(Kind.MEASURED_PADS, {"fl": 1.5, "rr": -0.1})}
    for number, work in works.items():
        ask(ring, wanted(ecu.params), {"control": {"n": number}}, LATER, work)
        consider(ring, ecu, 100 * number, NOW)
        add_note(tmp_path, in_force(ring))
    assert read_notes(tmp_path) == [
        (1, 100, {"control": {"n": 1}}, None),
        (2, 200, {"control": {"n": 2}}, works[2]),
    ]
