"""The judgement: what is taken of the product's results, the tables, and thirty cars."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from .brakings import find, read
from .judge import Judged, draw_calibration, judge_car, main, published, report, tabled
from .logger import CORNERS
from .route import G
from .test_brakings import NOMINAL, pulse, signals

pytestmark = pytest.mark.study


def result(**columns: float) -> dict[str, np.ndarray]:
    """Result columns of the signals of `signals`: constants, but in row 300 and later all is doubled."""
    t = signals(pulse())["t"]
    given = {"mu_b_fl": 0.4, "mu_b_fr": 0.4, "mu_b_rl": 0.5, "mu_b_rr": 0.5} | {
        f"{name}_{corner}": value
        for name, value in (("pressure_zero", 0.7), ("sigma_mu_b", 0.04))
        for corner in CORNERS
    }
    given |= {"grip_limit": np.nan, "grip_knee": np.nan, "grip_fall": 0.0, "motor_torque_share": 1.0}
    given |= {"vehicle_mass": 1200.0, "accel_x_zero": 0.0, "sigma_brake_force": 0.1}
    given |= {"overrun": 0.0, "overrun_power": 0.0} | columns
    later = np.where(np.arange(len(t)) >= 300, 2.0, 1.0)
    return {"t": t} | {name: value * later for name, value in given.items()}


@pytest.mark.parametrize(
    ("columns", "lining", "more"),
    [
        ({}, 1.0, 0.0),
        ({"overrun": 0.8}, 1.0, 0.8),
        ({"overrun_power": 7.0}, 1.0, "power"),
        ({"accel_x_zero": 0.2}, 1.0, -0.2 / (1.0 + G * 0.002)),
        ({f"mu_b_{corner}": 0.3 for corner in CORNERS}, None, 0.0),
        ({"grip_limit": 2.9, "grip_knee": 2.5}, "bent", 0.0),
        (
            {"grip_limit": 0.45, "grip_knee": 3.0, "grip_fall": 0.2},
            0.4 / 4.617,
            0.0,
        ),  # of a peak of 0.5 m/s^2
        ({f"pressure_zero_{corner}": 2.65 for corner in CORNERS}, 0.9, 0.0),  # 17.55 of 19.5 bar
    ],
)
def test_the_row_before_a_braking_predicts_it(
    columns: dict[str, float], lining: float | str | None, more: float | str
) -> None:
    known = read(signals(pulse()), NOMINAL)
    brakings = find(known, NOMINAL)
    said = published(result(**columns), known, brakings, NOMINAL)
    nominal = np.mean(brakings[0].lining)
    if more == "power":
        more = float(np.mean(7.0 / known.speed[brakings[0].rows])) - 0.7
    if lining == "bent":
        lining = (1.0 + (nominal / 2.9) ** 2.5) ** -0.4
    if lining is None:
        area = np.array([0.04, 0.03]) ** 2
        lining = 0.3 * area.sum() / (area @ [0.4, 0.5])
    assert said.decel[0] == pytest.approx(lining * nominal + brakings[0].rest + more, rel=1e-3)
    assert said.sigma[0] == pytest.approx(0.1 * lining * nominal, rel=1e-3)


def test_its_own_table_is_found_by_time() -> None:
    known = read(signals(pulse()), NOMINAL)
    brakings = find(known, NOMINAL)
    corners = np.tile(CORNERS, 2)
    columns = {
        "corner": corners,
        "t_start": np.repeat([5.5, 8.05], 4),
        "duration": np.repeat([1.0, 1.9], 4),
        "decel_predicted": np.repeat([9.0, 4.5], 4),
        "decel_mean": np.repeat([8.0, 4.0], 4),
        "left_out": np.repeat(["", ""], 4),
    }

    class Table(dict):
        columns = property(lambda self: list(self))

    own = SimpleNamespace(brakings=Table(columns))
    said, measured = tabled(own, known, brakings, ("decel_predicted", "decel_mean", "no_sigma"))
    assert (said.decel[0], measured[0]) == (4.5, 4.0)
    assert np.isnan(said.sigma[0])
    columns["left_out"] = np.repeat(["", "against the accelerator"], 4)
    own = SimpleNamespace(brakings=Table(columns))
    assert np.isnan(tabled(own, known, brakings, ("decel_predicted", "decel_mean", ""))[0].decel[0])


def test_tables_pool_split_and_number() -> None:
    judged = [
        Judged(0, "A", ("rain",), 1, "never learning", 6.0, 5.0, np.nan),
        Judged(0, "A", ("rain",), 2, "never learning", 4.5, 5.0, np.nan),
        Judged(1, "B", (), 1, "never learning", 5.0, 5.0, np.nan),
        Judged(0, "A", ("rain",), 1, "filter", 5.5, 5.0, 0.2),
        Judged(1, "B", (), 1, "filter", 5.1, 5.0, 0.2),
    ]
    text = report(judged)
    assert "| never learning | 10.0/18 | 15.0/19 | 0.0/0 |" in text
    assert "| filter | 6.0/9 50 | 10.0/10 0 | 2.0/2 100 |" in text
    assert "| never learning | 10.0 (+10) | 10.0 (-10) |" in text
    assert "| filter | 6.0/9 50 | 10.0/10 0 |" in text, "without rain and with it"


def test_the_share_inside_k_sigma_is_drawn(tmp_path: Path) -> None:
    """Errors of 0, 1 and 2 sigma: a step of a third at each, the last at two thirds of the axis."""
    judged = [Judged(0, "A", (), n, "filter", 5.0 + 0.2 * n, 5.0, 0.2) for n in range(3)]
    draw_calibration(judged, out := tmp_path / "calibration.svg")
    text = out.read_text("utf-8")
    assert "normal distribution" in text
    assert "filter" in text
    paths = [
        [tuple(map(float, pair.split(","))) for pair in line.split()]
        for line in re.findall(r'points="([^"]+)"', text)
    ]
    top, bottom = paths[0][-1][1], paths[0][0][1]
    shares = [round(3.0 * (bottom - y) / (bottom - top)) for _, y in paths[1]]
    assert [shares[0], shares[19], shares[21], shares[39], shares[41]] == [1, 1, 2, 2, 3]


@pytest.mark.compiled
def test_a_car_is_judged_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "judged.json"
    assert main(["--cars", "3", "--workers", "1", "--json", str(out), "--keep", str(tmp_path / "kept")]) == 0
    said = capsys.readouterr()
    assert "car 3: 1 of 1" in said.err
    assert "product, published" in said.out
    names = {path.name for path in (tmp_path / "kept").iterdir()}
    assert {"03-D.parquet", "03-D.toml", "03-D.truth.parquet", "03-D.result.brakes.parquet"} <= names
    assert '"predictor": "running average"' in out.read_text("utf-8")


def test_thirty_strangers(tmp_path: Path) -> None:
    """References in the order that recorded cars showed, and the product near the best of them."""
    judged = [one for number in range(30) for one in judge_car(1, number, tmp_path)]
    error = {
        name: np.mean([abs(one.error) for one in judged if one.predictor == name])
        for name in dict.fromkeys(one.predictor for one in judged)
    }
    print(error)
    assert error["its form, hindsight"] < error["saturating filter"] < error["running average"]
    assert error["running average"] < error["never learning"]
    assert error["saturating filter"] < 9.0
    stated = [one for one in judged if one.predictor == "saturating filter"]
    assert 0.88 < np.mean([abs(one.predicted - one.measured) < 2 * one.sigma for one in stated]) < 0.99
    assert error["product, published"] < 0.65 * error["running average"]
    said = [one for one in judged if one.predictor == "product, published"]
    assert 0.88 < np.mean([abs(one.predicted - one.measured) < 2 * one.sigma for one in said]) < 0.99
    assert len({one.car for one in judged}) == 30
