"""The loop from READY to the end; whole processes are in tests/system/test_processes_udp.py."""

import inspect
import signal
from types import SimpleNamespace

import pytest

from ecu.algorithm import step
from ecu.contract.records import CYCLE, new_record
from ecu.errors import RunFault
from ecu.runtime import calibration, clock, cycle, notify, service, side
from ecu.runtime.prepare import RunOptions
from ecu.settings import annex5 as regulation

LOOP = (calibration, clock, cycle, notify, regulation, service, side, step)


@pytest.mark.parametrize("module", LOOP, ids=lambda module: module.__name__)
@pytest.mark.requirement("REQ-LOOP-1")
def test_what_runs_in_the_loop_neither_logs_nor_prints(module):
    source = inspect.getsource(module)
    for output in ("structlog", "print(", "sys.stderr", "logging.getLogger"):
        assert output not in source


class Bus:
    """Takes note of the order of things."""

    def __init__(self, done):
        self.done = done

    def status(self):
        return SimpleNamespace(bus_off=False, send_failures=0, dropped=0)

    def close(self):
        self.done.append("closed")


# what happens in the cycle, whether the farewell works, too -> what run raises
ENDS = {
    "a signal": (None, True, None),
    "an error": (ZeroDivisionError("x"), True, ZeroDivisionError),
    "of the machine": (OSError(5, "Input/output error"), True, RunFault),
    "no memory": (MemoryError(), True, MemoryError),
    "an exit": (SystemExit(3), True, SystemExit),
    "a bus that is gone": (OSError(19, "No such device"), False, RunFault),
}


@pytest.mark.parametrize(("error", "farewell_works", "raised"), ENDS.values(), ids=ENDS)
@pytest.mark.requirement("REQ-DEM-3")
def test_whatever_ends_the_loop_first_the_farewell_then_the_last_words(
    error, farewell_works, raised, monkeypatch
):
    done, handlers = [], {}
    bus = Bus(done)

    def cycle_until(session, progress, stopping):
        progress.number = 7
        if error is not None:
            raise error
        handlers[signal.SIGHUP](signal.SIGHUP, None)

    def farewell(ecu, channel, number):
        done.append(f"farewell from {number}")
        if not farewell_works:
            raise OSError

    session = SimpleNamespace(
        ecu=SimpleNamespace(
            reception=SimpleNamespace(messages={"received": SimpleNamespace(sum=lambda: 1)}),
            cycle=new_record(CYCLE),
        ),
        channel=bus,
        ring=SimpleNamespace(path=None),
        side=SimpleNamespace(await_end=lambda patience_s: done.append("side ended")),
        compiled=SimpleNamespace(count=0),
        waits=False,
        manager=SimpleNamespace(tell=done.append),
    )
    monkeypatch.setattr(cycle, "new_twin", lambda ecu: ecu)
    monkeypatch.setattr(service, "prepare", lambda options: session)
    monkeypatch.setattr(service, "configure_logging", lambda: None)
    monkeypatch.setattr(service.signal, "signal", handlers.__setitem__)
    monkeypatch.setattr(service.signal, "getsignal", lambda number: signal.SIG_DFL)  # under nohup, too
    monkeypatch.setattr(service, "_cycle_until", cycle_until)
    monkeypatch.setattr(service, "send_farewell", farewell)
    monkeypatch.setattr(service, "close_ring", lambda ring, words: done.append(words["by"].partition(":")[0]))
    with pytest.raises(raised) if raised else pytest.MonkeyPatch.context():
        assert service.run(RunOptions(None, "virtual", "x")) == 0
    by = "SIGHUP" if error is None else type(error).__name__
    assert done == ["farewell from 7", "STOPPING=1", by, "closed", "side ended"]
