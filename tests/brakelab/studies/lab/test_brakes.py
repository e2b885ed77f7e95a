"""The bench of the friction laboratory: the printed tables it stands beside, and its own arithmetic."""

from types import SimpleNamespace

import numpy as np
import pytest

from brakelab.identify.friction.choice import Judged
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.dynamometer import new_bench
from brakelab.identify.friction.sequence import load_sequence, run_sequence
from brakelab.identify.friction.stops import Stops, find_stops
from brakelab.plant.friction.constant import Constant
from brakelab.studies.lab.bad_input import answers
from brakelab.studies.lab.brakes import (
    NOISE,
    OnAms,
    Recovered,
    linings,
    on_ams,
    r1_recording,
    recovery,
    table_errors,
)
from brakelab.studies.lab.choice import choice_of, compared
from brakelab.studies.lab.tables import PRINTED, TABLE_3_4_NRMSE
from brakelab.studies.physics.friction import LOADINGS, TABLE_3_4, TEMPERATURES
from ecu.settings.resources import resource


@pytest.fixture(scope="module")
def ams() -> Stops:
    lining = linings().lining["A"]
    bench = new_bench(lining, "A", 1)
    programme = load_sequence(resource("config/rig/ams.toml"))
    recording = run_sequence(bench, programme, lambda share: None)
    rig = bench.rig[0]
    return find_stops(recording, Columns.own(lining, float(rig["mass"] * rig["tyre_radius"] ** 2)), "ams")


@pytest.mark.parametrize("law", ["ostermeyer", "ostermeyer_revised", "ilvo"])
@pytest.mark.parametrize("brake", ["A", "B", "C"])
def test_printed_errors_are_at_least_those_of_the_means(law: str, brake: str) -> None:
    """A stop's nRMSE holds the error of its mean, so no printed nRMSE may be far below (weights differ)."""
    measured = np.array(TABLE_3_4["measured"][brake])
    means = 100.0 * np.abs(np.array(TABLE_3_4[PRINTED[law]][brake]) / measured - 1.0)
    assert np.all(np.array(TABLE_3_4_NRMSE[law][brake]) > means - 2.0)


@pytest.mark.parametrize(("brake", "share"), [("A", 0.362), ("B", 0.253), ("C", 0.250)])
def test_the_thesis_s_loadings_give_these_shares_of_variance(brake: str, share: float) -> None:
    """Temperature's r^2 from the loading l and the three components' variance V: 2 l^2 (4 V - 3)^2."""
    *_, loading, variance = LOADINGS[brake]
    assert 2.0 * (loading * (4.0 * variance - 3.0)) ** 2 == pytest.approx(share, abs=0.01)


def test_a_constant_on_ams_errs_by_its_distance(ams: Stops) -> None:
    law = Constant(law="constant", rig_mass=996.0, mu=0.40)
    judged = Judged("constant", law, False, 1, 0.0, 0.0, 0.0, True, 0.0, (), (), "", "")
    found = on_ams(judged, linings().lining["A"], ams)
    assert len(ams) == len(TEMPERATURES)
    expected = 100.0 * (0.40 / ams.mean - 1.0)
    assert found.replayed == pytest.approx(expected, abs=1e-9)
    assert found.closed == pytest.approx(expected, abs=1e-6)
    assert np.all(found.nrmse >= np.abs(found.replayed) - 0.5)


def test_coverage_counts_draws_inside() -> None:
    truth = np.array([1.0, 2.0])
    draws = [
        Recovered("R1", "A", np.array([1.0 + off, 2.0]), np.array([0.1, 0.2]), truth, np.zeros(6))
        for off in (0.05, 0.2, -0.09)
    ]
    others = [Recovered(*of, truth + 9.0, truth, truth, np.zeros(6)) for of in (("R1", "B"), ("R2", "A"))]
    found = recovery("A", [*draws, *others])
    assert found.inside == pytest.approx([2.0 / 3.0, 1.0])
    assert found.width == pytest.approx([10.0, 10.0])


def test_the_error_of_table_3_4_is_that_of_all_brakes() -> None:
    """Two draws: 3, 4 and 0 % off in every mean give 100 sqrt((9 + 16) / 3) / 100; the other none."""
    means = {"A": 0.03, "B": 0.04, "C": 0.0}
    one = np.ones(1)
    found = [
        Recovered("R1", brake, one, one, one, off * draw * np.ones(6))
        for draw in (1.0, 0.0)
        for brake, off in means.items()
    ]
    assert table_errors("R1", found) == pytest.approx([5.0 / np.sqrt(3.0), 0.0])


def test_a_choice_is_judged_by_ams_alone() -> None:
    """The chosen law is no rival of its own; the best in hindsight may be none of the thesis's."""
    found = {"table": 4.0, "constant": 9.0, "ilvo": 5.0, "ostermeyer": 6.0, "ostermeyer_revised": 7.0}
    zero = np.zeros(6)
    ams = {name: OnAms(zero, zero, np.full(6, off)) for name, off in found.items()}
    law = Constant(law="constant", rig_mass=996.0, mu=0.40)
    seen = [
        choice_of(
            "A",
            3,
            SimpleNamespace(
                identified=SimpleNamespace(
                    chosen=Judged(name, law, False, 1, 0, 0, 0, True, 0, (), (), "", "")
                ),
                ams=ams,
                seconds=1.0,
            ),
        )
        for name in ("table", "ilvo", "constant")
    ]
    assert [(each.rival, each.best) for each in seen] == [
        ("ilvo", "table"),
        ("ostermeyer", "table"),
        ("ilvo", "table"),
    ]
    assert compared(seen) == (2, 0)


def test_the_noise_of_a_recovery_is_one_percent() -> None:
    lining = linings().lining["A"]
    one, two = (r1_recording(lining, NOISE, seed).torque for seed in (0, 1))
    on = one > 100.0
    assert np.std(one[on] / two[on] - 1.0) == pytest.approx(0.01 * np.sqrt(2.0), rel=0.03)


def test_every_bad_input_gets_one_line_of_its_own() -> None:
    """Refused, or read with the place of what was left out; nothing wrong passes in silence."""
    found = answers()
    assert all(each.line and "\n" not in each.line for each in found), found
    assert len({each.line for each in found}) == len(found)
    assert all("mine." in each.line for each in found)
    read = {each.what: each.line for each in found if not each.is_refused}
    assert list(read) == [
        "a row with two cells",
        "a word among the numbers",
        "a row twice",
        "the last row cut off",
    ]
    for line, place in zip(
        read.values(), ("line 52", "line 62", "line 73", "the last line is cut off"), strict=True
    ):
        assert place in line
