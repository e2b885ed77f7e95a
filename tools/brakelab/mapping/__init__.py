"""From a log and its database to the proposal of a signal map."""

import ecu.bus  # noqa: F401 - hides asammdf from python-can, which cantools imports
