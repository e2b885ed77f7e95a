"""`brake-ecu bench blocks`: reproduction of road blocks on the dynamometer, Figures 7.9 to 7.12."""

from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.wear.curves import TABLE_7_1, sensitivity
from brakelab.identify.wear.page import sensitivity_panels, surface_panel
from brakelab.results.chart import BLUE, GREY, ORANGE, PINK, Cells, Line, Panel
from brakelab.results.text_table import Table
from brakelab.simulation.campaigns.wear_blocks import (
    DRIVERS,
    LABORATORY,
    ROADS,
    RUN_IN,
    drawn_car,
    programme,
    road_stops,
)
from brakelab.studies.study import Asked, Measured, Study, picture
from brakelab.studies.wear.bad_input import bad_input_table
from brakelab.studies.wear.blocks_rig import Corner, Done, corner_of, energy_error, run_stops
from brakelab.studies.wear.study import CLIMATE, measured_block

CARS: Final = 5
SEED: Final = 1  # of the trips, and of the car of the tables by road
REPEATS: Final = 8
SETTLED: Final = 3  # repeats of new linings that are not counted
SPEEDS: Final = np.linspace(25.0, 130.0, 22)  # km/h
DECELS: Final = np.linspace(0.5, 5.0, 19)  # m/s^2
LEGEND: Final = (
    ("coolest block, road", BLUE),
    ("hottest block, dynamometer", ORANGE),
    ("quasi-static", PINK),
)


class Pair(NamedTuple):
    """One block on the road and on the dynamometer."""

    road: Done
    rig: Done

    @property
    def energy_error(self) -> float:
        """(7.21) minus (7.20) over (7.21), of the block."""
        return 1.0 - float(self.road.energy.sum() / self.rig.energy.sum())

    @property
    def offset(self) -> float:
        """Wear on the dynamometer over that on the road, minus 1."""
        return float(self.rig.worn.sum() / self.road.worn.sum()) - 1.0


def pair_of(corner: Corner, stops: Array) -> Pair:
    """Run a block on the road, then its reproduction from the disc temperatures of the road."""
    road = run_stops(corner, stops, RUN_IN)
    return Pair(road, run_stops(corner, stops, RUN_IN, road.heat_in))


def car_pairs(seed: int) -> list[Pair]:
    """Return the trips of both drivers with the front brake of a drawn car."""
    corner = corner_of(drawn_car(seed), 0)
    return [pair_of(corner, road_stops("trip", driver, seed)) for driver in DRIVERS]


class Repeats(NamedTuple):
    """One block again and again with new linings; shape (REPEATS,)."""

    energy: Array
    """On the road so far, MJ."""
    road: Array
    """g per MJ of the road's energy."""
    rig: Array
    without_weather: float
    """Settled wear on the dynamometer over the road's, minus 1, were all days and tests alike."""


def repeated(corner: Corner, stops: Array, seed: int) -> Repeats:
    """Repeat a block on the road, by days of different climate, and on the dynamometer (Figure 7.12)."""
    random = np.random.default_rng([seed, 41])
    days, lab = (np.exp(each * random.standard_normal(REPEATS)) for each in (CLIMATE, LABORATORY))
    worn, energy, found = np.zeros(2), 0.0, []
    for k in range(REPEATS):
        road = run_stops(corner, stops, float(worn[0]))
        rig = run_stops(corner, stops, float(worn[1]), road.heat_in)
        lost = np.array([days[k] * road.worn.sum(), lab[k] * rig.worn.sum()])
        spent = 1e-6 * float(road.energy.sum())
        worn, energy = worn + lost, energy + spent
        found.append((energy, *(lost / spent)))
    energies, on_road, on_rig = np.array(found).T
    alike = float((on_rig / lab)[SETTLED:].mean() / (on_road / days)[SETTLED:].mean()) - 1.0
    return Repeats(energies, on_road, on_rig, alike)


def _mean_heat(done: Done) -> float:
    return float(np.average(done.heat, weights=done.energy))


def road_table(pairs: dict[str, Pair]) -> Table:
    """Return energy, temperature and wear of each block on the road and on the dynamometer."""
    rows = [
        (
            name,
            f"{1e-6 * pair.road.energy.sum():.1f}",
            f"{100 * pair.energy_error:.1f}",
            f"{100 * (pair.rig.seconds.sum() / pair.road.seconds.sum() - 1):+.1f}",
            f"{_mean_heat(pair.road):.0f} / {_mean_heat(pair.rig):.0f}",
            f"{pair.road.waited.sum() / 3600:.1f} / {pair.rig.waited.sum() / 3600:.1f}",
            f"{pair.road.worn.sum():.2f} / {pair.rig.worn.sum():.2f}",
            f"{100 * pair.offset:+.1f}",
        )
        for name, pair in pairs.items()
    ]
    columns = (
        "block",
        "energy, road [MJ]",
        "ΔE_b [%]",
        "duration [%]",
        "disc, road / dynamometer [degC]",
        "between brakings [h]",
        "wear [g]",
        "offset of wear [%]",
    )
    return Table(
        "Road blocks on the dynamometer", columns, rows,
        "One front brake, 300 applications. ΔE_b: (7.21) minus (7.20) over (7.21), of the block; offset: "
        "wear on the dynamometer over that on the road, minus 1. Disc: mean by energy. Between brakings: the "
        "rule waits for the disc to cool as far as on the road, but not below 65 degC, in 0.6 of its air.",
    )  # fmt: skip


def claims_table(pairs: list[Pair], repeats: Repeats, stops: Array) -> Table:
    """Return the thesis's claims of Figures 7.10 to 7.12 beside the findings."""
    offsets = np.array([100.0 * pair.offset for pair in pairs])
    errors = np.array([100.0 * pair.energy_error for pair in pairs])
    settled = repeats.rig[SETTLED:].mean() / repeats.road[SETTLED:].mean() - 1.0
    first = [values[0] / values[SETTLED:].mean() - 1.0 for values in (repeats.road, repeats.rig)]
    gentle = 100.0 * float(np.mean(stops[:, 2] < 2.0))
    rows = [
        ("applications below 2 m/s² in real driving", "above 80 %", f"{gentle:.0f} %"),
        ("ΔE_b of a trip", "–", f"{np.median(errors):.1f} % ({errors.min():.1f} to {errors.max():.1f})"),
        ("wear on the dynamometer over the road, trips", "+20 %",
         f"{np.median(offsets):+.1f} % ({offsets.min():+.1f} to {offsets.max():+.1f})"),
        ("one block repeated with new linings, settled", "+20 %", f"{100 * settled:+.1f} %"),
        ("of it without the weather of the road's days", "–", f"{100 * repeats.without_weather:+.1f} %"),
        ("first repeat above the settled wear, road / dynamometer", "a transient",
         f"{100 * first[0]:+.0f} / {100 * first[1]:+.0f} %"),
    ]  # fmt: skip
    below = (
        f"Trips of {len(pairs) // len(DRIVERS)} drawn cars by both drivers, median (least to greatest). "
        "Neither motors nor an engine's drag brake here; they would add to the resistances and the offset."
    )
    return Table("Beside the thesis", ("what", "thesis", "here"), rows, below)


def sensitivity_table(blocks: dict[str, Array]) -> Table:
    """Return errors of wear for a few errors of friction and temperature, both laws of Table 7.1."""
    rows: list[tuple[str, ...]] = []
    most: dict[str, tuple[float, str]] = {}
    for law, coefficients in TABLE_7_1.items():
        for name, x in blocks.items():
            errors = (
                *sensitivity(coefficients, x, np.array([-0.2, 0.2]), "friction"),
                *sensitivity(coefficients, x, np.array([-50.0, 50.0]), "temperature"),
            )
            most[law] = max(most.get(law, (0.0, "")), (float(errors[3] - errors[2]), name))
            rows.append((law, f"{name} ({x[1] / x[0]:.0f} degC)", *(f"{100 * each:+.1f}" for each in errors)))
    found = ", ".join(f"{law} law {50 * wide:.1f} % in {name}" for law, (wide, name) in most.items())
    columns = ("law", "block", "friction −20 %", "+20 %", "disc −50 K", "+50 K")
    below = (
        "Error of wear [%] by Table 7.1, disc in degC. The thesis: nearly linear in friction, more in hot "
        "brakes, and the quasi-static law deaf to temperature. Here 50 K are worth most to the "
        f"{found}."
    )
    return Table("Sensitivity (Figure 7.10)", columns, rows, below)


def _energy_panel(corner: Corner) -> Panel:
    speed, decel = (0.5 * (edges[1:] + edges[:-1]) for edges in (SPEEDS, DECELS))
    value = np.array([[energy_error(corner, v / 3.6, 0.0, a) for v in speed] for a in decel])
    high = 0.4
    cells = Cells(SPEEDS, DECELS, 100.0 * value, 0.0, 100.0 * high)
    title = (
        f"ΔE_b, {100 * value.min():.0f} to {100 * value.max():.0f} %, darkest from {100 * high:.0f}; [m/s²]"
    )
    ends = (float(SPEEDS[0]), float(SPEEDS[-1])), (float(DECELS[0]), float(DECELS[-1]))
    return Panel(title, "speed before [km/h], to standstill", *ends, [], cells=cells)


def _repeat_panel(repeats: Repeats) -> Panel:
    top = 1.15 * float(max(repeats.road.max(), repeats.rig.max()))
    ends = (0.0, 1.05 * float(repeats.energy[-1]))
    lines = []
    for values, colour in ((repeats.road, BLUE), (repeats.rig, ORANGE)):
        settled = float(values[SETTLED:].mean())
        lines.append(Line(np.array(ends), np.full(2, settled), GREY, True))
        lines.append(Line(repeats.energy, values, colour))
    return Panel(
        "wear of new linings [g per MJ of the road]", "energy on the road [MJ]", ends, (0.0, top), lines
    )


TEXT: Final = (
    "How well a dynamometer reproduces the wear of real driving (sections 7.3 to 7.5). Blocks of 300 "
    "applications from generated trips run twice with the plant's friction and wear "
    "(tools/brakelab/studies/wear/blocks_rig.py): on the road with drag and rolling resistance, and under "
    "the rule-based controller of Figure 7.5, which waits for the disc, runs up and holds the road's "
    "deceleration with the brake alone.\n\n"
    "![Specific wear by Table 7.1, its sensitivity, energy error, a block repeated](images/blocks.svg)\n\n"
    "In the picture: Figure 7.9 (both laws of Table 7.1), Figure 7.10 (a and b), Figure 7.11, Figure 7.12 "
    "(dashed: settled). Blue and orange in the sensitivities are the extended law."
)


def _run(asked: Asked) -> Measured:
    """Some 15 s for five cars."""
    cars = min(asked.seeds, CARS)
    corner = corner_of(drawn_car(SEED), 0)
    stops = {f"{road}-{driver}": road_stops(road, driver, SEED) for road in ROADS for driver in DRIVERS}
    pairs = {name: pair_of(corner, each) for name, each in stops.items()}
    repeats = repeated(corner, stops["trip-calm"], SEED)
    random = np.random.default_rng(SEED)
    traces = programme(corner.car, 0, SEED, ("trip", "motorway"))
    regressors = {block.name: measured_block(block, 1.0, random)[0] for block in traces}
    by_heat = sorted(regressors.values(), key=lambda x: float(x[1] / x[0]))
    tables = [
        road_table(pairs),
        claims_table([pair for seed in range(cars) for pair in car_pairs(seed)], repeats, stops["trip-calm"]),
        sensitivity_table(regressors),
        bad_input_table(),
    ]
    panels = [
        *(surface_panel(law, corner.mass, f"7.9 {name}") for name, law in TABLE_7_1.items()),
        *sensitivity_panels(TABLE_7_1["extended"], TABLE_7_1["quasi-static"], by_heat[0], by_heat[-1]),
        _energy_panel(corner),
        _repeat_panel(repeats),
    ]
    return Measured(tables, draw=picture("blocks.svg", panels, LEGEND))


STUDY: Final = Study("Road blocks on the dynamometer", TEXT, _run)
