"""A progress bar on stderr for long work; where nobody watches (no terminal), silence."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn


@contextmanager
def progress_bar(text: str, total: float | None, shown: bool = True) -> Iterator[Callable[[float], None]]:
    """Show how much of `total` (None: unknown) is done; the function that it yields advances it.

    `shown`: False for use from Python, where nobody asked for a bar.
    """
    console = Console(stderr=True)
    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(
        *columns, console=console, transient=True, disable=not (shown and console.is_terminal)
    ) as progress:
        task = progress.add_task(text, total=total)
        yield lambda amount: progress.advance(task, amount)
