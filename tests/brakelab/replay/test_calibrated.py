"""Calibrations of a recording: exchanged where a run is repeated, left out where it is not."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from brakelab.replay.calibrated import changes_of
from brakelab.replay.engine import new_ecu
from ecu.contract.work import Kind, Work
from ecu.errors import UserError
from ecu.recording.calibration import Note
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

CAR = load_config(resource("config/suv.toml"))


def recorded(rate: float, *, notes: int = 1) -> Any:
    control = {**CAR.control.model_dump(), "max_pressure_rate": rate}
    calibrations = [Note(number, 70 * number, {"control": control}) for number in range(1, notes + 1)]
    about = {"configuration": CAR.model_dump()}
    return SimpleNamespace(folder=Path("drive"), about=about, calibrations=calibrations)


def test_each_is_what_a_config_gives_but_for_what_is_the_run_s_own() -> None:
    ecu = new_ecu(new_params(CAR), None)
    ecu.params["transmit"], ecu.params["mapped"][0, 3] = 1, 0
    changes, line = changes_of(recorded(2000.0, notes=2), ecu)
    assert line == ""
    assert [change.cycle for change in changes] == [70, 140]
    for name in ecu.params.dtype.names or ():
        if name != "max_pressure_rate":
            assert changes[0].params[name].tobytes() == ecu.params[name].tobytes(), name
    assert changes[0].params["max_pressure_rate"] == 2e8


@pytest.mark.parametrize(("name", "value"), [("mu_drift", 0.03), ("observer", 2), ("max_pressure_rate", 2e8)])
def test_with_another_configuration_they_are_left_out_in_a_line(name: str, value: float) -> None:
    ecu = new_ecu(new_params(CAR), None)
    ecu.params[name] = value
    changes, line = changes_of(recorded(2000.0, notes=2), ecu)
    assert changes == []
    assert line == "drive: 2 calibrations left out, for CONFIG is not the recorded one"
    assert changes_of(recorded(2000.0, notes=0), ecu) == ([], "")


def test_new_pads_are_new_with_another_configuration_too() -> None:
    ecu = new_ecu(new_params(CAR), None)
    ecu.params["observer"] = 2
    recording, work = recorded(2000.0, notes=2), Work(Kind.NEW_PADS, {"fl": 0.0})
    recording.calibrations[1] = Note(2, 140, {}, work)
    changes, line = changes_of(recording, ecu)
    assert [(change.cycle, change.params is ecu.params, change.work) for change in changes] == [
        (140, True, work)
    ]
    assert line == "drive: 1 calibrations left out, for CONFIG is not the recorded one"
    del recording.calibrations[0]
    assert changes_of(recording, ecu)[1] == ""


def test_one_that_no_config_may_have_is_an_error() -> None:
    with pytest.raises(UserError, match=r"drive: control\.max_pressure_rate: give a value of at least 1500"):
        changes_of(recorded(1.0), new_ecu(new_params(CAR), None))
