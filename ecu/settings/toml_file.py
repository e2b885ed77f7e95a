"""TOML: what a person wrote is read, a mistake one line with file, key and remedy; tables are written."""

import os
import stat
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from ecu.errors import UserError, closest
from ecu.output import detail
from ecu.settings.described import describe_keys

LONGEST_FILE: Final = 16 << 20
"""Characters of a file: a fleet's manifest of 100,000 drives has 5 million."""
SHOWN: Final = 60
"""Characters that are shown of a value."""


class Unit(NamedTuple):
    """Unit of a key; stands in its `Annotated`."""

    name: str

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        """Return the schema of the key with its unit."""
        return {**handler(core), "unit": self.name}


class Section(BaseModel):
    """A table of a TOML file: no key but those it knows, no value but of the kind it has."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, strict=True, json_schema_extra=describe_keys
    )


_NUMBER, _WHOLE = "give a number", "give a whole number"
_WANTED = {
    "float_type": _NUMBER,
    "float_parsing": _NUMBER,
    "finite_number": "give a finite number",
    "int_type": _WHOLE,
    "int_parsing": _WHOLE,
    "int_from_float": _WHOLE,
    "bool_type": "give true or false",
    "bool_parsing": "give true or false",
    "string_type": 'give a text in "quotes"',
    "list_type": "give a list in [brackets]",
    "tuple_type": "give a list in [brackets]",
    "dict_type": "give a table with keys of its own",
    "model_type": "give a table with keys of its own",
    "greater_than": "give a value above {gt:g}",
    "greater_than_equal": "give a value of at least {ge:g}",
    "less_than": "give a value below {lt:g}",
    "less_than_equal": "give a value of at most {le:g}",
    "string_too_short": "give a text, not an empty one",
    "string_too_long": "give a text of at most {max_length} characters",
    "too_short": "give at least {min_length} values",
    "too_long": "give at most {max_length} values",
    "value_error": "{error}",
}
"""Allowed values, by pydantic's kind of finding."""


def describe(error: ValidationError, where: str, model: type[BaseModel]) -> UserError:
    """Turn the findings of pydantic into one line: the first, and how many more there are."""
    return summarised(findings(error, lambda _: where, model))


def summarised(found: list[UserError]) -> UserError:
    """Return the first of several findings with the number of the others."""
    first, more = found[0], len(found) - 1
    return UserError(first.where, first.place, first.remedy + (f" ({more} more)" if more else ""))


def findings(
    error: ValidationError, file_of: Callable[[tuple[int | str, ...]], str], model: type[BaseModel]
) -> list[UserError]:
    """Return every finding of pydantic as the line of its key, unknown keys first.

    `file_of` names the file of a key; `model` is what was validated: its keys and units are named.
    """
    found = sorted(error.errors(include_url=False), key=lambda one: one["type"] != "extra_forbidden")
    return [UserError(file_of(one["loc"]), _place(one["loc"]), _remedy(one, model)) for one in found]


def _place(loc: tuple[int | str, ...]) -> str:
    """Return the name of a key; tables of one name, and values of a list, are numbered from 1."""
    return ".".join(str(part + 1 if isinstance(part, int) else part) for part in loc)


def _remedy(finding: Any, model: type[BaseModel]) -> str:
    keys = [str(part) for part in finding["loc"]]
    table = _table(model, keys[:-1])
    if finding["type"] == "missing":
        return "missing; add this key"
    if finding["type"] == "extra_forbidden":
        meant = closest(keys[-1], table.model_fields) if table else ""
        return "unknown key" + (meant or "; remove it or correct its spelling")
    wanted: str = _WANTED.get(finding["type"], finding["msg"]).format(**finding.get("ctx", {}))
    if not keys or isinstance(finding["input"], dict):
        return wanted
    unit = _unit(table, keys) if finding["type"].startswith(("greater_than", "less_than")) else ""
    return f"{wanted}{unit} (found {_shown(finding['input'])})"


def _shown(value: object) -> str:
    try:
        text = repr(value)
    except ValueError:  # Python writes no number of more than 4300 digits
        return "a number of thousands of digits"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}…"


def _table(model: type[BaseModel], keys: list[str]) -> type[BaseModel] | None:
    """Return the model of the table that `keys` lead to, None: it is none of ours."""
    table: type[BaseModel] | None = model
    of_several = False
    for key in keys:
        if of_several:  # a name or a number of its own
            of_several = False
            continue
        field = table.model_fields.get(key) if table else None
        kinds = () if field is None else (field.annotation, *get_args(field.annotation))
        of_several = field is not None and get_origin(field.annotation) in (dict, list)
        table = next((kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)), None)
    return table


def _unit(table: type[BaseModel] | None, keys: list[str]) -> str:
    """Return the unit of a key behind a blank, empty for a pure number."""
    field = table.model_fields.get(keys[-1]) if table else None
    unit = unit_of(field) if field else None
    return f" {unit}" if unit and unit != "-" else ""


def unit_of(field: FieldInfo) -> str | None:
    """Return the unit of a key, None: it has none."""
    kinds = (field.annotation, *get_args(field.annotation))
    of_kinds = (note for kind in kinds for note in getattr(kind, "__metadata__", ()))
    return next((note.name for note in (*field.metadata, *of_kinds) if isinstance(note, Unit)), None)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; a mistake is one line. Whatever is no regular file is not read: it may never end."""
    detail(f"reading {path}")
    try:
        return tomllib.loads(_text(path))
    except tomllib.TOMLDecodeError as error:
        raise UserError(str(path), "", f"not valid TOML: {error}") from None
    except RecursionError:
        raise UserError(str(path), "", "nested too deep; no key needs more than three levels") from None
    except ValueError:
        raise UserError(str(path), "", "a number of thousands of digits; correct it") from None


def _text(path: Path) -> str:
    try:
        with open(path, encoding="utf-8-sig", opener=_without_waiting) as file:  # Windows editors mark it
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise UserError(str(path), "", "is no regular file; give a TOML file")
            text = file.read(LONGEST_FILE + 1)
    except FileNotFoundError:
        raise UserError(str(path), "", "no such file") from None
    except IsADirectoryError:
        raise UserError(str(path), "", "is a folder; give a TOML file") from None
    except (OSError, ValueError) as error:
        raise UserError(str(path), "", f"cannot be read as text: {error}") from None
    if len(text) > LONGEST_FILE:
        raise UserError(str(path), "", f"is larger than {LONGEST_FILE >> 20} MB; give a TOML file")
    return text


def _without_waiting(path: str, flags: int) -> int:
    """Open a file; a fifo that nobody writes to would wait for ever."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def toml_value(value: Any) -> str:
    """Return a value of a key as it stands in a file: numbers in full, texts without control characters."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    return repr(value)


def toml_lines(given: Mapping[str, Any], path: str = "") -> list[str]:
    """Return tables as the lines of a file; a key without a value (None) is left out."""
    keys = {key: value for key, value in given.items() if value is not None}
    lines = [f"{key} = {toml_value(value)}" for key, value in keys.items() if not isinstance(value, dict)]
    for key, value in keys.items():
        if isinstance(value, dict):
            lines += ["", f"[{path}{key}]", *toml_lines(value, f"{path}{key}.")]
    return lines
