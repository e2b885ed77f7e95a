"""A small co-simulation master: what an importer of FMI 3.0 or 2.0 does, with names for value references."""

import ctypes
import platform
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable, Mapping, Sequence
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint8, c_uint32, c_void_p
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

OK, WARNING, DISCARD, ERROR = range(4)
STEP = 0.01
_LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class Fmu:
    """An unpacked FMU."""

    def __init__(self, path: Path, folder: Path) -> None:
        with zipfile.ZipFile(path) as packed:
            packed.extractall(folder)
        self.description = ET.parse(folder / "modelDescription.xml").getroot()
        interface = self.description.find("CoSimulation")
        assert interface is not None
        self.version = int(self.description.get("fmiVersion", "")[0])
        binaries = folder / "binaries" / ("linux64" if self.version == 2 else f"{platform.machine()}-linux")
        self.library = ctypes.CDLL(str(binaries / f"{interface.get('modelIdentifier')}.so"))
        variables = self.description.findall("ModelVariables/*")
        self.references = {one.get("name", ""): int(one.get("valueReference", "")) for one in variables}
        by_cause: dict[str | None, list[str]] = {}
        for one in variables:
            by_cause.setdefault(one.get("causality"), []).append(one.get("name", ""))
        self.inputs, self.outputs = by_cause["input"], by_cause["output"]

    def instantiate(self, token: str | None = None) -> "Instance":
        if self.version == 2:
            return Instance2(self, token or self.description.get("guid", ""))
        return Instance(self, token or self.description.get("instantiationToken", ""))


class Instance:
    """One instance. A call returns FMI's status; `messages` is what the FMU has said."""

    STATE, DESERIALISE = "FMUState", "DeserializeFMUState"

    def __init__(self, fmu: Fmu, token: str) -> None:
        self.fmu, self.messages = fmu, list[tuple[int, str, str]]()
        self._log = _LOGGER(lambda _, *said: self._note(*said))
        made = self.make(token.encode())
        self.address = made and c_void_p(made)
        self.terminates, self.time = False, 0.0

    def _note(self, status: int, kind: bytes, text: bytes) -> None:
        self.messages.append((status, kind.decode(), text.decode()))

    def make(self, token: bytes) -> int | None:
        instantiate = self.fmu.library.fmi3InstantiateCoSimulation
        instantiate.restype = c_void_p
        no, yes = c_bool(False), c_bool(True)
        return instantiate(b"one", token, b"", no, yes, no, no, None, c_size_t(0), None, self._log, None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        getattr(self.fmu.library, f"fmi{self.fmu.version}FreeInstance")(self.address)

    def call(self, name: str, *arguments: Any) -> int:
        return int(getattr(self.fmu.library, f"fmi{self.fmu.version}{name}")(self.address, *arguments))

    def initialise(self, start: float = 0.0, stop: float | None = None) -> int:
        self.time = start
        return self.call(
            "EnterInitializationMode", c_bool(False), c_double(0.0), c_double(start),
            c_bool(stop is not None), c_double(stop or 0.0),
        ) or self.call("ExitInitializationMode")  # fmt: skip

    def put(self, values: Mapping[str, float]) -> int:
        count = len(values)
        references = (c_uint32 * count)(*(self.fmu.references[name] for name in values))
        return self.call(
            "SetFloat64", references, c_size_t(count), (c_double * count)(*values.values()), c_size_t(count)
        )

    def put_truth(self, name: str, value: bool) -> int:
        reference = (c_uint32 * 1)(self.fmu.references[name])
        return self.call("SetBoolean", reference, c_size_t(1), (c_bool * 1)(value), c_size_t(1))

    def get(self, names: Sequence[str]) -> NDArray[np.float64]:
        count = len(names)
        references = (c_uint32 * count)(*(self.fmu.references[name] for name in names))
        values = np.full(count, -1.0)
        status = self.call(
            "GetFloat64", references, c_size_t(count), c_void_p(values.ctypes.data), c_size_t(count)
        )
        assert status == OK, self.messages[-1]
        return values

    def step_arguments(self, by: float = STEP) -> tuple[Any, ...]:
        self._results = c_bool(True), c_bool(True), c_bool(True), c_double()
        return c_double(self.time), c_double(by), c_bool(False), *map(byref, self._results)

    def step(self, by: float = STEP) -> int:
        status = self.call("DoStep", *self.step_arguments(by))
        event, ends, early, reached = (one.value for one in self._results)
        if status == OK:
            assert (event, early) == (False, False)
            self.time, self.terminates = reached, ends
        return status

    def step_from(self, time: float) -> int:
        own, self.time = self.time, time
        status = self.step()
        self.time = own
        return status

    def state(self, kept: c_void_p | None = None) -> c_void_p:
        kept = kept or c_void_p()
        assert self.call(f"Get{self.STATE}", byref(kept)) == OK
        return kept

    def free(self, state: c_void_p) -> int:
        return self.call(f"Free{self.STATE}", byref(state))

    def restore(self, state: c_void_p) -> int:
        return self.call(f"Set{self.STATE}", state)

    def serialised(self, state: c_void_p) -> bytes:
        size = c_size_t()
        assert self.call(f"Serialized{self.STATE}Size", state, byref(size)) == OK
        content = (c_uint8 * size.value)()
        assert self.call(f"Serialize{self.STATE}", state, content, size) == OK
        return bytes(content)

    def deserialised(self, content: bytes) -> tuple[int, c_void_p]:
        state = c_void_p()
        return self.call(self.DESERIALISE, content, c_size_t(len(content)), byref(state)), state


def assert_refused(
    fmu: Fmu, call: Callable[[Instance], int], status: int, message: str, values: Mapping[str, float]
) -> None:
    """A step that cannot be done changes nothing; after an error a run has ended, until a reset."""
    with fmu.instantiate() as one:
        one.put(values)
        one.initialise()
        assert one.step() == OK
        before = one.get(fmu.outputs).tobytes()
        assert call(one) == status
        assert one.messages[-1][0] == status
        assert one.messages[-1][1] == {DISCARD: "logStatusDiscard", ERROR: "logStatusError"}[status]
        assert message in one.messages[-1][2]
        assert one.get(fmu.outputs).tobytes() == before
        assert one.step() == (OK if status == DISCARD else ERROR)
        assert one.call("Reset") == OK
        assert one.initialise() == OK
        assert one.step() == OK


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("log", c_void_p), ("allocate", c_void_p), ("release", c_void_p), ("finished", c_void_p),
        ("environment", c_void_p),
    )  # fmt: skip


_LOGGER_2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)


class Instance2(Instance):
    """One instance of FMI 2.0; what follows differs from FMI 3.0."""

    STATE, DESERIALISE = "FMUstate", "DeSerializeFMUstate"

    def make(self, token: bytes) -> int | None:
        def log(_: object, name: bytes, status: int, kind: bytes, form: bytes, text: bytes) -> None:
            assert (name, form) == (b"one", b"%s")
            self._note(status, kind, text)

        self._log_2 = _LOGGER_2(log)
        self._callbacks = _Callbacks(log=ctypes.cast(self._log_2, c_void_p).value)
        instantiate = self.fmu.library.fmi2Instantiate
        instantiate.restype = c_void_p
        return instantiate(b"one", c_int(1), token, b"", byref(self._callbacks), c_int(0), c_int(1))

    def initialise(self, start: float = 0.0, stop: float | None = None) -> int:
        self.time = start
        given, end = c_int(stop is not None), c_double(stop or 0.0)
        return (
            self.call("SetupExperiment", c_int(0), c_double(0.0), c_double(start), given, end)
            or self.call("EnterInitializationMode")
            or self.call("ExitInitializationMode")
        )

    def put(self, values: Mapping[str, float]) -> int:
        references = (c_uint32 * len(values))(*(self.fmu.references[name] for name in values))
        return self.call(
            "SetReal", references, c_size_t(len(values)), (c_double * len(values))(*values.values())
        )

    def put_truth(self, name: str, value: bool) -> int:
        reference = (c_uint32 * 1)(self.fmu.references[name])
        return self.call("SetBoolean", reference, c_size_t(1), (c_int * 1)(value))

    def get(self, names: Sequence[str]) -> NDArray[np.float64]:
        references = (c_uint32 * len(names))(*(self.fmu.references[name] for name in names))
        values = np.full(len(names), -1.0)
        status = self.call("GetReal", references, c_size_t(len(names)), c_void_p(values.ctypes.data))
        assert status == OK, self.messages[-1]
        return values

    def step(self, by: float = STEP) -> int:
        status = self.call("DoStep", c_double(self.time), c_double(by), c_int(0))
        reached, ends = c_double(), c_int(-1)
        if status in (OK, DISCARD):
            assert self.call("GetRealStatus", c_int(2), byref(reached)) == OK
            assert self.call("GetBooleanStatus", c_int(3), byref(ends)) == OK
            self.time, self.terminates = reached.value, ends.value == 1
        return status
