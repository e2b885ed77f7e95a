"""Standard streams of a command: open, able to print any character, and what becomes of an unread one."""

import io
import os
import select
import sys


def prepare() -> None:
    """Open those that were closed: the next files would take their places. Let none fail at a character."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            stream = open(os.devnull, mode, encoding="utf-8")  # noqa: SIM115
            os.set_inheritable(stream.fileno(), True)
            setattr(sys, name, stream)
    for each in (sys.stdout, sys.stderr):  # of a locale, or a file's name, that lacks a character of a line
        if isinstance(each, io.TextIOWrapper):
            each.reconfigure(errors="replace")


def are_unread() -> bool:
    """Return whether the reader of standard output or error has gone."""
    poll = select.poll()
    for handle in (1, 2):
        poll.register(handle, 0)
    return any(found & (select.POLLERR | select.POLLHUP) for _, found in poll.poll(0))


def is_nowhere() -> bool:
    """Return whether standard output goes to nowhere: rich leads it there after a broken pipe."""
    return os.path.samestat(os.fstat(1), os.stat(os.devnull))


def empty() -> None:
    """Lead output and error to nowhere, with what is left in their buffers."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for handle in (1, 2):
        os.dup2(nowhere, handle)
