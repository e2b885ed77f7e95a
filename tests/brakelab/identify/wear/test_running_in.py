"""Running-in: found of masses of blocks that wore by another form of it; none where there is none."""

import numpy as np
import pytest

from brakelab.identify.wear.fit import fit_law
from brakelab.identify.wear.fusion import BALANCE
from brakelab.identify.wear.page import run_in_line
from brakelab.identify.wear.running_in import TARE, Measured, measured, run_in_mass, unlinked, worn_before

from .test_fit import LAW, by_a_step_of_heat, regressors

pytestmark = pytest.mark.study

DRAWS = 10


def faster(energy: float, gain: float, work: float) -> float:
    """Return how much faster than run-in pads those wear that have done `energy`; no exponential, of work."""
    return 1.0 + gain / (1.0 + energy / work) ** 2


def worn(true: np.ndarray, energy: np.ndarray, gain: float, work: float) -> np.ndarray:
    """Return the masses [g] of blocks one after the other on new pads, in small steps of their energy."""
    done, found = 0.0, np.empty(len(true))
    for block, (mass, through) in enumerate(zip(true, energy, strict=True)):
        steps = done + through * (np.arange(200) + 0.5) / 200
        found[block] = mass * np.mean(faster(steps, gain, work))
        done += through
    return found


def programme(seed: int, gain: float, again: bool) -> tuple[Measured, np.ndarray]:
    """Return the wear of eight blocks in a drawn order, the first `again` at the end, and the true masses."""
    random = np.random.default_rng([seed, 4])
    x = regressors(seed, 8)
    if again:
        x = np.vstack([x, x[0]])
    true = by_a_step_of_heat(x)
    made = worn(true, x[:, 0], gain, random.uniform(15.0, 60.0))
    mass = made * (1.0 + 0.03 * random.standard_normal(len(x)))
    mass += np.sqrt(2.0) * BALANCE * random.standard_normal(len(x))
    return measured(x, np.full(len(x), np.nan), mass, np.cumsum(mass) - mass), true


# gain -> RMS of the predictions, beside those of a law that knows no running-in
RUN_IN = {"new pads": (0.6, 0.05, 1.7), "run-in pads": (0.0, 0.05, 0.9)}


@pytest.mark.parametrize(("gain", "error", "times"), RUN_IN.values(), ids=RUN_IN)
def test_blocks_not_seen_are_predicted_nearer_over_draws(gain: float, error: float, times: float):
    """Running-in of work, not of mass; wear of another form than any fitted; 3 % scatter."""
    errors, without = [], []
    for seed in range(DRAWS):
        wear, _ = programme(seed, gain, again=True)
        new = regressors(1000 + seed, 20)[1:]
        for found, mass, variance in (
            (errors, wear.mass, wear.variance),
            (without, wear.fused.mass, np.diag(wear.fused.covariance)),
        ):
            law = fit_law(wear.regressors, mass, variance)
            found.append(np.mean((new @ law.coefficients / by_a_step_of_heat(new) - 1.0) ** 2))
    own, before = np.sqrt(np.mean(errors)), np.sqrt(np.mean(without))
    print(own, before)
    assert own < error
    assert before > times * own


def test_a_block_that_repeats_makes_it_surer_over_draws():
    runs = [[programme(seed, 0.6, again)[0].run_in for seed in range(DRAWS)] for again in (False, True)]
    alone, repeated = (np.median([one.sigma for one in many]) for many in runs)
    print(alone, repeated)
    assert repeated < 0.8 * alone
    assert all(one.repeated for one in runs[1])
    assert not any(one.repeated for one in runs[0])
    assert "no block repeats another" in run_in_line(runs[0][0])
    assert "no block repeats another" not in run_in_line(runs[1][0])


def test_the_mass_of_run_in_pads_is_the_integral():
    begun, end, gain, decay = 1.5, 6.0, 0.7, 4.0
    steps = np.linspace(begun, end, 100_001)
    exact = np.trapezoid(1.0 / (1.0 + gain * np.exp(-steps / decay)), steps)
    found = run_in_mass(np.array([begun]), np.array([end - begun]), gain, decay)
    assert found[0] == pytest.approx(exact, rel=1e-8)


# masses before, after -> worn off before each
CHAINS = {
    "in order": ([900.0, 897.0, 895.0], [897.0, 895.0, 890.0], [0.0, 3.0, 5.0]),
    "rows in another order": ([895.0, 900.0, 897.0], [890.0, 897.0, 895.0], [5.0, 0.0, 3.0]),
    "worn between blocks": ([900.0, 880.0, 870.0], [897.0, 878.0, 868.0], [0.0, 20.0, 30.0]),
    "damp pads": ([900.0, 897.0 + 0.8 * TARE], [897.0, 895.0], [0.0, 3.0 - 0.8 * TARE]),
    "new pads for each": ([900.0, 899.0, 901.0], [897.0, 897.0, 896.0], None),
    "one mistyped by 0.8 g": (
        [900.0, 897.0, 895.0, 892.0],
        [897.0, 894.2, 892.0, 890.0],
        [0.0, 3.0, 5.0, 8.0],
    ),
    "what it lost, from the same number": ([450.0, 450.0], [447.0, 448.0], None),
}


@pytest.mark.parametrize(("before", "after", "begun"), CHAINS.values(), ids=CHAINS)
def test_what_was_worn_off_comes_of_the_masses(before, after, begun):
    found = worn_before(np.array(before), np.array(after))
    assert (found is None) if begun is None else found.tolist() == pytest.approx(begun)


# grams of which the second block's last mass is wrong -> what is named: that block, the next, and by how much
LINKS = {"right": (0.0, []), "too light": (-0.8, [(1, 2, 0.8)]), "too heavy": (0.7, [(1, 2, -0.7)])}


@pytest.mark.parametrize(("grams", "named"), LINKS.values(), ids=LINKS)
def test_masses_that_do_not_follow_one_another_are_named(grams, named):
    before = np.array([900.0, 897.05, 895.0, 892.02, 889.0])
    after = np.array([897.0, 895.02 + grams, 892.05, 889.0, 885.0])
    found = [(one, other, pytest.approx(by, abs=0.05)) for one, other, by in unlinked(before, after)]
    assert found == named
    apart = before - 3.0 * np.arange(5), after - 3.0 * np.arange(5)
    assert unlinked(*apart) == []  # worn between the blocks


def test_where_nothing_says_what_was_worn_off_the_masses_stay_and_sigma_grows():
    x = regressors(3, 8)
    wear = measured(x, np.full(8, np.nan), x @ LAW, None)
    np.testing.assert_array_equal(wear.mass, x @ LAW)
    assert wear.run_in.sigma > 0.08
    assert "not those of one set of pads" in run_in_line(wear.run_in)
