"""What a start may do to be soon: precedence until something has to be compiled and what ends it."""

import os
import signal
import subprocess
import sys
import threading

import numba
import pytest

from ecu.jit import CompileCounter
from ecu.runtime.start import (
    ENDING,
    IGNORED,
    OUT_OF_REACH,
    left_at_once,
    lower_priority,
    raise_priority,
    signal_name,
)


def test_each_compilation_is_reported_before_it_begins():
    reported = []
    counter = CompileCounter(reported.append)
    for result in (1, 2):
        numba.njit(lambda result=result: result)()
    assert (reported, counter.count) == ([0, 1], 2)


@pytest.mark.requirement("REQ-LOOP-6")
def test_a_signal_ends_what_compiles_at_once_and_nobody_s_business_else():
    script = (
        "import ctypes, os, signal\n"
        "from ecu.runtime.start import left_at_once\n"
        "signal.signal(signal.SIGTERM, lambda *_: None)\n"
        "with left_at_once():\n"
        "    print('compiling', flush=True)\n"
        "    ctypes.CDLL(None).sleep(60)\n"  # as the compiler: no Python, no handler
        "raise SystemExit(9)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE)
    assert process.stdout.readline() == b"compiling\n"
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) == 0
    before = threading.active_count()
    with left_at_once():
        assert threading.active_count() == before + 1
    assert threading.active_count() == before  # the loop has no thread beside it


def test_every_signal_that_would_end_the_loop_is_caught_or_out_of_reach():
    """The kernel itself says which signals end a process that does nothing about them."""
    script = (
        "import os, signal, sys; signal.signal(2, signal.SIG_DFL); os.kill(os.getpid(), int(sys.argv[1]))"
    )
    command = [sys.executable, "-I", "-S", "-c", script]
    numbers = [int(one) for one in signal.valid_signals() - OUT_OF_REACH - IGNORED]
    fatal = {n for n in numbers if subprocess.run([*command, str(n)], check=False).returncode == -n}
    assert fatal <= set(ENDING)
    assert {"SIGALRM", "SIGXCPU", "SIGVTALRM", "SIGPROF", "SIGRTMIN", "SIGIO", "SIGPWR", "SIGTERM"} <= {
        signal_name(number) for number in fatal
    }


def test_signals_have_names():
    assert [signal_name(number) for number in (signal.SIGHUP, signal.SIGRTMIN + 3)] == [
        "SIGHUP",
        "SIGRTMIN+3",
    ]


def test_precedence_is_real_time_below_every_cycle_and_goes_back():
    try:
        raise_priority()
        granted = os.sched_getscheduler(0) == os.SCHED_FIFO
        priority = os.sched_getparam(0).sched_priority
    finally:
        lower_priority()
    assert os.sched_getscheduler(0) == os.SCHED_OTHER
    if not granted:
        pytest.skip("SCHED_FIFO is not granted here")
    assert priority == 1
