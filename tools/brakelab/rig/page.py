"""The rig's outcomes as a page, as tables on disk and as one on the terminal."""

import math
from importlib.resources import files
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rich.table import Table

from brakelab.report.page import Tile, fill, fixed, percent, signed_percent
from brakelab.rig.live import Bus
from brakelab.rig.outcome import Outcome
from brakelab.rig.reaction import Reaction
from ecu import __version__
from ecu.settings.config import Config, config_hash

NAMED: Final = 3
"""Scenarios whose names are listed; more are counted."""


def bits_text(reaction: Reaction) -> str:
    """Return the fault bits raised, with their delays in ms."""
    return ", ".join(f"{name} {after:.0f}" for name, after in reaction.bits) or "none"


def passed_text(outcome: Outcome) -> str:
    """Return whether the scenario's expectations were met."""
    failed = sum(not verdict.passed for verdict in outcome.verdicts)
    if not outcome.verdicts:
        return "none"
    return f"{failed} of {len(outcome.verdicts)} failed" if failed else "passed"


def summary(outcomes: list[Outcome]) -> Table:
    """Return the outcomes as a table for the terminal."""
    table = Table(box=None, pad_edge=False)
    table.add_column("scenario", no_wrap=True)
    for name in ("s", "decel error", "friction nRMSE", "stop m", "vs sound", "missed", "frames lost"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("faults")
    for one in outcomes:
        seen = [f"{reaction.kind}: {bits_text(reaction)}" for reaction in one.reactions]
        table.add_row(
            one.scenario,
            fixed(one.seconds, 1),
            fixed(one.decel_error, 2),
            f"{percent(one.nrmse_front, 1)} / {percent(one.nrmse_rear, 1)} %",
            fixed(one.stopping_distance, 1),
            signed_percent(one.longer, 1),
            str(one.missed),
            str(one.frames.lost),
            "; ".join([*seen, *(f"unexplained: {name}" for name in one.unexplained)]),
        )
    return table


def by_the_car(outcomes: list[Outcome]) -> list[str]:
    """Return the fault bits that the car's linings account for, each once with its scenarios."""
    scenarios_of: dict[str, list[str]] = {}
    for one in outcomes:
        for line in one.of_linings:
            scenarios_of.setdefault(line, []).append(one.scenario)
    where = {
        line: ", ".join(names) if len(names) <= NAMED else f"{len(names)} of {len(outcomes)}"
        for line, names in scenarios_of.items()
    }
    return [f"by the car, in {scenarios}: {line}" for line, scenarios in where.items()]


def write_tables(outcomes: list[Outcome], out: Path) -> None:
    """Write `scenarios.parquet` and `faults.parquet`: one row per scenario, one per injected fault."""
    flat = (
        "scenario", "seconds", "brakings", "decel_error", "nrmse_front", "nrmse_rear", "stopping_distance",
        "undisturbed", "longer", "differing", "cycles", "missed",
    )  # fmt: skip
    rows = [
        {name: getattr(one, name) for name in flat}
        | {f"frames_{name}": value for name, value in one.frames._asdict().items()}
        | {f"lateness_{name}_us": value for name, value in one.lateness._asdict().items()}
        | {"unexplained": ", ".join(one.unexplained), "of_linings": "; ".join(one.of_linings)}
        | {"expected": len(one.verdicts), "failed": "; ".join(v.line for v in one.verdicts if not v.passed)}
        for one in outcomes
    ]
    pq.write_table(pa.Table.from_pylist(rows), out / "scenarios.parquet")
    injected = [
        {"scenario": one.scenario} | reaction._asdict() | {"bits": bits_text(reaction)}
        for one in outcomes
        for reaction in one.reactions
    ]
    if injected:
        pq.write_table(pa.Table.from_pylist(injected), out / "faults.parquet")


def _tiles(outcomes: list[Outcome], live: bool) -> list[Tile]:
    disturbed = sum(bool(one.reactions) for one in outcomes)
    tiles = [Tile("Scenarios", str(len(outcomes)), "", f"{disturbed} with injected faults")]
    worst = max(outcomes, key=lambda one: np.nan_to_num(one.decel_error, nan=-1.0))
    if not math.isnan(worst.decel_error):
        note = f"largest in settled braking: {worst.scenario}"
        tiles.append(Tile("Deceleration error", fixed(worst.decel_error, 2), "m/s²", note))
    longest = max(outcomes, key=lambda one: np.nan_to_num(one.longer, nan=-1.0))
    if not math.isnan(longest.longer):
        more = signed_percent(longest.longer, 1)
        tiles.append(Tile("Stopping distance", more, "%", f"longest by faults: {longest.scenario}"))
    count = sum(len(one.unexplained) for one in outcomes)
    note = "by no injected fault"
    tiles.append(Tile("Unexplained faults", str(count), "", note, count > 0))
    verdicts = [verdict for one in outcomes for verdict in one.verdicts]
    if verdicts:
        failed = sum(not verdict.passed for verdict in verdicts)
        note = f"of {len(verdicts)}"
        tiles.append(Tile("Failed expectations", str(failed), "", note, failed > 0))
    if live:
        missed = sum(one.missed for one in outcomes)
        note = f"of {sum(one.cycles for one in outcomes)}"
        tiles.append(Tile("Missed periods", str(missed), "", note, missed > 0))
    return tiles


def write_page(outcomes: list[Outcome], bus: Bus | None, config: Config, cars: str, seed: int) -> str:
    """Return the page, of the simulated `cars`; it needs no other file but links to reports beside it."""
    content = {
        "outcomes": outcomes,
        "tiles": _tiles(outcomes, bus is not None),
        "bits_text": bits_text,
        "passed_text": passed_text,
        "by_the_car": by_the_car(outcomes),
        "live": bus is not None,
        "controller": bus is not None and bus.wire is not None,
        "facts": [
            ("Vehicle", config.name),
            ("Simulated car", cars),
            ("Configuration", config_hash(config)[:12]),
            ("Observer", config.observer.kind),
            ("Seed", str(seed)),
            ("Bus", bus.why if bus else "in memory, lock-step"),
            ("brake-ecu", __version__),
        ],
        "isinf": math.isinf,
    }
    return fill({}, content, files("brakelab.rig") / "page.html.j2")
