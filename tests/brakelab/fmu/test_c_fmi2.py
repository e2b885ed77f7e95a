"""FMI 2.0: the same bits as by FMI 3.0, the same refusals, and how it ends a scenario."""

import ctypes
import subprocess
from collections.abc import Callable
from ctypes import c_double, c_int, c_size_t, c_uint32

import pytest

from .master import DISCARD, ERROR, OK, Fmu, Instance, assert_refused
from .test_c_states import braking
from .test_ecu_unit import DRIVING

pytestmark = pytest.mark.study


@pytest.mark.parametrize("name", ["suv", "stop"])
def test_both_versions_give_the_same_bits(request: pytest.FixtureRequest, name: str) -> None:
    fmus = request.getfixturevalue(name), request.getfixturevalue(f"{name}_2")
    assert fmus[0].references == fmus[1].references
    rows = []
    for fmu in fmus:
        with fmu.instantiate() as instance:
            assert instance.initialise(10.0) == OK
            rows.append(braking(instance, 150).tobytes())
    assert rows[0] == rows[1]


def test_the_parameter_makes_a_shadow(suv_2: Fmu) -> None:
    with suv_2.instantiate() as ecu:
        assert ecu.put_truth("armed", False) == OK
        kept = (c_int * 1)(-1)
        reference = (c_uint32 * 1)(suv_2.references["armed"])
        assert ecu.call("GetBoolean", reference, c_size_t(1), kept) == OK
        assert kept[0] == 0
        ecu.put({**DRIVING, "decel_demand": 4.0, "decel_demand_valid": 1.0})
        ecu.initialise()
        for _ in range(150):
            ecu.step()
        assert ecu.get(["pressure_demand_valid"])[0] == 0.0


def test_a_scenario_that_has_ended_is_discarded_and_terminated(stop_2: Fmu) -> None:
    with stop_2.instantiate() as vehicle:
        vehicle.initialise()
        while (status := vehicle.step()) == OK:
            assert not vehicle.terminates
        assert status == DISCARD
        assert vehicle.terminates
        assert vehicle.get(["truth.vehicle_speed"])[0] < 0.1


one = (c_uint32 * 1)(9999), c_size_t(1), (c_double * 1)(1.0)
WRONG: list[tuple[str, Callable[[Instance], int], int, str]] = [
    ("a step of 7 ms", lambda fmu: fmu.step(0.007), DISCARD, "of 0.007 s: this FMU takes steps of 0.01"),
    ("a step elsewhere", lambda fmu: fmu.step_from(5.0), DISCARD, "a step from 5 s: this FMU is at 0.01"),
    ("an unknown one read", lambda fmu: fmu.call("GetReal", *one), ERROR, "fmi2GetReal: no variable 9999"),
    ("an unknown one set", lambda fmu: fmu.call("SetReal", *one), ERROR, "fmi2SetReal: no variable 9999"),
    (
        "no array",
        lambda fmu: fmu.call("GetReal", None, *one[1:]),
        ERROR,
        "fmi2GetReal: no array of variables",
    ),
    ("no values", lambda fmu: fmu.call("SetReal", *one[:2], None), ERROR, "fmi2SetReal: no array of values"),
    ("no size", lambda fmu: fmu.call("SerializedFMUstateSize", None, None), ERROR, "no place for the size"),
    ("an output set", lambda fmu: fmu.put({"mode": 1.0}), ERROR, "cannot be set"),
    ("a parameter set late", lambda fmu: fmu.put_truth("armed", False), ERROR, "cannot be set any more"),
    ("another type", lambda fmu: fmu.call("GetInteger", *one), ERROR, "no variable is of this type"),
    ("set up again", lambda fmu: fmu.initialise(), ERROR, "fmi2SetupExperiment: not between steps"),
    ("derivatives", lambda fmu: fmu.call("SetRealInputDerivatives"), ERROR, "not provided"),
    ("no state", lambda fmu: fmu.restore(ctypes.c_void_p()), ERROR, "no state of this FMU is given"),
]


@pytest.mark.parametrize(("what", "call", "status", "message"), WRONG, ids=[what for what, *_ in WRONG])
def test_what_is_wrong_has_a_status_and_a_message(
    suv_2: Fmu, what: str, call: Callable[[Instance], int], status: int, message: str
) -> None:
    assert_refused(suv_2, call, status, message, DRIVING)


def test_another_guid_and_model_exchange_are_refused(suv_2: Fmu) -> None:
    assert suv_2.instantiate("another").address is None
    instantiate = suv_2.library.fmi2Instantiate
    instantiate.restype = ctypes.c_void_p
    guid = suv_2.description.get("guid", "").encode()
    assert instantiate(b"one", c_int(0), guid, b"", None, c_int(0), c_int(0)) is None


FUNCTIONS = """
GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment EnterInitializationMode
ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean GetString SetReal SetInteger SetBoolean
SetString GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate
GetDirectionalDerivative SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus
GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus
"""
"""Of fmi2Functions.h of FMI 2.0, but those of model exchange alone."""


def test_every_function_of_co_simulation_is_there(suv_2: Fmu) -> None:
    listed = subprocess.run(
        ["nm", "-D", "--defined-only", suv_2.library._name], capture_output=True, text=True, check=True
    ).stdout
    shown = {line.split()[-1] for line in listed.splitlines()}
    assert shown == {f"fmi2{name}" for name in FUNCTIONS.split()}
