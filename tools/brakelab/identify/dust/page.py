"""Tables of an identification of dust: trips as Table 8.1, models by the KPIs of Table 8.3, Figure 8.6."""

from typing import Final

import numpy as np

from brakelab.identify.dust.features import Applications
from brakelab.identify.dust.fit import Judged, spearman
from brakelab.results.text_table import Table

THESIS: Final = {"LUT": -32.68, "static ANN": -9.07, "dynamic ANN": -3.95}
"""%, sum of particles of Trip 8, Table 8.2."""


def trip_table(trips: list[Applications]) -> Table:
    """Return the trips beside Table 8.1."""
    rows = [
        (
            trip.trip + (" (test)" if trip.test else ""),
            f"{trip.km:.0f}",
            f"{trip.decel.mean():.2f}",
            f"{trip.decel.var():.2f}",
            f"{len(trip.particles)}",
            f"{1e-6 * trip.energy.sum():.2f}",
            f"{1e-9 * trip.particles.sum() / trip.km:.2f}",
            f"{trip.background.still:.0f} + {trip.background.by_speed:.0f} v",
            f"{trip.way_s:.1f}",
        )
        for trip in trips
    ]
    return Table(
        "Trips",
        ("trip", "km", "mean a_x [m/s²]", "var a_x", "applications", "E_b [MJ]", "ΣPN [10⁹/km]",
         "background [1/cm³]", "way of the air [s]"),
        rows,
        "As Table 8.1: one front brake. Background: what cruising shows against the speed v in m/s "
        "(Figure 8.2). Way of the air: until the counter follows the friction power best.",
    )  # fmt: skip


def model_table(judged: list[Judged], chosen: Judged) -> Table:
    """Return the models' KPIs (Table 8.3, Figure 8.9), and Table 8.2's errors beside."""
    rows = []
    for one in judged:
        test = one.test
        rows.append(
            (
                f"**{one.name}**" if one is chosen else one.name,
                f"{one.model.size}",
                f"{one.seconds:.2f}",
                f"{one.left_out_rms:.3f}",
                f"{100 * one.left_out_sum:.1f}",
                f"{one.factor:.2f}",
                f"{one.below:+.2f} … {one.above:+.2f}",
                *(
                    ("–",) * 5
                    if test is None
                    else (
                        f"{100 * test.sum_error:+.1f}",
                        f"{100 * ((1.0 + test.sum_error) / one.factor - 1.0):+.1f}",
                        f"{test.vaf:.2f}",
                        f"{test.nrmse:.4f}",
                        f"{100 * test.covered:.0f}",
                    )
                ),
                f"{THESIS[one.name]:+.1f}" if one.name in THESIS else "–",
            )
        )
    return Table(
        "Models",
        ("model", "numbers", "training [s]", "left out: EF, RMS", "left out: ΣPN, RMS [%]", "factor",
         "95 % of EF", "test: ΣPN [%]", "without factor [%]", "VAF", "nRMSE", "inside 95 % [%]",
         "thesis: ΣPN [%]"),
        rows,
        "Left out: each trip by a model of the others. Factor: particles over ten to the EF, for the mean of "
        "a logarithm is not the logarithm of the mean. ΣPN: predicted over counted, minus 1, as Table 8.2 "
        "(the definition in Table 8.3 has the other sign). Bold: goes into the configuration.",
    )  # fmt: skip


def spearman_table(trips: list[Applications]) -> Table:
    """Return the rank correlations (Figure 8.6)."""
    names, matrix = spearman(trips)
    rows = [
        (name, *(f"{value:+.2f}" for value in row)) for name, row in zip(names, np.array(matrix), strict=True)
    ]
    return Table("Spearman", ("", *names), rows, "Rank correlations of all trips, as Figure 8.6.")
