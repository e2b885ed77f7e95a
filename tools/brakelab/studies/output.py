"""Output of a bench: tables on the terminal, JSON, and pages of the documentation."""

from typing import Final

from rich.console import Console

from brakelab.results.text_table import Table, markdown, show
from brakelab.studies.provenance import measured_on
from brakelab.studies.study import Measured, Study
from ecu import __version__
from ecu.output import give, policy, say
from ecu.settings.resources import resource

RESULTS: Final = "docs/results"
"""Folder of the pages that benches write."""
PICTURES: Final = f"{RESULTS}/images"
CAUSES: Final = "Causes"
"""Title of the section of a page that a person writes."""
MOVED: Final = "**The figures changed since this was written: read it again, then take this line away.**"


def print_tables(line: str, tables: list[Table]) -> None:
    """Print a line, then tables."""
    console = Console()
    console.print(line, highlight=False)
    for table in tables:
        show(console, table)


def write_page(name: str, title: str, text: str, tables: list[Table], keep: bool = False) -> None:
    """Renew a page; with `keep` sections with other titles stay: of other buses, measured elsewhere.

    The section `CAUSES` stays always, marked where figures are no longer those that it was written for.
    """
    path = resource(RESULTS) / name
    sections = {table.title: markdown(table) for table in tables}
    if path.exists():
        _, *found = path.read_text(encoding="utf-8").split("\n## ")
        before = {section.partition("\n")[0]: f"## {section.rstrip()}\n" for section in found}
        same = all(before.get(head, "").rstrip() == one.rstrip() for head, one in sections.items())
        if keep:
            sections = before | sections
        elif CAUSES in before:
            sections[CAUSES] = before[CAUSES]
            if not same and MOVED not in before[CAUSES]:
                sections[CAUSES] = before[CAUSES].replace("\n", f"\n\n{MOVED}\n", 1)
    content = "\n".join([f"# {title}", "", measured_on(), "", text, "", *sections.values()])
    path.write_text(content.rstrip() + "\n", encoding="utf-8")
    say(f"written: {RESULTS}/{name}")


def show_measured(command: str, page: Study, measured: Measured, write: bool) -> None:
    """Print tables, or give JSON; with `write` renew the page and its pictures. `command`: bench NAME."""
    of = f"`brake-ecu {command}`, version {__version__}{measured.of}"
    if policy().json:
        give(of=of, **({"tables": measured.tables} if measured.plain is None else measured.plain))
    else:
        print_tables(of, measured.tables)
    if write:
        file = page.file or command.rpartition(" ")[2]
        write_page(f"{file}.md", page.title, f"{of}. {page.text}".rstrip(), measured.tables, page.keep)
        if measured.draw is not None:
            measured.draw(resource(PICTURES))
