"""Arguments and options that several of the laboratory's commands share."""

from pathlib import Path
from typing import Annotated

import typer

from ecu.arguments import scenario_file
from ecu.completion import known, shipped
from ecu.settings.resources import SCENARIOS

Plant = Annotated[
    str | None,
    typer.Option(
        "--plant",
        autocompletion=known("as-config", "suv", "suv14", "sedan", "lcv"),
        metavar="PLANT",
        help="Simulated car: as-config, file or name (sedan, …); default: SCENARIO's",
    ),
]
Scenario = Annotated[
    Path,
    typer.Argument(
        parser=scenario_file,
        autocompletion=shipped(*SCENARIOS),
        metavar="SCENARIO",
        help="Scenario file, or name of a shipped one",
    ),
]
Seed = Annotated[
    int, typer.Option("--seed", metavar="N", min=0, help="Seed of the drawn vehicle and its noise")
]
