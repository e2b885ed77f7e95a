"""`python -m brakelab.build`: make the libraries of the laboratory's kernels and the ECU's, on two cores.

Afterwards `simulate`, `replay`, `rig` and `demo` compile nothing, whatever scenario and friction law.
"""

import subprocess
import sys
from collections.abc import Callable
from typing import NoReturn

from ecu import build
from ecu.building.c_compiler import compiler


def _load_workload() -> Callable[[], None]:
    from brakelab.entries import call_every_entry

    return call_every_entry


def main() -> NoReturn:
    if compiler() is None:
        print("no C compiler (cc): numba compiles each kernel by itself instead, which takes minutes")
        raise SystemExit(subprocess.call([sys.executable, "-m", "brakelab.warm"]))
    daemon = subprocess.Popen([sys.executable, "-m", "ecu.build"])
    failed = build.make("brakelab", _load_workload, everything=False)
    build.leave(daemon.wait() or failed)


if __name__ == "__main__":
    main()
