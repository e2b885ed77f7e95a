"""Every usual mistake in a recording is named, with its remedy; a sound one is not doubted."""

import pytest

from brakelab.identify.friction.check import CONFIGURED, Numbers, likeliest, refuse_nonsense, say_unlike
from brakelab.identify.friction.columns import Columns, DiscGiven, Rig
from brakelab.identify.friction.recording import Recording
from brakelab.identify.wear.reader import IN_ORDER
from ecu.errors import UserError
from ecu.settings.config import load_config
from ecu.settings.resources import resource


def test_a_sound_recording_passes(recording: Recording, columns: Columns) -> None:
    numbers = refuse_nonsense(recording, columns, "cpc.csv")
    assert numbers.friction == pytest.approx(0.44, abs=0.05)
    assert numbers.inertia == pytest.approx(129.1, rel=0.02)
    # The thermocouple lags, the air cools, and the heat capacity rises: all three heat the disc less.
    assert numbers.heating == pytest.approx(2.111e-4, rel=0.18)


@pytest.mark.parametrize(
    ("column", "factor", "known", "place", "remedy"),
    [
        ("pressure", 14.504, True, "pressure", 'give the unit "psi"'),
        ("pressure", 14.504, False, "pressure", 'give the unit "psi"'),
        ("pressure", 0.1, True, "pressure", 'give the unit "MPa"'),
        ("pressure", 0.1, False, "pressure", 'give the unit "MPa"'),
        ("torque", 0.5, True, "torque", "one pad: set pads = 1"),
        ("torque", 1e-3, False, "torque", 'give the unit "kN m"'),
        ("speed", 1.0 / 3.6, True, "speed", 'give the unit "m/s"'),
        ("speed", 1.0 / 1.609, True, "speed", 'give the unit "mph"'),
    ],
)
def test_a_mistake_is_named(
    recording: Recording, columns: Columns, column: str, factor: float, known: bool, place: str, remedy: str
) -> None:
    """`known`: the flywheel's inertia and the disc's heating are given."""
    if not known:
        columns = columns.model_copy(update={"rig": Rig(), "disc": DiscGiven()})
    spoilt = recording._replace(**{column: getattr(recording, column) * factor})
    with pytest.raises(UserError) as error:
        refuse_nonsense(spoilt, columns, "cpc.csv")
    assert str(error.value).startswith(f"cpc.csv: {place} (friction ")
    assert remedy in str(error.value)


@pytest.mark.parametrize(
    ("factor", "remedy"), [(1.8, 'give the unit "°F"'), (0.2, "take the column of the disc")]
)
def test_a_temperature_is_doubted_by_what_the_energy_heats(
    recording: Recording, columns: Columns, factor: float, remedy: str
) -> None:
    spoilt = recording._replace(temperature=recording.temperature * factor + (32.0 if factor > 1 else 40.0))
    with pytest.raises(UserError, match="temperature") as error:
        refuse_nonsense(spoilt, columns, "cpc.csv")
    assert remedy in str(error.value)


def test_a_thermocouple_that_shows_nothing_is_named(recording: Recording, columns: Columns) -> None:
    still = recording._replace(temperature=0.0 * recording.temperature + 25.0)
    with pytest.raises(UserError, match="temperature: does not change; give the column of the disc's"):
        refuse_nonsense(still, columns, "DATA")


def test_kelvin_is_no_disc(recording: Recording, columns: Columns) -> None:
    with pytest.raises(UserError, match="no brake disc is that"):
        refuse_nonsense(recording._replace(temperature=recording.temperature + 800.0), columns, "cpc.csv")


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_milliseconds_are_no_seconds(recording: Recording, columns: Columns, factor: float) -> None:
    with pytest.raises(UserError, match=r"time, .* s between samples: check its unit"):
        refuse_nonsense(recording._replace(time=recording.time * factor), columns, "cpc.csv")


def test_kelvin_that_a_disc_could_have_is_known_by_its_coldest(
    recording: Recording, columns: Columns
) -> None:
    with pytest.raises(UserError, match='reads like K: give the unit "K"'):
        refuse_nonsense(recording._replace(temperature=recording.temperature + 273.15), columns, "cpc.csv")


@pytest.mark.parametrize(
    ("end", "evened", "said"),
    [
        (3.8e-4, 1.74e-4, None),  # a thermocouple on the surface, hard stops of some seconds
        (1e-6, 2.28e-4, None),  # one that is 6 s late
        (3.8e-4, 3.4e-4, "°F"),
        (0.4e-4, 0.45e-4, "backing plate"),
    ],
)
def test_a_disc_is_heated_by_what_lies_between_its_rise_at_once_and_evened_out(end, evened, said):
    columns = Columns.contract(IN_ORDER, "rad/s", load_config(resource("config/suv.toml")), "front")
    mistake = likeliest(Numbers(0.45, 60.0, end, evened), columns, CONFIGURED)
    assert (mistake is None) if said is None else (mistake is not None and said in mistake.remedy)


def test_a_recording_that_is_heated_unlike_the_others_is_named(capsys):
    bounds = [(3.8e-4, 1.7e-4), (2.6e-4, 1.8e-4), (5.9e-4, 3.3e-4), (2.1e-4, 0.6e-4), (2.9e-4, 1.8e-4)]
    say_unlike("abcde", [Numbers(0.45, 60.0, *each) for each in bounds], "manifest.csv", "block")
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("manifest.csv: block c: the same work heats its disc 1.")
