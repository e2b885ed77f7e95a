"""Report command: `brake-ecu report RESULT.parquet [--truth TRUTH.parquet] --out REPORT.html`."""

from pathlib import Path

from brakelab.report.accuracy import accuracy_per_axle, tracking
from brakelab.report.brakes_section import brakes_section, read_car
from brakelab.report.brakings import brakings
from brakelab.report.brakings_table import brakings_table
from brakelab.report.drive import onto, read_drive
from brakelab.report.friction import plots_of_friction
from brakelab.report.loop import plots_of_loop
from brakelab.report.over_time import POINTS, plots_over_time
from brakelab.report.page import check_page, fill
from brakelab.report.per_braking import plots_per_braking
from brakelab.report.prediction import (
    peer_errors,
    plots_of_prediction,
    prediction_errors,
    prediction_rows,
)
from brakelab.report.quality import drop_placeholders, lacks_pressure, quality_tiles, read_quality
from brakelab.report.summary import facts, faults, tiles
from brakelab.report.timing import read_timing, spreads
from brakelab.report.wear_section import wear_section
from brakelab.report.wheel_torque import reference_of
from brakelab.results.outputs import write_text
from ecu.contract.signals import CORNERS
from ecu.errors import UserError

_FRICTION = tuple(f"mu_b_{corner}" for corner in CORNERS)


def report(result: Path, truth: Path | None, out: Path, timing: Path | None = None) -> None:
    """Write the page on `result` to `out`; it needs no other file and no network.

    `result` is a file of replay or the closed loop, `truth` the plant's true values (`simulate` writes
    them), `timing` a recording's folder or its `cycles.bin`. Raises UserError with one line for any of
    them that is missing or damaged, and when `out` cannot be written.
    """
    recorded = [] if timing is None else [timing, timing / "cycles.bin"]
    check_page(out, [result, *([truth] if truth else []), *recorded])
    drive = read_drive(
        result, ("vehicle_speed", *_FRICTION), "give a RESULT.parquet that `brake-ecu replay` or `demo` wrote"
    )
    quality = read_quality(drive, result)
    without_pressure = lacks_pressure(drive, quality)
    drive = drop_placeholders(drive, without_pressure)
    true = None
    if truth is not None and truth.resolve() == result.resolve():
        raise UserError(str(truth), "", "this is the result; give true values as --truth, or none")
    if truth is not None:
        remedy = "give the NAME.truth.parquet that `brake-ecu simulate` wrote"
        true = onto(drive, read_drive(truth, _FRICTION, remedy), truth)
    found = brakings(drive, result)
    car = read_car(drive, result)
    measured = None if car is None else reference_of(drive, car, found)
    if true is None and measured is not None:
        true = measured.drive
    accuracy = None if true is None else accuracy_per_axle(drive, true, found)
    if accuracy is not None and not any(row.seconds for row in accuracy.values()):
        accuracy = None
    loop = None if timing is None else read_timing(timing)
    predicted = prediction_errors(found)
    wear, wear_plots = wear_section(drive, true, result, quality, without_pressure)
    brakes, brakes_plots = brakes_section(drive, true, car, found, without_pressure)
    page = fill(
        {
            "over_time": plots_over_time(drive, true, found),
            "friction_plots": plots_of_friction(drive, true, found),
            "prediction_plots": plots_of_prediction(found),
            "per_braking": plots_per_braking(found),
            "loop_plots": {} if loop is None else plots_of_loop(loop),
            **brakes_plots,
            **wear_plots,
        },
        {
            "name": result.stem,
            "facts": facts(drive),
            "tiles": [
                *tiles(drive, found, tracking(drive, true, found), predicted, accuracy, loop),
                *(quality_tiles(quality) if quality else []),
            ],
            **brakings_table(drive, found),
            "zooms": True,
            "without_pressure": without_pressure,
            "predictions": prediction_rows(found),
            "prediction_errors": predicted,
            "prediction_peers": peer_errors(found),
            "accuracy": accuracy,
            "reference": "the truth" if truth is not None else "measured wheel torque",
            "factors": {} if measured is None else measured.factors,
            "brakes": brakes,
            "wear": wear,
            "reduced": len(drive.t) > POINTS,
            "faults": faults(drive),
            "quality": quality,
            "spreads": {} if loop is None else spreads(loop),
        },
    )
    write_text(out, page)
