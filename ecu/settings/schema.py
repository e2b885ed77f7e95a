"""`brake-ecu config schema`: the JSON schema of CONFIG files, with units and descriptions, for editors."""

import json
from typing import Any

from ecu.output import give, policy
from ecu.settings.sections import Config


def schema() -> None:
    """Print the schema."""
    give(**(found := config_schema()))
    if not policy().json:  # it is printed as it was given
        print(json.dumps(found, indent=1, ensure_ascii=False))


def config_schema() -> dict[str, Any]:
    """Return the schema; `include`, which is resolved before the keys are checked, stands in it too."""
    found = Config.model_json_schema()
    described(found)
    found["properties"]["include"] = {
        "type": "string",
        "description": "File beside this one, or shipped one (suv, …), with what this one does not give.",
    }
    return found


def described(node: Any) -> None:
    """Put the unit of every key of a schema at the end of its description, where editors show it."""
    if isinstance(node, list):
        for one in node:
            described(one)
    if not isinstance(node, dict):
        return
    for one in node.values():
        described(one)
    for name, key in node.get("properties", {}).items():
        units = [part["unit"] for part in (key, *key.get("anyOf", [])) if "unit" in part]
        if units and units[0] != "-":
            key["unit"] = units[0]
            key["description"] = f"{key.get('description', name)} [{units[0]}]"
