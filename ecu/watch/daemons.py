"""Running daemons of this user, found by their rings.

Looking takes no lock that a starting daemon could meet and removes nothing: a ring that is being made has
another name until its writer holds it.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ecu.errors import UserError
from ecu.recording.lock import lock
from ecu.recording.recorder import interface_name
from ecu.recording.ring import RingReader, open_own, ring_folder


class Daemon(NamedTuple):
    """A running daemon, or the last one that ran."""

    path: Path
    """Of its ring."""
    pid: int
    name: str
    """Of its car, as CONFIG has it."""
    interface: str
    channel: str
    start_ns: int

    @property
    def label(self) -> str:
        """Return how it is named to the user."""
        return f"{self.name} on {self.interface} {self.channel}, process {self.pid}"

    def answers_to(self, wanted: str) -> bool:
        """Return whether `wanted` is its process, channel, car or ring."""
        return wanted in (str(self.pid), self.channel, self.name, str(self.path))

    def on_bus(self, interface: str, channel: str) -> bool:
        """Return whether it runs on that bus."""
        return (self.interface, self.channel) == (interface, interface_name(channel))

    def follows(self, other: "Daemon") -> bool:
        """Return whether it serves the same car on the same bus as `other`."""
        return (self.name, self.interface, self.channel) == (other.name, other.interface, other.channel)


def pid_of(path: Path) -> int:
    """Return the process that writes a ring, by its name."""
    return int(path.name.split(".")[2])


def is_held(path: Path) -> bool:
    """Return whether the writer of a ring lives: it holds a lock on it."""
    try:
        handle = open_own(path)
    except OSError:
        return False
    try:
        lock(handle, shared=True)
    except BlockingIOError:
        return True
    finally:
        os.close(handle)
    return False


def running() -> list[Daemon]:
    """Return the daemons of this user whose loops run, the one started last at the end."""
    found = []
    for path in ring_folder().glob("brake-ecu.*.ring"):
        if not is_held(path):
            continue
        try:
            reader = RingReader(path)
        except UserError:  # of another version, or gone meanwhile
            continue
        if not reader.closed:
            found.append(_daemon(path, reader))
    return sorted(found, key=lambda daemon: (daemon.start_ns, daemon.pid))


def _daemon(path: Path, reader: RingReader) -> Daemon:
    about = reader.description
    return Daemon(
        path,
        pid_of(path),
        str(about.get("name", "?")),
        str(about.get("interface", "?")),
        str(about.get("channel", "?")),
        int(about.get("start_ns", 0)),
    )


def choose(daemons: Sequence[Daemon], wanted: str | None) -> Daemon | None:
    """Return the daemon that answers to `wanted` (None: the only one), None while there is none.

    Raises:
        UserError: several do.
    """
    matching = [daemon for daemon in daemons if wanted is None or daemon.answers_to(wanted)]
    if len(matching) > 1:
        named = "; ".join(daemon.label for daemon in matching)
        raise UserError("watch", f"{len(matching)} daemons run ({named})", "name one by its process")
    return matching[0] if matching else None
