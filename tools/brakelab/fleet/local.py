"""Worker processes of this machine.

Each is reached by a pipe that it inherits, and by nothing else: there is no address at which another user of
the machine could have code run, as there is of a cluster's workers.
"""

import os
import signal
import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from queue import SimpleQueue
from typing import Any, Final

ONE_THREAD: Final = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
"""Environment of the workers: there is one for each core."""
PATIENCE_S: Final = 5.0
"""For a worker to remove its temporary files."""


class WorkerDied(Exception):
    """The process that had the task is gone."""


class LocalWorkers(ThreadPoolExecutor):
    """Executor of `count` processes, each for one task at a time; a thread waits for each.

    A task whose process dies raises `WorkerDied`, no other one does, and the next task gets a new process.
    """

    def __init__(self, count: int) -> None:
        super().__init__(count)
        os.environ.update(ONE_THREAD)
        self._idle: SimpleQueue[Connection | None] = SimpleQueue()
        for _ in range(count):
            self._idle.put(None)
        self._processes: list[BaseProcess] = []

    def submit(self, task: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have a task run; it and its arguments are pickled."""
        return super().submit(self._in_process, task, args, kwargs)

    def _in_process(self, *call: Any) -> Any:
        worker = self._idle.get()
        try:
            worker = worker or self._new()
            worker.send(call)
            outcome = worker.recv()
        except (EOFError, OSError):
            worker = None
            raise WorkerDied from None
        finally:
            self._idle.put(worker)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    def _new(self) -> Connection:
        spawn = get_context("spawn")
        here, there = spawn.Pipe()
        process = spawn.Process(target=_work, args=(there,), daemon=True)
        process.start()
        there.close()  # its death is to end `recv` here
        self._processes.append(process)
        return here

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes, in the middle of a task too."""
        super().shutdown(wait=False, cancel_futures=True)
        for process in self._processes:
            process.terminate()
        for process in self._processes:
            process.join(PATIENCE_S)
            process.kill()
        super().shutdown(wait)


def _work(pipe: Connection) -> None:
    """Run the tasks that come through a pipe until its other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the client alone
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # temporary files are removed
    while True:
        try:
            task, args, kwargs = pipe.recv()
        except EOFError:
            return
        try:
            outcome = task(*args, **kwargs)
        except Exception as error:
            outcome = error
        pipe.send(outcome)
