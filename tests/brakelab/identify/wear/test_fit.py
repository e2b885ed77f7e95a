"""Identification of a wear law: a known law is found within its confidence, by few blocks too."""

import numpy as np
import pytest

from brakelab.identify.wear.command import slope_is_known
from brakelab.identify.wear.fit import QUASI_STATIC, explains, fit_law, rank_of, strangers
from brakelab.identify.wear.fusion import BALANCE, POINT, POINTS, disagreeing, doubtful, fuse, unequal
from ecu.errors import UserError

pytestmark = pytest.mark.study

LAW = np.array([0.1016, 0.0, 0.0, 0.4887, 0.0, 0.0, 0.66e-2])  # Table 7.1 without its smallest term
SEEDS = 40


def regressors(seed: int, blocks: int = 10) -> np.ndarray:
    """Draw what blocks have: work, heat, slowing and power that vary by road and driver."""
    random = np.random.default_rng([seed, 1])
    energy, heat = random.uniform(10, 40, blocks), random.uniform(60, 250, blocks)
    rate, power = random.uniform(0.05, 0.4, blocks), random.uniform(0.01, 0.06, blocks)
    parts = (1.0, heat, 1.1 * heat**2, rate, rate * heat, power, power * heat)
    return energy[:, None] * np.column_stack([np.broadcast_to(part, blocks) for part in parts])


def measured(x: np.ndarray, seed: int, scatter: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    true = x @ LAW
    noise = np.random.default_rng([seed, 2]).standard_normal((2, len(x)))
    variance = np.full(len(x), 2 * BALANCE**2)
    return true * (1 + scatter * noise[0]) + np.sqrt(variance) * noise[1], variance


def test_a_law_without_scatter_is_found_exactly():
    x = regressors(0, 20)
    fit = fit_law(x, x @ LAW, np.full(20, 1e-12))
    np.testing.assert_allclose(x @ fit.coefficients, x @ LAW, rtol=5e-3)
    assert fit.r2 > 0.9999


def test_a_block_that_was_weighed_wrongly_is_found_and_no_other():
    """30 g too many in one of ten, no thickness beside it; sound blocks with 5 % scatter are all kept."""
    for seed in range(5):
        x = regressors(seed)
        mass, variance = measured(x, seed, 0.05)
        assert strangers(x, mass, variance) == []
        wrong = int(np.argsort(x[:, 1] / x[:, 0])[4])
        mass[wrong] += 30.0
        assert strangers(x, mass, variance) == [wrong]


def of_another_form(x: np.ndarray) -> np.ndarray:
    """Return masses [g] by a step of heat and a power of the load, run in over the first block."""
    heat, power = x[:, 1] / x[:, 0], x[:, 5] / x[:, 0]
    mass = 0.14 * x[:, 0] * (1.0 + 0.8 / (1.0 + np.exp(-(heat - 170.0) / 30.0))) * (power / 0.03) ** 0.3
    mass[0] *= 1.15
    return mass


def by_a_step_of_heat(x: np.ndarray) -> np.ndarray:
    heat = x[:, 1] / x[:, 0]
    return 0.14 * x[:, 0] * (1.0 + 0.8 / (1.0 + np.exp(-(heat - 170.0) / 30.0)))


def by_the_exponential_of_heat(x: np.ndarray) -> np.ndarray:
    return 0.1 * x[:, 0] * np.exp((x[:, 1] / x[:, 0] - 100.0) / 200.0)


OTHERS = {
    "a step of heat, four blocks": (by_a_step_of_heat, 4, 0.085),
    "the exponential of heat, four blocks": (by_the_exponential_of_heat, 4, 0.1),
    "heat and load, five blocks": (of_another_form, 5, 0.137),
}


@pytest.mark.parametrize(("true", "blocks", "error"), OTHERS.values(), ids=OTHERS)
def test_few_blocks_of_a_law_of_another_form_predict_others_over_seeds(true, blocks, error):
    """3 % scatter. With sets weighed by (error)^-n alone: 10.3, 12.0 and 15.0 % RMS."""
    errors = []
    for seed in range(20):
        x = regressors(seed, blocks)
        noise = np.random.default_rng([seed, 3]).standard_normal((2, blocks))
        mass = true(x) * (1.0 + 0.03 * noise[0]) + np.sqrt(2.0) * BALANCE * noise[1]
        law = fit_law(x, mass, np.full(blocks, 2 * BALANCE**2))
        new = regressors(1000 + seed, 20)[1:]
        errors.append(np.mean((new @ law.coefficients / true(new) - 1.0) ** 2))
    print(blocks, np.sqrt(np.mean(errors)))
    assert np.sqrt(np.mean(errors)) < error


MISTYPED = {
    "a law of the family": (lambda x: x @ LAW, 2.0, 0.7, 0.03, 0.05),
    "a law of another form, run in": (of_another_form, 2.0, 0.6, 0.1, 0.12),
    "a law of the family, nothing wrong": (lambda x: x @ LAW, 0.0, 0.0, 0.0, 0.05),
    "another form, nothing wrong": (of_another_form, 0.0, 0.0, 0.1, 0.12),
}


@pytest.mark.parametrize(("true", "grams", "found", "wrongly", "error"), MISTYPED.values(), ids=MISTYPED)
def test_two_grams_mistyped_without_a_thickness_are_found_over_seeds(true, grams, found, wrongly, error):
    """Eight blocks, 3 % scatter. By 80 % and the others' median 12 % were found."""
    right, false, errors = 0, 0, []
    for seed in range(24):
        x = regressors(seed, 8)
        noise = np.random.default_rng([seed, 3]).standard_normal((2, 8))
        mass = true(x) * (1.0 + 0.03 * noise[0]) + np.sqrt(2.0) * BALANCE * noise[1]
        wrong = int(np.argsort(x[:, 1] / x[:, 0])[4])
        mass[wrong] += grams
        variance = np.full(8, 2 * BALANCE**2)
        strange = strangers(x, mass, variance)
        right += wrong in strange and grams > 0.0
        false += bool(set(strange) - ({wrong} if grams else set()))
        kept = np.setdiff1d(np.arange(8), strange)
        law = fit_law(x[kept], mass[kept], variance[kept])
        new = regressors(1000 + seed, 20)[1:]
        errors.append(np.sqrt(np.mean((new @ law.coefficients / true(new) - 1.0) ** 2)))
    print(right / 24, false / 24, np.median(errors))
    assert right / 24 >= found
    assert false / 24 <= wrongly
    assert np.median(errors) < error


def test_a_law_that_tells_no_block_explains_nothing():
    x = regressors(2)
    mass, variance = measured(x, 2)
    assert explains(fit_law(x, mass, variance), mass)
    other = mass[::-1] * np.geomspace(0.2, 5.0, len(mass))
    assert not explains(fit_law(x, other, variance), other)


# wear of each block [mm] -> whether what a gram is worth is taken from them
WORN = {"a tenth each": (0.1, True), "a hundredth each": (0.01, False)}


@pytest.mark.parametrize(("wear", "known"), WORN.values(), ids=WORN)
def test_k_is_known_where_enough_was_worn_off(wear: float, known: bool):
    """Against a thousand programmes of six blocks, 27 g/mm."""
    random = np.random.default_rng(5)
    true = wear * np.linspace(0.8, 1.2, 6)
    made = [
        fuse(
            true + POINT * np.sqrt(2.0 / POINTS) * random.standard_normal(6),
            27.0 * true + np.sqrt(2.0) * BALANCE * random.standard_normal(6),
        )
        for _ in range(1000)
    ]
    assert np.mean([slope_is_known(one) for one in made]) == pytest.approx(float(known), abs=0.05)
    if known:
        assert np.std([one.slope for one in made]) == pytest.approx(made[0].slope_error, rel=0.1)


@pytest.mark.parametrize(("grams", "found"), [(0.0, []), (2.0, [3]), (-1.5, [3])])
def test_balance_and_thickness_that_disagree(grams: float, found: list[int]):
    """Blocks of 2 g and more, 27 g/mm; a block without thickness is not judged."""
    mass = np.array([2.0, 3.0, 2.5, 4.0, 3.5])
    wear = mass / 27.0
    wear[1] = np.nan
    mass[3] += grams
    assert [place for place, _ in disagreeing(wear, mass)] == found


# scatter of thickness beside mass, grams mistyped in a block -> share of programmes that name it, another one
DOUBTED = {
    "as sure as both are": (0.0, 0.8, 0.4, 0.02),
    "as sure as both are, more": (0.0, 1.2, 0.75, 0.02),
    "worn unevenly": (0.03, 1.2, 0.6, 0.05),
    "nothing wrong": (0.0, 0.0, 0.0, 0.05),
    "nothing wrong, worn unevenly": (0.05, 0.0, 0.0, 0.1),
}


@pytest.mark.parametrize(("uneven", "grams", "share", "wrongly"), DOUBTED.values(), ids=DOUBTED)
def test_a_block_weighed_wrongly_beside_its_thickness_is_doubted_over_seeds(uneven, grams, share, wrongly):
    named, others = 0, 0
    for seed in range(100):
        random = np.random.default_rng([seed, 8])
        true = random.uniform(2.0, 6.0, 7)
        mass = true + np.sqrt(2.0) * BALANCE * random.standard_normal(7)
        wear = true / 28.0 * (1.0 + uneven * random.standard_normal(7))
        wear += POINT * np.sqrt(2.0 / POINTS) * random.standard_normal(7)
        mass[4] += grams
        places = {place for place, _ in doubtful(wear, mass)}
        named += 4 in places
        others += bool(places - ({4} if grams else set()))
        if 4 in places and grams:
            assert fuse(wear, mass).covariance[4, 4] > 0.2 * grams**2
    print(named, others)
    assert named >= 100 * share
    assert others <= 100 * wrongly


@pytest.mark.parametrize(("grams", "found"), [(0.0, []), (0.8, [3]), (-0.7, [3]), (0.15, [])])
def test_pads_that_share_their_wear_unlike_in_the_other_blocks(grams: float, found: list[int]):
    """Inboard pads lose 1.2 times what outboard ones lose, give or take 5 %; one is mistyped."""
    outboard = np.array([1.0, 1.4, 1.2, 1.5, 1.1])
    inboard = 1.2 * outboard * (1.0 + 0.05 * np.array([1.0, -1.0, 0.5, 0.0, -0.5]))
    inboard[3] += grams
    outboard[1] = np.nan
    assert [place for place, _ in unequal(inboard, outboard)] == found


@pytest.mark.parametrize(("blocks", "error", "holds"), [(4, 0.16, 0.5), (8, 0.02, 0.85), (12, 0.015, 0.85)])
def test_the_true_mass_is_predicted_and_confidence_holds_over_seeds(blocks, error, holds):
    """New blocks by the identified law, and the true terms in their 95 %, whichever sets were chosen.

    A set chosen by AICc missed new blocks by 31 % where there were four, and held 2 % of the terms.
    """
    held, errors, places = 0, [], np.flatnonzero(LAW)
    for seed in range(SEEDS):
        x = regressors(seed, blocks)
        fit = fit_law(x, *measured(x, seed))
        new = regressors(1000 + seed, 6)
        errors.append(np.sqrt(np.mean((new @ fit.coefficients / (new @ LAW) - 1.0) ** 2)))
        held += np.sum((fit.low[places] <= LAW[places]) & (LAW[places] <= fit.high[places]))
    print(blocks, np.median(errors), held / (SEEDS * len(places)))
    assert np.median(errors) < error
    assert held / (SEEDS * len(places)) > holds


def test_blocks_of_one_temperature_say_little_of_another():
    """Their law was 51 % wrong on ordinary blocks, and said 10 %."""
    x = regressors(5, 8)
    alike = x.copy()
    alike[:, [1, 4, 6]] = 150.0 * x[:, [0, 3, 5]]
    alike[:, 2] = 1.02 * 150.0**2 * x[:, 0]
    fits = [fit_law(one, *measured(one, 5)) for one in (x, alike)]
    assert fits[0].elsewhere < 0.1
    assert fits[1].elsewhere > 0.15


def test_the_extended_law_is_chosen_over_the_quasi_static_one_by_its_criterion():
    x = regressors(3, 12)
    mass, variance = measured(x, 3)
    assert fit_law(x, mass, variance).criterion < fit_law(x, mass, variance, QUASI_STATIC).criterion - 4.0


def test_no_coefficient_is_negative():
    for seed in range(10):
        x = regressors(seed, 6)
        fit = fit_law(x, *measured(x, seed, 0.1))
        assert (fit.coefficients >= 0.0).all()


def test_blocks_that_are_multiples_of_one_another_have_rank_one():
    x = np.outer([1.0, 2.0, 3.0, 5.0], regressors(0, 1)[0])
    assert rank_of(x) == 1
    with pytest.raises(UserError, match="collinear: add other roads"):
        fit_law(x, x @ LAW, np.full(4, 1e-4))


def test_too_few_blocks():
    x = regressors(0, 2)
    with pytest.raises(UserError, match="give 3 or more"):
        fit_law(x, x @ LAW, np.full(2, 1e-4))


def test_fusion_is_most_likely_point_on_the_line_with_its_variance_over_seeds():
    """Truth y = K x; balance and gauge as stated: errors of the blend beside its covariance."""
    random = np.random.default_rng(5)
    true = random.uniform(0.02, 0.3, 8)
    chi, blend, balance = [], [], []
    for _ in range(300):
        wear = true + random.normal(0, POINT * np.sqrt(2 / POINTS), 8)
        mass = 35.0 * true + random.normal(0, np.sqrt(2) * BALANCE, 8)
        fused = fuse(wear, mass)
        error = fused.mass - 35.0 * true
        chi.append(error @ np.linalg.solve(fused.covariance, error))
        blend.append(error), balance.append(mass - 35.0 * true)
    assert np.mean(chi) == pytest.approx(8.0, rel=0.15)
    assert np.std(blend) < np.std(balance)


def test_fusion_is_the_projection_of_7_11():
    wear, mass = np.array([0.1, 0.2, 0.3]), np.array([3.2, 7.4, 10.2])
    fused = fuse(wear, mass)
    k, a = fused.slope, fused.alpha
    assert k == pytest.approx((wear @ mass) / (wear @ wear))
    np.testing.assert_allclose(fused.mass, (k * mass + a * wear) / (k + a / k), rtol=1e-12)


def test_without_thickness_the_balance_stands_alone():
    fused = fuse(np.full(3, np.nan), np.array([1.0, 2.0, 3.0]))
    assert fused.mass.tolist() == [1.0, 2.0, 3.0]
    assert np.isnan(fused.slope)
