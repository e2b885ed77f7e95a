"""`python -m ecu.build [--all] [--inner DIR]`: make the library of kernels that Python calls.

`ecu/library.py` reads it. For this processor, with `--all` for every one of its architecture. What Python
calls is called once, with kernels as plain Python, to see which they are and with what; numba translates
those and all that they call, LLVM optimises them as one program, and a C compiler links it. numba and LLVM
are needed here alone. `numba.pycc`, which did the like, is deprecated without a successor; this uses numba's
compiler up to LLVM's text, and llvmlite.
"""

import argparse
import hashlib
import importlib
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple, NoReturn

import numba

from ecu import jit
from ecu.building.calls import Seen, watch
from ecu.building.machine_code import Row, link, link_shared, machine_code, returned_spec, translate, within
from ecu.errors import UserError
from ecu.library import BASELINE, FOLDER, MANIFEST, V3, Library, has_v3, open_library

MACHINERY: Final = {"ecu.errors", "ecu.interpreted", "ecu.jit", "ecu.library"}
"""Modules whose texts are in no kernel: they call them."""
TESTS: Final = "tests"
"""Package whose kernels are in a library of tests alone."""
INNER: Final = "also libraries, in DIR, of what tests call: kernels that these call, and the tests' own"

LoadWorkload = Callable[[], Callable[[], None]]


class Inner(NamedTuple):
    """A folder of libraries for tests; one of a text that has changed since is no reason to make all anew.

    In a folder of the package's name the kernels that kernels call, and its kernels that the workload calls;
    in the folder itself those of tests.
    """

    folder: Path
    load_workload: LoadWorkload


def processors(all_of_them: bool) -> list[str]:
    """Return those that a library is made for."""
    least = BASELINE[platform.machine()]
    if platform.machine() != "x86_64":
        return [least]
    return [least, V3] if all_of_them else [V3 if has_v3() else least]


def is_up_to_date(found: Library | None, wanted: list[str]) -> bool:
    """Return whether a library is made for `wanted`, and from the texts that are there."""
    return (
        found is not None
        and set(wanted) <= set(found.manifest["processors"])
        and all(found.fits(module, jit.text_digest) for module in found.manifest["modules"])
    )


def build(package: str, load_workload: LoadWorkload, wanted: list[str], inner: Inner | None = None) -> None:
    """Make the library of a package for processors `wanted` from what a workload calls, and `inner`.

    `load_workload` imports it: afterwards kernels are plain Python.

    Raises:
        UserError: the C compiler cannot link it.
    """
    began = time.monotonic()
    watch()
    for module in sorted(jit.modules_with_kernels(package)):
        with suppress(ImportError):  # of a bench: its peers are not installed
            importlib.import_module(module)
    load_workload()()
    calls = [call for call in Seen.calls.values() if call.kernel.name.startswith(f"{package}.")]
    print(f"{package}: translating {len(calls)} kernels and all that they call, about a minute", flush=True)
    rows = translate(calls)
    print(f"{package}: translated after {time.monotonic() - began:.0f} s; optimising", flush=True)
    made = [(package, Path(importlib.import_module(package).__file__ or "").parent / FOLDER, rows)]
    if inner is not None:
        made += _inner(package, inner, rows)
    for of, folder, found in made:
        _make(of, folder, found, wanted)
        print(f"{folder}: {', '.join(wanted)}, after {time.monotonic() - began:.0f} s", flush=True)


def _inner(package: str, inner: Inner, rows: list[Row]) -> Iterator[tuple[str, Path, list[Row]]]:
    called, known = {row[:2] for row in rows}, set(Seen.calls)
    inner.load_workload()()
    more = translate(call for key, call in Seen.calls.items() if key not in known)
    for of, folder in ((package, inner.folder / package), (TESTS, inner.folder)):
        ahead = {row[:2]: row for row in (*more, *within(of)) if row.name.startswith(f"{of}.")}
        fewer = [row for key, row in ahead.items() if key not in called]
        if fewer:  # whole numbers first: real ones take them too
            yield of, folder, sorted(fewer, key=lambda row: str(row.arguments), reverse=True)


def _make(package: str, folder: Path, rows: list[Row], wanted: list[str]) -> None:
    """Make the library of kernels in `folder`, but of those that return what no entry does."""
    kept = [row for row in rows if returned_spec(row.result.fndesc.restype) is not None]
    kernels, symbols = dict[str, list[dict[str, Any]]](), [f"kernel_{number}" for number in range(len(kept))]
    for symbol, row in zip(symbols, kept, strict=True):
        returns = returned_spec(row.result.fndesc.restype)
        entry = {"symbol": symbol, "arguments": row.arguments, "returns": returns}
        kernels.setdefault(row.name, []).append(entry)
    whole = link(kept, symbols)
    codes = {processor: machine_code(whole, processor) for processor in wanted}
    folder.mkdir(parents=True, exist_ok=True)
    _write(package, folder, kernels, codes)


def _write(
    package: str, folder: Path, kernels: dict[str, list[dict[str, Any]]], codes: dict[str, bytes]
) -> None:
    """Write the files of a library and put its manifest in place of the last; who runs that one keeps it."""
    needs, sources = dict[str, list[str]](), dict[str, str]()
    for module in sorted(Seen.modules):
        if module.partition(".")[0] == package:
            texts = jit.sources_of_kernels(module)
            needs[module] = [name for name in texts if name not in MACHINERY]
            sources |= {name: texts[name].hex() for name in needs[module]}
    files = {
        processor: f"{processor}-{hashlib.sha256(code).hexdigest()[:16]}.so"
        for processor, code in codes.items()
    }
    for processor, name in files.items():
        link_shared(codes[processor], folder / name)
    manifest = {
        "numba": numba.__version__,
        "processors": files,
        "sources": sources,
        "modules": needs,
        "kernels": kernels,
    }
    part = folder / f"{MANIFEST}.part"
    part.write_text(json.dumps(manifest, separators=(",", ":")), "utf-8")
    part.replace(folder / MANIFEST)
    for path in folder.glob("*.so"):
        if path.name not in files.values():
            path.unlink()


def make(
    package: str, load_workload: LoadWorkload, everything: bool = False, inner: Inner | None = None
) -> int:
    """Make the library of a package, see `build`, unless it is up to date; return an exit code.

    The process is to end by `leave`.
    """
    wanted = processors(everything)
    found = [jit.library(package)] + ([open_library(inner.folder / package)] if inner else [])
    if not all(is_up_to_date(one, wanted) for one in found):
        try:
            build(package, load_workload, wanted, inner)
        except UserError as error:
            print(error, file=sys.stderr)
            return 1
    return 0


def leave(code: int) -> NoReturn:
    """End the process without taking apart what numba believes that it has compiled."""
    sys.stdout.flush()
    os._exit(code)


def _load_workload() -> Callable[[], None]:
    from ecu.entries import call_every_entry

    return call_every_entry


def main() -> NoReturn:
    """Compile the kernels, as the command line asks."""
    parser = argparse.ArgumentParser(
        prog="python -m ecu.build", description="Compile the kernels of the ECU."
    )
    parser.add_argument("--all", action="store_true", help="for every processor of this architecture")
    parser.add_argument("--inner", type=Path, metavar="DIR", help=INNER)
    given = parser.parse_args()
    inner = Inner(given.inner, lambda: lambda: None) if given.inner else None
    leave(make("ecu", _load_workload, given.all, inner))


if __name__ == "__main__":
    main()
