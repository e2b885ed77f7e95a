"""User-defined friction law: a Python file named in the lining file, compiled by itself when read.

The file, or an entry point of the group `brakelab.friction_laws` that loads such a module, has

NUMBERS  name: (unit, least, greatest) of the law's parameters, in the order in which `step` reads them;
         `brake-ecu identify friction --own` searches between the two
START    the memory at the start of an application; without, 1
step     `(numbers, memory, pressure, speed, slowing, temperature, dt) -> (memory, mu_b)`, compilable by
         numba; inputs as in the package

`step` becomes a C function whose address is stored in the law's row, where `friction` calls it: no other
kernel is recompiled. An address is valid in the process that made the row; laws, not rows, are passed to
other processes.
"""

import importlib.metadata
import importlib.util
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, Final, Literal, NamedTuple, Self

import numpy as np
from pydantic import ValidationInfo, field_validator, model_validator

from brakelab.plant.friction.law import ROW, Law, RigBrake
from brakelab.plant.jit import Record, interprets, kernel

GROUP: Final = "brakelab.friction_laws"
ADDRESS: Final = 1
NUMBERS: Final = 2  # index of the first number in the row
MOST_NUMBERS: Final = ROW - NUMBERS
TRIED: Final = (1.0, 30e5, 5.0, 30.0, 100.0, 1e-3)
"""Inputs after the numbers at which a law must give a friction: 30 bar, 5 m/s, 30 rad/s^2, 100 degC, 1 ms."""

Step = Callable[..., tuple[float, float]]


class Code(NamedTuple):
    """File of a law, read and compiled."""

    numbers: dict[str, tuple[str, float, float]]  # unit, least, greatest
    start: float
    address: int
    keeps: Any  # objects that keep the address valid


class Own(Law):
    law: Literal["own"]
    code: str  # FILE.py beside the lining file, or the name of an entry point
    numbers: dict[str, float]

    @field_validator("code")
    @classmethod
    def _beside(cls, code: str, info: ValidationInfo) -> str:
        if code.endswith(".py") and info.context:
            return str(Path(info.context["folder"], code).resolve())
        return code

    @model_validator(mode="after")
    def _known(self) -> Self:
        wanted = read_code(self.code).numbers
        for name in (*wanted, *self.numbers):
            if name not in self.numbers or name not in wanted:
                remedy = f"{Path(self.code).name} wants {', '.join(wanted)}"
                raise ValueError(
                    f"numbers.{name} is {'unknown' if name not in wanted else 'missing'}; {remedy}"
                )
        return self

    def row(self, brake: RigBrake) -> Sequence[float]:
        code = read_code(self.code)
        return (code.start, float(code.address), *(self.numbers[name] for name in code.numbers))


_READ: dict[str, tuple[int, Code]] = {}
_PLAIN: dict[int, Step] = {}


def read_code(code: str) -> Code:
    """Return the file or entry point `code`, compiled once per version. Raises `ValueError`."""
    path = Path(code)
    try:
        changed = path.stat().st_mtime_ns if code.endswith(".py") else 0
    except OSError as error:
        raise ValueError(f"{code}: {error.strerror}") from error
    if code not in _READ or _READ[code][0] != changed:
        _READ[code] = changed, _checked(code, _module(code))
    return _READ[code][1]


def plain_step(code: str) -> Step:
    """Return the function `step` of a file or entry point. Raises `ValueError`."""
    step: Step = _module(code).step
    return step


def _module(code: str) -> ModuleType:
    if not code.endswith(".py"):
        found = list(importlib.metadata.entry_points(group=GROUP, name=code))
        if not found:
            raise ValueError(f"{code}: no file that ends in .py, and no entry point of {GROUP}")
        loaded = found[0].load()
        if not isinstance(loaded, ModuleType):
            raise ValueError(f"{code}: the entry point must name a module")
        return loaded
    spec = importlib.util.spec_from_file_location(f"own_law_{Path(code).stem}", code)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ValueError(f"{code}: {_one_line(error)}") from error
    return module


def _checked(code: str, module: ModuleType) -> Code:
    given, law = getattr(module, "NUMBERS", None), getattr(module, "step", None)
    try:
        numbers = {str(name): (str(u), float(low), float(high)) for name, (u, low, high) in given.items()}  # type: ignore[union-attr]
    except (AttributeError, TypeError, ValueError):
        raise ValueError(f"{code}: give NUMBERS = {{name: (unit, least, greatest)}}") from None
    for name, (_, low, high) in numbers.items():
        if not low < high:
            raise ValueError(f"{code}: NUMBERS[{name!r}]: least {low:g} is not below greatest {high:g}")
    if len(numbers) > MOST_NUMBERS:
        raise ValueError(f"{code}: {len(numbers)} numbers; at most {MOST_NUMBERS}")
    if not callable(law):
        raise ValueError(f"{code}: has no function step")
    try:
        address, keeps = _compiled(law, len(numbers))
    except Exception as error:
        raise ValueError(f"{code}: numba cannot compile step: {_one_line(error)}") from error
    compiled = Code(numbers, float(getattr(module, "START", 1.0)), address, keeps)
    middle = [0.5 * (low + high) for _, low, high in numbers.values()]
    _, mu = step(_padded(compiled, middle), *TRIED)
    if not math.isfinite(mu):
        raise ValueError(f"{code}: step gives {mu} at 30 bar, 5 m/s, 100 °C and the middle of its numbers")
    return compiled


def _padded(code: Code, values: list[float]) -> Any:
    row = np.zeros(ROW)
    row[ADDRESS], row[NUMBERS : NUMBERS + len(values)] = code.address, values
    return row


def _one_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    telling = [
        line for line in lines if not line.startswith(("Failed in nopython", "During:", "- Resolution"))
    ]
    return (telling or lines or [type(error).__name__])[0]


def _compiled(step: Any, count: int) -> tuple[int, Any]:
    """Return the address of `step` as a C function, and its owner."""
    plain = getattr(step, "py_func", step)
    if interprets():
        _PLAIN[len(_PLAIN) + 1] = plain
        return len(_PLAIN), plain
    from brakelab.plant.friction.own_compiled import as_c_function

    return as_c_function(plain, NUMBERS, count)


def _call_plain(address: int, row: Any, *inputs: float) -> tuple[float, float]:
    memory, mu = _PLAIN[address](row[NUMBERS:], *inputs)
    return float(memory), float(mu)


class _CompiledCall:
    """`own_compiled.call` by its type: numba asks for it, nobody else needs numba."""

    @property
    def _numba_type_(self) -> Any:
        from brakelab.plant.friction.own_compiled import type_of_call

        return type_of_call()


call_law: Any = _call_plain if interprets() else _CompiledCall()


@kernel
def step(
    row: Record,
    memory: float,
    pressure: float,
    speed: float,
    slowing: float,
    temperature: float,
    dt: float,
) -> tuple[float, float]:
    """Return memory and friction of the law at the row's address; NaN if it gave none."""
    address = int(row[ADDRESS])
    called: tuple[float, float] = call_law(address, row, memory, pressure, speed, slowing, temperature, dt)
    return called
