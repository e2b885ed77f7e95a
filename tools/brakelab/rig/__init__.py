"""Vehicle and daemon in real time, on a bus that `ecu.bus` has imported without what only log files need."""

import ecu.bus  # noqa: F401
