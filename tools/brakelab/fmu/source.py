"""C text of an FMU's library: tables of its variables, memory and calls, and behind them the files of c/."""

import hashlib
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from brakelab.fmu.description import Version
from brakelab.fmu.unit import Unit
from ecu.contract.signals import CYCLE_NS

FOLDER: Final = Path(__file__).parent / "c"
HEADERS: Final = (
    *("assert.h", "dlfcn.h", "fenv.h", "math.h", "stdarg.h", "stdbool.h", "stddef.h", "stdint.h"),
    *("stdio.h", "stdlib.h", "string.h"),
)


def _listed(values: Iterable[object], apart: str = ",") -> str:
    return "{" + apart.join(map(str, values)) + "}"


def _text(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _number(value: float) -> str:
    return repr(value) if math.isfinite(value) else "INFINITY" if value > 0.0 else "-INFINITY"


def _tables(unit: Unit, libraries: dict[str, str]) -> str:
    """Return what depends on the unit; `libraries`: files of the kernels by processor, the best first."""
    most = max(len(call.places) for call in unit.calls)
    variables = (
        _listed((one.offset, one.place, one.kind, _number(one.low), _number(one.high)))
        for one in unit.variables
    )
    targets = (
        f"{{{number},{place},{target}}}"
        for number, call in enumerate(unit.calls)
        for place, target in call.targets.items()
    )
    places = (
        _listed(
            f"{place}ll" if place != -(2**63) else "INT64_MIN" for place in _plain(call.places, call.targets)
        )
        for call in unit.calls
    )
    return "\n".join(
        (
            f"enum {{ MEMORY = {unit.memory.size}, COUNT = {len(unit.variables)}, CYCLE_NS = {CYCLE_NS} }};",
            f"enum {{ {', '.join(call.name for call in unit.calls)}, CALLS }};",
            f"enum {{ MOST_PLACES = {most}, TAKEN_AT = {unit.taken_at} }};",
            "enum { TIME, INPUT, OUTPUT, PARAMETER };",
            "static const struct { const char *processor, *file; } LIBRARIES[] = "
            + _listed(_listed(map(_text, one)) for one in libraries.items())
            + ";",
            f"static const char *const SYMBOLS[] = {_listed(_text(call.symbol) for call in unit.calls)};",
            "typedef struct { uint32_t offset, place, kind; double low, high; } variable;",
            f"static const variable VARIABLES[] = {_listed(variables)};",
            f"static const struct {{ int call, place; int64_t target; }} TARGETS[] = {_listed(targets)};",
            f"static const int64_t PLACES[CALLS][MOST_PLACES] = {_listed(places)};",
            *(
                f"__attribute__((unused)) static const int AT_{call.name}[] = {_listed(call.at)};"
                for call in unit.calls
            ),
            f"static const unsigned char START[MEMORY] = {_listed(unit.memory.content())};",
            "",
        )
    )


def _plain(places: list[int], targets: dict[int, int]) -> list[int]:
    """Return the places without what is an address in this process."""
    return [0 if place in targets else value for place, value in enumerate(places)]


def c_source(unit: Unit, libraries: dict[str, str], version: Version) -> tuple[str, str]:
    """Return the token that identifies the unit, and the C text of its library."""
    text = _tables(unit, libraries) + "".join(
        (FOLDER / name).read_text("utf-8") for name in ("instance.c", unit.text, f"fmi{version}.c")
    )
    names = "".join(f"{one.name} {one.unit}\n" for one in unit.variables)
    token = hashlib.sha256((names + text).encode()).hexdigest()
    includes = "".join(f"#include <{name}>\n" for name in HEADERS)
    return token, f"#define _GNU_SOURCE\n{includes}#define TOKEN {_text(token)}\n{text}"
