"""Columns as pandas, Polars and Arrow: the same values, missing ones as each of them says it."""

from typing import Any

import numpy as np
import pytest

from brakelab.table import Table
from ecu.errors import UserError

COLUMNS = {
    "t": np.array([0.0, 0.01, 0.02]),
    "pressure": np.array([1.0, np.nan, np.inf]),
    "number": np.array([1, 2, 3], np.int32),
    "valid": np.array([True, False, True]),
    "law": np.array(["linear", "", "table"], object),
}
TABLE = Table(COLUMNS, {"t": "s", "pressure": "bar"})
EMPTY = Table({name: column[:0] for name, column in COLUMNS.items()}, TABLE.units)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        (5, "Table of 3 rows, 5 columns: t [s], pressure [bar], number, valid, law"),
        (2, "Table of 3 rows, 2 columns: t [s], pressure [bar]"),
        (0, "Table of 0 rows, 0 columns: "),
    ],
)
def test_a_table_says_what_is_in_it(columns: int, said: str) -> None:
    names = [*COLUMNS][:columns]
    assert repr(Table({name: COLUMNS[name] for name in names}, TABLE.units)) == said


@pytest.fixture
def polars() -> Any:
    return pytest.importorskip("polars", reason="Polars is not installed")


def test_polars_keeps_types_and_says_null_where_pandas_says_nan(polars: Any) -> None:
    frame = TABLE.to_polars()
    assert frame.schema == {
        "t": polars.Float64,
        "pressure": polars.Float64,
        "number": polars.Int32,
        "valid": polars.Boolean,
        "law": polars.String,
    }
    assert frame["pressure"].to_list() == [1.0, None, np.inf]
    assert frame["pressure"].mean() == np.inf, "NaN would have spread"
    pandas = TABLE.to_pandas()
    for name in COLUMNS:
        np.testing.assert_array_equal(frame[name].to_numpy(), pandas[name].to_numpy(), err_msg=name)


def test_units_are_with_pandas_and_arrow_and_the_table(polars: Any) -> None:
    """A frame of Polars has no place for them."""
    assert TABLE.to_pandas().attrs["units"] == {"t": "s", "pressure": "bar"}
    arrow = TABLE.to_arrow()
    assert [arrow.schema.field(name).metadata[b"unit"] for name in ("t", "pressure", "law")] == [
        b"s",
        b"bar",
        b"",
    ]
    assert TABLE.to_polars().to_arrow().schema.field("t").metadata is None


@pytest.mark.parametrize("mask", [np.ones(2, bool), np.ones(3), [0, 1, 2], True])
def test_what_is_no_mask_is_refused(mask: Any) -> None:
    with pytest.raises(UserError, match=r"give a mask of bool of shape \(3,\)"):
        TABLE.where(mask)


def test_a_table_without_rows_has_its_columns(polars: Any) -> None:
    frame = EMPTY.to_polars()
    assert (frame.shape, frame.columns) == ((0, 5), list(COLUMNS))
    assert frame["t"].dtype == polars.Float64
    assert len(EMPTY) == len(EMPTY.to_pandas()) == 0


def test_rows_by_a_mask() -> None:
    some = TABLE.where(TABLE["t"] > 0.005)
    assert (len(some), some.units) == (2, TABLE.units)
    assert some["law"].tolist() == ["", "table"]
