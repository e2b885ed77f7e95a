"""CONFIG files that take all but some keys from another one; what that one says in comments stays."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import InlineTable

from brakelab.results.outputs import config_files, write_text
from ecu.settings.resources import shipped_in

Section = dict[str, tuple[str, str]]
"""Keys of a table, each with its value as TOML and a comment."""


def car_toml(config: Path, out: Path, head: str, sections: Mapping[str, Section]) -> str:
    """Return a configuration that takes all but `sections` from `config`; comments `head` stand first.

    `sections` by the names of tables, as front.pad, "": the keys at the top. A file that is included includes
    no other: what `config` itself includes is included in its place, and its own keys are repeated. A shipped
    one is included by its name, so that the file can be moved to another machine.
    """
    source = config_files(config)[-1]
    document: Any = tomlkit.parse(config.read_text("utf-8-sig") if source != config else "")
    beside = Path(os.path.relpath(source.resolve(), out.resolve().parent)).as_posix()
    document["include"] = source.stem if is_shipped(source) else beside
    for name, keys in sections.items():
        table = document
        for part in filter(None, name.split(".")):
            if not isinstance(table.get(part), Mapping):
                table[part] = tomlkit.table()
            table = table[part]
        for key, (value, comment) in keys.items():
            item = tomlkit.value(value)
            table[key] = item.comment(comment) if comment and not isinstance(table, InlineTable) else item
    return f"{head}\n{document.as_string().rstrip()}\n"


def is_shipped(config: Path) -> bool:
    """Return whether `config` is one of the shipped configurations."""
    shipped = shipped_in("config").get(config.stem)
    return shipped is not None and shipped.resolve() == config.resolve()


def write_car(config: Path, out: Path, head: str, sections: Mapping[str, Section]) -> None:
    """Write `car_toml` to `out`.

    Raises:
        UserError: it cannot be written.
    """
    text = car_toml(config, out, head, sections)
    write_text(out, text)
