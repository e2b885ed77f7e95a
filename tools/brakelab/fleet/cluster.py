"""Workers that replay the drives: processes of this machine, or those of a Dask scheduler."""

import logging
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import dask
from distributed import Client, LocalCluster

from ecu import __version__
from ecu.errors import UserError

TIMEOUT_S: Final = 10.0
ONE_THREAD: Final = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
"""Environment of a worker, without the MALLOC_TRIM_THRESHOLD_ that Dask would set: with it every block of a
log is new memory from the kernel, which took a third more processor time."""

LOCAL: Final = {
    # A drive whose worker died returns to the client, which counts and reports it.
    "distributed.scheduler.allowed-failures": 0,
    "distributed.nanny.pre-spawn-environ": ONE_THREAD,
    # Dask monitors itself up to a hundred times a second, for pages unused here; on two cores that took 6 %.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.worker.memory.monitor-interval": "500ms",
    "distributed.scheduler.active-memory-manager.start": False,
}


@contextmanager
def connect(scheduler: str | None, workers: int | None) -> Iterator[Client]:
    """Return a client of the scheduler at an address; None: of `workers` local processes (None: one a core).

    Raises:
        UserError: no answer from the address, or its workers have another version of this program.
    """
    if scheduler is None:
        yield from _local(workers or _cores())
        return
    try:
        client = Client(scheduler, timeout=TIMEOUT_S)
    except (OSError, ValueError) as error:
        remedy = f"no Dask scheduler answers ({error}); start one with `dask scheduler`, or leave this out"
        raise UserError("--scheduler", scheduler, remedy) from None
    with client:
        _check_versions(client, scheduler)
        yield client


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _local(workers: int) -> Iterator[Client]:
    with (
        dask.config.set(LOCAL),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
            silence_logs=logging.CRITICAL,
            preload=[__name__],
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


def dask_setup(worker: Any) -> None:
    """Prepare a local worker, called by Dask: Ctrl-C is for the client alone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _version() -> str:
    return __version__


def _check_versions(client: Client, scheduler: str) -> None:
    for worker, found in client.run(_version, on_error="return").items():
        if found != __version__:
            says = f"version {found}" if isinstance(found, str) else f"{found}"
            remedy = f"worker {worker} cannot run brake-ecu {__version__} ({says}); install it there"
            raise UserError("--scheduler", scheduler, remedy)
