"""When the recorder is started again, and when not."""

import json
import socket
from types import SimpleNamespace

import pytest

from ecu.runtime import supervisor

# exit codes of one recorder after the other, after which of them the loop is gone -> starts, pauses [s]
LIVES = {
    "the loop was done": ([0], None, 1, []),
    "something to mend": ([2], None, 1, []),
    "killed twice": ([-9, -9, 0], None, 3, [0.1, 0.2]),
    "dies again and again": ([1] * 9 + [0], None, 10, [0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4, 10, 10]),
    "killed with the loop: written out once more": ([-9, 0], 1, 2, [0.1]),
    "no more than once": ([-9, -9], 1, 2, [0.1]),
}


@pytest.mark.parametrize(("codes", "gone_after", "starts", "pauses"), LIVES.values(), ids=LIVES)
def test_it_is_started_again_with_pauses_that_grow(codes, gone_after, starts, pauses, monkeypatch, capsys):
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    commands, waited = [], []

    def start(command, pass_fds):
        commands.append(command)
        return SimpleNamespace(wait=lambda: codes[len(commands) - 1])

    def wait(reading, _, __, pause_s):
        waited.append(pause_s)
        return ([theirs] if gone_after == len(commands) else [], [], [])

    monkeypatch.setattr(supervisor.subprocess, "Popen", start)
    monkeypatch.setattr(supervisor.select, "select", wait)
    monkeypatch.setattr(supervisor, "free_output", lambda: None)
    monkeypatch.setattr(supervisor, "leave_signals", lambda: None)
    monkeypatch.setattr(supervisor, "lower_priority", lambda: None)
    assert supervisor.main([str(theirs.detach()), "--ring", "x"]) == codes[starts - 1]
    assert len(commands) == starts
    assert waited == pytest.approx(pauses)
    assert ["--again" in command for command in commands] == [False] + [True] * (starts - 1)
    lines = [json.loads(line)["event"] for line in capsys.readouterr().err.splitlines()]
    assert lines == ["recorder_gone"] * len(pauses)
    assert all(ours.recv(9) == b"x" for _ in pauses)


@pytest.mark.parametrize(
    ("asked", "module", "given"),
    [
        (["--metrics", "127.0.0.1:9476"], "ecu.watch.metrics_process", ["--metrics", "127.0.0.1:9476"]),
        (["--diagnostics", "x"], "ecu.diagnostics.process", ["--diagnostics", "x"]),
        (
            ["--state", "DIR", "--diagnostics", "x"],
            "ecu.diagnostics.process",
            ["--state", "DIR", "--diagnostics", "x"],
        ),
        (["--xcp", "x"], "ecu.xcp.process", ["--xcp", "x"]),
        (["--standby", "True"], "ecu.runtime.follow_first", []),
    ],
)
def test_what_is_asked_for_is_served_by_a_process_beside_the_recorder(asked, module, given, monkeypatch):
    """The recorder knows of it, too: it may become the supervisor."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    said = []

    class Beside:
        def __init__(self, module, arguments, patience_s=0.0):
            said.append((module, arguments))

        def end(self):
            said.append("ended")

    monkeypatch.setattr(supervisor, "Companion", Beside)
    monkeypatch.setattr(supervisor, "await_end_of", lambda recorder, companions: 0)
    monkeypatch.setattr(supervisor.subprocess, "Popen", lambda command, pass_fds: said.append(command))
    monkeypatch.setattr(supervisor, "free_output", lambda: None)
    monkeypatch.setattr(supervisor, "leave_signals", lambda: None)
    assert supervisor.main([str(theirs.detach()), "--ring", "x", *asked]) == 0
    assert said[0] == (module, ["--ring", "x", *given])
    assert said[1][-len(asked) :] == asked
    assert said[2] == "ended"
    ours.close()
