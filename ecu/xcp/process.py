"""XCP slave of `run --xcp`: a process of its own, started by the supervisor.

`python -m ecu.xcp.process --ring RING --xcp SETTINGS --parent PID [--pause S]`. It follows the ring as any
reader does. It ends with exit code 0 when the run has ended.
"""

import json
import os

from ecu.runtime.companion import await_ring, begin_companion


def main() -> int:
    """Serve until the run has ended or the parent has gone."""
    options, goes_on = begin_companion("ecu.xcp.process", "--xcp")
    if not await_ring(options.ring, goes_on):
        return 0
    from ecu.recording.log import configure_logging
    from ecu.runtime.xcp import Settings
    from ecu.xcp.serve import serve

    configure_logging()
    serve(options.ring, Settings(*json.loads(options.xcp)), goes_on)
    return 0


if __name__ == "__main__":
    code = main()
    os._exit(code)  # the end of the run waits for this process, not for the modules it takes down
