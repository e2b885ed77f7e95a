"""`python -m ecu.warm [--check]`: compile every kernel of the cycle, or load it from the cache.

Runs the preparation of `brake-ecu run`, and prints how many kernels had to be compiled. With `--check` it
exits 1 if there was any: an installation whose cache is complete compiles nothing.
"""

import argparse
from collections.abc import Callable
from typing import Final

from ecu.bus.signal_map import receive_plan
from ecu.bus.transmit import contract_transmit_plan
from ecu.jit import CompileCounter
from ecu.runtime.memory import new_ecu
from ecu.runtime.warm_up import warm_up
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

EVERY: Final = 50
"""Kernels between two lines of progress."""


def warm(begins: Callable[[int], None] = lambda count: None) -> int:
    """Prepare every kernel of the cycle; return how many had to be compiled.

    `begins` is called before each, with the number of those before it.
    """
    compiled = CompileCounter(begins)
    params = new_params(load_config(resource("config/suv.toml")))
    sending = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "BrakeEcu")
    warm_up(new_ecu(params, None, receive_plan(None), sending), compiled)
    return compiled.count


def _tell_progress(count: int) -> None:
    if count % EVERY == 0:
        print(f"{count} kernels compiled, some 500 in all", flush=True)


def main() -> int:
    """Compile what is missing, and return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m ecu.warm", description="Compile the kernels of the cycle."
    )
    parser.add_argument("--check", action="store_true", help="exit 1 if anything had to be compiled")
    check = parser.parse_args().check
    compiled = warm(_tell_progress)
    print(f"{compiled} kernels compiled")
    return int(check and compiled > 0)


if __name__ == "__main__":
    raise SystemExit(main())
