"""A calibration is checked as a CONFIG file is, handed to the loop, saved; a refusal is a line in the log."""

import struct
from types import SimpleNamespace

import numpy as np
import pytest
import structlog

from ecu.algorithm.step import new_state
from ecu.errors import UserError
from ecu.recording.calibration import in_force
from ecu.recording.ring import RingReader
from ecu.runtime import asking
from ecu.runtime.calibration import consider
from ecu.runtime.clock import monotonic_s
from ecu.runtime.xcp import SAVED
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource
from ecu.xcp.parameters import PARAMETERS, to_record
from ecu.xcp.protocol import Error, Refused
from ecu.xcp.takeover import Takeover

NAN = float("nan")


class Calibrated:
    """A run at rest that looks for calibrations whenever its slave waits."""

    def __init__(self, run, path, save):
        config = load_config(path)
        self.run, params = run, new_params(config)
        state = new_state(params)
        state["estimate"]["started"], state["demand"]["standing_s"] = 1, 9.0
        self.ecu = SimpleNamespace(params=params, state=state, estimate=state["estimate"])
        self.draft = to_record(config.model_dump())
        self.begin(save)

    def begin(self, save):
        self.takeover = Takeover(RingReader(self.run.ring.path, asks=True), save, self.look)

    def look(self, _):
        self.run.publish(1)
        header = self.run.ring.header
        header["followed"] = self.run.number - 1
        consider(self.run.ring, self.ecu, self.run.number, round(1e9 * monotonic_s()))

    def take(self, **values):
        """Write values into the draft, by their last names, and take it over; return what was logged."""
        for key in PARAMETERS.names:
            name = key.rpartition(".")[2]
            if name in values and key.split(".")[0] not in ("front", "rear", "vehicle"):
                self.draft[key] = values[name]
        with structlog.testing.capture_logs() as lines:
            try:
                self.takeover.take_over(self.draft.tobytes())
            except Refused as refused:
                return refused.error, lines[-1]["reason"]
        return None


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    monkeypatch.setattr(asking, "ANSWERS_IN_S", 0.05)


@pytest.fixture
def calibrated(loop, configuration, tmp_path):
    run = loop(configuration=configuration)
    return Calibrated(run, resource("config/suv.toml"), tmp_path / "saved.toml")


def eight(*values):
    return [*values, *[NAN] * (8 - len(values))]


def test_the_loop_gets_what_a_config_file_would_give(calibrated, tmp_path):
    assert (
        calibrated.take(max_pressure_rate=2000.0, pedal_decel=eight(0, 0, 1, 2.5, 4.5, 7, 10), mu_drift=0.03)
        is None
    )
    assert calibrated.takeover.begins == in_force(calibrated.run.ring).cycle > 0
    calibrated.takeover.save(calibrated.takeover.current())
    given = load_config(tmp_path / "saved.toml")
    assert given.control.max_pressure_rate == 2000.0
    want = new_params(given)
    want["transmit"] = calibrated.ecu.params["transmit"]
    assert calibrated.ecu.params.tobytes() == want.tobytes()


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"max_pressure_rate": NAN}, "control.max_pressure_rate: give a finite number"),
        ({"max_pressure_rate": 1499.0}, "control.max_pressure_rate: give a value of at least 1500 bar/s"),
        ({"max_pressure": float("inf")}, "control.max_pressure: give a finite number"),
        ({"max_pressure_rate": struct.unpack("<d", b"\0\0\0\0\0@\xaf@")[0] / 4}, "give a value of at least"),
        ({"pedal_decel": eight(0, NAN, 3)}, "control.pedal_decel.2: give a finite number"),
        ({"pedal_decel": eight()}, "control.pedal_decel: give at least 2 values"),
        ({"pedal_decel": eight(0, 0, 1, 0.5, 4, 7, 10)}, "control.pedal_decel: must rise"),
        ({"pedal_decel": eight(0, 2)}, "pedal_position and pedal_decel need the same number of points"),
        ({"pedal_decel": eight(0, 0, 1, 2, 3, 4, 5)}, "control.pedal_decel"),  # Annex 3 asks for more
        ({"front_share": 0.6}, '"ideal" has its own'),
        ({"mu_drift": -1.0}, "observer.mu_drift: give a value above 0.0001 1/sqrt(s)"),
    ],
)
def test_what_a_config_may_not_have_is_refused_by_the_same_line(calibrated, values, says):
    before = calibrated.ecu.params.tobytes()
    error, reason = calibrated.take(**values)
    assert error == Error.OUT_OF_RANGE
    assert reason.startswith("calibration: ")
    assert says in reason
    assert calibrated.ecu.params.tobytes() == before
    assert in_force(calibrated.run.ring) is None


def test_two_values_that_are_valid_together_alone(calibrated):
    """A point more of the pedal map: refused while one of its two lists has it."""
    positions, decels = [0, 5, 20, 40, 60, 70, 80, 100], [0, 0, 0.8, 2.1, 4, 5, 6.6, 10]
    assert calibrated.take(pedal_position=positions)[0] == Error.OUT_OF_RANGE
    assert calibrated.take(pedal_decel=decels) is None
    assert calibrated.ecu.params["pedal_position"][0].tolist() == positions


def test_a_car_that_is_armed_and_drives(calibrated):
    calibrated.ecu.params["transmit"], calibrated.ecu.estimate["speed"] = 1, 20.0
    error, reason = calibrated.take(max_pressure_rate=2000.0)
    assert error == Error.RESOURCE_TEMPORARY_NOT_ACCESSIBLE
    assert reason == "the car is armed and does not stand; stop, or calibrate a shadow"
    calibrated.ecu.estimate["speed"] = 0.0
    assert calibrated.take() is None


def test_a_loop_that_stands_still_takes_nothing_later(calibrated, monkeypatch):
    monkeypatch.setattr(calibrated.takeover, "_sleep", lambda _: None)
    assert calibrated.take(max_pressure_rate=2000.0)[0] == Error.RESOURCE_TEMPORARY_NOT_ACCESSIBLE
    calibrated.look(0)
    assert in_force(calibrated.run.ring) is None


def test_one_that_is_not_recorded_yet_is_waited_for(calibrated, monkeypatch):
    assert calibrated.take(max_pressure_rate=2000.0) is None
    calibrated.run.ring.header["followed"] = -1
    monkeypatch.setattr(calibrated.takeover, "_sleep", lambda _: None)
    error, reason = calibrated.take(max_pressure_rate=2100.0)
    assert error == Error.RESOURCE_TEMPORARY_NOT_ACCESSIBLE
    assert reason == "the change before is not recorded yet; try again"


def test_each_cycle_has_the_parameters_that_it_went_by(calibrated):
    assert calibrated.take(max_pressure_rate=2000.0) is None
    begins = calibrated.takeover.begins
    cycles = np.zeros(4, [("number", "i8")])
    cycles["number"] = np.arange(begins - 2, begins + 2)
    found = calibrated.takeover.parameters_of(cycles)["control.max_pressure_rate"].tolist()
    assert found == [3000.0, 3000.0, 2000.0, 2000.0]


def test_a_slave_that_is_started_again_goes_on_with_what_the_loop_goes_by(calibrated):
    assert calibrated.take(max_pressure_rate=2000.0) is None
    now = calibrated.takeover.current()
    calibrated.begin(None)
    assert calibrated.takeover.current() == now != calibrated.takeover.reference
    assert calibrated.take(mu_drift=0.03) is None
    assert in_force(calibrated.run.ring).number == 2


def test_what_is_saved_is_a_config_of_a_shadow(calibrated, tmp_path):
    path = tmp_path / "saved.toml"
    calibrated.takeover.save(calibrated.takeover.current())
    assert path.read_text().splitlines()[0] == SAVED
    shipped = load_config(resource("config/suv.toml"))
    assert load_config(path) == shipped.model_copy(update={"transmit": False})
    assert [one.name for one in tmp_path.iterdir() if one.is_file()] == ["saved.toml"]


@pytest.mark.parametrize(
    ("save", "changed", "error", "says"),
    [
        ("", False, Error.MODE_NOT_VALID, "start with --xcp-save FILE"),
        ("saved.toml", True, Error.SEQUENCE, "take the working page over first"),
        ("none/saved.toml", False, Error.GENERIC, "saved.toml: cannot be written: No such file"),
    ],
)
def test_what_cannot_be_saved(calibrated, tmp_path, save, changed, error, says):
    calibrated.begin(tmp_path / save if save else None)
    if changed:
        calibrated.draft["control.max_pressure_rate"] = 2000.0
    with structlog.testing.capture_logs() as lines, pytest.raises(Refused) as refused:
        calibrated.takeover.save(calibrated.draft.tobytes())
    assert refused.value.error == error
    assert says in lines[-1]["reason"]


def test_a_recorded_configuration_that_is_none_is_an_error(loop, configuration):
    run = loop(configuration={**configuration, "vehicle": {**configuration["vehicle"], "mass": 1.0}})
    with pytest.raises(UserError, match=r"calibration: vehicle\.mass"):
        Takeover(RingReader(run.ring.path, asks=True), None)
