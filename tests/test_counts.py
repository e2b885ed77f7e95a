"""Counts that no machine changes, against `counts.json`: what grows by more than a tenth is meant, or mended.

    BRAKE_ECU_UPDATE_COUNTS=1 python -m pytest tests/test_counts.py

writes them anew; the commit says why. Calls of Python depend on its version, a library on its processor: they
are compared where those are the ones of the file. That nothing is left allocated:
`tests/ecu/runtime/test_cycle.py`.
"""

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import threading
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from brakelab.bench.braking import simulated_stop
from brakelab.bench.cycle import bursts, our_side
from brakelab.bench.socket_pair import put, take
from ecu.jit import library, library_of

pytestmark = pytest.mark.compiled
ROOT, COMMITTED = Path(__file__).parent.parent, Path(__file__).parent / "counts.json"
UPDATE = os.environ.get("BRAKE_ECU_UPDATE_COUNTS") == "1"
GROWTH = 1.1
CYCLES = 30
KERNEL = re.compile(r"^@(?:parallel_|batch_)?kernel\b", re.MULTILINE)
IMPORTED = re.compile(r"^import time: +\d+ \| +\d+ \| *([\w.]+)$", re.MULTILINE)


@pytest.fixture(autouse=True)
def of_these_texts() -> None:
    """With numba in place of a library all counts are others."""
    if None in map(library_of, ("ecu.algorithm.step", "brakelab.replay.engine", "brakelab.logs.candump")):
        pytest.skip("no library of these texts; python -m brakelab.build makes it")


def check(name: str, found: int, of: str = "") -> None:
    """Compare a count with the committed one, `of` what it depends on."""
    known = json.loads(COMMITTED.read_text("utf-8"))
    if UPDATE:
        known[name] = {"count": found, "of": of}
        COMMITTED.write_text(json.dumps(dict(sorted(known.items())), indent=2) + "\n", "utf-8")
        return
    if known[name]["of"] != of:
        pytest.skip(f"counted with {known[name]['of']}, this is {of}")
    most = GROWTH * known[name]["count"]
    remedy = "mend it, or BRAKE_ECU_UPDATE_COUNTS=1 python -m pytest tests/test_counts.py, and say why"
    assert found <= most, f"{name}: {found} instead of {known[name]['count']}; {remedy}"


@pytest.mark.parametrize(("package", "folder"), [("ecu", "ecu"), ("brakelab", "tools/brakelab")])
def test_kernels_and_their_library(package: str, folder: str) -> None:
    texts = (path.read_text("utf-8") for path in (ROOT / folder).rglob("*.py"))
    check(f"kernels in {folder}", sum(len(KERNEL.findall(text)) for text in texts))
    found = library(package)
    assert found is not None
    check(f"kernels of {folder} that Python calls", len(found.manifest["kernels"]))
    file = found.folder / found.manifest["processors"][found.processor]
    check(f"library of {folder}, kB", file.stat().st_size // 1000, found.processor)


def _imported(folder: Path, arguments: list[str], is_over: Callable[[str], bool]) -> int:
    """Return how many modules a command has imported, but Python's own, when `is_over` of what it said."""
    with (folder / "said").open("w+") as said:
        command = [sys.executable, "-X", "importtime", "-m", "ecu.cli", *arguments]
        run = subprocess.Popen(command, stdout=said, stderr=said, cwd=folder)
        try:
            deadline = time.monotonic() + 60.0
            while time.monotonic() < deadline and not is_over(text := (folder / "said").read_text("utf-8")):
                time.sleep(0.05)
            assert is_over(text), text[-2000:]
        finally:
            run.terminate()
            run.wait()
    names = set(IMPORTED.findall(text))
    return sum(name.partition(".")[0] not in sys.stdlib_module_names for name in names)


def test_modules_at_the_start_of_replay(tmp_path: Path) -> None:
    log = ROOT / "tests/data/mustang.log"
    arguments = ["replay", str(log), "--config", "mustang", "--map", "mustang", "--out", "result.parquet"]
    check("modules of replay", _imported(tmp_path, arguments, lambda text: "rows from" in text))


def test_modules_of_the_daemon_when_it_is_ready(tmp_path: Path) -> None:
    arguments = ["run", "--config", "suv", "-i", "virtual", "-c", "counted"]
    check("modules of run", _imported(tmp_path, arguments, lambda text: '"event": "ready"' in text))


@pytest.fixture(scope="module")
def cycle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., None]]:
    """Run cycles of the daemon on a socket, 39 frames in and 6 out, between `before` and `after` of each."""
    stop = simulated_stop()
    side, sent = our_side(stop, tmp_path_factory.mktemp("ring")), iter(bursts(stop, 10 * CYCLES))

    def run(before: Callable[[], object], after: Callable[[], object]) -> None:
        for _ in range(CYCLES):
            put(side.vehicle, next(sent))
            before()
            side.cycle()
            after()
            take(side.vehicle)

    run(int, int)
    yield run
    side.close()


def test_calls_of_python_in_a_cycle(cycle: Callable[..., None]) -> None:
    calls = 0

    def count(frame: object, event: str, argument: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    cycle(lambda: sys.setprofile(count), lambda: sys.setprofile(None))
    check(
        "calls of Python in a cycle", calls // CYCLES, f"Python {sys.version_info[0]}.{sys.version_info[1]}"
    )


def test_memory_of_python_in_a_cycle(cycle: Callable[..., None]) -> None:
    """What is allocated in between and freed again."""
    most = [0]

    def note() -> None:
        most.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()

    cycle(tracemalloc.start, note)
    of = f"Python {sys.version_info[0]}.{sys.version_info[1]}"
    check("bytes of Python in a cycle", sorted(most)[len(most) // 2], of)


def test_system_calls_in_a_cycle(cycle: Callable[..., None], tmp_path: Path) -> None:
    if shutil.which("strace") is None:
        pytest.skip("no strace")
    calls = tmp_path / "calls"  # a cycle that is late sleeps and drains less often
    command = [
        "strace",
        "-e",
        "trace=!clock_nanosleep",
        "-p",
        str(threading.get_native_id()),
        "-o",
        str(calls),
    ]
    strace = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert strace.stderr is not None
    if "attached" not in strace.stderr.readline():
        strace.wait()
        pytest.skip("strace may not attach to a process here")
    try:
        cycle(os.getppid, os.getppid)  # a call that nobody else makes stands at either end
    finally:
        strace.terminate()
        strace.communicate()
    between = re.findall(
        r"^getppid\(.*\n((?:(?!getppid).*\n)*)getppid", calls.read_text("utf-8"), re.MULTILINE
    )
    assert len(between) == CYCLES
    check("system calls in a cycle, but sleeps", max(one.count("\n") for one in between), platform.machine())
