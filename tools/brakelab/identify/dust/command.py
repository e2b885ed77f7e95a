"""Identification of dust (`brake-ecu identify dust`): emission models from trips with a particle counter."""

from pathlib import Path
from typing import Final

import numpy as np

from brakelab.identify.config_file import Section, write_car
from brakelab.identify.dust.features import Applications, Array
from brakelab.identify.dust.fit import Judged, choose, judge_all, ranges
from brakelab.identify.dust.model import LEAST
from brakelab.identify.dust.page import model_table, spearman_table, trip_table
from brakelab.identify.dust.reader import read_trips
from brakelab.results.chart import BLUE, GREY, ORANGE, PINK, Line, Panel, write_chart
from brakelab.results.outputs import check_outputs, config_files
from brakelab.results.text_table import markdown
from ecu.contract.dust import MODELS
from ecu.errors import UserError
from ecu.output import give, wrote
from ecu.settings.config import Axle, load_config, new_params

LEGEND: Final = (("chosen", BLUE), ("others", ORANGE), ("95 %, and the background's line", PINK))


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


def _pairs(judged: Judged, trips: list[Applications]) -> tuple[Array, Array]:
    """Return counted and predicted EF in the order of the counted one."""
    features, sequences, counted = (
        np.concatenate([getattr(trip, name) for trip in trips])
        for name in ("features", "sequences", "particles")
    )
    known = counted > LEAST
    measured = np.log10(counted[known])
    order = np.argsort(measured)
    return measured[order], judged.model.predict(features, sequences)[known][order]


def dust_panels(trips: list[Applications], judged: list[Judged], chosen: Judged) -> list[Panel]:
    """Return Figures 8.2 and 8.8: background by speed, and predicted over counted EF of the tests."""
    shown = [trip for trip in trips if trip.test] or trips
    first = shown[0].background
    top = 1.3 * float(max(first.levels.max(initial=1.0), first.still))
    speed = np.linspace(0.0, 35.0, 50)
    line = first.still + first.by_speed * speed
    panels = [
        Panel("background [1/cm³]", "speed [m/s]", (0.0, 35.0), (0.0, max(top, float(line[-1]))), [
            Line(first.speeds, first.levels, BLUE), Line(speed, line, PINK, True),
        ])
    ]  # fmt: skip
    for one in judged:
        if one is not chosen and one.name not in ("LUT", "static ANN"):
            continue
        counted, said = _pairs(one, shown)
        ends = float(np.floor(min(counted.min(), said.min()))), float(np.ceil(max(counted.max(), said.max())))
        diagonal = np.array(ends)
        lines = [
            Line(counted, said, BLUE if one is chosen else ORANGE),
            Line(diagonal, diagonal, GREY),
            Line(diagonal, diagonal - one.below, PINK, True),
            Line(diagonal, diagonal - one.above, PINK, True),
        ]
        panels.append(Panel(f"EF by {one.name}", "EF counted", ends, ends, lines))
    return panels


def write_page(page: Path, trips: list[Applications], judged: list[Judged], chosen: Judged) -> None:
    """Write the tables with Figures 8.2 and 8.8 above them."""
    picture = page.with_suffix(".svg")
    write_chart(picture, dust_panels(trips, judged, chosen), LEGEND)
    tables = [model_table(judged, chosen), trip_table(trips), spearman_table(trips)]
    head = f"# Emission of one brake by {len(trips)} trips\n\n![Figures 8.2 and 8.8]({picture.name})\n\n"
    page.write_text(head + "\n".join(map(markdown, tables)).rstrip() + "\n", encoding="utf-8")


def identify_dust(manifest: Path, config: Path, axle: str, out: Path) -> int:
    """Identify the emission of an axle's brakes; write `out` and `out`.md, return 0.

    Raises:
        UserError: an argument or a file is invalid.
    """
    if axle not in ("front", "rear"):
        raise UserError("--axle", axle, "choose front or rear")
    vehicle = load_config(config)
    written = out, page, _ = out, out.with_suffix(".md"), out.with_suffix(".svg")
    check_outputs(out, written, [manifest, *config_files(config)], toml=True)
    brake: Axle = getattr(vehicle, axle)
    radius = float(new_params(vehicle)[0]["wheel_radius"][0 if axle == "front" else 2])
    trips = read_trips(manifest, brake.push_out_pressure, radius)
    trained, test = [trip for trip in trips if not trip.test], [trip for trip in trips if trip.test]
    judged = judge_all(trained, test)
    chosen = choose(judged)
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
    wrote(*written, next=f"brake-ecu replay LOG --config {out} --out drive.parquet")
    return 0
