"""A torque whose zero is off, columns that hang, a disc that no air cools: found, not where all is sound."""

import numpy as np
import pytest

from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.sensors import air_of, coolings, refuse_air, refuse_hung, without_zero
from brakelab.identify.wear.reader import IN_ORDER
from ecu.errors import UserError
from ecu.settings.config import load_config
from ecu.settings.resources import resource

RATE = 10.0  # Hz
AIR = 22.0  # degC


@pytest.fixture(scope="module")
def described() -> Columns:
    return Columns.contract(IN_ORDER, "rad/s", load_config(resource("config/suv.toml")), "front")


def thirty_stops(inertia: float, pause: float, wind: float = 0.5, air: float = AIR) -> Recording:
    """Return stops, each after a `pause` [s] of cooling, of a disc that radiates and warms its hat."""
    random = np.random.default_rng(7)
    rows = []
    rubbed = hat = air + 30.0
    for _ in range(30):
        speed, left = random.uniform(40.0, 100.0), pause
        while speed > 5.0:
            braked = left <= 0.0
            torque = 10.8 * inertia * braked
            speed -= torque / inertia / RATE
            left -= 1.0 / RATE
            out = (7.0 + wind * speed) * (rubbed - air)
            out += 4e-9 * ((rubbed + 273.0) ** 4 - (air + 273.0) ** 4)
            rubbed += (torque * speed - out - 300.0 * (rubbed - hat)) / 2000.0 / RATE
            hat += 300.0 * (rubbed - hat) / 2000.0 / RATE
            rows.append((0.5e5 * 0.4 + 20e5 * braked, torque, speed, rubbed))
    noise = np.array([0.05e5, 3.0, 0.05, 0.3]) * random.standard_normal((len(rows), 4))
    pressure, torque, speed, heat = (np.array(rows) + noise).T
    return Recording(np.arange(len(rows)) / RATE, pressure, torque, speed, heat)


@pytest.fixture(scope="module")
def sound() -> Recording:
    return thirty_stops(65.0, 120.0)


def test_a_sound_recording_stays_as_it_is(sound, described, capsys):
    assert without_zero(sound, described, "run.csv") is sound
    refuse_hung(sound, described, "run.csv")
    refuse_air(sound, described, "run.csv")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("zero", [40.0, -25.0])
def test_the_zero_of_a_torque_is_taken_off_and_said(sound, described, capsys, zero):
    mended = without_zero(sound._replace(torque=sound.torque + zero), described, "run.csv")
    assert np.median(mended.torque - sound.torque) == pytest.approx(0.0, abs=0.5)
    said = capsys.readouterr().err
    assert said.startswith(f"run.csv: brake_torque shows {zero:+.1f}"[:-1])
    assert "first at 0.0 s" in said


def test_a_torque_that_drives_the_flywheel_between_stops_is_no_zero(sound, described, capsys):
    """A shaft's transducer sees what speeds the flywheel up, which is not steady."""
    let_go = sound.pressure < 1e5
    driven = np.where(let_go, -np.linspace(0.0, 300.0, len(let_go)) % 200.0, 0.0)
    shaft = sound._replace(torque=sound.torque + driven)
    assert without_zero(shaft, described, "run.csv") is shaft
    assert capsys.readouterr().err == ""


# quantity, value -> what is said
HUNG = {
    "thermocouple": (
        "temperature",
        96.5,
        r"disc_temperature: stands at 96.5 °C from \d+.\d to \d+.\d s, over 1[345]",
    ),
    "torque": ("torque", 312.0, "brake_torque: stands at 312 N m"),
    "pressure": ("pressure", 18e5, "calliper_pressure: stands at 1.8e.06 Pa"),
    "speed": ("speed", 55.0, "omega: stands at 55 rad/s"),
}


@pytest.mark.parametrize(("quantity", "value", "said"), HUNG.values(), ids=HUNG)
def test_a_column_that_hangs_half_of_the_time_is_refused(sound, described, quantity, value, said):
    values = getattr(sound, quantity).copy()
    values[len(values) // 2 :] = value
    with pytest.raises(UserError, match=said):
        refuse_hung(sound._replace(**{quantity: values}), described, "run.csv")


def test_a_recorder_that_stands_while_the_disc_turns_is_refused(sound, described):
    place = int(np.argmax(sound.speed > 60.0))
    held = Recording(sound.time, *(values.copy() for values in sound[1:]))
    for values in held[1:]:
        values[place : place + 200] = values[place]
    with pytest.raises(UserError, match=r"t: all the same values .* while the disc turns"):
        refuse_hung(held, described, "run.csv")


def test_a_rounded_thermocouple_does_not_hang(sound, described):
    refuse_hung(sound._replace(temperature=np.round(sound.temperature)), described, "run.csv")


def test_a_disc_cools_towards_the_air(sound, described):
    assert air_of(coolings(sound, described)) == pytest.approx(AIR, abs=12.0)


def test_a_hot_disc_that_radiates_is_not_refused(described):
    hot = thirty_stops(250.0, 70.0, wind=0.1, air=35.0)
    assert hot.temperature.max() > 400.0
    refuse_air(hot, described, "run.csv")


def test_a_thermocouple_whose_zero_is_off_by_60_k_is_refused(sound, described):
    with pytest.raises(
        UserError, match=r"run.csv: disc_temperature: cools towards \d+ °C .* no air is as warm"
    ):
        refuse_air(sound._replace(temperature=sound.temperature + 60.0), described, "run.csv")


def test_where_little_cooling_was_recorded_nothing_is_said_of_the_air(sound, described):
    short = Recording(*(values[:4000] for values in sound))
    refuse_air(short._replace(temperature=short.temperature + 60.0), described, "run.csv")
