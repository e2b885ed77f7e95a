"""Logs that cannot tell the disc's model: each gives one line with file, signal and remedy."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.thermal.check import check_drive, check_fit
from brakelab.identify.thermal.fit import fit_axle
from brakelab.identify.thermal.model import Cooling
from brakelab.identify.thermal.reader import ThermalLog
from ecu.errors import UserError

from .series import DRY, XI, discs, series

ONES = np.ones(4)
START = Cooling(*DRY, DRY[0], 1.5 * DRY[1])


@pytest.fixture(scope="module")
def good():
    return series(1500)


def drive(one, **changed) -> ThermalLog:
    given = {"applications": 25, "wheels_seen": ONES, "pressures_seen": ONES, "rain_known": True} | changed
    return ThermalLog(Path("a.csv"), one, np.zeros((len(one.speed), 4)), **given)


def reading(one, change) -> ThermalLog:
    measured = one.measured.copy()
    measured[:, 0] = change(measured[:, 0])
    return drive(one._replace(measured=measured))


def short(one) -> ThermalLog:
    cut = {name: getattr(one, name)[:200] for name in ("power", "speed", "wet", "air", "measured")}
    return drive(one._replace(**cut))


def test_a_good_drive_names_its_measured_corners(good) -> None:
    assert check_drive(drive(good)) == [0, 1]


BAD = {
    "nothing measured": (lambda one: drive(one._replace(measured=np.nan * one.measured)), "not in this log"),
    "too short": (short, "lasts 200 s"),
    "no wheel speed": (lambda one: drive(one, wheels_seen=np.array([0.1, 1, 1, 1])), "wheel_speed_fl: known"),
    "no pressure": (lambda one: drive(one, pressures_seen=0.0 * ONES), "calliper_pressure_fl: mostly"),
    "no braking": (lambda one: drive(one, applications=0), "0 brake applications"),
    "few samples": (lambda one: reading(one, lambda x: np.where(np.arange(len(x)) % 20 == 0, x, np.nan)),
                    "log it once a second"),
    "constant": (lambda one: reading(one, lambda x: 25.0 + 0.0 * x), "stays at 25.0 for the whole log"),
    "K": (lambda one: reading(one, lambda x: x + 273.15), "K? convert it to degC"),
    "air in degF": (lambda one: drive(one._replace(air=1.8 * one.air + 62.0)), "below the air"),
    "saturated": (lambda one: reading(one, lambda x: np.minimum(x, np.percentile(x, 70))), "saturated"),
    "pyrometer": (lambda one: reading(one, lambda x: np.maximum(x, np.percentile(x, 50))), "range begins"),
    "one of two in degF": (lambda one: reading(one, lambda x: 1.8 * x + 32.0), "fl: rises and falls 1.*F"),
    "cold disc": (lambda one: reading(one, lambda x: 20.0 + 0.05 * x), "brake harder"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_bad_log_is_one_line(good, name) -> None:
    make, text = BAD[name]
    with pytest.raises(UserError, match=text.replace("?", r"\?")) as caught:
        check_drive(make(good))
    line = str(caught.value)
    assert line.startswith("a.csv: ")
    assert "\n" not in line


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda x: 1.8 * x + 32.0, "degF"),
        (lambda x: 12.0 + 0.2 * (x - 12.0), "0.2 times"),
        (lambda x: 12.0 + 4.0 * (x - 12.0), r"[34]\.\d times"),
    ],
    ids=["degF", "another wheel", "another brake"],
)
def test_a_temperature_that_the_work_cannot_explain_is_refused(good, change, text) -> None:
    wrong = discs(good._replace(measured=change(good.measured)))
    with pytest.raises(UserError, match=text):
        check_fit("a.csv", wrong, fit_axle(wrong, XI, START), XI, START)


@pytest.mark.parametrize("share", [0.7, 1.0, 1.4])
def test_a_right_temperature_of_a_brake_somewhat_configured_wrong_passes(good, share) -> None:
    right = discs(good)
    check_fit("a.csv", right, fit_axle(right, share * XI, START), share * XI, START)
