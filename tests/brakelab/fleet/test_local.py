"""Processes of this machine: what runs in them, what their death costs, and that nobody else reaches them."""

import gzip
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from multiprocessing import active_children
from pathlib import Path

import pytest

from brakelab.fleet.local import ONE_THREAD, LocalWorkers, WorkerDied

ROOT = Path(__file__).parents[3]
SLEEPS_WITH_A_FOLDER = """
import pathlib, tempfile, time
with tempfile.TemporaryDirectory(dir={folder!r}):
    pathlib.Path({folder!r}, "begun").touch()
    time.sleep(60)
"""


@pytest.fixture(scope="module")
def two() -> Iterator[LocalWorkers]:
    with LocalWorkers(2) as workers:
        yield workers


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_tasks_run_in_processes_of_their_own_and_give_what_they_give(two: LocalWorkers) -> None:
    pids = {two.submit(os.getpid).result() for _ in range(6)}
    assert pids <= {child.pid for child in active_children()}
    assert two.submit(pow, 2, 10).result() == two.submit(pow, 2, exp=10).result() == 1024
    assert {name: two.submit(os.getenv, name).result() for name in ONE_THREAD} == ONE_THREAD
    assert two.submit(signal.getsignal, signal.SIGINT).result() == signal.SIG_IGN


FAULTS = {
    "of the task": (ValueError, int, "x"),
    "of the task, as of a pipe that is closed": (EOFError, gzip.decompress, gzip.compress(b"drive")[:15]),
    "a task that cannot be sent": (Exception, lambda: None),
    "an argument that cannot be sent": (TypeError, str, threading.Lock()),
}


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)
def test_an_exception_is_the_client_s_and_the_workers_live_on(two: LocalWorkers, fault) -> None:
    before = {two.submit(os.getpid).result() for _ in range(4)}
    kind, *call = fault
    with pytest.raises(kind) as raised:
        two.submit(*call).result()
    assert raised.type is not WorkerDied
    assert all(map(alive, before))
    assert two.submit(pow, 3, 2).result() == 9


@pytest.mark.parametrize(("task", "number"), [(os._exit, 0), (signal.raise_signal, signal.SIGKILL)])
def test_a_worker_that_dies_costs_its_own_task_alone(two: LocalWorkers, task, number: int) -> None:
    beside = two.submit(exec, "import time; time.sleep(1)")
    dead = two.submit(task, number)
    assert isinstance(dead.exception(), WorkerDied)
    assert beside.exception() is None
    assert [two.submit(pow, 2, k).result() for k in range(8)] == [2**k for k in range(8)]


def test_they_listen_nowhere(two: LocalWorkers) -> None:
    """Who could connect to a worker, as to one of Dask on 127.0.0.1, could have code run by it."""
    assert two.submit(pow, 1, 1).result() == 1
    listening = set()
    for name in ("tcp", "tcp6", "unix"):
        for line in Path(f"/proc/net/{name}").read_text("ascii").splitlines()[1:]:
            parts = line.split()
            listens, inode = (
                (parts[3] == "00010000", parts[6]) if name == "unix" else (parts[3] == "0A", parts[9])
            )
            listening |= {f"socket:[{inode}]"} if listens else set()
    workers = active_children()
    assert workers
    for worker in workers:
        held = {os.readlink(link) for link in Path(f"/proc/{worker.pid}/fd").iterdir()}
        assert held
        assert not held & listening


def test_leaving_ends_what_runs_and_removes_its_temporary_files(tmp_path: Path) -> None:
    with LocalWorkers(1) as workers:
        running = workers.submit(exec, SLEEPS_WITH_A_FOLDER.format(folder=str(tmp_path)))
        waiting = workers.submit(pow, 1, 1)
        while not (tmp_path / "begun").exists():
            time.sleep(0.01)
    assert isinstance(running.exception(), WorkerDied)
    assert waiting.cancelled()
    assert [path.name for path in tmp_path.iterdir()] == ["begun"]


def test_they_end_with_a_client_that_is_killed() -> None:
    script = (
        "import os, time; from brakelab.fleet.local import LocalWorkers\n"
        "print(LocalWorkers(1).submit(os.getpid).result(), flush=True); time.sleep(60)"
    )
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'tools'}"}
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, env=environment) as client:
        pid = int(client.stdout.readline())
        assert alive(pid)
        client.kill()
    while alive(pid):
        time.sleep(0.01)
