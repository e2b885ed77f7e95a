"""Kernels as C: the same numbers from both, and what has no form there is refused by its line."""

import ctypes
import itertools
import math
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.c_source import INT, Source, array, number
from ecu.building.c_compiler import compiler
from ecu.errors import UserError

PLACES = (3.0, -1.5, 0.25)


def branches(x: float, y: float) -> float:
    if x > y and not x > 2.0:
        return x - y
    if 0.0 < x <= y or x < -1.0:
        return min(x, y) ** 2
    return abs(x) if x != y else -y


def loops(x: float, count: int) -> float:
    total = 0
    for k in range(count):
        total += k
        if k in (3, 5):
            continue
        while total > 7:
            total -= 2
            if total == 6:
                break
    for k in range(1, 3):
        total += PLACES[k] * x
    return total / 2


def pair(x: float, y: float) -> tuple[int, float]:
    x, y = y, x
    return int(x), y if x > 0.0 else -y


def both(x: float, y: float) -> float:
    k, z = pair(x, y)
    a, b, c = PLACES
    return math.floor(z) + k / 2 + a * b - c + math.hypot(x, y) * math.pi


def untyped(numbers, memory, pressure):  # type: ignore[no-untyped-def]  # as a law of one's own
    level, grow = numbers
    memory += grow * (1.0 - memory)
    return memory, level * memory * pressure


def compiled(folder: Path, text: str) -> ctypes.CDLL:
    """Return the library of a C text, compiled with all warnings as errors."""
    if compiler() is None:
        pytest.skip("no C compiler")
    source, out = folder / "made.c", folder / f"made{next(_NUMBER)}.so"
    source.write_text(text, encoding="utf-8")
    strict = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-Wno-unused-parameter")
    made = ("-O2", "-ffp-contract=off", "-shared", "-fPIC", "-o", str(out), str(source), "-lm")
    subprocess.run([str(compiler()), *strict, *made], check=True)
    return ctypes.CDLL(str(out))


_NUMBER = itertools.count()


@pytest.mark.parametrize("function", [branches, loops, both])
def test_a_function_gives_the_same_in_c(function: Callable[..., Any], tmp_path: Path) -> None:
    source = Source()
    name = source.add(function)
    kind = INT if function is loops else "double"
    text = f"{source.text}\ndouble call(double x, {kind} y) {{ return {name}(x, y); }}\n"
    call = compiled(tmp_path, text).call
    call.restype = ctypes.c_double
    second = ctypes.c_int if function is loops else ctypes.c_double
    call.argtypes = [ctypes.c_double, second]
    for x in np.linspace(-3.0, 3.0, 13):
        for y in range(7) if function is loops else np.linspace(-3.0, 3.0, 13):
            assert call(x, y) == pytest.approx(function(float(x), y), rel=1e-14, abs=1e-14), (x, y)


def test_a_law_without_annotations_has_numbers_first(tmp_path: Path) -> None:
    source = Source()
    name = source.add(untyped)
    text = (
        f"{source.text}\ndouble call(double *n) {{ double a, b; {name}(n, 0.5, 3.0, &a, &b); return b; }}\n"
    )
    call = compiled(tmp_path, text).call
    call.restype = ctypes.c_double
    assert call((ctypes.c_double * 2)(0.4, 0.1)) == untyped((0.4, 0.1), 0.5, 3.0)[1]


def of_text(x: float) -> float:
    return len(str(x)) * x


def rest(x: float) -> float:
    return x % 2.0


def listed(x: float) -> float:
    return sum([x, 1.0])


def unequal(x: float) -> float:
    a, b = PLACES
    return a * b * x


@pytest.mark.parametrize(
    ("function", "what"),
    [(of_text, "str(x)"), (rest, "x % 2.0"), (listed, "[x, 1.0]"), (unequal, "PLACES")],
)
def test_what_has_no_form_in_c_is_refused_by_its_line(function: Callable[..., Any], what: str) -> None:
    with pytest.raises(UserError) as refused:
        Source().add(function)
    said = str(refused.value)
    assert __file__ in said
    assert f"line {function.__code__.co_firstlineno + 1}" in said
    assert what in said


@pytest.mark.parametrize(
    ("value", "text"), [(0.1, "0.1"), (math.inf, "INFINITY"), (-math.inf, "-INFINITY"), (math.nan, "NAN")]
)
def test_numbers_are_written_to_the_bit(value: float, text: str) -> None:
    assert number(value) == text
    assert text in array("some", [value])
