import os
from concurrent.futures import ProcessPoolExecutor

import pytest

from brakelab.results import processes


def test_jobs_are_done_in_order_by_other_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "ProcessPoolExecutor", ProcessPoolExecutor)
    monkeypatch.setattr(processes, "cores", lambda: 2)
    *done, here = processes.run_each("jobs", os.path.realpath, ["/proc/1", "/proc/2", "/proc/self"])
    assert done == ["/proc/1", "/proc/2"]
    assert here != os.path.realpath("/proc/self")
