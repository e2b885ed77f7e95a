"""Report on a run of the WLTP-Brake cycle: trips, whole run, what each figure rests on."""

from pathlib import Path
from typing import Final

import numpy as np

from brakelab.identify.dust.cycle_run import NEAR_S, NEAR_SPEED, Run, read_run
from brakelab.identify.manifest import read_manifest
from brakelab.results import euro7
from brakelab.results.outputs import check_outputs, config_files, write_text
from brakelab.results.text_table import Table, cell, markdown
from brakelab.simulation.trip.wltp_brake import DISC_AT_START, TOTALS, TRIPS
from ecu.errors import UserError
from ecu.output import give, wrote
from ecu.settings.config import load_config

CYCLE: Final = "UN GTR 24, as Grigoratos et al. 2020 (doi 10.3390/atmos11121309) have it"
DISTANCE_OFF: Final = 0.01  # of the distance, from which on it is said
WARMER: Final = 5.0  # K of a disc at the start of a trip, likewise. Assumption
TOLERANCE: Final = "assumed, as the WLTP on a chassis dynamometer has it"
NOT_OBTAINED: Final = (
    "The text of UN Regulation 179 (OJ L, 2026/1044, of 18 May 2026; ECE/TRANS/WP.29/2026/36) and of UN GTR "
    "24 was not at hand: its tolerances of speed, temperature, humidity and sampling, its checks of "
    "background and of losses in the line, and its friction shares c by type of vehicle are not applied. "
    "Nothing here is an approval."
)


def trip_table(run: Run) -> Table:
    """Return the trips as run."""
    rows = []
    for number, trip in enumerate(run.trips):
        begin = DISC_AT_START[number] if number < len(DISC_AT_START) else np.nan
        net = trip.total - trip.background
        rows.append(
            (
                trip.name,
                f"{trip.km:.2f}",
                f"{trip.seconds:.0f}",
                f"{trip.applications}",
                f"{trip.work:.2f}",
                f"{trip.cold:.0f} ({cell(trip.cold - begin, '+.0f')})",
                f"{trip.hottest:.0f}",
                f"{trip.violations}" if trip.violations >= 0 else "–",
                cell(trip.outside, ".1f"),
                cell(1e-9 * trip.total / trip.km, ".3f"),
                cell(1e-9 * net / trip.km, ".3f"),
                cell(1e-9 * trip.solid / trip.km, ".3f"),
            )
        )
    return Table(
        "Trips",
        ("trip", "km", "s", "applications", "work [MJ]", "disc at the start [°C] (off)", "hottest [°C]",
         "violations", "outside [s]", "TPN10 [10⁹/km]", "net of background", "SPN10 [10⁹/km]"),
        rows,
        f"Violations: stretches of speed more than {3.6 * NEAR_SPEED:.0f} km/h off the reference within "
        f"±{NEAR_S:.0f} s ({TOLERANCE}); – without `reference`. Disc at the start: off "
        f"{DISC_AT_START[0]:.0f} °C for the first trip, {DISC_AT_START[1]:.0f} °C for the others ({CYCLE}). "
        "Particles without c.",
    )  # fmt: skip


def whole_table(run: Run) -> Table:
    """Return the whole run, each figure with what it is held against and the source of that."""
    km, seconds = run.sum_of("km"), run.sum_of("seconds")
    applications = sum(trip.applications for trip in run.trips)
    stated = "RUN.csv" if np.isfinite(run.whole["friction_share"]) else "not stated: 1, of linings alone"
    limit = f"all brakes of a car together: {euro7.WORDS}"
    source = "Regulation (EU) 2024/1257, Annex I, by a summary"
    rows = [
        ("trips", f"{len(run.trips)}", f"{len(TRIPS)}", CYCLE),
        ("distance [km]", f"{km:.2f}", f"{1e-3 * TOTALS.metres:.0f}", CYCLE),
        ("time [s]", f"{seconds:.0f}", f"{TOTALS.seconds:.0f}", CYCLE),
        ("brake applications", f"{applications}", f"{TOTALS.brakings}", CYCLE),
        ("outside of the speed's tolerance [s]", cell(run.sum_of("outside"), ".1f"), "–", TOLERANCE),
        ("friction share c", f"{run.share:.3g}", "–", stated),
        ("PM10 [mg/km], this brake", cell(run.mass("pm10"), ".3f"), limit, source),
        ("PM2.5 [mg/km], this brake", cell(run.mass("pm25"), ".3f"), "none there", source),
        ("TPN10 [10⁹/km], this brake", cell(1e-9 * run.number("total"), ".3f"), "none there", source),
        ("of it background [10⁹/km]", cell(1e-9 * run.number("background"), ".3f"), "–", "cruising"),
        ("SPN10 [10⁹/km], this brake", cell(1e-9 * run.number("solid"), ".3f"), "none there", source),
        ("pads lost [mg/km], linings alone", cell(run.lost("pads"), ".2f"), "–", "balance"),
        ("disc lost [mg/km], linings alone", cell(run.lost("disc"), ".2f"), "–", "balance"),
        ("PM10 of what pads and disc lost [%]", cell(_airborne(run), ".0f"), "–", "both"),
    ]
    return Table(
        "Run",
        ("", "measured", "asked or allowed", "source"),
        rows,
        f"PM and PN times c. {NOT_OBTAINED}",
    )


def _airborne(run: Run) -> float:
    return 100.0 * run.mass("pm10") / run.share / (run.lost("pads") + run.lost("disc"))


def findings(run: Run) -> list[str]:
    """Return what is wrong with a run, as far as the published figures show it."""
    found = []
    if len(run.trips) != len(TRIPS):
        found.append(f"{len(run.trips)} of {len(TRIPS)} trips")
    km, asked = run.sum_of("km"), 1e-3 * TOTALS.metres
    if abs(km / asked - 1.0) > DISTANCE_OFF:
        found.append(f"{km:.1f} of {asked:.0f} km")
    if (outside := run.sum_of("outside")) > 0.0:
        found.append(f"{outside:.1f} s outside of the speed's tolerance")
    if not np.isfinite(outside):
        found.append("no reference of every trip: speed violations are not known")
    begins = zip(run.trips, DISC_AT_START, strict=False)
    if warm := [trip.name for trip, asked in begins if trip.cold > asked + WARMER]:
        found.append(
            f"disc over {WARMER:.0f} K too warm at the start of trip {', '.join(warm)}: soaked too short"
        )
    for trip in run.trips:
        if trip.unseen > 0.0:
            found.append(
                f"trip {trip.name}: its file ends {trip.unseen:.0f} s before the air of its last brake "
                "application is at the counter; record on"
            )
    if _airborne(run) > 100.0:
        found.append(
            f"PM10 is {_airborne(run):.0f} % of what pads and disc lost: masses in g, filters in mg, flows?"
        )
    if euro7.above_all(run.mass("pm10")):
        found.append(f"PM10 of this brake alone is above every limit of a car ({run.mass('pm10'):.1f} mg/km)")
    if not np.isfinite(run.mass("pm10")):
        found.append("PM10 was not weighed")
    return found


def report_cycle(manifest: Path, config: Path, axle: str, out: Path, columns: Path | None = None) -> None:
    """Write the report of a run of the WLTP-Brake cycle. `columns`: file of columns of the trips.

    Raises:
        UserError: an argument or a file is invalid.
    """
    if axle not in ("front", "rear"):
        raise UserError("--axle", axle, "choose front or rear")
    if out.suffix != ".md":
        raise UserError("--out", str(out), "with --cycle a page is written; let it end in .md")
    vehicle = load_config(config)
    rows = [row for _, row in read_manifest(manifest, columns)]
    files = [manifest.parent / row[name] for row in rows for name in ("file", "reference") if row.get(name)]
    check_outputs(out, (out,), [manifest, *files, *config_files(config), *([columns] if columns else [])])
    run = read_run(manifest, vehicle, axle, columns)
    found = findings(run)
    said = f"Found: {'; '.join(found)}." if found else "Nothing is off what is published of the cycle."
    tables = [whole_table(run), trip_table(run)]
    parts = "\n".join(map(markdown, tables)).rstrip()
    write_text(out, f"# Run of the WLTP-Brake cycle, {axle} brake\n\n{said}\n\n{parts}\n")
    print(
        f"{out}: {run.sum_of('km'):.1f} km, PM10 {cell(run.mass('pm10'), '.2f')} mg/km, TPN10 "
        f"{cell(1e-9 * run.number('total'), '.2f')}e9/km of this brake, c {run.share:.3g}"
    )
    for line in found:
        print(f"{out}: {line}")
    give(
        pm10=run.mass("pm10"), pm25=run.mass("pm25"), tpn10=run.number("total"), spn10=run.number("solid"),
        km=run.sum_of("km"), friction_share=run.share, findings=found,
    )  # fmt: skip
    wrote(out)
