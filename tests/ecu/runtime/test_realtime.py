import gc
import os
import subprocess
import sys
from contextlib import contextmanager

import pytest
from structlog.testing import capture_logs

from ecu.errors import UserError
from ecu.recording import ring as ring_module
from ecu.recording.ring import ring_path
from ecu.runtime import realtime


def refused(*_):
    raise PermissionError(1, "Operation not permitted")


@contextmanager
def rights():
    """Undo what asking for rights does to this process's memory."""
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()


# what the kernel grants -> the verdicts, the lines that are logged
GRANTS = {
    "everything": ((True, True), [("SCHED_FIFO", True), ("mlockall", True), ("affinity", True)], []),
    "no priority": ((False, True), [("SCHED_FIFO", False), ("mlockall", True)], ["SCHED_FIFO"]),
    "nothing": ((False, False), [("SCHED_FIFO", False), ("mlockall", False)], ["SCHED_FIFO", "mlockall"]),
}


@pytest.mark.parametrize(("granted", "verdicts", "lines"), GRANTS.values(), ids=GRANTS)
def test_each_refusal_is_one_line_with_its_remedy(monkeypatch, granted, verdicts, lines):
    answers = [(lambda *_: None) if grant else refused for grant in granted]
    for name, answer in zip(("_fifo", "_lock_memory", "pin"), [*answers, lambda: None], strict=True):
        monkeypatch.setattr(realtime, name, answer)
    with rights(), capture_logs() as logged:
        found = realtime.make_realtime()
        assert not gc.isenabled()
    assert [(verdict.name, verdict.granted) for verdict in found] == verdicts
    assert [line["what"] for line in logged] == lines
    assert all("limits.conf" in line["remedy"] for line in logged)


@pytest.mark.parametrize("granted", [True, False])
def test_cpu_and_priority_are_those_asked_for(granted, monkeypatch):
    asked = {}
    fifo = (lambda _, kind, given: asked.update(priority=given.sched_priority)) if granted else refused
    monkeypatch.setattr(os, "sched_setscheduler", fifo)
    monkeypatch.setattr(os, "sched_setaffinity", lambda _, given: asked.update(cpu=given))
    monkeypatch.setattr(realtime, "_lock_memory", lambda *_: None)
    with rights(), capture_logs() as logged:
        realtime.make_realtime(cpu=3, priority=80)
    assert asked == ({"cpu": {3}, "priority": 80} if granted else {"cpu": {3}})
    assert [("rtprio 80" in line["remedy"]) for line in logged] == ([] if granted else [True])


def test_a_cpu_that_is_not_there_is_named_at_once(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {1, 0, 2})
    realtime.check_cpu(None)
    realtime.check_cpu(2)
    with pytest.raises(UserError, match="--cpu: 3: choose 0, 1, 2"):
        realtime.check_cpu(3)


LOCKING = """
import mmap, re
import numpy
from ecu.runtime.realtime import make_realtime

untouched = mmap.mmap(-1, 1 << 28, mmap.MAP_PRIVATE)
print({verdict.name: verdict.granted for verdict in make_realtime()}["mlockall"])
print(re.search(r"VmRSS:\\s+(\\d+)", open("/proc/self/status").read())[1])
for name in ("_multiarray_umath", "openblas"):
    parts = [part for part in re.split(r"\\n(?=[0-9a-f]+-)", open("/proc/self/smaps").read()) if name in part]
    print(*(sum(int(re.search(rf"^{field}: +(\\d+)", part, re.M)[1]) for part in parts if "r-xp" in part)
          for field in ("Size", "Rss", "Locked")))
"""


def test_what_the_loop_never_calls_and_what_nothing_touched_is_not_locked():
    out = subprocess.run(
        [sys.executable, "-c", LOCKING], capture_output=True, text=True, timeout=60, check=True
    )
    granted, resident, code, algebra = out.stdout.splitlines()
    if granted != "True":
        pytest.skip("this user may not lock memory")
    size, loaded, locked = map(int, code.split())
    assert loaded == size
    assert locked > 0
    assert algebra.endswith(" 0")
    assert int(resident) < 100_000


LIMITED = """
import mmap, os, resource
from ecu.runtime.realtime import make_realtime

resource.setrlimit(resource.RLIMIT_MEMLOCK, (1 << 20, 1 << 20))
os.setuid(65534)
print({verdict.name: verdict.granted for verdict in make_realtime()}["mlockall"])
mmap.mmap(-1, 1 << 25)
"""


@pytest.mark.skipif(os.getuid() != 0, reason="only root may become somebody else")
def test_a_user_who_may_not_lock_memory_can_map_it(tmp_path):
    """Locked later, what is mapped would fail beyond the limit: the daemon's ring."""
    asked = [sys.executable, "-c", LIMITED]
    out = subprocess.run(asked, capture_output=True, text=True, timeout=60, check=True)
    assert out.stdout.endswith("False\n")


def test_a_daemon_sees_the_others_of_its_user(monkeypatch, tmp_path):
    monkeypatch.setattr(ring_module, "ring_folder", lambda: tmp_path)
    rings = [ring_module.create_ring(ring_path(n), {}, b"", slots=2, frames=1) for n in (7, os.getpid())]
    (tmp_path / "brake-ecu.1.8.ring").touch()
    assert len(rings) == 2
    assert realtime.other_daemons() == [7]


# CPUs allowed, process -> its CPUs -> the CPU of process 50
PINNED = {
    "alone": ({0, 1, 2, 3}, {}, {3}),
    "beside a standby": ({0, 1, 2, 3}, {7: {3}}, {2}),
    "beside two": ({0, 1, 2, 3}, {7: {3}, 60: {2}}, {1}),
    "beside one without rights": ({0, 1, 2, 3}, {7: {0, 1, 2, 3}}, {3}),
    "beside one elsewhere": ({0, 1}, {7: {3}}, {1}),
    "none left": ({0, 1}, {7: {0}, 8: {1}}, {0, 1}),
}


@pytest.mark.parametrize(("allowed", "others", "taken"), PINNED.values(), ids=PINNED)
def test_a_daemon_takes_the_last_cpu_that_no_other_one_has(monkeypatch, allowed, others, taken):
    cpus = {50: allowed} | others
    monkeypatch.setattr(realtime, "other_daemons", lambda: list(others))
    monkeypatch.setattr(os, "getpid", lambda: 50)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: cpus[process or 50])
    monkeypatch.setattr(os, "sched_setaffinity", lambda process, given: cpus.update({50: given}))
    if taken == allowed:
        with pytest.raises(OSError, match="other daemons"):
            realtime.pin()
    else:
        realtime.pin()
    assert cpus[50] == taken


@pytest.mark.parametrize(("rival", "taken"), [(49, {2}), (51, {3})])
def test_of_two_that_pin_at_once_the_later_process_moves_on(monkeypatch, rival, taken):
    cpus = {50: {0, 1, 2, 3}, rival: {0, 1, 2, 3}}

    def pin(process, given):
        cpus.update({50: given, rival: {3}})

    monkeypatch.setattr(realtime, "other_daemons", lambda: [rival])
    monkeypatch.setattr(os, "getpid", lambda: 50)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: cpus[process or 50])
    monkeypatch.setattr(os, "sched_setaffinity", pin)
    realtime.pin()
    assert cpus[50] == taken
