"""Two linings: what differs is found, what does not is left alone, however many sections there are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ttest_rel

from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.comparison import Compared, compare, comparison_table, holm
from brakelab.identify.friction.report_tables import Measured, measured
from brakelab.identify.friction.sections import Part
from brakelab.identify.friction.stops import Stops

SECTIONS, EACH = 12, 2
SCATTER = 0.02


def recorded(stops: Stops, columns: Columns, seed: int, level: float = 1.0, lost: int = 0) -> Measured:
    """Return a lining whose friction rises over the test as that of every other, scatter 2 %."""
    count = SECTIONS * EACH
    random = np.random.default_rng(seed)
    rise = np.linspace(0.9, 1.1, count)
    mu = 0.4 * level * rise * np.exp(SCATTER * random.standard_normal(count))
    numbers = np.arange(count)
    parts = [
        Part(f"{k}", numbers[4 * k + lost : 4 * k + 4], np.arange(lost, 4), 4) for k in range(count // 4)
    ]
    return measured(f"pad {seed}", replace(stops, mean=mu), columns, parts, numbers[:0])


@pytest.mark.parametrize(
    ("p", "expected"),
    [
        ([0.01, 0.04, 0.03], [0.03, 0.06, 0.06]),
        ([0.01, np.nan, 0.02], [0.02, np.nan, 0.02]),
        ([0.5, 0.9], [1.0, 1.0]),
        ([], []),
    ],
)
def test_holm_s_adjustment_by_hand(p: list[float], expected: list[float]) -> None:
    np.testing.assert_allclose(holm(np.array(p)), expected)


def test_a_section_is_a_t_test_of_pairs(stops: Stops, columns: Columns) -> None:
    """What rises over the test in both is no scatter."""
    one, other = recorded(stops, columns, 1), recorded(stops, columns, 2, level=1.05)
    rows = compare(one, other)
    whole = ttest_rel(np.log(other.stops.mean), np.log(one.stops.mean)).pvalue
    assert (rows[-1].name, rows[-1].pairs) == ("all together", SECTIONS * EACH)
    assert rows[-1].p == pytest.approx(whole)
    for row, mine, theirs in zip(rows[:-1], one.parts, other.parts, strict=True):
        p = ttest_rel(np.log(other.mu(theirs)), np.log(one.mu(mine))).pvalue
        assert row.p == pytest.approx(p)
        assert row.low < row.change < row.high
        assert (row.low > 0.0 or row.high < 0.0) == (p < 0.05)


def test_equal_linings_seldom_differ(stops: Stops, columns: Columns) -> None:
    """In 200 comparisons of 6 sections some difference is found 10 times; p alone finds one in 53."""
    found, alone = 0, 0
    for seed in range(200):
        rows = compare(recorded(stops, columns, seed), recorded(stops, columns, seed + 1000))
        found += any(row.adjusted < 0.05 for row in rows)
        alone += any(row.p < 0.05 for row in rows)
    print(f"adjusted {found}, alone {alone} of 200")
    assert found <= 20
    assert alone >= 30


def test_ten_per_cent_are_found(stops: Stops, columns: Columns) -> None:
    found = [
        row
        for seed in range(20)
        for row in compare(recorded(stops, columns, seed), recorded(stops, columns, seed + 1000, level=1.1))
    ]
    print(np.mean([row.adjusted < 0.05 for row in found]))
    assert np.mean([row.adjusted < 0.05 for row in found]) > 0.5
    assert np.mean([row.low < 10.0 < row.high for row in found]) == pytest.approx(0.95, abs=0.05)


def test_pairs_are_of_the_same_place(stops: Stops, columns: Columns) -> None:
    """An application that one of them lacks is in no pair; without three pairs there is no test."""
    rows = compare(recorded(stops, columns, 1), recorded(stops, columns, 2, lost=1))
    assert [row.pairs for row in rows] == [3] * 6 + [18]
    rows = compare(recorded(stops, columns, 1), recorded(stops, columns, 2, lost=2))
    assert all(np.isnan(row.p) and np.isnan(row.adjusted) for row in rows[:-1])
    assert np.isfinite(rows[-1].p)  # six sections of two are twelve pairs
    table = comparison_table(recorded(stops, columns, 1), recorded(stops, columns, 2), rows)
    assert {row[-1] for row in table.rows[:-1]} == {"too few"}
    assert "0 of 0 sections differ" in table.below


def test_the_table_says_which_differ(stops: Stops, columns: Columns) -> None:
    one, other = recorded(stops, columns, 1), recorded(stops, columns, 2)
    rows = [
        Compared("9 fade 1", 15, (0.3, 0.33), 10.0, 8.0, 12.0, 1e-5, 2e-5),
        Compared("6 cold", 8, (0.4, 0.401), 0.2, -1.0, 1.4, 0.7, 0.7),
    ]
    table = comparison_table(one, other, rows)
    assert [row[-1] for row in table.rows] == ["differs", "–"]
    assert table.rows[0][4:7] == ("+10.0", "+8.0 to +12.0", "< 0.001")
    assert "1 of 2 sections differ" in table.below
