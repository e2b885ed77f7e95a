"""CONFIG files that take all but some keys from another one."""

import os
from pathlib import Path
from typing import Any

from ecu.settings.toml_file import read_toml

Section = dict[str, tuple[str, str]]
"""Keys of a section, each with its value as TOML and a comment."""


def toml_value(value: Any) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, list):
        return f"[{', '.join(toml_value(each) for each in value)}]"
    return repr(value)


def _lines(path: str, own: dict[str, Any], sections: dict[str, Section]) -> list[str]:
    """Return the keys of table `path` that `own` has, then those fitted, then the tables within."""
    new = sections.get(path, {})
    plain = [
        f"{key} = {toml_value(v)}" for key, v in own.items() if not isinstance(v, dict) and key not in new
    ]
    plain += [f"{key} = {value}  # {comment}" for key, (value, comment) in new.items()]
    lines = ["", f"[{path}]", *plain] if plain and path else plain
    for key, value in own.items():
        if isinstance(value, dict):
            lines += _lines(f"{path}.{key}" if path else key, value, sections)
    return lines


def split_include(config: Path) -> tuple[Path, dict[str, Any]]:
    """Return the file that a new CONFIG includes in place of `config`, and the keys that it must repeat.

    An included file includes no other: `config` itself, or the one that it includes and its own keys.
    """
    own = read_toml(config)
    return (config.parent / str(own.pop("include")), own) if "include" in own else (config, {})


def car_toml(config: Path, out: Path, head: str, sections: dict[str, Section]) -> str:
    """Return a configuration that takes all but `sections` from `config`; `head` are its first lines."""
    source, own = split_include(config)
    include = Path(os.path.relpath(source, out.parent)).as_posix()
    for name in sections:
        own.setdefault(name, {})
    return "\n".join([head, f'include = "{include}"', *_lines("", own, sections), ""])
