"""`brake-ecu fmu …`: FMUs. Each command imports what it needs when it is called."""

from pathlib import Path
from typing import Annotated

from brakelab.cli.arguments import Plant, Scenario, Seed
from ecu.arguments import CONFIG_OPTION, Commands, Config, Draw, option

app = Commands(help="Write FMUs (FMI 3.0, 2.0) for Simulink, CarMaker and others.", no_args_is_help=True)

Out = Annotated[Path, option("FILE.fmu", "FMU to write", "--out", "-o")]
Fmi = Annotated[int, option("N", "Version of FMI, 3 or 2", "--fmi", min=2, max=3)]


@app.command()
def ecu(config: Config, out: Out, fmi: Fmi = 3) -> None:
    """Write the ECU of a configuration."""
    from brakelab.fmu import command

    command.write_ecu(config, out, 2 if fmi == 2 else 3)


@app.command()
def vehicle(
    scenario: Scenario,
    out: Out,
    seed: Seed = 0,
    draw: Draw = None,
    plant: Plant = None,
    config: Annotated[Path | None, CONFIG_OPTION] = None,
    fmi: Fmi = 3,
) -> None:
    """Write the simulated vehicle of a scenario with its driver. CONFIG is the car of --plant as-config."""
    from brakelab.fmu import command

    command.write_vehicle(scenario, config, out, seed, draw, plant, 2 if fmi == 2 else 3)
