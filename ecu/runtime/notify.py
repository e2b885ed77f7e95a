"""Notification of systemd (Type=notify): READY, STOPPING, and WATCHDOG=1 from the cycle, without waiting.

Protocol: sd_notify(3), sd_watchdog_enabled(3).
"""

import os
import socket
from collections.abc import Mapping
from typing import Final

from ecu.contract.signals import CYCLE_NS

_SHARE: Final = 4  # of the watchdog's time between two notifications; sd_watchdog_enabled(3) asks for 2


class Manager:
    """The service manager that started us, if any; one that has gone is ignored."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._socket: socket.socket | None = None
        self._address = environment.get("NOTIFY_SOCKET", "")
        if self._address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.setblocking(False)
        self.watchdog_cycles = _watchdog_cycles(environment) if self._address else 0
        """Cycles between two watchdog notifications, 0: no watchdog."""

    def tell(self, state: str) -> bool:
        """Send one state; return whether it was taken (True without a manager)."""
        if self._socket is None:
            return True
        address = "\0" + self._address[1:] if self._address.startswith("@") else self._address
        try:
            self._socket.sendto(state.encode(), address)
        except OSError:
            return False
        return True


def _watchdog_cycles(environment: Mapping[str, str]) -> int:
    period_us, owner = environment.get("WATCHDOG_USEC", ""), environment.get("WATCHDOG_PID", "")
    if not period_us.isdecimal() or (owner and owner != str(os.getpid())):
        return 0
    return max(1, int(period_us) * 1000 // (_SHARE * CYCLE_NS))
