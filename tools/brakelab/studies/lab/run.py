"""All that `brake-ecu bench lab` measures."""

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

from brakelab.results.processes import new_pool
from brakelab.studies.lab.brakes import DRAWS, R2_DRAWS, Brake, Recovered, measure, recovered
from brakelab.studies.lab.choice import Choice, choices
from brakelab.studies.lab.discovery import Draw, PadTerms, discovered, jobs, pad_terms
from brakelab.studies.lab.observer import CARS, CAUSES, OnTrip, on_trip
from brakelab.studies.lab.searches import Searches, searches
from brakelab.studies.lab.trips import PADS, OnTrips, trips
from brakelab.studies.physics.heat import BRAKES


class Lab(NamedTuple):
    """All that the bench measures."""

    brakes: dict[str, Brake]
    recovered: list[Recovered]
    on_trips: list[OnTrips]  # of `PADS`
    in_cars: list[OnTrip]  # the joint observer
    draws: list[Draw]  # of discovery
    pads: list[PadTerms]
    searches: Searches
    choices: list[Choice]  # on further pads


def run_lab(progress: Callable[[str], None]) -> Lab:
    """Return all results; `progress` receives a line at a time. Minutes, on two cores."""
    brakes = {}
    for brake in BRAKES:
        brakes[brake] = measure(brake, progress)
        progress(f"{brake}: CPC simulated and all laws identified in {brakes[brake].seconds:.0f} s")
    with new_pool(2) as pool:
        searched = pool.submit(searches)
        on_trips = list(pool.map(trips, PADS))
        progress(f"estimators of chapter 2: {len(on_trips)} pads")
        sets = [*product(("R1",), BRAKES, range(DRAWS)), *product(("R2",), BRAKES, range(R2_DRAWS))]
        found = list(pool.map(recovered, sets))
        progress(f"recovery: {len(found)} draws")
        in_cars = list(pool.map(on_trip, product(CAUSES, range(CARS))))
        progress(f"joint observer: {len(in_cars)} cars")
        draws = list(pool.map(discovered, jobs()))
        progress(f"discovery: {len(draws)} draws")
        pads = list(pool.map(pad_terms, BRAKES))
        costs = searched.result()
    return Lab(brakes, found, on_trips, in_cars, draws, pads, costs, choices(progress))
