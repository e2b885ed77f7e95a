"""Identification of dust (`brake-ecu identify dust`): emission models from trips with a particle counter."""

from pathlib import Path
from typing import Final

from brakelab.arrays import Array
from brakelab.identify.config_file import Section, write_car
from brakelab.identify.dust.features import Applications
from brakelab.identify.dust.fit import Judged, choose, judge_all, ranges
from brakelab.identify.dust.page import write_page
from brakelab.identify.dust.reader import read_trips
from brakelab.identify.measurement_files import open_campaign
from ecu.contract.dust import MODELS
from ecu.errors import RunFault
from ecu.output import argument, give, wrote

LOST: Final = 1.0
"""Relative error of the particles of trips left out, from which on a model predicts nothing."""


def _numbers(values: Array) -> str:
    return "[" + ", ".join(f"{value:.6g}" for value in values) + "]"


def dust_section(chosen: Judged, trained: tuple[Array, Array]) -> Section:
    """Return the keys of [front.dust] or [rear.dust], of one brake; see ecu/settings/dust.py."""
    model = chosen.model
    assert model.on_board is not None
    return {
        "model": (f'"{MODELS[model.on_board]}"', "of one brake"),
        "numbers": (_numbers(model.numbers), ""),
        "low": (
            _numbers(trained[0]),
            "trained from here: v_in, v_end [m/s], torque [N m], disc [degC], duration [s], pressure [bar]",
        ),
        "high": (_numbers(trained[1]), "to here"),
        "factor": (f"{chosen.factor:.4f}", "mean of the particles over ten to the emission factor"),
        "below": (f"{chosen.below:.4f}", "95 % of the emission factor, conformal"),
        "above": (f"{chosen.above:.4f}", ""),
    }


def _per_megajoule(trips: list[Applications]) -> str:
    """Return the particles that each trip counted per work of friction."""
    rates = {one.trip: 1e6 * one.particles.sum() / one.energy.sum() for one in trips}
    return ", ".join(f"{trip} {rate:.1e} 1/MJ" for trip, rate in rates.items())


def identify_dust(manifest: Path, config: Path, axle: str, out: Path, columns: Path | None = None) -> None:
    """Identify the emission of an axle's brakes; write `out` and `out`.md.

    `columns`: file of columns of the trips.

    Raises:
        UserError: an argument or a file is invalid.
        RunFault: no model explains the trips.
    """
    vehicle, written = open_campaign(manifest, config, axle, out, columns)
    page = written[1]
    trips = read_trips(manifest, vehicle, axle, columns)
    trained, test = [trip for trip in trips if not trip.test], [trip for trip in trips if trip.test]
    judged = judge_all(trained, test)
    chosen = choose(judged)
    if chosen.left_out_sum > LOST:
        raise RunFault(
            f"{manifest}: no model predicts these trips: left out, missed by "
            f"{100 * chosen.left_out_sum:.0f} % RMS; check that all count in the same unit and "
            f"dilution: {_per_megajoule(trained)}"
        )
    head = "# Emission of particles by `brake-ecu identify dust`."
    write_car(config, out, head, {f"{axle}.dust": dust_section(chosen, ranges(trained))})
    write_page(page, trips, judged, chosen)
    said = f", test trips {100 * chosen.test.sum_error:+.1f} %" if chosen.test else ""
    print(
        f"{out}: {chosen.name}, {chosen.model.size} numbers, from {len(trained)} trips; particles of a trip "
        f"left out within {100 * chosen.left_out_sum:.0f} % RMS{said}"
    )
    print(f"{page}: models beside each other, background, correlations")
    give(model=chosen.name, left_out=chosen.left_out_sum, trips=len(trained))
    wrote(*written, next=f"brake-ecu replay LOG --config {argument(out)} --out drive.parquet")
