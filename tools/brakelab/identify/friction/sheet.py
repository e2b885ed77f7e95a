"""Page of measurements: one HTML file without scripts or anything from elsewhere; its charts are SVG."""

import re
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Final

from brakelab.results.outputs import write_text
from brakelab.results.text_table import Table

WORD: Final = re.compile("[a-z]{3}")
"""Mark of a column of words, which is set from the left."""
STYLE: Final = (
    "body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:990px;padding:0 1em;color:#1d2733}"
    "h1{font-size:1.5em}h2{font-size:1.15em;margin-top:2em}"
    "table{border-collapse:collapse;font-size:13px}td,th{padding:3px 10px;border-bottom:1px solid #dde2e7;"
    "text-align:right}td:first-child,th:first-child,.words{text-align:left}"
    ".scroll{overflow-x:auto}svg{width:100%;min-width:640px}.limit{background:#fff4e5;"
    "border-left:4px solid #d55e00;padding:.6em 1em}"
    "@media screen and (prefers-color-scheme:dark){body{background:#14181d;color:#e8ebef}"
    "td,th{border-color:#323941}.limit{background:#33291a}svg{filter:invert(.91)hue-rotate(180deg)}}"
)


def write_sheet(path: Path, title: str, body: Sequence[str]) -> None:
    """Write a page of HTML elements. Raises UserError if it cannot be written."""
    head = (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta name="color-scheme" content="light dark"><style>{STYLE}</style>'
    )
    write_text(path, f"{head}<body>{''.join(body)}</body></html>\n")


def scrolling(wide: str) -> str:
    """Return what may be wider than a phone as HTML that scrolls by itself."""
    return f'<div class="scroll" tabindex="0">{wide}</div>'


def html_of(table: Table) -> str:
    """Return a table as HTML, its title above."""
    wordy = [any(WORD.search(row[k]) for row in table.rows) for k in range(len(table.columns))]
    kinds = [' class="words"' if words else "" for words in wordy]

    def cells(tag: str, values: Sequence[str]) -> str:
        return "".join(f"<{tag}{kind}>{escape(v)}</{tag}>" for kind, v in zip(kinds, values, strict=True))

    rows = "".join(f"<tr>{cells('td', row)}</tr>" for row in table.rows)
    below = f"<p>{escape(table.below)}</p>" if table.below else ""
    lines = f"<table><tr>{cells('th', table.columns)}</tr>{rows}</table>"
    return f"<h2>{escape(table.title)}</h2>{scrolling(lines)}{below}"
