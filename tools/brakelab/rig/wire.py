"""Two CAN controllers on one wire: the kernel's slcan driver, with this program as the adapters.

Each adapter is a pseudo-terminal whose kernel side has the slcan line discipline, so the network device has a
bit rate and a controller state. Frames sent by one are passed to the other; a controller's state and missing
acknowledgements can be reported to it as an adapter would. Needs root, `ip`, and the kernel's slcan driver.

The driver has no restart after bus-off of its own (it refuses `restart-ms`): the device is taken down and up.
"""

import contextlib
import fcntl
import json
import os
import selectors
import struct
import subprocess
import threading
import tty
from typing import Final

from ecu.errors import UserError

CHANNEL: Final = "slcan"
"""Value of the rig's `-c` for a wire of its own."""
PRIORITY: Final = 10  # of SCHED_FIFO: the vehicle's
QUEUE: Final = 256  # frames that a device keeps; the default of 10 is less than a car sends at once

N_SLCAN: Final = 17
TIOCSETD: Final = 0x5423
SIOCGIFNAME: Final = 0x8910

# Adapter to driver: "s", a letter for the state, transmit and receive error counters in three digits each.
ACTIVE, WARNING, PASSIVE, BUS_OFF = "sa000000", "sw097000", "sp130000", "sb256000"
STATE_NAMES: Final = {
    ACTIVE: "ERROR-ACTIVE",
    WARNING: "ERROR-WARNING",
    PASSIVE: "ERROR-PASSIVE",
    BUS_OFF: "BUS-OFF",
}
NOT_ACKNOWLEDGED: Final = "e1a"
FRAME_LETTERS: Final = b"tTrR"


class Controller:
    """One slcan network device and the adapter's end of its line."""

    def __init__(self) -> None:
        self.adapter, self._kernel = os.openpty()
        for end in (self.adapter, self._kernel):
            tty.setraw(end)
        fcntl.ioctl(self._kernel, TIOCSETD, struct.pack("i", N_SLCAN))
        name = fcntl.ioctl(self._kernel, SIOCGIFNAME, bytes(64))
        self.name = name.split(b"\0", 1)[0].decode()
        self.rest = b""
        self.off = False

    def up(self) -> None:
        """Bring the device up at 500 kbit/s."""
        self._set("type", "can", "bitrate", "500000")
        self._set("txqueuelen", str(QUEUE), "up")

    def _set(self, *arguments: str) -> None:
        subprocess.run(["ip", "link", "set", self.name, *arguments], check=True)

    def go_off(self) -> None:
        """Go bus-off through the preceding states; afterwards the line is disconnected."""
        self.off = True
        for state in (WARNING, PASSIVE, BUS_OFF):
            self.report(state)

    def restart(self) -> None:
        """Rejoin the bus, if it was off."""
        if self.off:
            self._set("down")
            self._set("up")
            self.off = False

    def report(self, line: str) -> None:
        """Send the driver a status message, as the adapter's firmware would."""
        os.write(self.adapter, line.encode() + b"\r")

    def state(self) -> str:
        """Return the controller's state as seen by the kernel."""
        command = ["ip", "-json", "-details", "link", "show", self.name]
        (device,) = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
        return str(device["linkinfo"]["info_data"]["state"])

    def close(self) -> None:
        """Remove the device."""
        with contextlib.suppress(subprocess.CalledProcessError):
            self._set("down")
        for end in (self._kernel, self.adapter):
            with contextlib.suppress(OSError):
                os.close(end)


class Wire:
    """Link that passes frames between two controllers until it is closed; `cut`: no node acknowledges."""

    def __init__(self) -> None:
        self.ends = (Controller(), Controller())
        self.cut = False
        self._stop_reader, self._stop = os.pipe()
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()
        for end in self.ends:
            end.up()

    def _carry(self) -> None:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))  # of this thread
        with selectors.DefaultSelector() as ready:
            ready.register(self._stop_reader, selectors.EVENT_READ)
            for here, there in (self.ends, self.ends[::-1]):
                ready.register(here.adapter, selectors.EVENT_READ, (here, there))
            while True:
                for key, _ in ready.select():
                    if key.data is None:
                        return
                    self._pass_on(*key.data)

    def _pass_on(self, here: Controller, there: Controller) -> None:
        *lines, here.rest = (here.rest + os.read(here.adapter, 4096)).split(b"\r")
        for line in lines:
            if line[:1] not in FRAME_LETTERS or not line:
                continue
            if self.cut:
                here.report(NOT_ACKNOWLEDGED)
            elif not (here.off or there.off):
                os.write(there.adapter, line + b"\r")

    def close(self) -> None:
        """Stop passing frames and remove both devices."""
        os.write(self._stop, b"x")
        self._thread.join()
        for end in self.ends:
            end.close()
        os.close(self._stop)
        os.close(self._stop_reader)


def lay_wire() -> Wire:
    """Return a wire between two running controllers.

    Raises:
        UserError: not possible on this machine, or for this user.
    """
    try:
        return Wire()
    except (OSError, subprocess.CalledProcessError) as error:
        raise UserError(
            f"-c {CHANNEL}",
            "",
            f"cannot make two controllers ({error}); needs root, ip and modprobe can-dev slcan",
        ) from None
