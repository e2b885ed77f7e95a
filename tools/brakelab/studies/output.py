"""Output of a bench: tables on the terminal, JSON, and pages of the documentation."""

from typing import Any, Final

from rich.console import Console

from brakelab.results.text_table import Table, markdown, show
from brakelab.studies.measure import Figure, Row
from brakelab.studies.provenance import measured_on
from ecu import __version__
from ecu.output import give, say
from ecu.settings.resources import resource

RESULTS: Final = "docs/results"
"""Folder of the pages that benches write."""
PICTURES: Final = f"{RESULTS}/images"


def plain_row(row: Any) -> dict[str, Any]:
    """Return a row for JSON: figures become objects, times get their ratio."""
    values = row._asdict().items()
    plain = {key: value._asdict() if isinstance(value, Figure) else value for key, value in values}
    return plain | {"ratio": row.ratio} if isinstance(row, Row) else plain


def print_tables(line: str, tables: list[Table]) -> None:
    """Print a line, then tables."""
    console = Console()
    console.print(line, highlight=False)
    for table in tables:
        show(console, table)


def write_page(name: str, title: str, text: str, tables: list[Table], keep: bool = False) -> None:
    """Renew a page; with `keep` sections with other titles stay: of other buses, measured elsewhere."""
    folder = resource(RESULTS)
    if folder.is_dir():
        sections = {table.title: markdown(table) for table in tables}
        if keep and (folder / name).exists():
            _, *before = (folder / name).read_text(encoding="utf-8").split("\n## ")
            kept = {section.partition("\n")[0]: f"## {section.rstrip()}\n" for section in before}
            sections = kept | sections
        content = "\n".join([f"# {title}", "", measured_on(), "", text, "", *sections.values()])
        (folder / name).write_text(content.rstrip() + "\n", encoding="utf-8")
        say(f"written: {RESULTS}/{name}")


def results_page(
    name: str,
    title: str,
    text: str,
    tables: list[Table],
    json: bool,
    file: str | None = None,
    keep: bool = False,
) -> int:
    """Print the tables of bench `name`, or give JSON; renew its page, `file` or its name. Returns 0."""
    of = f"`brake-ecu bench {name}`, version {__version__}"
    if json:
        give(of=of, tables=tables)
        return 0
    print_tables(of, tables)
    write_page(f"{file or name}.md", title, f"{of}. {text}", tables, keep)
    return 0
