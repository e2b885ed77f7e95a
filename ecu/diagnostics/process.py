"""Diagnostic server of `run --diagnostics`: a process of its own, started by the supervisor.

`python -m ecu.diagnostics.process --ring RING --diagnostics SETTINGS [--state DIR] --parent PID [--pause
S]`. It follows the ring as any reader does, and loads what it needs once that is there: a starting daemon
goes first. It ends with exit code 0 when the run has ended and the fault memory is stored.
"""

import json
import os
from pathlib import Path

from ecu.runtime.companion import await_ring, begin_companion


def main() -> int:
    """Serve until the run has ended or the parent has gone."""
    options, goes_on = begin_companion("ecu.diagnostics.process", "--diagnostics", "--state")
    if not await_ring(options.ring, goes_on):
        return 0
    from ecu.diagnostics.serve import serve
    from ecu.recording.log import configure_logging
    from ecu.runtime.diagnostics import Settings

    configure_logging()
    state = Path(options.state) if options.state else None
    serve(options.ring, state, Settings(*json.loads(options.diagnostics)), goes_on)
    return 0


if __name__ == "__main__":
    code = main()
    os._exit(code)  # the end of the run waits for this process, not for the modules it takes down
