"""Progress of long work on stderr: a bar on a terminal, elsewhere a line every ten seconds."""

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Final, TypeVar

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from ecu.compiling import compiling_told
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
    with compiling_told():
        if not console.is_terminal:
            yield Lines(text, total).advance
            return
        columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
        with Progress(*columns, console=console, transient=True) as progress:
            task = progress.add_task(text, total=total)
            yield lambda amount: progress.advance(task, amount)


def tracked(items: Iterable[Item], text: str, total: int) -> Iterator[Item]:
    """Yield `items`, of which there are `total`, with their progress."""
    with progress_bar(text, total) as advance:
        for item in items:
            yield item
            advance(1.0)


class Lines:
    """Progress as lines, one every `PERIOD_S`; work that is shorter says nothing."""

    def __init__(self, text: str, total: float | None, now_s: Callable[[], float] = time.monotonic) -> None:
        self._text, self._total, self._done, self._now_s = text, total, 0.0, now_s
        self._began_s = self._told_s = now_s()

    def advance(self, amount: float) -> None:
        """Note that so much more of the total is done."""
        self._done += amount
        now_s = self._now_s()
        if now_s - self._told_s < PERIOD_S:
            return
        self._told_s = now_s
        share = f"{100.0 * self._done / self._total:.0f} %, " if self._total else ""
        say(f"{self._text}: {share}{now_s - self._began_s:.0f} s")
