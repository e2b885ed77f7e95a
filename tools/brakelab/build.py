"""`python -m brakelab.build [--inner DIR]`: make the libraries of laboratory and ECU, on two cores.

Afterwards `simulate`, `replay`, `rig` and `demo` compile nothing, whatever scenario and friction law.
"""

import argparse
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NoReturn

from ecu import build
from ecu.building.c_compiler import compiler


def _load_workload() -> Callable[[], None]:
    from brakelab.entries import call_every_entry

    return call_every_entry


def _load_tests() -> Callable[[], None]:
    sys.path.insert(0, str(Path(__file__).parents[2]))
    return import_module("tests.kernels").call_every_kernel


def main() -> NoReturn:
    """Compile the kernels, as the command line asks."""
    parser = argparse.ArgumentParser(
        prog="python -m brakelab.build", description="Compile the kernels of laboratory and ECU."
    )
    parser.add_argument("--inner", type=Path, metavar="DIR", help=build.INNER)
    folder = parser.parse_args().inner
    if compiler() is None:
        print("no C compiler (cc): numba compiles each kernel by itself instead, which takes minutes")
        raise SystemExit(subprocess.call([sys.executable, "-m", "brakelab.warm"]))
    daemon = subprocess.Popen([sys.executable, "-m", "ecu.build", *sys.argv[1:]])
    inner = build.Inner(folder, _load_tests) if folder else None
    failed = build.make("brakelab", _load_workload, inner=inner)
    build.leave(daemon.wait() or failed)


if __name__ == "__main__":
    main()
