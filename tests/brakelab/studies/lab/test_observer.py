"""Cars of the bench of the joint observer: what is known of them is what a row says, all else as drawn."""

from pathlib import Path

import pytest

from brakelab.identify.friction.trips import GENTLE, HIGH, LOW, MILD
from brakelab.plant.description import load_plant
from brakelab.plant.draw import draw, load_widths
from brakelab.studies.lab.observer import AS_DRAWN, BRAKINGS, CAUSES, KINDS, plant_files, trip_of_kinds
from ecu.settings.resources import resource

SEED = 3


@pytest.mark.parametrize("cause", CAUSES)
def test_one_thing_is_as_configured_all_else_as_drawn(tmp_path: Path, cause: str) -> None:
    """The same seed draws the same car, whatever width is nought; laws of linings draw another number."""
    plant = load_plant(Path(plant_files(tmp_path, CAUSES[cause])))
    shipped = load_widths(resource("config/plant/draw.toml"), "wide")
    widths = load_widths(tmp_path / "draw.toml", "wide")
    changed = {name for name, value in widths.model_dump().items() if value != shipped.model_dump()[name]}
    assert changed == set(CAUSES[cause])
    if cause == AS_DRAWN or "friction_laws" in changed:
        return
    ours, theirs = draw(plant, SEED, widths)[0], draw(plant, SEED, shipped)[0]
    assert ours["free_radius"] == pytest.approx(theirs["free_radius"])
    assert (ours["mass"] == pytest.approx(theirs["mass"])) == ("mass" not in changed)
    known = "push_out_pressure" in changed
    assert (ours["push_out_pressure"] == pytest.approx(theirs["push_out_pressure"])) == (not known)


def test_brakings_are_of_their_kinds() -> None:
    trip, kinds = trip_of_kinds(SEED)
    assert sorted(kinds) == sorted(KINDS * BRAKINGS)
    cruises, brakings = trip.phase[::2], trip.phase[1::2]
    for kind, cruise, braking in zip(kinds, cruises, brakings, strict=True):
        assert (cruise.speed <= LOW) == (kind in "AC")
        assert (cruise.speed >= HIGH) == (kind in "BD")
        assert (braking.decel >= MILD) == (kind in "AB")
        assert (braking.decel <= GENTLE) == (kind in "CD")
