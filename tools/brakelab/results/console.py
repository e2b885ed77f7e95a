"""Console of the laboratory's tables."""

from typing import Final

from rich.console import Console

WIDTH: Final = 110  # columns where no terminal says how wide it is


def new_console(width: int = WIDTH) -> Console:
    """Return a console as wide as its terminal, `width` columns where there is none."""
    console = Console()
    return console if console.is_terminal else Console(width=width)
