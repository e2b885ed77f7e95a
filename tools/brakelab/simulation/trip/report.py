"""Trip report as plain text: Tables 1.1 and 1.2 beside the trip, its brakings and use of its brakes."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from brakelab.arrays import Array
from brakelab.report.drive import DriveResult
from brakelab.simulation.trip.table import KMH, RURAL, URBAN, Brakings, Row, distance_driven, trip_rows
from ecu.contract.signals import CORNERS

DRIVE_COLUMNS: Final = (
    "vehicle_speed",
    "grade",
    *(f"{stem}_{c}" for stem in ("brake_torque", "wheel_speed", "disc_temperature") for c in CORNERS),
    *(f"{stem}_{c}" for stem in ("mu_b", "pad_wear_mass") for c in CORNERS),
)
"""Columns of the truth that `brake_lines` and the tables need."""
FRICTION_BIN: Final = 0.02
ROADS: Final = (("Urban", -np.inf, URBAN), ("Rural", URBAN, RURAL), ("Motorway", RURAL, np.inf))
"""m/s, of the speed before an application."""
AXLES: Final = {"front": slice(0, 2), "rear": slice(2, 4)}
BIN: Final = 0.5  # m/s^2, of the histogram


def _limits(row: Row) -> str:
    if np.isinf(row.low):
        return f"< {row.high:.0f}"
    if np.isinf(row.high):
        return f"> {row.low:.0f}"
    return f"{row.low:.0f} to {row.high:.0f}"


def trip_lines(t: Array, speed: Array, grade: Array, found: Brakings) -> list[str]:
    """Return Tables 1.1 and 1.2 beside a trip (as for `trip_rows`) and its brakings."""
    lines = [f"{'Table 1.1':26}{'unit':>10}{'required':>12}{'Ilmenau':>10}{'here':>10}  met"]
    for row in trip_rows(t, speed, grade):
        verdict = "yes" if row.met else "NO"
        lines.append(
            f"{row.name:26}{row.unit:>10}{_limits(row):>12}{row.ilmenau:10.0f}{row.value:10.1f}  {verdict}"
        )
    decel = found.mean_decel
    if len(decel) == 0:
        return [*lines, "", "No braking"]
    kilometres = distance_driven(t, speed)[-1] / 1e3

    def share(low: float, high: float) -> float:
        return 100.0 * float(np.mean((decel >= low) & (decel < high)))

    lines += ["", f"{'Table 1.2, mean decelerations':36}{'unit':>7}{'printed':>20}{'here':>9}"]
    for name, unit, printed, value in (
        ("Mean", "m/s^2", "1.59, 1.70, 1.82", decel.mean()),
        ("Standard deviation", "m/s^2", "0.35, 0.61, 0.51", decel.std()),
        ("Below 1 m/s^2", "%", "", share(0.0, 1.0)),
        ("1 to 2 m/s^2", "%", "60 to 80", share(1.0, 2.0)),
        ("2 to 3 m/s^2", "%", "10 to 30", share(2.0, 3.0)),
        ("Above 3 m/s^2", "%", "very rarely", share(3.0, np.inf)),
        ("Brakings (printed: Table 8.1, a van)", "", "78 to 121", len(decel)),
        ("Brakings per km", "1/km", "", len(decel) / kilometres),
    ):
        lines.append(f"{name:36}{unit:>7}{printed:>20}{value:9.2f}")
    lines += ["", "Mean deceleration [m/s^2], a # for each braking"]
    return lines + _histogram(decel, np.arange(0.0, max(float(decel.max()), 3.0) + BIN, BIN), 1)


def _histogram(values: Array, edges: Array, places: int) -> list[str]:
    return [
        f"{low:4.{places}f} to {high:3.{places}f}{number:5d}  {'#' * number}".rstrip()
        for low, high, number in zip(edges, edges[1:], np.histogram(values, edges)[0], strict=False)
    ]


def part_lines(t: Array, speed: Array, discs: Array, found: Brakings) -> list[str]:
    """Return number and means of the brake applications of each part of a trip, by their initial speed.

    `discs` are temperatures [degC] of shape (n, 4), or (n, 0) if unknown. After Figures 7.3
    and 7.4.
    """
    lines = [f"{'Brakings, means':16}{'number':>8}{'per 100 km':>12}{'from [km/h]':>13}{'by [m/s^2]':>12}"]
    if discs.size:
        lines[0] += "  discs before, front and rear [degC]"
    for name, low, high in ROADS:
        here = (found.speed_in > low) & (found.speed_in <= high)
        kilometres = _kilometres(t, speed, low, high)
        if kilometres == 0.0:
            continue
        number = int(here.sum())
        line = f"{name:16}{number:8d}{100.0 * number / kilometres:12.0f}"
        if number:
            line += f"{found.speed_in[here].mean() / KMH:13.1f}{found.mean_decel[here].mean():12.2f}"
            if discs.size:
                before = discs[np.searchsorted(t, found.start[here])].mean(axis=0)
                line += f"{before[:2].mean():10.0f}{before[2:].mean():8.0f}"
        lines.append(line)
    return lines


def _kilometres(t: Array, speed: Array, low: float, high: float) -> float:
    metres = np.diff(distance_driven(t, speed))
    return float(metres[(speed[1:] > low) & (speed[1:] <= high)].sum() / 1e3)


def braking_lines(found: Brakings) -> list[str]:
    """Return one line for each brake application, speeds in km/h."""
    lines = ["start [s]  lasts [s]  from [km/h]  to [km/h]  mean deceleration [m/s^2]"]
    for start, lasts, v_in, v_out, decel in zip(*found, strict=True):
        lines.append(f"{start:9.1f}{lasts:11.1f}{v_in / KMH:13.1f}{max(v_out, 0.0) / KMH:11.1f}{decel:27.2f}")
    return lines


def follow_line(t: Array, speed: Array, trip_t: Array, trip_speed: Array) -> str:
    """Return how well a drive, `t` [s] and `speed` [m/s], followed a trip."""
    error = speed - np.interp(t, trip_t, trip_speed)
    away = distance_driven(t, speed)[-1] - distance_driven(trip_t, trip_speed)[-1]
    return (
        f"Speed error {np.sqrt(np.mean(error**2)):.2f} m/s rms, {np.abs(error).max():.2f} m/s at most; "
        f"distance {away:+.0f} m"
    )


def friction_lines(drive: DriveResult, found: Brakings) -> list[str]:
    """Return friction of the applications of each axle, and wear over work, by road; then its histogram.

    After Table 1.2, Figures 1.3c and 7.4b. An application's friction is its mean over time, of both wheels.
    """
    mean, worn, done = _of_applications(drive, found)
    lines = [f"{'Brakings':16}{'axle':>6}{'friction':>10}{'deviation':>11}{'wear [g/MJ]':>13}"]
    for name, low, high in (("All", -np.inf, np.inf), *ROADS):
        here = (found.speed_in > low) & (found.speed_in <= high)
        if not here.any():
            continue
        for axle, of in AXLES.items():
            level, rate = mean[here, of], worn[here, of].sum() / max(done[here, of].sum(), 1e-9)
            lines.append(
                f"{name:16}{axle:>6}{level.mean():10.3f}{level.mean(axis=1).std():11.3f}{rate:13.3f}"
            )
    for axle, of in AXLES.items():
        level = mean[:, of].mean(axis=1)
        if len(level):
            lines += ["", f"Mean friction, {axle}, a # for each braking"]
            first, last = (int(np.floor(value / FRICTION_BIN + 1e-9)) for value in (level.min(), level.max()))
            edges = np.arange(first, last + 2, dtype=np.float64) * FRICTION_BIN - 1e-9
            lines += _histogram(level, edges, 2)
    return lines


def _of_applications(drive: DriveResult, found: Brakings) -> tuple[Array, Array, Array]:
    """Return mean friction, wear [g] and work [MJ] of every application, shapes (applications, 4)."""
    power = drive.corners("brake_torque") * np.abs(drive.corners("wheel_speed"))
    work = np.vstack([np.zeros(4), np.cumsum(np.diff(drive.t)[:, None] * power[1:], axis=0)])
    begins, ends = (np.searchsorted(drive.t, when) for when in (found.start, found.start + found.duration))
    ends = np.minimum(np.maximum(ends, begins + 1), len(drive.t) - 1)
    pairs = list(zip(begins, ends, strict=True))
    friction = drive.corners("mu_b")
    mean = np.array([friction[begin:end].mean(axis=0) for begin, end in pairs]).reshape(-1, 4)
    worn, done = (
        np.array([values[end] - values[begin] for begin, end in pairs]).reshape(-1, 4)
        for values in (drive.corners("pad_wear_mass"), 1e-6 * work)
    )
    return mean, worn, done


def spread_lines(drives: Sequence[tuple[DriveResult, Brakings]]) -> list[str]:
    """Return applications per distance and wear over work by road, mean of the drives ± 2 σ (Figure 7.4)."""
    lines = [
        f"{f'Of {len(drives)} drives':16}{'brakings per 100 km':>21}{'front [g/MJ]':>18}{'rear [g/MJ]':>18}"
    ]
    for name, low, high in ROADS:
        rows = []
        for drive, found in drives:
            here = (found.speed_in > low) & (found.speed_in <= high)
            _, worn, done = _of_applications(drive, found)
            rates = [worn[here, of].sum() / max(done[here, of].sum(), 1e-9) for of in AXLES.values()]
            kilometres = _kilometres(drive.t, drive.column("vehicle_speed"), low, high)
            rows.append((100.0 * here.sum() / kilometres if kilometres else np.nan, *rates))
        mean, two_sigma = np.mean(rows, axis=0), 2.0 * np.std(rows, axis=0, ddof=1)
        cells = [
            f"{value:{places}} ± {wide:{places}}"
            for value, wide, places in zip(mean, two_sigma, (".0f", ".3f", ".3f"), strict=True)
        ]
        lines.append(f"{name:16}{cells[0]:>21}{cells[1]:>18}{cells[2]:>18}")
    return lines


def brake_lines(drive: DriveResult) -> list[str]:
    """Return temperature, energy and use of each brake of a drive with `DRIVE_COLUMNS`."""
    power = drive.corners("brake_torque") * np.abs(drive.corners("wheel_speed"))
    energy = np.diff(drive.t) @ (0.5 * (power[1:] + power[:-1])) * 1e-6
    discs = drive.corners("disc_temperature")
    lines = [f"{'Brakes':24}" + "".join(f"{corner:>9}" for corner in CORNERS)]
    for name, values in (
        ("Disc, mean [degC]", discs.mean(axis=0)),
        ("Disc, 95 % below [degC]", np.quantile(discs, 0.95, axis=0)),
        ("Disc, highest [degC]", discs.max(axis=0)),
        ("Friction energy [MJ]", energy),
        ("Time applied [%]", 100.0 * np.mean(power > 0.0, axis=0)),
    ):
        lines.append(f"{name:24}" + "".join(f"{value:9.2f}" for value in values))
    return lines
