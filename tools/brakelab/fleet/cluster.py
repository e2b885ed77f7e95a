"""Workers that replay the drives: processes of this machine, or those of a Dask scheduler.

Whoever reaches a Dask scheduler or its workers without TLS has code run as their user, and so does whoever
sits between them and the client. A scheduler elsewhere has to be one of TLS therefore, unless Dask's
configuration says `distributed.comm.require-encryption: false`.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from ipaddress import ip_address
from typing import Any, Final, NamedTuple
from urllib.parse import urlsplit

from brakelab.fleet.local import LocalWorkers, WorkerDied
from brakelab.results.processes import cores
from ecu import __version__
from ecu.errors import UserError

TIMEOUT_S: Final = 10.0
QUEUED: Final = 2
"""Drives on a cluster for each of its threads: one runs, one waits for it to end."""
ENCRYPTED: Final = ("tls", "wss")


class Workers(NamedTuple):
    """What replays the drives."""

    executor: Executor
    room: Callable[[], int]
    """Return how many drives they take at a time."""
    died: type[Exception]
    """Raised by the drive of a worker that died."""


@contextmanager
def connect(scheduler: str | None, workers: int | None) -> Iterator[Workers]:
    """Yield the workers of the scheduler at an address; None: `workers` local processes (None: one a core).

    Raises:
        UserError: no answer from the address, it is neither encrypted nor on this machine, or its workers
            have another version of this program.
    """
    if scheduler is None:
        count = workers or cores()
        with LocalWorkers(count) as local:
            yield Workers(local, lambda: count, WorkerDied)
        return
    from distributed import Client, KilledWorker

    _refuse_open(scheduler)
    try:
        client = Client(scheduler, timeout=TIMEOUT_S)
    except TypeError:
        remedy = "without a certificate of yours; name it to Dask (docs/fleet.md)"
        raise UserError("--scheduler", scheduler, remedy) from None
    except (OSError, ValueError, AssertionError) as error:  # AssertionError: its thread does not start
        remedy = f"no Dask scheduler answers ({error}); start one with `dask scheduler`, or leave this out"
        raise UserError("--scheduler", scheduler, remedy) from None
    with client:
        _check_versions(client, scheduler)
        yield Workers(
            client.get_executor(pure=False),
            lambda: QUEUED * max(sum(client.nthreads().values()), 1),
            KilledWorker,
        )


def _refuse_open(scheduler: str) -> None:
    import dask

    if scheduler.partition("://")[0] in ENCRYPTED or _is_loopback(scheduler):
        return
    if dask.config.get("distributed.comm.require-encryption", None) is False:
        return
    remedy = (
        "is not encrypted: whoever reaches it or listens has code run by its workers; give tls://…, or say"
        " that nobody can by DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION=false (docs/fleet.md)"
    )
    raise UserError("--scheduler", scheduler, remedy)


def _is_loopback(scheduler: str) -> bool:
    try:
        host = urlsplit(scheduler if "://" in scheduler else f"tcp://{scheduler}").hostname
        return host == "localhost" or ip_address(host or "").is_loopback
    except ValueError:  # a name, or no address
        return False


def _version() -> str:
    return __version__


def _check_versions(client: Any, scheduler: str) -> None:
    for worker, found in client.run(_version, on_error="return").items():
        if found != __version__:
            says = f"version {found}" if isinstance(found, str) else f"{found}"
            remedy = f"worker {worker} cannot run brake-ecu {__version__} ({says}); install it there"
            raise UserError("--scheduler", scheduler, remedy)
