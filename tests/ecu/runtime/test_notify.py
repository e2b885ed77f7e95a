"""What the daemon says to the service manager that started it."""

import os
import socket

import pytest

from ecu.runtime.notify import Manager


@pytest.fixture
def manager(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # an address has at most 107 letters
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind("notify")
        listening.setblocking(False)
        yield listening


def test_the_service_manager_receives_what_is_sent(manager):
    assert Manager({"NOTIFY_SOCKET": "notify"}).tell("READY=1")
    assert manager.recv(64) == b"READY=1"


@pytest.mark.parametrize(("environment", "sent"), [({"NOTIFY_SOCKET": "gone"}, False), ({}, True)])
def test_one_that_is_gone_or_never_asked_is_no_matter(environment, sent, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert Manager(environment).tell("READY=1") is sent


def test_one_that_does_not_read_holds_nobody_up(manager):
    sent = [Manager({"NOTIFY_SOCKET": "notify"}).tell("WATCHDOG=1") for _ in range(10_000)]
    assert sent[0]
    assert not sent[-1]


# environment -> cycles between two signs of life: at most half of what systemd waits
WATCHDOGS = {
    "one second": ({"WATCHDOG_USEC": "1000000"}, 25),
    "for this process": ({"WATCHDOG_USEC": "1000000", "WATCHDOG_PID": str(os.getpid())}, 25),
    "for another process": ({"WATCHDOG_USEC": "1000000", "WATCHDOG_PID": "1"}, 0),
    "less than a cycle": ({"WATCHDOG_USEC": "20000"}, 1),
    "none": ({}, 0),
    "nonsense": ({"WATCHDOG_USEC": "soon"}, 0),
}


@pytest.mark.parametrize(("environment", "cycles"), WATCHDOGS.values(), ids=WATCHDOGS)
@pytest.mark.requirement("REQ-PROC-3")
def test_signs_of_life_come_as_often_as_they_are_waited_for(environment, cycles):
    assert Manager({"NOTIFY_SOCKET": "notify", **environment}).watchdog_cycles == cycles
