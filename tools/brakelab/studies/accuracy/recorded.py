"""Recorded cars: what the observer predicts of brake applications that somebody drove.

No recording has a friction truth; each brake application is predicted from its pressures and from what was
known before it. The Mustang's drive is replayed several times with one state, as a car that drives on would.
"""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

import numpy as np

from brakelab.replay.command import Replayed, replay_into
from brakelab.replay.summary import errors_of, judged, peers
from brakelab.results.brakes import LEARNED, BrakeRow
from brakelab.results.prediction import Errors, errors
from brakelab.results.text_table import Table
from brakelab.results.verdict import Goal, verdict
from brakelab.studies.study import Asked, Measured, Study
from ecu.contract.signals import CORNERS
from ecu.errors import UserError
from ecu.settings.resources import resource

PASSES: Final = 3
WORSE: Final = 2.0  # percentage points by which no pass may be worse than the first
SIGMAS: Final = 2.0
FOLDER: Final = Path("tests/data")
MUSTANG: Final = "mustang-drive.log.gz"
OTHERS: Final = (
    ("Toyota RAV4", "rav4.log", "rav4", "2 s, the cruise control brakes a little; pressure in counts"),
    ("Hyundai Kona EV", "kona.log", "kona", "1.5 s at a standstill, invalid flags go away; two buses"),
)
"""Car, file, name of its map, what is in it."""


class Pass(NamedTuple):
    """One pass of the drive: its brake applications that count, a row of one corner each."""

    rows: list[BrakeRow]

    @property
    def off(self) -> Errors:
        """Errors of the predictions."""
        return errors_of(self.rows)

    @property
    def measured(self) -> list[float]:
        """Mean specific forces [m/s^2]."""
        return [row.specific_force_mean for row in self.rows]

    @property
    def distances(self) -> list[float]:
        """Predicted less measured, in standard deviations of what was said."""
        return [
            (row.specific_force_predicted - row.specific_force_mean) / row.sigma_specific_force
            for row in self.rows
        ]


def drive_passes(log: Path, car: str, count: int) -> list[Pass]:
    """Replay a log several times with one state. Raises UserError if it is not there."""
    passes = []
    with TemporaryDirectory(prefix="brake-ecu-recorded-") as folder:
        for number in range(count):
            done = _replay(log, car, car, Path(folder, f"{number}.parquet"), Path(folder, "state"))
            passes.append(Pass(judged(done.writer.brakes.rows)))
    return passes


def _replay(log: Path, config: str, map: str, out: Path, state: Path | None) -> Replayed:
    if not log.exists():
        raise UserError(str(log), "no such file", "measure it in a checkout, which has the recordings")
    return replay_into(
        [log], resource(f"config/{config}.toml"), resource(f"config/maps/{map}.toml"), None, state, out
    )


def application_table(passes: Sequence[Pass]) -> Table:
    """Return a line for each brake application of each pass."""
    lines = []
    for number, one in enumerate(passes, 1):
        for row, distance in zip(one.rows, one.distances, strict=True):
            error = 100.0 * (row.specific_force_predicted / row.specific_force_mean - 1.0)
            lines.append(
                (
                    str(number),
                    f"{row.t_start:.1f}",
                    f"{3.6 * row.v_in:.0f} → {3.6 * row.v_end:.0f}",
                    f"{row.specific_force_mean:.2f}",
                    f"{row.specific_force_predicted:.2f} ± {row.sigma_specific_force:.2f}",
                    f"{error:+.1f}",
                    f"{distance:+.2f}",
                    verdict(Goal("", abs(distance), SIGMAS)),
                )
            )
    return Table(
        "Ford Mustang: each brake application",
        ("pass", "at s", "km/h", "measured m/s²", "predicted m/s²", "error %", "σ", f"goal ±{SIGMAS:g} σ"),
        lines,
        "Specific force, mean over the brake application; predicted by the friction known before it. σ: "
        "predicted less measured, in standard deviations of what was predicted.",
    )


def pass_table(passes: Sequence[Pass]) -> Table:
    """Return a line for each pass, beside other predictors of the same brake applications."""
    first = 100.0 * passes[0].off.mean
    lines = []
    for number, one in enumerate(passes, 1):
        others = [100.0 * errors(one.measured, other).mean for other in peers(one.rows).values()]
        mean = 100.0 * one.off.mean
        lines.append(
            (
                str(number),
                str(one.off.counted),
                f"{mean:.1f}",
                f"{100.0 * one.off.worst:.1f}",
                f"{100.0 * one.off.bias:+.1f}",
                *(f"{other:.1f}" for other in others),
                verdict(Goal("", mean, first + WORSE)),
            )
        )
    return Table(
        "Ford Mustang: one state kept over the passes [%]",
        (
            *("pass", "brake applications", "mean error", "worst", "bias"),
            *("configured friction", "running average", "one scale in hindsight"),
            f"goal: first + {WORSE:g}",
        ),
        lines,
        "Errors of the predicted specific force. The other predictors begin anew with each pass.",
    )


def other_table(folder: Path) -> Table:
    """Return a line for each recording that has next to nothing to be learned from."""
    lines = []
    for car, file, name, what in OTHERS:
        with TemporaryDirectory(prefix="brake-ecu-recorded-") as out:
            done = _replay(folder / file, "suv", name, Path(out, "out.parquet"), None)
        rows = done.writer.brakes.rows
        moved = max((abs(row.mu_b_end / row.mu_b_before - 1.0) for row in rows), default=0.0)
        taught = sum(row.learning == LEARNED for row in rows[:: len(CORNERS)])
        lines.append((car, what, str(done.writer.rows), str(taught), f"{100.0 * np.nan_to_num(moved):.1f}"))
    return Table(
        "Cuts of other cars",
        ("car", "recording", "rows", "brake applications that taught", "friction moved by %"),
        lines,
        "With config/suv.toml: neither cut may teach anything.",
    )


TEXT: Final = (
    "Cars that somebody drove, raw frames through the shipped signal maps; origins and licences are in "
    "[tests/data](../../tests/data/README.md). None has a friction truth. The Mustang's 70 s are city "
    "traffic with three brake applications beyond 1.5 m/s²; instead of calliper pressures it sends the "
    "brake torque that its ABS unit estimates, and the logger lost 28 % of these frames. Searched on 27"
    " November 2026, in public repositories, for recordings with speed, brake pressure and a licence: "
    "Ford Mustang (parse_can_logs, MIT), Toyota RAV4 (comma2k19, MIT) and Hyundai Kona EV (hyundai-"
    "kona-ev-can-logs, CC0) are here. Toyota 86 and Super FJ (libxrk, MIT) and Tesla Model 3 (r-tesla-"
    "telemetry, Apache 2.0) have brake pressure and accelerometer, but the copies that we reached lack "
    "the large files; the race cars of the GR Cup, recorded with pressures of both axles, have no "
    "licence. Cars simulated as loggers record them: [loggers.md](loggers.md); drawn strangers: [wide-"
    "world.md](../wide-world.md)."
)


def _run(asked: Asked) -> Measured:
    passes = drive_passes(FOLDER / MUSTANG, "mustang", PASSES)
    tables = [pass_table(passes), application_table(passes), other_table(FOLDER)]
    return Measured(tables, ", Ford Mustang, Toyota RAV4, Hyundai Kona EV")


STUDY: Final = Study("Recorded cars", TEXT, _run, "recorded-cars")
