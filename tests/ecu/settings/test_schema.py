"""The JSON schema: every key described, every number with a unit, every shipped configuration valid by it."""

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ecu import cli
from ecu.settings.schema import config_schema

CONFIGS = Path(__file__).parents[3] / "config"
SCHEMA = config_schema()
MIXED = {"coefficients", "numbers", "low", "high", "factor", "below", "above"}
"""Numbers of several units in a list, and logarithms of counts."""


def keys() -> Iterator[tuple[str, dict[str, Any]]]:
    for table in (SCHEMA, *SCHEMA["$defs"].values()):
        yield from table["properties"].items()


@pytest.mark.parametrize(
    ("name", "key"), [*keys()], ids=lambda value: value if isinstance(value, str) else ""
)
def test_a_key_is_described_and_a_number_has_a_unit(name: str, key: dict[str, Any]) -> None:
    kinds = [key, *key.get("anyOf", [])]
    number = any(kind.get("type") in ("number", "integer", "array") for kind in kinds)
    described = "description" in key or name in MIXED or name == "pad" or name == "dust" or name == "model"
    assert described, name
    if number and name not in MIXED:
        assert any("unit" in kind for kind in kinds), name


def bounded(kind: dict[str, Any]) -> bool:
    return bool(
        {"minimum", "exclusiveMinimum"} & kind.keys() and {"maximum", "exclusiveMaximum"} & kind.keys()
    )


def test_every_number_has_a_least_and_a_greatest_value() -> None:
    open_ended = {
        name
        for name, key in keys()
        for kind in (key, *key.get("anyOf", []), key.get("items", {}))
        if kind.get("type") in ("number", "integer") and not bounded(kind)
    }
    assert open_ended == set()


def test_the_command_prints_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["config", "schema"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == SCHEMA
    mass = printed["$defs"]["Vehicle"]["properties"]["mass"]
    assert (mass["unit"], mass["exclusiveMinimum"], mass["description"]) == ("kg", 200, "As driven. [kg]")


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_configurations_have_only_keys_of_the_schema(path: Path) -> None:
    def check(content: dict[str, Any], table: dict[str, Any]) -> None:
        assert set(content) <= set(table["properties"])
        for name, value in content.items():
            if isinstance(value, dict):
                key = table["properties"][name]
                refs = [
                    one["$ref"]
                    for one in (key, *key.get("anyOf", []), *key.get("allOf", []))
                    if "$ref" in one
                ]
                check(value, SCHEMA["$defs"][refs[0].rpartition("/")[2]])

    check(tomllib.loads(path.read_text("utf-8")), SCHEMA)
