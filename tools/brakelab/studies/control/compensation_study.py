"""`brake-ecu bench compensation`: what compensation is worth."""

from functools import partial
from pathlib import Path
from typing import Final

from brakelab.results.chart import write_chart
from brakelab.results.processes import run_each
from brakelab.simulation.configured import configured
from brakelab.studies.control.compensation import CARS, one_car
from brakelab.studies.control.compensation_picture import LEGEND, pictured
from brakelab.studies.control.compensation_table import compensation_tables
from brakelab.studies.study import Asked, Measured, Study

TEXT: Final = (
    "Manoeuvres of section 5.7 and fade (6.2.3) in closed loop with the ECU of config/suv.toml, motors at "
    "rest but where it says so (then the ECU blends, f = 0.7 on both axles); cars are drawn per seed from "
    "config/plant/suv.toml, nothing was learned before. Ideal: the same controller in the same car, given "
    "the true friction. Achieved: brake and motor torque over radius and mass, all true. Uncompensated: "
    "nominal friction always. Under, over: given 1.15 and 0.85 of the true friction (section 5.6).\n\n"
    "![Figures 5.8 to 5.12 with car 0](images/compensation.svg)\n\nCar 0; pedal curves of its second "
    "application. In 5.8 friction is a constant that the configuration has 15 % too high or too low."
)


def _run(asked: Asked) -> Measured:
    config = configured()
    cars = run_each("compensation", partial(one_car, config), range(CARS))

    def draw(folder: Path) -> None:
        panels = pictured(config)
        write_chart(folder / "compensation.svg", panels, LEGEND)

    return Measured(compensation_tables(cars), draw=draw)


STUDY: Final = Study("What compensation is worth", TEXT, _run)
