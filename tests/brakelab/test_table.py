"""Columns as pandas, Polars and Arrow: the same values, missing ones as each of them says it."""

import re
from pathlib import Path
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


WHEELS = Table(
    {
        "mode": np.array([1.0, 2.0]),
        **{f"{name}_{corner}": np.array([k, np.nan]) for name in ("mode", "wheel_speed", "mu_b")
           for k, corner in enumerate(("fl", "fr", "rl", "rr"))},
        "slip_fl": np.zeros(2),
    },
    {"wheel_speed_fl": "rad/s", "mu_b_fl": "-"},
)  # fmt: skip


@pytest.mark.parametrize(("name", "unit"), [("wheel_speed", "rad/s"), ("mu_b", "-"), ("mode_mu_b", "")])
def test_a_name_without_its_corner_is_of_all_four_wheels(name: str, unit: str) -> None:
    assert WHEELS[name].shape == (2, 4)
    np.testing.assert_array_equal(WHEELS[name][0], [0, 1, 2, 3])
    assert WHEELS.unit(name) == unit
    assert WHEELS.unit("wheel_speed_fl") == "rad/s"


def test_a_column_of_that_name_comes_first_and_three_wheels_are_none() -> None:
    assert WHEELS["mode"].shape == (2,)
    for asked in (WHEELS.__getitem__, WHEELS.unit, WHEELS.column):
        with pytest.raises(UserError, match=r"^column: slip: no such column; did you mean slip_fl\?"):
            asked("slip")
    with pytest.raises(UserError, match=r"^column: mu_b: no such column"):
        WHEELS.column("mu_b")
    assert {"mu_b", "mu_b_rr", "mode", "wheel_speed"} <= {*WHEELS._ipython_key_completions_()}


def test_a_notebook_shows_unit_and_range_of_each_column() -> None:
    html = TABLE._repr_html_()
    assert "<caption>Table of 3 rows, 5 columns</caption>" in html
    assert "<tr><th>t</th><td>s</td><td>0</td><td>0.01</td><td>0.02</td></tr>" in html
    assert "<tr><th>pressure</th><td>bar</td><td>1</td><td>1</td><td>1</td></tr>" in html
    assert "<tr><th>law</th><td></td><td></td><td></td><td></td></tr>" in html
    assert "&lt;x&gt;" in Table({"<x>": COLUMNS["t"]}, {})._repr_html_()
    assert "<tr><th>t</th><td>s</td><td></td>" in EMPTY._repr_html_()


def test_what_reads_arrow_takes_a_table(polars: Any) -> None:
    import pyarrow as pa

    assert pa.table(TABLE).schema.field("t").metadata == {b"unit": b"s"}
    assert polars.DataFrame(TABLE).equals(TABLE.to_polars())


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


def curves(svg: str) -> list[list[list[float]]]:
    lines = re.findall(r'<polyline points="([^"]*)"', svg)
    return [[[float(each) for each in point.split(",")] for point in line.split()] for line in lines]


def test_a_plot_has_a_panel_for_each_name_and_a_line_for_each_wheel() -> None:
    n = 5
    table = Table(
        {
            "t": np.arange(n) * 0.01,
            "speed": np.array([3.0, np.nan, 1.0, 2.0, 5.0]),
            **{f"mu_b_{corner}": np.full(n, k) for k, corner in enumerate(("fl", "fr", "rl", "rr"))},
        },
        {"t": "s", "speed": "m/s"},
    )
    drawn = table.plot("speed", "mu_b")
    found = curves(drawn.svg)
    assert [len(line) for line in found] == [4, 5, 5, 5, 5], "a value that is not known is left out"
    assert found[0][0][1] > found[0][-1][1], "y grows upwards"
    heights = [line[0][1] for line in found[1:]]
    assert heights == sorted(heights, reverse=True)
    assert len(curves(table.plot("speed", "mu_b", columns=0).svg)) == 5
    for text in ("speed [m/s]", ">mu_b<", ">t [s]<", ">rl<"):
        assert text in drawn.svg
    assert drawn._repr_html_() == f'<div style="max-width:880px">{drawn.svg}</div>'
    assert ">rl<" not in table.plot("speed", x="mu_b_fl").svg


@pytest.mark.parametrize("name", ["pressure", "number", "valid", "t"])
@pytest.mark.parametrize("table", [TABLE, EMPTY, TABLE.where(np.array([True, False, False]))])
def test_whatever_is_known_is_drawn(table: Table, name: str) -> None:
    assert "nan" not in table.plot(name).svg


@pytest.mark.parametrize(
    ("names", "x", "says"),
    [
        ((), "t", 'plot: name what to draw: plot("mu_b", "vehicle_speed")'),
        (("presure",), "t", "column: presure: no such column; did you mean pressure?"),
        (("law",), "t", "plot: law: has text; name a column of numbers"),
        (("pressure",), "time", "column: time: no such column"),
        ((["pressure"],), "t", "column: ['pressure']: no such column"),
    ],
)
def test_a_plot_of_what_is_none_says_so(names: tuple[str, ...], x: str, says: str) -> None:
    with pytest.raises(UserError, match=re.escape(says)):
        TABLE.plot(*names, x=x)


def test_brake_applications_are_drawn_over_their_start() -> None:
    brakings = Table({"brake": np.arange(3), "t_start": np.array([1.0, 5.0, 9.0]), "v_in": np.ones(3)}, {})
    assert ">t_start<" in brakings.plot("v_in").svg


def test_a_place_is_no_name() -> None:
    with pytest.raises(UserError, match="column: 0: no such column"):
        TABLE[0]


def test_a_plot_is_saved(tmp_path: Path) -> None:
    drawn = TABLE.plot("pressure")
    assert drawn.save(tmp_path / "new" / "drive.svg").read_text("utf-8") == drawn.svg
