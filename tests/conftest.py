"""What tests need around them: a SocketCAN bus, UDP multicast, the recorded drives; else they are skipped."""

import gc
import math
import os
import pickle
import re
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from brakelab.results import processes
from ecu import jit
from ecu.library import Entry, Library, open_library

pytest_plugins = ["brakelab.testing.plugin"]
"""Of this checkout, be it installed or not; the entry point in tools/pyproject.toml has the same name."""

# A property is tried on the same values each time, and as slowly as the machine likes.
settings.register_profile(
    "here", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("here")

# What a user's shell or a CI machine may have set, and what changes what commands print or whom they tell.
for name in ("BRAKE_ECU_DEBUG", "NOTIFY_SOCKET", "COLUMNS", "FORCE_COLOR", "GITHUB_ACTIONS", "PY_COLORS"):
    os.environ.pop(name, None)

# Small matrices: threads of their own in every worker cost more than they give.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

gc.disable()  # until all tests are collected

# Kernels come from the library where it holds them; `BRAKE_ECU_TEST_LIBRARY=0`: in tests all from numba.
if os.environ.get("BRAKE_ECU_TEST_LIBRARY") == "0":
    os.environ["BRAKE_ECU_LIBRARY"] = "0"
    for package in ("ecu", "brakelab"):
        jit.library(package)
    del os.environ["BRAKE_ECU_LIBRARY"]

CHECKOUT = Path(__file__).parent.parent
INNER = {package: open_library(CHECKOUT / "tests/compiled" / package) for package in ("ecu", "brakelab")}
"""Kernels that tests call and no program does, see `ecu.build.Inner`; without it numba compiles each."""


def _entries(library: Library, kernel: str, nogil: bool = False, own: Any = Library.entries) -> list[Entry]:
    inner = INNER.get(kernel.partition(".")[0])
    known = inner is not None and inner.fits(kernel.rpartition(".")[0], jit.text_digest)
    return own(library, kernel, nogil) + (own(inner, kernel, nogil) if known else [])


Library.entries = _entries  # type: ignore[method-assign]

LONG = re.compile(
    r"tests/(system/|test_|golden/|wide_world/|closed_loop/|brakelab/(identify|fleet|report|studies)/"
    r"|ecu/(test_|recording/test_store|algorithm/test_step_extremes))"
)
"""Files whose tests run processes, trainings, studies or browsers, compile much, or wait for a disk."""


def shared_folder() -> Path:
    """Folder beside the checkout that holds what is too large for it; BRAKE_ECU_SHARED names another."""
    return Path(os.environ.get("BRAKE_ECU_SHARED") or CHECKOUT.parent / "shared")


@pytest.fixture(scope="session")
def drives() -> Path:
    """Folder of the recorded drives."""
    return shared_folder() / "drives"


class InThisProcess(Executor):
    """Does each task at once; what a process would be sent pickled is pickled here too."""

    def __init__(self, *arguments: object, **named: object) -> None:
        pass

    def submit(self, task: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Do a task; return a future that has its result."""
        future: Future[Any] = Future()
        task, args, kwargs = pickle.loads(pickle.dumps((task, args, kwargs)))
        try:
            future.set_result(task(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@pytest.fixture(autouse=True, scope="session")
def in_this_process() -> Iterator[None]:
    """Pools of processes start none: there is a worker of pytest for each core already."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(processes, "ProcessPoolExecutor", InThisProcess)
        yield


@pytest.fixture(autouse=True, scope="module")
def nothing_remembered(request: pytest.FixtureRequest) -> Iterator[None]:
    """What a file's tests keep by `functools.cache`, drives of 10 to 100 MB, ends with them."""
    yield
    for one in vars(request.module).values():
        if hasattr(one, "cache_clear") and one.__module__ == request.module.__name__:
            one.cache_clear()


def _has_multicast() -> bool:
    group = socket.inet_aton("239.74.163.1")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + socket.inet_aton("0.0.0.0"))
        except OSError:
            return False
    return True


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Two workers more than there are cores: tests of whole processes wait for most of their time."""
    return len(os.sched_getaffinity(0)) + 2


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import no file without the one marker that is asked for: `-m study` is of a sixth of the files."""
    wanted = str(config.option.markexpr)
    if not wanted.isidentifier() or not collection_path.match("test_*.py"):
        return None
    return f"mark.{wanted}" not in collection_path.read_text("utf-8") or None


def pytest_collection_finish() -> None:
    """Collect garbage of tests from here on, and look at none of the twelve thousand items each time."""
    gc.enable()
    gc.collect()
    gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    # Long tests first (`--no-loadscope-reorder`), lest all workers but one wait for them at the end: a file
    # that waits for processes and one that computes in turn.
    waiting, computing = count(0, 2), count(1, 2)
    rank: dict[Path, float] = {}
    for item in items:
        if item.path not in rank:
            turns = waiting if item.nodeid.startswith("tests/system/") else computing
            rank[item.path] = next(turns) if LONG.match(item.nodeid) else math.inf
    items.sort(key=lambda item: rank[item.path])
    absent = {}
    if not Path("/sys/class/net/vcan0").exists():
        absent["socketcan"] = "no interface vcan0"
    if not (shared_folder() / "drives").is_dir():
        absent["drives"] = "no recorded drives beside the checkout (BRAKE_ECU_SHARED)"
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        absent["compiled"] = "kernels run as plain Python"
    if not _has_multicast():
        absent["multicast"] = "no UDP multicast (ip route add 239.0.0.0/8 dev lo)"
    for item in items:
        for marker, reason in absent.items():
            if item.get_closest_marker(marker):
                item.add_marker(pytest.mark.skip(reason=reason))
