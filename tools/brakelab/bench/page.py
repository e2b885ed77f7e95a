"""Tables of a bench: printed, as JSON, or as its page of the documentation."""

import json as json_format
from pathlib import Path
from typing import Any

from rich.console import Console

from brakelab.bench.measure import Figure, Row
from brakelab.bench.table import Table, markdown, show
from ecu import __version__
from ecu.resources import resource


def write_page(
    name: str,
    title: str,
    text: str,
    tables: list[Table],
    json: bool,
    file: str | None = None,
    keep: bool = False,
) -> int:
    """Print a bench's tables, or JSON, and renew its page, `file` or its name; return 0."""
    of = f"`brake-ecu bench {name}`, version {__version__}"
    if json:
        print_json({"of": of, "tables": [table._asdict() for table in tables]})
        return 0
    print_tables(of, tables)
    write_tables(f"{file or name}.md", title, f"{of}. {text}", tables, keep)
    return 0


def as_json(row: Any) -> dict[str, Any]:
    """Return a row as JSON has it: figures become objects, times get their ratio."""
    values = row._asdict().items()
    plain = {key: value._asdict() if isinstance(value, Figure) else value for key, value in values}
    return plain | {"ratio": row.ratio} if isinstance(row, Row) else plain


def print_json(content: dict[str, Any]) -> None:
    """Print it, as it is in every language."""
    print(json_format.dumps(content, indent=1, ensure_ascii=False))


def print_tables(line: str, tables: list[Table]) -> None:
    """Print tables below a line on what they are of."""
    console = Console()
    console.print(line, highlight=False)
    for table in tables:
        show(console, table)


def write_tables(name: str, title: str, text: str, tables: list[Table], keep: bool = False) -> None:
    """Renew a page; with `keep` the sections of other titles stay: of other buses, measured elsewhere."""
    folder: Path = resource("docs")
    if folder.is_dir():
        sections = {table.title: markdown(table) for table in tables}
        if keep and (folder / name).exists():
            _, *before = (folder / name).read_text(encoding="utf-8").split("\n## ")
            kept = {section.partition("\n")[0]: f"## {section.rstrip()}\n" for section in before}
            sections = kept | sections
        content = "\n".join([f"# {title}", "", text, "", *sections.values()])
        (folder / name).write_text(content.rstrip() + "\n", encoding="utf-8")
        Console(stderr=True).print(f"written: docs/{name}", highlight=False)
