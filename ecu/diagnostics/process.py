"""Diagnostic server of `run --diagnostics`: a process of its own, started by the supervisor.

`python -m ecu.diagnostics.process --ring RING --diagnostics SETTINGS [--state DIR] --parent PID [--pause
S]`. It follows the ring as any reader does, and loads what it needs once that is there: a starting daemon
goes first. It ends with exit code 0 when the run has ended and the fault memory is stored.
"""

import argparse
import os
from pathlib import Path

from ecu.runtime.companion import await_ring, begin_companion


def main() -> int:
    """Serve until the run has ended or the parent has gone."""
    parser = argparse.ArgumentParser(
        prog="python -m ecu.diagnostics.process", description="Diagnostics of run."
    )
    parser.add_argument("--diagnostics", required=True)
    parser.add_argument("--state", type=Path)
    options, goes_on = begin_companion(parser)
    if not await_ring(options.ring, goes_on):
        return 0
    from ecu.diagnostics.serve import serve
    from ecu.recording.log import configure_logging
    from ecu.runtime.diagnostics import read_settings

    configure_logging()
    serve(options.ring, options.state, read_settings(options.diagnostics), goes_on)
    return 0


if __name__ == "__main__":
    code = main()
    os._exit(code)  # the end of the run waits for this process, not for the modules it takes down
