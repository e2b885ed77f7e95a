"""Reference of every key of configurations, signal maps and scenarios, from the models that read them.

    python tools/write_reference.py

writes docs/reference-*.md, with unit, range, default and meaning of each key, docs/contract.md,
docs/requirements.md, the tables of docs/diagnostics.md and docs/xcp.md, and layouts in tools/deploy.
"""

import math
from pathlib import Path
from typing import Any, Final, NamedTuple

from pydantic import BaseModel

from brakelab.logs.column_map import ColumnMap
from brakelab.simulation.scenario import Scenario
from columns_page import PAGE as COLUMNS
from columns_page import columns_text
from contract_page import contract_text
from diagnostics_tables import PAGE as DIAGNOSTICS
from diagnostics_tables import with_tables
from ecu.bus.signal_map import SignalMap
from ecu.contract.signals import INPUT_SIGNALS, without_corner
from ecu.settings.schema import config_schema
from ecu.settings.sections import Config
from layouts import FOXGLOVE, PLOTJUGGLER, foxglove_text, plotjuggler_text
from requirements_page import PAGE as REQUIREMENTS
from requirements_page import requirements_text
from xcp_tables import PAGE as XCP
from xcp_tables import with_xcp_tables

DOCS: Final = Path(__file__).parent.parent / "docs"
REPEATED: Final = {"rear": "front"}
"""Tables whose keys are those of another one."""


class Page(NamedTuple):
    """One page of the reference."""

    title: str
    text: str
    model: type[BaseModel]
    second: tuple[str, type[BaseModel]] | None = None
    """Heading and model of another kind of this file."""


PAGES: Final = {
    "reference-config.md": Page(
        "Keys of a configuration",
        "A CONFIG file describes one vehicle: `run`, `replay`, `simulate` and others take it with `--config`."
        " `brake-ecu config new` writes one from a data sheet, `config check` lists its mistakes,"
        " `config schema` is this page for editors. Complete example: `config/suv.toml`.",
        Config,
    ),
    "reference-maps.md": Page(
        "Keys of a signal map",
        "A MAP says which signal of a database, or which column of a signal file, is which input of the ECU:"
        " [signal-maps.md](signal-maps.md). Complete examples: `config/maps/`.",
        SignalMap,
        ("Keys of a map of columns", ColumnMap),
    ),
    "reference-scenarios.md": Page(
        "Keys of a scenario",
        "A SCENARIO describes a car, a road and a driver: [scenarios.md](scenarios.md). Complete examples:"
        " `config/scenarios/`.",
        Scenario,
    ),
}
HEAD: Final = ["| key | unit | values | default | meaning |", "| --- | --- | --- | --- | --- |"]


def page_text(name: str) -> str:
    """Return a page of the reference."""
    page = PAGES[name]
    schema = config_schema() if page.model is Config else page.model.model_json_schema()
    lines = [
        f"# {page.title}",
        "",
        page.text,
        "",
        "Written by `python tools/write_reference.py` from the models that read these files.",
        "",
        *_table(schema, schema, ""),
    ]
    if page.second:
        heading, model = page.second
        schema = model.model_json_schema()
        below = [line.replace("## `", "### `") for line in _table(schema, schema, "")]
        lines += ["", f"## {heading}", "", *below, *_inputs()]
    return "\n".join(lines).rstrip("\n") + "\n"


def _table(schema: dict[str, Any], node: dict[str, Any], path: str) -> list[str]:
    """Return the keys of a table, and after them its own tables."""
    lines, below = list(HEAD), []
    for name, key in node["properties"].items():
        inner, shown = _inner(schema, key, f"{path}.{name}".lstrip("."))
        if inner and name in REPEATED:
            lines.append(f"| `{name}` | | table | {_default(node, name, key)} | as `{REPEATED[name]}` |")
            continue
        meaning = _meaning(key, inner)
        lines.append(
            f"| `{name}` | {_unit(key)} | {_values(key)} | {_default(node, name, key)} | {meaning} |"
        )
        if inner:
            also = "".join(f", `[{one}]`" for one, same in REPEATED.items() if same == name)
            inside = shown.strip("`[]")
            below += ["", f"## {shown}{also}", "", *_described(inner), *_table(schema, inner, inside)]
    return [*lines, *below]


def _inner(schema: dict[str, Any], key: dict[str, Any], path: str) -> tuple[dict[str, Any] | None, str]:
    """Return the table that a key holds, one or several, and how its heading is written in TOML."""
    for one in (key, *key.get("anyOf", []), *key.get("allOf", [])):
        for part, shown in (
            (one, f"`[{path}]`"),
            (one.get("items", {}), f"`[[{path}]]`"),
            (one.get("additionalProperties") or {}, f"`[{path}.NAME]`"),
        ):
            if isinstance(part, dict) and "$ref" in part:
                return schema["$defs"][part["$ref"].rpartition("/")[2]], shown
    return None, ""


def _described(table: dict[str, Any]) -> list[str]:
    text = table.get("description", "")
    return [_flat(text), ""] if text else []


def _unit(key: dict[str, Any]) -> str:
    units = [one["unit"] for one in (key, *key.get("anyOf", [])) if "unit" in one]
    return units[0] if units else ""


def _values(key: dict[str, Any]) -> str:
    found = [_value(one) for one in key.get("anyOf", [key]) if one.get("type") != "null"]
    return " or ".join(dict.fromkeys(one for one in found if one))


def _value(key: dict[str, Any]) -> str:
    if "enum" in key:
        return ", ".join(f'"{one}"' for one in key["enum"])
    if "const" in key:
        return f'"{key["const"]}"'
    if "$ref" in key:
        return "table"
    kind = key.get("type", "")
    if kind == "array":
        items = [_value(one) for one in key.get("prefixItems", [])] or [_value(key.get("items", {}))]
        least, most = key.get("minItems", 0), key.get("maxItems", math.inf)
        if "prefixItems" in key:
            return f"[{'; '.join(items)}]" if "," in items[0] else f"[{', '.join(items)}]"
        count = f", {least}" if least == most else f", {least} to {most}" if most < math.inf else ""
        return f"list of {items[0]}{count} of them" if count else f"list of {items[0]}"
    if kind == "object":
        return "tables" if "$ref" in key["additionalProperties"] else "table"
    if kind in ("number", "integer"):
        bounds = (
            ("> ", "exclusiveMinimum"),
            ("≥ ", "minimum"),
            ("< ", "exclusiveMaximum"),
            ("≤ ", "maximum"),
        )
        shown = ", ".join(f"{sign}{key[name]:g}" for sign, name in bounds if name in key)
        whole = "whole number" if kind == "integer" else "number"
        return f"{whole} {shown}".strip() if kind == "integer" or not shown else shown
    return {"string": "text", "boolean": "true, false"}.get(kind, kind)


def _default(table: dict[str, Any], name: str, key: dict[str, Any]) -> str:
    if name in table.get("required", []):
        return "**needed**"
    given = key.get("default")
    if given in (None, "", [], {}) or isinstance(given, dict):
        return ""
    if isinstance(given, float) and math.isinf(given):
        return "never" if given > 0 else "none"
    if isinstance(given, bool):
        return str(given).lower()
    if isinstance(given, list | tuple):
        return str(given).replace("'", '"')
    return (
        f"{given:g}" if isinstance(given, float) else f'"{given}"' if isinstance(given, str) else str(given)
    )


def _meaning(key: dict[str, Any], inner: dict[str, Any] | None) -> str:
    text = _flat(key.get("description") or (inner or {}).get("description", ""))
    unit = _unit(key)
    for suffix in (f" [{unit}]", f", {unit}.", ", -."):
        if unit and text.endswith(suffix):
            text = text.removesuffix(suffix).rstrip(".") + "."
    return text.replace("|", "\\|")


def _flat(text: str) -> str:
    return " ".join(text.split())


def _inputs() -> list[str]:
    """Return the inputs of the ECU as a table; a wheel's is named once."""
    lines = ["", "## Inputs", "", "`_*` stands for `_fl`, `_fr`, `_rl` and `_rr`.", ""]
    lines += ["| input | unit | range | time-out, s |", "| --- | --- | --- | --- |"]
    rows: dict[str, str] = {}
    for signal in INPUT_SIGNALS:
        stem = without_corner(signal.name)
        name = stem if stem == signal.name else f"{stem}_*"
        shown = f"| `{name}` | {signal.unit} | {signal.low:g} to {signal.high:g} | {signal.timeout_s:g} |"
        rows.setdefault(name, shown)
    return [*lines, *rows.values()]


if __name__ == "__main__":
    for name in PAGES:
        (DOCS / name).write_text(page_text(name), "utf-8")
        print(DOCS / name)
    for page, text in (
        (DOCS / "contract.md", contract_text()),
        (COLUMNS, columns_text()),
        (REQUIREMENTS, requirements_text()),
        (FOXGLOVE, foxglove_text()),
        (PLOTJUGGLER, plotjuggler_text()),
    ):
        page.write_text(text, "utf-8")
        print(page)
    for page, with_its_tables in ((DIAGNOSTICS, with_tables), (XCP, with_xcp_tables)):
        page.write_text(with_its_tables(page.read_text("utf-8")), "utf-8")
        print(page)
