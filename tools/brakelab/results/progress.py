"""Progress of long work on stderr: a bar on a terminal, elsewhere a line every ten seconds."""

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Final, TypeVar

from rich.console import Console

from ecu.compiling import report_compiling
from ecu.output import say

PERIOD_S: Final = 10.0
Item = TypeVar("Item")


@contextmanager
def progress_bar(text: str, total: float | None, shown: bool = True) -> Iterator[Callable[[float], None]]:
    """Show how much of `total` (None: unknown) is done; the function that it yields advances it.

    Says when kernels are being compiled. `shown`: False for use from Python, where nobody asked for words.
    """
    if not shown:
        yield lambda amount: None
        return
    console = Console(stderr=True)
    with report_compiling():
        if not console.is_terminal:
            with _lines(text, total) as advance:
                yield advance
            return
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

        columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
        with Progress(
            *columns, console=console, transient=True, redirect_stdout=sys.stdout.isatty()
        ) as progress:
            task = progress.add_task(text, total=total)
            yield lambda amount: progress.advance(task, amount)


def tracked(items: Iterable[Item], text: str, total: int) -> Iterator[Item]:
    """Yield `items`, of which there are `total`, with their progress."""
    with progress_bar(text, total) as advance:
        for item in items:
            yield item
            advance(1.0)


@contextmanager
def _lines(text: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """Say every `PERIOD_S` how much is done; work that is shorter says nothing."""
    done, over, began_s = 0.0, threading.Event(), time.monotonic()

    def tell() -> None:
        while not over.wait(PERIOD_S):
            share = f"{100.0 * done / total:.0f} %, " if total else ""
            say(f"{text}: {share}{time.monotonic() - began_s:.0f} s")

    def advance(amount: float) -> None:
        nonlocal done
        done += amount

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield advance
    finally:
        over.set()
        teller.join()
