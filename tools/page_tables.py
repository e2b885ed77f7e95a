"""The part of a page that is written from the code: what stands between two marks."""

from collections.abc import Iterable
from typing import Final

BEGIN: Final = "<!-- tables: python tools/write_reference.py -->\n"
END: Final = "<!-- end of the tables -->\n"


def filled(page: str, parts: Iterable[Iterable[str]]) -> str:
    """Return the page with `parts`, each some lines, between its marks."""
    before, _, rest = page.partition(BEGIN)
    text = "\n\n".join("\n".join(part) for part in parts)
    return before + BEGIN + text + "\n" + END + rest.partition(END)[2]


def table(head: str, rows: Iterable[Iterable[str]]) -> list[str]:
    """Return the lines of a table below the line `head`."""
    return [head, f"|{' --- |' * (head.count('|') - 1)}", *(f"| {' | '.join(row)} |" for row in rows)]
