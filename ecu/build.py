"""`python -m ecu.build [--all]`: make the library of kernels that Python calls (`ecu/library.py`).

For this processor, with `--all` for every one of its architecture. What Python calls is called once, with
kernels as plain Python, to see which they are and with what; numba translates those and all that they call,
LLVM optimises them as one program, and a C compiler links it. numba and LLVM are needed here alone.
`numba.pycc`, which did the like, is deprecated without a successor; this uses numba's compiler up to LLVM's
text, and llvmlite.
"""

import argparse
import hashlib
import importlib
import json
import os
import platform
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NoReturn

import numba

from ecu import jit
from ecu.building.calls import Seen, watch
from ecu.building.machine_code import link, link_shared, machine_code, returned_spec, translate
from ecu.errors import UserError
from ecu.library import BASELINE, FOLDER, MANIFEST, V3, has_v3

MACHINERY: Final = {"ecu.errors", "ecu.interpreted", "ecu.jit", "ecu.library"}
"""Modules whose texts are in no kernel: they call them."""


def processors(all_of_them: bool) -> list[str]:
    """Return those that a library is made for."""
    least = BASELINE[platform.machine()]
    if platform.machine() != "x86_64":
        return [least]
    return [least, V3] if all_of_them else [V3 if has_v3() else least]


def is_up_to_date(package: str, wanted: list[str]) -> bool:
    """Return whether the library of a package is made for `wanted`, and from the texts that are there."""
    found = jit.library(package)
    return (
        found is not None
        and set(wanted) <= set(found.manifest["processors"])
        and all(found.fits(module, jit.text_digest) for module in found.manifest["modules"])
    )


def build(package: str, load_workload: Callable[[], Callable[[], None]], wanted: list[str]) -> None:
    """Make the library of a package for processors `wanted` from what a workload calls.

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
    results = translate(calls)
    kept = [
        (call, result, returned)
        for call, result in zip(calls, results, strict=True)
        if (returned := returned_spec(result.fndesc.restype)) is not None
    ]
    symbols = [f"kernel_{number}" for number in range(len(kept))]
    whole = link([result for _, result, _ in kept], symbols, [call.specs for call, _, _ in kept])
    print(f"{package}: translated after {time.monotonic() - began:.0f} s; optimising", flush=True)
    kernels = dict[str, list[dict[str, Any]]]()
    for symbol, (call, _, returned) in zip(symbols, kept, strict=True):
        row = {"symbol": symbol, "arguments": call.specs, "returns": returned}
        kernels.setdefault(call.kernel.name, []).append(row)
    codes = {processor: machine_code(whole, processor) for processor in wanted}
    folder = Path(importlib.import_module(package).__file__ or "").parent / FOLDER
    folder.mkdir(exist_ok=True)
    _write(package, folder, kernels, codes)
    print(f"{folder}: {', '.join(wanted)}, after {time.monotonic() - began:.0f} s", flush=True)


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


def make(package: str, load_workload: Callable[[], Callable[[], None]], everything: bool) -> int:
    """Make the library of a package unless it is up to date; return an exit code.

    The process is to end by `leave`.
    """
    wanted = processors(everything)
    if not is_up_to_date(package, wanted):
        try:
            build(package, load_workload, wanted)
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
    parser = argparse.ArgumentParser(
        prog="python -m ecu.build", description="Compile the kernels of the ECU."
    )
    parser.add_argument("--all", action="store_true", help="for every processor of this architecture")
    leave(make("ecu", _load_workload, parser.parse_args().all))


if __name__ == "__main__":
    main()
