"""Table 2.1 over pads: medians, and on how many the thesis's order holds."""

from itertools import product

import numpy as np
import pytest

from brakelab.identify.friction.estimators import NETWORK, OSTERMEYER, SURFACE, Error
from brakelab.studies.lab.goals import RANKS, same_ranking
from brakelab.studies.lab.observer import KINDS
from brakelab.studies.lab.trips import PADS, OnTrips, median_wrong, over_pads
from brakelab.studies.physics.heat import BRAKES


def pad(**errors: float) -> OnTrips:
    named = {NETWORK: errors["ann"], SURFACE: errors["surface"], OSTERMEYER: errors["ostermeyer"]}
    return OnTrips(
        {name: {kind: Error(value, 0.0) for kind in KINDS} for name, value in named.items()},
        {name: [value, 2.0 * value] for name, value in named.items()},
        {},
        {},
    )


FOUND = [
    pad(ann=3.0, surface=6.0, ostermeyer=9.0),
    pad(ann=4.0, surface=8.0, ostermeyer=7.0),
    pad(ann=8.0, surface=7.0, ostermeyer=11.0),
]


def test_every_brake_has_five_pads() -> None:
    assert sorted(PADS) == sorted(product(BRAKES, range(1, 6)))


def test_an_order_is_counted_pad_by_pad() -> None:
    """The first is as the thesis has A, C and D; the second as B; on the third a surface is best."""
    assert RANKS["B"] == (NETWORK, OSTERMEYER, SURFACE)
    assert same_ranking(FOUND) == {"A": 1, "B": 1, "C": 1, "D": 1}


def test_pads_are_beside_each_other() -> None:
    assert over_pads(FOUND)[SURFACE]["A"] == pytest.approx([6.0, 8.0, 7.0])
    assert median_wrong(FOUND)[OSTERMEYER] == pytest.approx(np.array([9.0, 18.0]))
