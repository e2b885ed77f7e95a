"""Real-time rights of a process; each refused one is a warning with its remedy."""

import ctypes
import errno
import gc
import os
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import structlog

from ecu.errors import UserError
from ecu.recording.ring import living_rings, ring_path

PRIORITY: Final = 50  # of SCHED_FIFO: the priority that Linux gives its interrupt threads
_MCL_FUTURE, _MLOCK_ONFAULT = 2, 1
_NEVER_CALLED: Final = ("openblas", "gfortran", "quadmath", "libcrypto", "libssl", "libsqlite")
"""Of the names of libraries that a library brings along and the loop never calls."""
_MAPPING: Final = re.compile(
    rb"^([0-9a-f]+)-([0-9a-f]+) (\S+) \S+ \S+ \S+ *(.*)\n(?:.*\n){3}Rss: +(\d+)", re.MULTILINE
)
"""Of /proc/self/smaps: first address, end, rights, path, kB that were touched."""


class Verdict(NamedTuple):
    """Result of one request for a right."""

    name: str
    granted: bool
    reason: str
    remedy: str


def _fifo(priority: int) -> None:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


def _lock_memory(later: bool = True) -> None:
    """Load and lock what is mapped from files, lock what was touched of the rest and what is mapped `later`.

    A free page of the heap is locked when it is first used: it comes from memory, never from the disk.
    Left out: libraries that the loop never calls, buffers that nothing has touched. Refused, nothing is
    locked: a limit would make what is mapped later fail.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    refused = 0
    for begin, end, rights, path, touched in _MAPPING.findall(Path("/proc/self/smaps").read_bytes()):
        if int(touched) and not any(name in os.fsdecode(path) for name in _NEVER_CALLED):
            first, last = int(begin, 16), int(end, 16)
            free = rights == b"rw-p" and not path.startswith(b"/")
            how = _MLOCK_ONFAULT if free else 0
            refused = refused or libc.mlock2(ctypes.c_void_p(first), ctypes.c_size_t(last - first), how)
    refused = refused or (libc.mlockall(_MCL_FUTURE) if later else 0)
    if refused:
        number = ctypes.get_errno()
        libc.munlockall()
        raise OSError(number, os.strerror(number))


def pin() -> None:
    """Pin to the last CPU that no other daemon is pinned to: interrupts are served by the first ones.

    Of two that pin at once the later process moves on. Raises OSError if no CPU is left.
    """
    allowed, own = os.sched_getaffinity(0), os.getpid()
    rival = True
    while rival:
        free = allowed - _pinned().keys()
        if not free:
            os.sched_setaffinity(0, allowed)
            raise OSError(errno.EBUSY, "other daemons are pinned to all CPUs")
        os.sched_setaffinity(0, {max(free)})
        rival = _pinned().get(max(free), own) < own


def other_daemons() -> list[int]:
    """Return the processes of our user that write rings, but for this one."""
    own = ring_path(os.getpid()).name.split(".")
    names = [path.name.split(".") for path in living_rings()]
    return [int(name[2]) for name in names if name[1] == own[1] and name[2] != own[2]]


def _pinned() -> dict[int, int]:
    """Return the CPUs to which other daemons are pinned, with the first process of each."""
    found: dict[int, int] = {}
    for process in sorted(other_daemons(), reverse=True):
        with suppress(ProcessLookupError):
            cpus = os.sched_getaffinity(process)
            found |= {cpu: process for cpu in cpus if len(cpus) == 1}
    return found


FIFO_REMEDY: Final = (
    "grant CAP_SYS_NICE, or `rtprio {}` in /etc/security/limits.conf (ulimit -r), or LimitRTPRIO in the unit"
)
MEMORY_REMEDY: Final = (
    "grant CAP_IPC_LOCK, or `memlock unlimited` in /etc/security/limits.conf (ulimit -l), "
    "or LimitMEMLOCK=infinity in the unit"
)
CPU_REMEDY: Final = "let the cpuset of this process hold a CPU of its own"


def check_cpu(cpu: int | None) -> None:
    """Raise UserError for a CPU that this process may not use."""
    allowed = os.sched_getaffinity(0)
    if cpu is not None and cpu not in allowed:
        raise UserError("--cpu", str(cpu), f"choose {', '.join(map(str, sorted(allowed)))}")


def freeze_memory() -> None:
    """Freeze live objects, disable garbage collection, load the memory pages of the loop: after the warm-up.

    Pages that the kernel has evicted are read from the disk, which can take a second.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    with suppress(OSError, AttributeError):  # `make_realtime` asks again and judges
        _lock_memory(False)


def make_realtime(cpu: int | None = None, priority: int = PRIORITY) -> list[Verdict]:
    """Freeze memory, request SCHED_FIFO, locked memory and one CPU; return the verdicts.

    A refusal is logged and the service continues. `cpu`: None: the last one that no other daemon has.
    """
    freeze_memory()
    verdicts = [
        _attempt("SCHED_FIFO", lambda: _fifo(priority), FIFO_REMEDY.format(priority)),
        _attempt("mlockall", _lock_memory, MEMORY_REMEDY),
    ]
    if cpu is not None:
        verdicts.append(_attempt("affinity", lambda: os.sched_setaffinity(0, {cpu}), CPU_REMEDY))
    elif verdicts[0].granted:  # tied to one CPU without priority it could not dodge a busy neighbour
        verdicts.append(_attempt("affinity", pin, CPU_REMEDY))
    log = structlog.get_logger("realtime")
    for verdict in verdicts:
        if not verdict.granted:
            log.warning("refused", what=verdict.name, reason=verdict.reason, remedy=verdict.remedy)
    return verdicts


def _attempt(name: str, request: Callable[[], None], remedy: str) -> Verdict:
    try:
        request()
    except (OSError, AttributeError) as error:
        return Verdict(name, False, str(error), remedy)
    return Verdict(name, True, "", remedy)
