"""Lining file of an identified law, which the simulated vehicle and the rig read."""

import os
from pathlib import Path
from typing import Any

from brakelab.identify.friction.choice import Identified
from brakelab.identify.friction.columns import Columns
from brakelab.plant.description import read_file
from brakelab.plant.friction.own import Own
from brakelab.plant.linings import Disc, Linings

CHOSEN = "SIM"
"""Name under which a vehicle file finds the law that was chosen."""


def write_lining(path: Path, columns: Columns, heating: float, identified: Identified) -> Linings:
    """Write the file and return its contents as read back: the brake, the disc and all laws.

    `heating` [K/J] is used where `columns` gives none. The law that was chosen is called SIM, and there is
    each law under its own name.
    """
    given = columns.disc.model_dump()
    disc = Disc(**(given | {"heating": given["heating"] or heating}))
    low, high = identified.temperature
    lines = [
        f"# Identified by `brake-ecu identify friction` from {identified.stops} stops: "
        f"{low:.0f} to {high:.0f} °C, "
        f"{1e-5 * identified.pressure[0]:.0f} to {1e-5 * identified.pressure[1]:.0f} bar.",
        f"# SIM is {identified.chosen.name}. Beyond the data: {identified.chosen.extrapolates}.",
    ]
    head = f"lining.{_key(columns.name)}"
    for title, section in (("brake", columns.brake), ("disc", disc)):
        lines += ["", f"[{head}.{title}]", *_entries(section.model_dump())]
    for name, judged in [(CHOSEN, identified.chosen), *((law.name, law) for law in identified.laws)]:
        given = judged.law.model_dump()
        if isinstance(judged.law, Own) and judged.law.code.endswith(".py"):
            given["code"] = Path(os.path.relpath(judged.law.code, path.parent)).as_posix()
        lines += ["", f"[{head}.friction.{_key(name)}]", *_entries(given)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return read_file(path, Linings)


def _key(name: str) -> str:
    return '"' + name.replace("\\", "").replace('"', "") + '"'


def _entries(values: dict[str, Any]) -> list[str]:
    return [f"{name} = {_toml(value)}" for name, value in values.items()]


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return _key(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(_toml(each) for each in value)}]"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{_key(name)} = {_toml(each)}' for name, each in value.items())} }}"
    return repr(float(value))
