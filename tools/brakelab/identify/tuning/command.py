"""Tuning of Observer 2's noise by a genetic algorithm (`brake-ecu tune`; thesis, section 6.2.1)."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from brakelab.identify.tuning.recording import (
    Errors,
    Recording,
    drive_errors,
    drive_once,
    mean_errors,
    recording,
)
from brakelab.identify.tuning.replay import replay_errors
from brakelab.identify.tuning.search import RANGES, Best, search
from brakelab.results.console import new_console
from brakelab.results.outputs import check_outputs, config_files, write_text
from brakelab.results.progress import progress_bar
from brakelab.results.text_table import Table, show
from brakelab.simulation.configured import with_observer
from brakelab.simulation.scenario import Scenario, load_scenario
from ecu import __version__
from ecu.errors import UserError
from ecu.output import give, say
from ecu.settings.config import Config, config_hash, load_config

FIRST_SESSION: Final = ("fixed-pedal", "bursts")
"""Section 6.2.1, calibration."""
LATER_SESSIONS: Final = ("fixed-decel", "fade")
"""Sections 6.2.2 and 6.2.3, validation."""
TABLE_6_1: Final = "12.7 to 7.6 % in front (40 % less), 20.8 to 16.1 % at the rear (22 % less)"
"""Means over its six runs."""


class Budget(NamedTuple):
    """Length of the search, and its seed."""

    generations: int
    population: int
    seed: int


class Row(NamedTuple):
    """One session with the initial tuning and with the one found."""

    session: str
    before: Errors
    after: Errors


def tune(
    config: Path, trained: Sequence[Path], validated: Sequence[Path], seeds: int, budget: Budget, out: Path
) -> None:
    """Tune Observer 2 on `trained` with cars 0 to `seeds` - 1, validate it with as many others, write `out`.

    Validation is in closed loop, over `trained` and `validated`. After Ctrl-C the best tuning so far is
    written.

    Raises:
        UserError: a file cannot be read, is wrong, or cannot be written; a scenario never brakes.
    """
    check_outputs(out, (out,), [*config_files(config), *trained, *validated], toml=True)
    manual = with_observer(load_config(config), kind="observer2")
    scenarios = {path: load_scenario(path) for path in (*trained, *validated)}
    recordings = record_drives(manual, {path: scenarios[path] for path in trained}, range(seeds))
    before, generations, best = find_tuning(manual, recordings, budget)
    names = " + ".join(dict.fromkeys(path.stem for path in trained))
    rows = [Row(f"{names}, tuned on", before, best.errors)]
    if generations == budget.generations:
        rows += _validate(manual, best.config, scenarios, range(seeds, 2 * seeds))
    of = (
        f"version {__version__}, {config.name} ({config_hash(manual)[:12]}), cars 0–{seeds - 1}, "
        f"{generations} generations of {budget.population}, seed {budget.seed}"
    )
    _write(out, of, rows, best.config)
    _tell(out, of, rows, seeds)


def record_drives(config: Config, scenarios: Mapping[Path, Scenario], cars: range) -> list[Recording]:
    """Drive every scenario with every car. Raises UserError for a scenario that never brakes."""
    recordings = []
    with progress_bar("record", len(scenarios) * len(cars)) as advance:
        for path, scenario in scenarios.items():
            for car in cars:
                recordings.append(recording(drive_once(scenario, config, car)))
                if not (recordings[-1].braking >= 0).any():
                    raise UserError(
                        str(path), "", "has no brake application above 15 km/h of a second or more; add one"
                    )
                advance(1.0)
    return recordings


def find_tuning(manual: Config, recordings: list[Recording], budget: Budget) -> tuple[Errors, int, Best]:
    """Return the errors of `manual`, the number of generations until Ctrl-C, and the best tuning."""
    start = Best(manual, replay_errors(recordings, [manual])[0])
    generations, best = 0, start
    with progress_bar("tune", budget.generations) as advance:
        try:
            for found in search(start, lambda trials: replay_errors(recordings, trials), *budget):
                generations, best = generations + 1, found
                advance(1.0)
        except KeyboardInterrupt:
            pass
    return start.errors, generations, best


def _validate(
    manual: Config, tuned: Config, scenarios: Mapping[Path, Scenario], cars: range
) -> Iterator[Row]:
    """Yield a row a scenario until all are driven or Ctrl-C."""
    with progress_bar("validate", 2 * len(scenarios) * len(cars)) as advance:

        def errors(scenario: Scenario, config: Config, car: int) -> Errors:
            found = drive_errors(drive_once(scenario, config, car))
            advance(1.0)
            return found

        try:
            for path, scenario in scenarios.items():
                before, after = (
                    mean_errors([errors(scenario, config, car) for car in cars]) for config in (manual, tuned)
                )
                yield Row(f"{path.stem}, other cars", before, after)
        except KeyboardInterrupt:
            return


def _write(out: Path, of: str, rows: Sequence[Row], config: Config) -> None:
    figures = [
        f"#   {row.session}: {row.before.nrmse[0]:.2f}, {row.before.nrmse[1]:.2f} -> "
        f"{row.after.nrmse[0]:.2f}, {row.after.nrmse[1]:.2f}"
        for row in rows
    ]
    lines = [
        f"# Observer 2 by `brake-ecu tune`, {of}.",
        f'# A CONFIG beside it takes what it does not set itself: include = "{out.name}"',
        "# nRMSE of friction [%], front and rear, before -> after:",
        *figures,
        "",
        "[observer]",
        f'kind = "{config.observer.kind}"',
        *(f"{key} = {getattr(config.observer, key)!r}" for key in RANGES),
    ]
    write_text(out, "\n".join(lines) + "\n")


def _tell(out: Path, of: str, rows: Sequence[Row], seeds: int) -> None:
    lines = []
    for row in rows:
        gains = [
            f"{before:.2f} → {after:.2f} ({100.0 * (after / before - 1.0):+.0f} %)"
            for before, after in zip(row.before.nrmse, row.after.nrmse, strict=True)
        ]
        inside = (*row.before.inside_2_sigma, *row.after.inside_2_sigma)
        lines.append((row.session, *gains, "{:.0f}, {:.0f} → {:.0f}, {:.0f}".format(*inside)))
    columns = ("session", "front, manual → tuned", "rear, manual → tuned", "truth inside 2σ [%]")
    below = (
        f"Means over brake applications and {seeds} cars; other cars: none of those that were tuned on, in "
        f"closed loop. The thesis on a car of its own, Table 6.1: {TABLE_6_1}."
    )
    console = new_console()
    console.print(f"brake-ecu tune, {of}", highlight=False)
    show(console, Table("Friction by Observer 2: nRMSE [%]", columns, lines, below))
    console.print(f"written: {out}", highlight=False)
    give(written=[out], sessions=rows)
    say(f'next: brake-ecu replay LOG --config CAR.toml --out drive.parquet, CAR.toml with include = "{out}"')
