"""What a start may do to be soon: precedence until something has to be compiled, and less to load."""

import importlib
import os
import sys

import numba
import pytest

from ecu.jit import CompileCounter
from ecu.start import ahead_of_others, kept_out, like_others


def test_what_is_kept_out_is_not_found_and_comes_back_afterwards(monkeypatch, tmp_path):
    (tmp_path / "library_of_nobody.py").write_text("", "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    with kept_out("library_of_nobody", "os"), pytest.raises(ImportError):
        importlib.import_module("library_of_nobody")
    assert importlib.import_module("library_of_nobody")
    assert sys.modules["os"] is os  # was loaded before
    with kept_out("library_of_nobody"):
        assert importlib.import_module("library_of_nobody")


def test_the_first_compilation_and_only_that_gives_precedence_up():
    told = []
    counter = CompileCounter(lambda: told.append(counter.count))
    for result in (1, 2):
        numba.njit(lambda result=result: result)()
    assert (told, counter.count) == ([0], 2)


def test_precedence_is_real_time_below_every_cycle_and_goes_back():
    try:
        ahead_of_others()
        granted = os.sched_getscheduler(0) == os.SCHED_FIFO
        priority = os.sched_getparam(0).sched_priority
    finally:
        like_others()
    assert os.sched_getscheduler(0) == os.SCHED_OTHER
    if not granted:
        pytest.skip("SCHED_FIFO is not granted here")
    assert priority == 1
