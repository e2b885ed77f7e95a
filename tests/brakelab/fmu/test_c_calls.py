"""What an importer does wrong has a defined result and a message, and never crashes."""

import ctypes
import os
import subprocess
from collections.abc import Callable
from ctypes import byref, c_bool, c_double, c_size_t, c_uint32
from pathlib import Path

import pytest

from brakelab.fmu import command
from ecu.building.c_compiler import compile_shared
from ecu.settings.resources import resource

from .master import DISCARD, ERROR, OK, STEP, Fmu, Instance, assert_refused
from .test_ecu_unit import DRIVING

pytestmark = pytest.mark.study

ENTER = ("EnterInitializationMode", c_bool(False), c_double(0.0), c_double(0.0), c_bool(False), c_double(0.0))

_BYTES = ctypes.create_string_buffer(100)
FOREIGN = ctypes.cast(_BYTES, ctypes.c_void_p)


def one(reference: int, count: int = 1) -> tuple[object, ...]:
    """Arguments of a function that reads or writes a number."""
    return (c_uint32 * 1)(reference), c_size_t(1), (c_double * 1)(1.0), c_size_t(count)


def truth(reference: int) -> tuple[object, ...]:
    return (c_uint32 * 1)(reference), c_size_t(1), (c_bool * 1)(True), c_size_t(1)


WRONG: list[tuple[str, Callable[[Instance], int], int, str]] = [
    ("a step of 7 ms", lambda fmu: fmu.step(0.007), DISCARD, "of 0.007 s: this FMU takes steps of 0.01"),
    ("a step of 25 ms", lambda fmu: fmu.step(0.025), DISCARD, "a step of 0.025 s"),
    ("no step", lambda fmu: fmu.step(0.0), DISCARD, "a step of 0 s"),
    ("a step without an end", lambda fmu: fmu.step(1e300), DISCARD, "a step of 1e+300 s"),
    ("a step of days", lambda fmu: fmu.step(1e6), DISCARD, "this FMU takes steps of 1 h at most"),
    ("a step back", lambda fmu: fmu.step(-0.01), DISCARD, "a step of -0.01 s"),
    ("a step of NaN", lambda fmu: fmu.step(float("nan")), DISCARD, "a step of nan s"),
    ("a step elsewhere", lambda fmu: fmu.step_from(5.0), DISCARD, "a step from 5 s: this FMU is at 0.01"),
    ("an unknown one read", lambda fmu: fmu.call("GetFloat64", *one(9999)), ERROR, "no variable 9999, the"),
    ("an unknown one set", lambda fmu: fmu.call("SetFloat64", *one(9999)), ERROR, "no variable 9999"),
    ("values missing", lambda fmu: fmu.call("GetFloat64", *one(1, 2)), ERROR, "2 values of 1 variables"),
    ("no array", lambda fmu: fmu.call("GetFloat64", None, *one(1)[1:]), ERROR, "no array of variables"),
    ("no values", lambda fmu: fmu.call("SetFloat64", *one(1)[:2], None, c_size_t(1)), ERROR, "of values"),
    ("values without end", lambda fmu: fmu.call("GetFloat64", *one(1, 2**64 - 1)), ERROR, "of 1 variables"),
    ("an output set", lambda fmu: fmu.put({"mode": 1.0}), ERROR, "cannot be set"),
    ("time set", lambda fmu: fmu.put({"time": 1.0}), ERROR, "cannot be set"),
    ("a parameter set late", lambda fmu: fmu.put_truth("armed", False), ERROR, "cannot be set any more"),
    ("a number as truth", lambda fmu: fmu.call("GetBoolean", *truth(1)), ERROR, "variable 1 is a number"),
    ("a parameter as a number", lambda fmu: fmu.put({"armed": 1.0}), ERROR, "is a truth value"),
    ("another type", lambda fmu: fmu.call("GetInt32", *one(1)), ERROR, "no variable is of this type"),
    ("initialised twice", lambda fmu: fmu.call(*ENTER), ERROR, "InitializationMode: not between steps"),
    ("event mode", lambda fmu: fmu.call("EnterEventMode"), ERROR, "fmi3EnterEventMode: not provided"),
    ("no state", lambda fmu: fmu.restore(ctypes.c_void_p()), ERROR, "no state of this FMU is given"),
    ("a foreign state", lambda fmu: fmu.restore(FOREIGN), ERROR, "no state of this FMU is given"),
    ("a foreign one kept", lambda fmu: fmu.call("GetFMUState", byref(FOREIGN)), ERROR, "no place for a"),
    ("nowhere kept", lambda fmu: fmu.call("GetFMUState", None), ERROR, "no place for a state"),
    ("a foreign one out", lambda fmu: fmu.call("SerializeFMUState", FOREIGN, _BYTES, c_size_t(2**20)), ERROR,
        "no state of this FMU"),
    ("no bytes", lambda fmu: fmu.call("DeserializeFMUState", None, c_size_t(100), byref(FOREIGN)), ERROR,
        "not a state of this FMU"),
    ("no size", lambda fmu: fmu.call("SerializedFMUStateSize", FOREIGN, None), ERROR, "no place for the"),
]  # fmt: skip


@pytest.mark.parametrize(("what", "call", "status", "message"), WRONG, ids=[what for what, *_ in WRONG])
def test_what_is_wrong_has_a_status_and_a_message(
    suv: Fmu, what: str, call: Callable[[Instance], int], status: int, message: str
) -> None:
    assert_refused(suv, call, status, message, DRIVING)


def test_a_call_at_the_wrong_time_is_refused(suv: Fmu) -> None:
    for early in (("DoStep",), ("ExitInitializationMode",), ("Terminate",)):
        with suv.instantiate() as ecu:
            assert (ecu.step() if early[0] == "DoStep" else ecu.call(*early)) == ERROR
            assert f"fmi3{early[0]}: not before initialisation" in ecu.messages[-1][2]
    with suv.instantiate() as ecu:
        ecu.initialise()
        assert ecu.call("Terminate") == OK
        assert ecu.step() == ERROR
        assert "fmi3DoStep: not after the end, or an error" in ecu.messages[-1][2]


def test_results_of_a_step_that_nobody_asks_for_are_left_out(suv: Fmu) -> None:
    with suv.instantiate() as ecu:
        ecu.initialise()
        assert ecu.call("DoStep", *ecu.step_arguments()[:3], None, None, None, None) == OK
        assert ecu.get(["time"])[0] == STEP


def test_a_library_of_a_relative_path_finds_its_kernels_from_any_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its folder may have a space and an umlaut."""
    command.write_ecu(resource("config/suv.toml"), tmp_path / "ecu.fmu")
    monkeypatch.chdir(tmp_path)
    fmu = Fmu(Path("ecu.fmu"), Path("Prüfstand 1"))
    monkeypatch.chdir("/")
    with fmu.instantiate() as ecu:
        assert ecu.initialise() == OK
        assert ecu.step() == OK


def test_the_stop_time_is_the_end(suv: Fmu) -> None:
    with suv.instantiate() as ecu:
        assert ecu.initialise(3.0, 3.02) == OK
        assert [ecu.step(), ecu.step(), ecu.step()] == [OK, OK, ERROR]
        assert "the stop time is 3.02 s" in ecu.messages[-1][2]
    with suv.instantiate() as ecu:
        assert ecu.initialise(float("inf")) == ERROR


def test_time_does_not_drift(suv: Fmu) -> None:
    with suv.instantiate() as ecu:
        ecu.initialise(100.0)
        for k in range(1, 5001):
            assert ecu.step() == OK
            assert ecu.get(["time"])[0] == ecu.time == pytest.approx(100.0 + 0.01 * k, abs=1e-9)


def test_another_fmus_token_is_refused(suv: Fmu) -> None:
    ecu = suv.instantiate("another")
    assert ecu.address is None
    assert ecu.messages == [(ERROR, "logStatusError", "the token is another FMU's")]


def test_without_kernels_it_says_which_file_is_missing(make_ecu: Callable[[str], Fmu]) -> None:
    fmu = make_ecu("sedan")
    for path in Path(fmu.library._name).parent.glob("x86*.so"):
        path.unlink()
    ecu = fmu.instantiate()
    assert ecu.address is None
    assert "cannot open shared object file" in ecu.messages[-1][2]


def test_logging_can_be_turned_off_but_for_errors(suv: Fmu) -> None:
    def logging(ecu: Instance, on: bool, *names: bytes) -> int:
        return ecu.call(
            "SetDebugLogging", c_bool(on), c_size_t(len(names)), (ctypes.c_char_p * len(names))(*names)
        )

    with suv.instantiate() as ecu:
        ecu.initialise()
        assert logging(ecu, False) == OK
        assert ecu.step(0.007) == DISCARD
        assert ecu.messages == []
        assert logging(ecu, True, b"logStatusDiscard") == OK
        assert ecu.step(0.007) == DISCARD
        assert len(ecu.messages) == 1
        assert logging(ecu, False) == OK
        assert logging(ecu, True, b"logNothing") == ERROR
        assert ecu.messages[-1][2] == "there is no category logNothing of messages"


def test_no_instance_is_an_error(suv: Fmu) -> None:
    for name in ("Reset", "Terminate", "ExitInitializationMode", "EnterEventMode"):
        assert getattr(suv.library, f"fmi3{name}")(None) == ERROR
    suv.library.fmi3FreeInstance(None)


TYPES = (
    "Float32",
    "Float64",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
    "String",
    "Binary",
    "Clock",
)
# fmt: off
FUNCTIONS = (
    *(f"{does}{kind}" for does in ("Get", "Set") for kind in TYPES),
    "GetVersion", "SetDebugLogging", "InstantiateModelExchange", "InstantiateCoSimulation",
    "InstantiateScheduledExecution", "FreeInstance", "EnterInitializationMode",
    "ExitInitializationMode", "EnterEventMode", "Terminate", "Reset", "GetNumberOfVariableDependencies",
    "GetVariableDependencies", "GetFMUState", "SetFMUState", "FreeFMUState", "SerializedFMUStateSize",
    "SerializeFMUState", "DeserializeFMUState", "GetDirectionalDerivative", "GetAdjointDerivative",
    "EnterConfigurationMode", "ExitConfigurationMode", "GetIntervalDecimal", "GetIntervalFraction",
    "GetShiftDecimal", "GetShiftFraction", "SetIntervalDecimal", "SetIntervalFraction",
    "SetShiftDecimal", "SetShiftFraction", "EvaluateDiscreteStates", "UpdateDiscreteStates",
    "EnterContinuousTimeMode", "CompletedIntegratorStep", "SetTime", "SetContinuousStates",
    "GetContinuousStateDerivatives", "GetEventIndicators", "GetContinuousStates",
    "GetNominalsOfContinuousStates", "GetNumberOfEventIndicators", "GetNumberOfContinuousStates",
    "EnterStepMode", "GetOutputDerivatives", "DoStep", "ActivateModelPartition",
)
# fmt: on
"""Of fmi3Functions.h of FMI 3.0: an FMU has to have them all (chapter 2.5)."""


def test_every_function_of_the_standard_is_there_and_nothing_else(suv: Fmu) -> None:
    listed = subprocess.run(
        ["nm", "-D", "--defined-only", suv.library._name], capture_output=True, text=True, check=True
    ).stdout
    shown = {line.split()[-1] for line in listed.splitlines()}
    assert shown == {f"fmi3{name}" for name in FUNCTIONS}


ROUNDING_UP = 0x1F80 | 0x4000 | 0x8000 | 0x40  # MXCSR: masked, upwards, flush to zero, denormals are zero


def test_the_importers_floating_point_does_not_matter(suv: Fmu, tmp_path: Path) -> None:
    """A thread that rounds upwards and flushes to zero gets the same bits, and keeps its own setting."""
    text = """
    #include <xmmintrin.h>
    unsigned get(void) { return _mm_getcsr(); }
    void set(unsigned csr) { _mm_setcsr(csr); }
    """
    if os.uname().machine != "x86_64":
        pytest.skip("MXCSR is x86's")
    (tmp_path / "csr.c").write_text(text)
    shown = ("-fvisibility=default",)
    compile_shared((tmp_path / "csr.c",), shown, tmp_path / "csr.so")
    csr = ctypes.CDLL(str(tmp_path / "csr.so"))

    def run(mode: int | None) -> bytes:
        with suv.instantiate() as ecu:
            ecu.put({**DRIVING, "decel_demand": 4.0, "decel_demand_valid": 1.0, "accel_x": 1e-310})
            ecu.initialise()
            for _ in range(100):
                usual = csr.get()
                if mode is not None:
                    csr.set(mode)
                try:
                    assert ecu.call("DoStep", *ecu.step_arguments()) == OK
                    assert mode is None or csr.get() & 0xFFC0 == mode & 0xFFC0
                finally:
                    csr.set(usual)
                ecu.time += 0.01
            return ecu.get(suv.outputs).tobytes()

    assert run(ROUNDING_UP) == run(None)


def test_the_text_compiles_without_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    strict = (*command.OPTIONS, "-Wall", "-Wextra", "-Wconversion", "-Wno-sign-conversion", "-Werror")
    monkeypatch.setattr(command, "OPTIONS", strict)
    command.write_ecu(resource("config/suv.toml"), tmp_path / "ecu.fmu")
    command.write_vehicle(
        resource("config/scenarios/stop-1.toml"), None, tmp_path / "vehicle.fmu", 0, None, None
    )
