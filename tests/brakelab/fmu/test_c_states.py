"""States: a run goes on from one as it went on before, in this instance or in another one."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from .master import ERROR, OK, Fmu, Instance
from .test_ecu_unit import DRIVING


@pytest.fixture(params=["suv", "stop", "suv_2", "stop_2"])
def fmu(request: pytest.FixtureRequest) -> Fmu:
    """The ECU, the vehicle, both of FMI 2.0."""
    return request.getfixturevalue(request.param)


def braking(instance: Instance, cycles: int, first: int = 0) -> np.ndarray:
    """Return the outputs of some cycles with inputs that change."""
    rows = []
    for k in range(first, first + cycles):
        wave = 1.0 + 0.01 * np.sin(0.3 * k)
        values = {name: DRIVING.get(name, 30.0) * wave for name in instance.fmu.inputs}
        values |= {name: 1.0 for name in values if name in ("decel_demand_valid", "pressure_demand_valid")}
        assert instance.put(values) == OK
        assert instance.step() == OK
        rows.append(instance.get([*instance.fmu.outputs, "time"]))
    return np.array(rows)


@pytest.fixture
def running(fmu: Fmu) -> Iterator[Instance]:
    """An instance after 1.2 s."""
    with fmu.instantiate() as instance:
        assert instance.initialise() == OK
        braking(instance, 120)
        yield instance


def test_a_run_goes_on_from_a_state_as_before(running: Instance) -> None:
    state, time = running.state(), running.time
    before = braking(running, 50, 120)
    assert running.restore(state) == OK
    running.time = time
    assert braking(running, 50, 120).tobytes() == before.tobytes()
    assert braking(running, 50, 170).tobytes() != before.tobytes()
    assert running.free(state) == OK
    assert state.value is None


def test_a_serialised_state_goes_on_in_another_instance(running: Instance) -> None:
    kept, time = running.serialised(running.state()), running.time
    before = braking(running, 50, 120)
    with running.fmu.instantiate() as other:
        status, state = other.deserialised(kept)
        assert status == OK
        assert other.serialised(state) == kept
        assert other.restore(state) == OK
        other.time = time
        assert braking(other, 50, 120).tobytes() == before.tobytes()


def test_a_state_is_taken_over_an_older_one(running: Instance) -> None:
    state = running.state()
    old = running.serialised(state)
    braking(running, 10, 120)
    assert running.state(state) is state
    assert running.serialised(state) != old


@pytest.mark.parametrize("damage", ["cut", "longer", "foreign", "empty", "one bit"])
def test_a_state_of_something_else_is_refused(running: Instance, damage: str) -> None:
    kept = running.serialised(running.state())
    flipped = bytes([kept[len(kept) // 2] ^ 16])
    content = {
        "cut": kept[:-8],
        "longer": kept + b"\0",
        "foreign": b"0" * 64 + kept[64:],
        "empty": b"",
        "one bit": kept[: len(kept) // 2] + flipped + kept[len(kept) // 2 + 1 :],
    }
    status, state = running.deserialised(content[damage])
    assert status == ERROR
    assert not state
    assert "not a state of this FMU, or damaged" in running.messages[-1][2]


def test_instances_do_not_know_each_other(fmu: Fmu) -> None:
    with fmu.instantiate() as alone:
        alone.initialise()
        expected = braking(alone, 80)
    with fmu.instantiate() as one, fmu.instantiate() as other:
        assert one.initialise() == other.initialise() == OK
        rows = []
        for k in range(80):
            rows.append(braking(one, 1, k))
            braking(other, 1, 200 - k)
        assert np.concatenate(rows).tobytes() == expected.tobytes()


def test_instances_run_in_threads_of_their_own(fmu: Fmu) -> None:
    def drive(first: int) -> bytes:
        with fmu.instantiate() as instance:
            assert instance.initialise() == OK
            return braking(instance, 300, first).tobytes()

    expected = [drive(0), drive(70)]
    assert expected[0] != expected[1]
    with ThreadPoolExecutor(2) as threads:
        assert list(threads.map(drive, (0, 70) * 3)) == expected * 3


@pytest.mark.parametrize("start", [-9.99e8, -5.0, 0.005, 1e5, 9.99e8])
def test_the_start_time_changes_no_output(fmu: Fmu, start: float) -> None:
    rows = []
    for begin in (0.0, start):
        with fmu.instantiate() as instance:
            assert instance.initialise(begin) == OK
            rows.append(braking(instance, 150)[:, :-1].tobytes())  # but for the time
    assert rows[0] == rows[1]


def test_a_state_of_another_unit_is_refused(suv: Fmu, stop: Fmu) -> None:
    with suv.instantiate() as ecu, stop.instantiate() as vehicle:
        state = ecu.state()
        assert vehicle.restore(state) == ERROR
        assert ecu.restore(state) == OK
        assert ecu.free(state) == OK


def test_reset_is_a_new_instance(running: Instance) -> None:
    with running.fmu.instantiate() as new:
        new.initialise()
        expected = braking(new, 30)
    assert running.call("Terminate") == OK
    assert running.call("Reset") == OK
    assert running.initialise() == OK
    assert braking(running, 30).tobytes() == expected.tobytes()
