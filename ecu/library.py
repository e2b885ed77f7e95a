"""Kernels of a compiled library, called without numba: `ecu/build.py` makes it, `ecu/jit.py` asks for it.

A library stands beside its package in `compiled/`, a file for each kind of processor, with a manifest: the
texts that its kernels were made from, and for each kernel the arguments that it was compiled for. A kernel is
taken from it where every one of those texts is unchanged. An entry reads its arguments from a block of
8-byte places and writes what it returns behind them:

number     one place
record     its address
array      two empty places, elements, bytes of one, address, shape, strides
tuple      what it holds, one after the other
generator  where numpy's generator keeps its state and functions
"""

import ctypes
import hashlib
import importlib
import json
import platform
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

FOLDER: Final = "compiled"
MANIFEST: Final = "manifest.json"
BASELINE: Final = {"x86_64": "x86-64", "aarch64": "generic"}
"""Names of the least processor of an architecture, as LLVM has them."""
V3: Final = "x86-64-v3"

Spec = tuple[Any, ...]
"""Kind of an argument, see `spec_of`."""


@cache
def has_v3() -> bool:
    """Return whether this processor runs code for x86-64-v3."""
    if platform.machine() != "x86_64":
        return False
    try:
        text = Path("/proc/cpuinfo").read_text("ascii", "replace")
    except OSError:
        return False
    flags = set(next((line for line in text.splitlines() if line.startswith("flags")), "").split())
    return {"avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe"} <= flags


_LAYOUTS: dict[int, tuple[np.dtype[Any], str]] = {}


def layout(dtype: np.dtype[Any]) -> str:
    """Return what stands for the layout of a dtype: names, kinds, offsets, sizes."""
    known = _LAYOUTS.get(id(dtype))
    if known is None:
        text = dtype.str if dtype.names is None else _described(dtype)
        name = text if dtype.names is None else hashlib.sha256(text.encode()).hexdigest()[:16]
        known = _LAYOUTS[id(dtype)] = dtype, name
    return known[1]


def _described(dtype: np.dtype[Any]) -> str:
    if dtype.subdtype is not None:
        base, shape = dtype.subdtype
        return f"{_described(base)}{shape}"
    if dtype.names is None:
        return dtype.str
    fields: Mapping[str, Any] = dtype.fields or {}
    inside = ",".join(f"{name}@{fields[name][1]}:{_described(fields[name][0])}" for name in dtype.names)
    return f"{{{inside}}}{dtype.itemsize}"


def spec_of(value: Any) -> Spec | None:
    """Return the kind of an argument as the manifest has it; None: no library takes such a one."""
    if isinstance(value, np.ndarray):
        flags = value.flags
        order = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return ("array", layout(value.dtype), value.ndim, order, flags.writeable) if flags.aligned else None
    if isinstance(value, np.void):
        return ("record", layout(value.dtype))
    if isinstance(value, bool | np.bool_):
        return ("bool",)
    if isinstance(value, int):
        return ("number", "<i8")
    if isinstance(value, float):
        return ("number", "<f8")
    if isinstance(value, np.integer | np.floating):
        return ("number", value.dtype.str)
    if isinstance(value, tuple):
        inside = [spec_of(part) for part in value]
        return None if None in inside else ("tuple", _name_of(type(value)), *inside)
    if isinstance(value, np.random.Generator):
        return ("generator",)
    return None


@cache
def _name_of(kind: type) -> str:
    spec = sys.modules["__main__"].__spec__ if kind.__module__ == "__main__" else None
    module = kind.__module__ if spec is None else spec.name  # of `python -m package.module`
    return f"{module}:{kind.__qualname__}"


def fits(wanted: Spec, found: Spec) -> bool:
    """Return whether a kernel compiled for `wanted` takes `found`."""
    kind = wanted[0]
    if kind != found[0]:
        return False
    if kind == "array":
        _, form, dimensions, order, written = wanted
        return (
            found[1] == form
            and found[2] == dimensions
            and (found[3] == order or order == "A")
            and (found[4] or not written)
        )
    if kind == "number":
        return bool(wanted[1] == found[1] or (wanted[1] == "<f8" and found[1] == "<i8"))
    if kind == "tuple":
        parts = zip(wanted[2:], found[2:], strict=False)
        return wanted[1] == found[1] and len(wanted) == len(found) and all(fits(w, f) for w, f in parts)
    return bool(wanted[1:] == found[1:])


def places_of(spec: Spec) -> int:
    """Return how many places of a block an argument takes."""
    if spec[0] == "array":
        return 5 + 2 * int(spec[2])
    if spec[0] == "tuple":
        return sum(map(places_of, spec[2:]))
    return 9 if spec[0] == "generator" else 1


class _Block:
    """Arguments of one call, kept for the next: what is the same object is not written again."""

    def __init__(self, count: int, places: int) -> None:
        self.values = np.zeros(max(places, 1), np.int64)
        self.whole: memoryview[int] = memoryview(self.values)  # type: ignore[arg-type]
        self.real: memoryview[float] = memoryview(self.values.view(np.float64))  # type: ignore[arg-type]
        self.address = self.values.ctypes.data
        self.last: list[Any] = [_Block] * count  # of no argument


def _address(value: Any) -> int:
    """Return where an array or a record lies; its `__array_interface__` would describe every field first."""
    return int((value if isinstance(value, np.ndarray) else np.frombuffer(value, np.uint8)).ctypes.data)


def _write(block: _Block, at: int, spec: Spec, value: Any) -> int:
    """Write an argument into its places; return the place after it."""
    whole, kind = block.whole, spec[0]
    if kind == "number":
        if spec[1] in ("<f8", "<f4"):
            block.real[at] = value
        else:
            whole[at] = (int(value) + 2**63) % 2**64 - 2**63
        return at + 1
    if kind == "bool":
        whole[at] = bool(value)
        return at + 1
    if kind == "record":
        whole[at] = _address(value)
        return at + 1
    if kind == "array":
        whole[at + 2], whole[at + 3], whole[at + 4] = value.size, value.itemsize, _address(value)
        at += 5
        for number in (*value.shape, *value.strides):
            whole[at] = number
            at += 1
        return at
    if kind == "tuple":
        for part, inside in zip(value, spec[2:], strict=True):
            at = _write(block, at, inside, part)
        return at
    source = value.bit_generator.ctypes
    functions = (source.next_uint64, source.next_uint32, source.next_double)
    addresses = [ctypes.cast(function, ctypes.c_void_p).value or 0 for function in functions]
    whole[at + 1], whole[at + 2] = source.state_address, source.state_address
    whole[at + 3], whole[at + 4], whole[at + 5] = addresses
    whole[at + 6] = ctypes.cast(source.bit_generator, ctypes.c_void_p).value or 0
    return at + 9


@cache
def _tuple_of(name: str) -> Callable[[list[Any]], Any]:
    module, _, qualified = name.partition(":")
    made = getattr(importlib.import_module(module), qualified)
    return getattr(made, "_make", made)


def _read(block: _Block, at: int, spec: Spec) -> tuple[Any, int]:
    """Return what was returned, and the place after it."""
    kind = spec[0]
    if kind == "none":
        return None, at
    if kind == "tuple":
        parts = []
        for inside in spec[2:]:
            part, at = _read(block, at, inside)
            parts.append(part)
        return _tuple_of(spec[1])(parts), at
    if kind == "bool":
        return bool(block.whole[at]), at + 1
    return block.real[at] if spec[1] in ("<f8", "<f4") else block.whole[at], at + 1


class Entry:
    """A kernel as compiled for one list of arguments."""

    def __init__(self, name: str, function: Any, arguments: Sequence[Spec], returns: Spec) -> None:
        self._name, self._function, self._arguments, self._returns = name, function, arguments, returns
        self._places = [0]
        for spec in arguments:
            self._places.append(self._places[-1] + places_of(spec))
        self._free: list[_Block] = []
        self.count = len(arguments)

    def take(self, arguments: tuple[Any, ...]) -> _Block | None:
        """Return a block with the arguments of a call; None: this entry does not take them."""
        try:
            block = self._free.pop()
        except IndexError:
            block = _Block(self.count, self._places[-1] + places_of(self._returns))
        last = block.last
        for index, value in enumerate(arguments):
            if value is not last[index]:
                spec, found = self._arguments[index], spec_of(value)
                if found is None or not fits(spec, found):
                    self._free.append(block)
                    return None
                last[index] = _Block  # half written
                _write(block, self._places[index], spec, value)
                last[index] = value
        return block

    def call(self, block: _Block) -> Any:
        """Call the kernel; return what it returns."""
        if self._function(block.address):
            raise RuntimeError(f"{self._name} failed")  # an index or a shape that numba checks
        result = None if self._returns[0] == "none" else _read(block, self._places[-1], self._returns)[0]
        self._free.append(block)
        return result


class Library:
    """Kernels of a package that are compiled."""

    def __init__(self, folder: Path) -> None:
        """Open the library in `folder`. Raises OSError, ValueError: there is none for this processor."""
        self.folder = folder
        self.manifest = json.loads((folder / MANIFEST).read_bytes())
        known = self.manifest["processors"]
        wanted = [V3] if has_v3() else []
        wanted.append(BASELINE.get(platform.machine(), ""))
        self.processor = next((name for name in wanted if name in known), "")
        if not self.processor:
            raise ValueError(f"{folder}: nothing for {platform.machine()}")
        self._file = str(folder / known[self.processor])
        self._held = ctypes.PyDLL(self._file)
        self._kernels: dict[str, list[dict[str, Any]]] = self.manifest["kernels"]
        self._sources: dict[str, str] = self.manifest["sources"]
        self._needs: dict[str, list[str]] = self.manifest["modules"]

    def fits(self, module: str, digest: Callable[[str], str | None]) -> bool:
        """Return whether the kernels of a module are made from the texts that are there now."""
        needs = self._needs.get(module)
        return needs is not None and all(digest(name) == self._sources[name] for name in needs)

    def entries(self, kernel: str, nogil: bool = False) -> list[Entry]:
        """Return a kernel, by its full name, for each list of arguments.

        `nogil`: other threads of Python run while it is called.
        """
        found, file = [], ctypes.CDLL(self._file) if nogil else self._held
        for row in self._kernels.get(kernel, ()):
            function = file[row["symbol"]]
            function.argtypes, function.restype = [ctypes.c_void_p], ctypes.c_int
            found.append(Entry(kernel, function, _as_tuples(row["arguments"]), _as_tuples(row["returns"])))
        return found


def open_library(folder: Path) -> Library | None:
    """Return the library in `folder`, None: there is none for this processor, or it is damaged."""
    with suppress(OSError, ValueError, KeyError, TypeError):  # or it is of an earlier form
        return Library(folder)
    return None


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value
