"""Energy balance of every shipped scenario, with its residual."""

from pathlib import Path
from typing import Final

from brakelab.plant.cycle import CYCLE
from brakelab.plant.energy import Energy, energy
from brakelab.results.text_table import Table
from brakelab.simulation.closed_loop import new_loop, run_blocks
from brakelab.simulation.configured import configured
from brakelab.simulation.scenario import load_scenario
from brakelab.studies.study import Asked, Measured, Study
from ecu.settings.config import Config
from ecu.settings.resources import resource

SUSPENDED: Final = "suv14"
SOURCES: Final = ("motion", "gravity", "driven")
LOSSES: Final = ("brakes", "regenerated", "tyres", "drag", "rolling", "dampers")
SHOWN: Final = 5e-5  # share, above which it shows a digit in the table


def scenario_energy(path: Path, config: Config, car: str | None = None) -> tuple[float, Energy]:
    """Drive a scenario with its own car or `car`, seed 0; return its duration [s] and its energy.

    Raises:
        UserError: a file cannot be read or is wrong.
    """
    scenario = load_scenario(path)
    loop = new_loop(scenario.model_copy(update={"plant": car or scenario.plant}), config, 0)
    vehicle = loop.sides.vehicle
    start = vehicle.state.copy()
    cycles = sum(len(block.truth) for block in run_blocks(loop))
    return (cycles - 1) * CYCLE, energy(vehicle.params, start, vehicle.state)


def energy_tables(scenarios: Path, config: Config) -> list[Table]:
    """Return the table of the scenarios in a folder."""
    rows = []
    for path in sorted(scenarios.glob("*.toml")):
        _, own = scenario_energy(path, config)
        seconds, found = scenario_energy(path, config, SUSPENDED)
        shares = (getattr(found, term) / found.turned_over for term in (*SOURCES, *LOSSES))
        rows.append(
            (
                path.stem,
                f"{seconds:.0f}",
                f"{1e-3 * found.turned_over:.0f}",
                *(f"{100.0 * share:.2f}" if abs(share) > SHOWN else "–" for share in shares),
                f"{100.0 * found.missing:.1e}",
                f"{100.0 * own.missing:.1e}",
            )
        )
    columns = (
        "scenario",
        "duration [s]",
        "turned over [kJ]",
        "from motion",
        "from gravity",
        "from motors",
        "brakes",
        "to motors",
        "tyres",
        "drag",
        "rolling",
        "dampers",
        "missing",
        "missing, own car",
    )
    below = (
        f"Shares of what was turned over, in %, with the car {SUSPENDED} (14 degrees of freedom); negative: "
        "gained instead of given. Springs store less than 0.05 %. Own car: the one that the scenario names."
    )
    return [Table("Energy of the scenarios [%]", columns, rows, below)]


TEXT: Final = (
    "Every scenario of config/scenarios in closed loop with the ECU of config/suv.toml. The simulated "
    "vehicle sums what leaves and enters in its own steps (tools/brakelab/plant/energy.py)."
)


def _run(asked: Asked) -> Measured:
    config = configured()
    return Measured(energy_tables(resource("config/scenarios"), config))


STUDY: Final = Study("Where the energy goes", TEXT, _run)
