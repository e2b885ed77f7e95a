"""Measure all pages of docs/results again, one after the other.

    python tools/measure_results.py [BENCH...]

A bench is `brake-ecu bench NAME --write`, "times" the one without a name. A page that was measured on this
very code (no change of `provenance.CODE` since) is left as it is: a run that was interrupted goes on where it
was. A bench that fails does not stop the others. The exit code is 1 where one failed, 2 where no page is of a
BENCH. Times want a machine that does nothing else.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from brakelab.studies.provenance import CODE
from stale_pages import HEADER, MEASURED

ROOT = Path(__file__).parent.parent
TIMES = "times"


def benches(checkout: Path) -> dict[str, Path]:
    """Return the page of every bench."""
    pages = {}
    for page in sorted((checkout / "docs/results").glob("*.md")):
        header = HEADER.search(page.read_text("utf-8"))
        if header is not None:
            pages[header["bench"] or TIMES] = page
    return pages


def is_of_this_code(checkout: Path, page: Path) -> bool:
    """Return whether a page was measured on the code as it is, nothing of it uncommitted."""
    measured = MEASURED.search(page.read_text("utf-8"))
    if measured is None or measured["dirty"]:
        return False
    git = ["git", "diff", "--quiet", measured["commit"], "--", *CODE]
    return subprocess.run(git, cwd=checkout, stderr=subprocess.DEVNULL).returncode == 0


def measure(bench: str) -> bool:
    """Run a bench, which writes its page. Returns whether it succeeded."""
    name = () if bench == TIMES else (bench,)
    command = [sys.executable, "-P", "-m", "ecu.cli", "bench", *name, "--write", "--quiet"]
    return subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL).returncode == 0


def measure_all(
    checkout: Path,
    names: list[str],
    measure: Callable[[str], bool],
    clock: Callable[[], float] = time.monotonic,
) -> int:
    """Measure the pages of `names`, of all benches where there are none, and say how long each took.

    Returns 1 where one failed, 2 where there is no page of a name.
    """
    pages = benches(checkout)
    unknown = [name for name in names if name not in pages]
    if unknown:
        print(
            f"{unknown[0]}: no page of docs/results is of this bench; choose of {', '.join(pages)}",
            file=sys.stderr,
        )
        return 2
    chosen = names or list(pages)
    failed = []
    for number, bench in enumerate(chosen, start=1):
        place = f"{number} of {len(chosen)}: bench {bench}, {pages[bench].name}"
        if is_of_this_code(checkout, pages[bench]):
            print(f"{place}: is of this code", flush=True)
            continue
        print(f"{place}: since {time.strftime('%H:%M')}", flush=True)
        start = clock()
        if not measure(bench):
            failed.append(bench)
        print(
            f"{place}: {'failed' if bench in failed else 'written'} after {clock() - start:.0f} s", flush=True
        )
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(measure_all(ROOT, sys.argv[1:], measure))
