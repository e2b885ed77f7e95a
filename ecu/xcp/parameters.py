"""The keys of a CONFIG as one record: what a master reads, and calibrates, of what a run goes by.

Its fields are those of the schema (`ecu/settings/schema.py`): numbers as float64, whole ones too, true and
false as 0 and 1, a word as its place among those allowed. A key that is not given, and what of a list is not,
is NaN; a word that is not given is 255. Names are left out.

The numbers of `CALIBRATED` may be written: how the ECU judges its sensors, estimates, brakes and blends. What
the car and its brakes are may not: what was learned belongs to them. Nor may what a word or a truth value
switches: what the other kind would remember of the drive is missing.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

from ecu.contract.records import RecordArray, new_record
from ecu.settings.schema import config_schema

NO_WORD: Final = 255
CALIBRATED: Final = ("sensors", "observer", "control", "blending")
"""Tables of CONFIG."""


class Parameter(NamedTuple):
    """One key with a value."""

    key: str
    """With its tables: front.pad.area."""
    length: int
    """Of a list at most, 0: one value."""
    unit: str
    low: float | None
    high: float | None
    """Limits, None: none; of a list those of each value."""
    meaning: str
    texts: tuple[str, ...]
    """Words that are allowed, empty: a number."""

    @property
    def writable(self) -> bool:
        """Return whether a master may calibrate it."""
        return not self.texts and self.key.partition(".")[0] in CALIBRATED


@cache
def parameters() -> tuple[Parameter, ...]:
    """Return every key of a CONFIG that is no name."""
    schema = config_schema()
    return tuple(_of_table(schema, schema, ""))


def _of_table(schema: dict[str, Any], table: dict[str, Any], path: str) -> Iterator[Parameter]:
    for name, key in table["properties"].items():
        for one in (key, *key.get("anyOf", [])):
            if "$ref" in one:
                inner = schema["$defs"][one["$ref"].rpartition("/")[2]]
                yield from _of_table(schema, inner, f"{path}{name}.")
            elif "type" in one and one["type"] != "null" and ("enum" in one or one["type"] != "string"):
                yield _of_key(f"{path}{name}", one, key)


def _of_key(key: str, one: dict[str, Any], described: dict[str, Any]) -> Parameter:
    value = one["items"] if one["type"] == "array" else one
    texts = ("false", "true") if one["type"] == "boolean" else tuple(one.get("enum", ()))
    unit = described.get("unit", one.get("unit", "-"))
    meaning = " ".join(described.get("description", "").split())
    if texts:
        return Parameter(key, 0, unit, 0.0, len(texts) - 1.0, meaning, texts)
    low = value.get("minimum", value.get("exclusiveMinimum"))
    high = value.get("maximum", value.get("exclusiveMaximum"))
    return Parameter(key, one.get("maxItems", 0), unit, low, high, meaning, ())


PARAMETERS: Final = np.dtype(
    [
        (one.key, "u1") if one.texts else (one.key, "f8", (one.length,)) if one.length else (one.key, "f8")
        for one in parameters()
    ],
    align=True,
)


def to_record(given: Mapping[str, Any]) -> RecordArray:
    """Return a configuration, as `Config.model_dump` gives it, as `PARAMETERS`, shape (1,)."""
    record = new_record(PARAMETERS)
    for one in parameters():
        value = _value(given, one.key)
        if one.texts:
            word = str(value).lower() if isinstance(value, bool) else value
            record[one.key] = NO_WORD if value is None else one.texts.index(word)
        elif one.length:
            values = value or []
            record[one.key] = [*values, *[np.nan] * (one.length - len(values))]
        else:
            record[one.key] = np.nan if value is None else value
    return record


def tables_of(record: RecordArray, given: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the tables of `CALIBRATED` as `given`, with the numbers of `record` (PARAMETERS, shape (1,)).

    A list ends before its last NaNs; NaN for a key that is not given is none. Any other NaN stays, and is a
    mistake for who checks them.
    """
    tables: dict[str, dict[str, Any]] = {name: dict(given[name]) for name in CALIBRATED}
    for one in parameters():
        table, _, name = one.key.partition(".")
        if one.writable:
            value = record[one.key][0].tolist()
            while one.length and value and np.isnan(value[-1]):
                value.pop()
            absent = not one.length and np.isnan(value) and tables[table][name] is None
            tables[table][name] = None if absent else value
    return tables


def _value(given: Mapping[str, Any], key: str) -> Any:
    found: Any = given
    for name in key.split("."):
        found = None if found is None else found[name]
    return found
