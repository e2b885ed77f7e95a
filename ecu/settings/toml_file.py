"""Reading TOML that a person wrote: what is wrong is one line that names the file, the key and the remedy."""

import tomllib
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from ecu.errors import UserError


class Section(BaseModel):
    """A table of a TOML file: no key but those it knows, no value but of the kind it has."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


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
    "too_short": "give at least {min_length} values",
    "too_long": "give at most {max_length} values",
    "value_error": "{error}",
}
"""Allowed values, by pydantic's kind of finding."""


def describe(error: ValidationError, where: str) -> UserError:
    """Turn the first finding of pydantic into one line with the key's path."""
    finding = error.errors(include_url=False)[0]
    place = ".".join(str(part) for part in finding["loc"])
    more = error.error_count() - 1
    if finding["type"] == "missing":
        remedy = "missing; add this key"
    elif finding["type"] == "extra_forbidden":
        remedy = "unknown key; remove it or correct its spelling"
    else:
        wanted = _WANTED.get(finding["type"], finding["msg"]).format(**finding.get("ctx", {}))
        one_value = place and not isinstance(finding["input"], dict)
        remedy = f"{wanted} (found {finding['input']!r})" if one_value else wanted
    return UserError(where, place, remedy + (f" ({more} more findings)" if more else ""))


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; what cannot be read is one line."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(str(path), "", "no such file") from None
    except IsADirectoryError:
        raise UserError(str(path), "", "is a folder; give a TOML file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(str(path), "", f"cannot be read as text: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise UserError(str(path), "", f"not valid TOML: {error}") from None
