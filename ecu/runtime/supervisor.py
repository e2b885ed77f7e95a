"""Supervisor of the recorder: `python -m ecu.runtime.supervisor SOCKET --ring RING …`.

The loop starts no process once it is READY, so this small one does. It imports next to nothing and waits. It
ends with the recorder when the loop has ended (exit code 0) or on a user error (2). A recorder whose
supervisor died becomes one itself (`become`). With `--metrics ADDRESS:PORT`, `--diagnostics SETTINGS` or
`--xcp SETTINGS` it also starts the processes that serve these, with `--standby` the one of `follow_first.py`.
"""

import json
import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Final, NoReturn

from ecu.recording.sink import free_output
from ecu.runtime.companion import Companion, await_end_of
from ecu.runtime.side import AWAY
from ecu.runtime.start import leave_signals, lower_priority

PAUSE_S: Final = 0.1
LONGEST_PAUSE_S: Final = 10.0  # less than the ring holds
CALM_S: Final = 60.0  # a recorder that lived that long restarts after the short pause again
FINAL_EXITS: Final = (0, 2)
COMPANIONS: Final = (
    ("--metrics", "ecu.watch.metrics_process", ("--ring", "--metrics"), 0.0),
    ("--diagnostics", "ecu.diagnostics.process", ("--ring", "--state", "--diagnostics"), 1.0),
    ("--xcp", "ecu.xcp.process", ("--ring", "--xcp"), 0.5),
    ("--standby", "ecu.runtime.follow_first", ("--ring",), 0.0),
)
"""Option that asks for a process, its module and options, and how long it may take to end [s]: it stores the
fault memory, it sends the last cycles."""


def main(arguments: Sequence[str]) -> int:
    """Keep a recorder alive as long as the loop lives; return its last exit code."""
    free_output()
    leave_signals()
    leash = socket.socket(fileno=int(arguments[0]))
    leash.setblocking(False)
    again = "--again" in arguments
    rest = [argument for argument in arguments[1:] if argument != "--again"]
    command = [sys.executable, "-m", "ecu.runtime.side_process"]
    command += ["--leash", arguments[0], "--parent", str(os.getpid()), *rest]
    companions = _companions(rest)
    pause_s, loop_is_gone = PAUSE_S, False
    while True:
        began = time.monotonic()
        recorder = subprocess.Popen(command + ["--again"] * again, pass_fds=[leash.fileno()])
        code = await_end_of(recorder, companions)
        if code in FINAL_EXITS or loop_is_gone:
            for companion in companions:
                companion.end()
            return code
        _say_away(leash, code)
        lower_priority()
        again = True
        if time.monotonic() - began > CALM_S:
            pause_s = PAUSE_S
        loop_is_gone = bool(select.select([leash], [], [], pause_s)[0])  # the loop never sends: its end
        pause_s = min(2 * pause_s, LONGEST_PAUSE_S)


def _companions(arguments: Sequence[str]) -> list[Companion]:
    """Start the processes that `arguments` ask for."""
    return [
        Companion(module, _picked(arguments, *options), patience_s)
        for option, module, options, patience_s in COMPANIONS
        if option in arguments
    ]


def _picked(arguments: Sequence[str], *names: str) -> list[str]:
    """Return those of the options `names` that are there, each with its value."""
    at = [arguments.index(name) for name in names if name in arguments]
    return [word for place in at for word in arguments[place : place + 2]]


def _say_away(leash: socket.socket, code: int) -> None:
    line = {
        "event": "recorder_gone",
        "level": "error",
        "exit_code": code,
        "remedy": "it is started again and goes on where it was",
    }
    sys.stderr.write(json.dumps(line) + "\n")
    with suppress(OSError):  # the loop has died, or will notice the silence
        leash.send(AWAY)


def become(leash: int, arguments: Sequence[str]) -> NoReturn:
    """Turn this process into a supervisor that starts a recorder to continue."""
    command = [sys.executable, "-m", "ecu.runtime.supervisor", str(leash), "--again", *arguments]
    os.execv(sys.executable, command)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
