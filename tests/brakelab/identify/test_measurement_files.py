"""Tables of measurements: by their endings, in capitals as well, and what is a number in them."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pytest

from brakelab.identify.measurement_files import numbers_in, numbers_of, open_campaign, read_columns
from ecu.errors import UserError
from ecu.settings.resources import resource

TABLE = pa.table({"t": [0.0, 0.1], "omega": [80.0, 79.0]})


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("block.csv", pa_csv.write_csv),
        ("BLOCK.CSV", pa_csv.write_csv),
        ("block.parquet", pq.write_table),
        ("BLOCK.PARQUET", pq.write_table),
    ],
)
def test_the_ending_of_a_block_may_be_in_capitals(tmp_path: Path, name: str, write) -> None:
    write(TABLE, tmp_path / name)
    assert read_columns(tmp_path / name, ("t", "omega"), "block")["omega"].tolist() == [80.0, 79.0]


BLOCKS = {
    "as the contract has it": "t,omega,brake_torque,disc_temperature\n0,80,1200,20\n0.1,79,1210,\n",
    "decimal commas, units below": (
        "t;omega;brake_torque;disc_temperature\ns;1/min;kN m;°F\n0;763,9437;1,2;68\n0,1;754,3944;1,21;\n"
        "0,2;744,8451;1,22;70\n0,3;735,2958;1,23;71\n"
    ),
    "a head, units in brackets": (
        "Prüfstand 4\nBelag X\nt [s];omega [rad/s];brake_torque [N m];disc_temperature [°C]\n"
        "0;80;1.200,0;20\n0,1;79;1.210,0;\n0,2;78;1.220,0;21\n0,3;77;1.230,0;22\n"
    ),
    "times of day": (
        "t,omega,brake_torque,disc_temperature\n10:59:59.9,80,1200,20\n11:00:00.0,79,1210,nan\n"
    ),
}


@pytest.mark.parametrize("text", BLOCKS.values(), ids=BLOCKS)
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_a_block_is_what_a_rig_writes(tmp_path: Path, text: str, encoding: str) -> None:
    path = tmp_path / "block.csv"
    path.write_text(text, encoding)
    columns = read_columns(path, ("t", "omega", "brake_torque", "disc_temperature"), "block")
    assert np.diff(columns["t"][:2]) == pytest.approx([0.1])
    assert columns["omega"][:2] == pytest.approx([80.0, 79.0], rel=1e-5)
    assert columns["brake_torque"][:2] == pytest.approx([1200.0, 1210.0])
    assert columns["disc_temperature"][0] == pytest.approx(20.0)
    assert np.isnan(columns["disc_temperature"][1])


def test_a_sample_that_stands_alone_is_left_out_and_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    torque = 800.0 + 100.0 * np.sin(np.arange(200.0))
    torque[77] = 1e6
    counted = np.where(np.arange(200) == 77, 5e3, torque)  # a plume
    table = pa.table({"t": 0.1 * np.arange(200), "brake_torque": torque, "particle_concentration": counted})
    pq.write_table(table, tmp_path / "block.parquet")
    names = ("t", "brake_torque", "particle_concentration")
    columns = read_columns(tmp_path / "block.parquet", names, "trip", counts=names[2:])
    assert np.flatnonzero(np.isnan(columns["brake_torque"])).tolist() == [77]
    assert np.isfinite(columns["particle_concentration"]).all()
    assert "brake_torque 1e+06 at 7.7 s stands alone; left out" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("t,omega\n0,80\n0.1,fast\n", "line 3, omega: fast is no number"),
        ("t,omega\n0,80\n0.1\n", "line 3 (1 cell instead of 2): is damaged"),
        ("Zeit,n\n0,80\n1,79\n", "t: no such column; a block has t, omega, this file Zeit, n; name its own"),
        ("t;omega\ns;furlong\n0;80\n1;79\n2;78\n", "omega: unit 'furlong' unknown; one of rad/s, rpm"),
    ],
)
def test_what_is_no_number_is_named(tmp_path: Path, text: str, line: str) -> None:
    (tmp_path / "block.csv").write_text(text)
    with pytest.raises(UserError) as error:
        read_columns(tmp_path / "block.csv", ("t", "omega"), "block")
    assert line in str(error.value)


@pytest.mark.parametrize(
    ("rows", "line"),
    [
        (
            ("a.csv,1,12.1", "b.csv,2,12.3", "c.csv,3,12.1"),
            None,
        ),  # run once more: another mass
        (("a.csv,1,12.1", "b.csv,2,12.1", "c.csv,3,12.3"), "line 3"),
        (("a.csv,1,12.1", "c.csv,2,12.3", "a.csv,3,12.1"), "line 4"),
        (("a.csv,1,12.1", "", "c.csv,2,12.3", "", "a.csv,3,12.1"), "line 6"),
    ],
)
def test_a_measurement_counts_once(tmp_path: Path, rows: tuple[str, ...], line: str | None) -> None:
    """a.csv and b.csv are the same block under two names."""
    for name, text in {"a": "t\n0\n1\n", "b": "t\n0\n1\n", "c": "t\n0\n2\n"}.items():
        (tmp_path / f"{name}.csv").write_text(text)
    manifest = tmp_path / "manifest.csv"
    manifest.write_text("\n".join(("file,block,mass_g", *rows)))
    if line is None:
        open_campaign(manifest, resource("config/suv.toml"), "front", tmp_path / "out.toml")
        return
    with pytest.raises(
        UserError, match=f"manifest.csv: {line}: the same measurement as line 2; leave one of them out"
    ):
        open_campaign(manifest, resource("config/suv.toml"), "front", tmp_path / "out.toml")


@pytest.mark.parametrize(
    "cells",
    [
        ["1.5", "-3e-5", "0.1", "4.9e-324", "-0.0", "1e400", ".5", "5."],
        ["1", None, "nan", "inf", "-Infinity"],
        [" 1", "+2", "1_0", "1,5", "0x10", "1d5", "nan(1)", "x"],
        ["10:23:45.1", "2"],
    ],
)
def test_a_column_has_the_numbers_of_its_cells(cells: list[str | None]) -> None:
    np.testing.assert_array_equal(numbers_in(pa.array(cells, pa.string())), numbers_of(cells))


@pytest.mark.parametrize(
    ("first", "second", "between"),
    [
        ("12.03.2024 23:59:59.5", "13.03.2024 00:00:01", 1.5),
        ("2024-03-12T10:23:45.12Z", "2024-03-12T10:23:46.12Z", 1.0),
        ("2024-03-12 10:23:45+01:00", "2024-03-12 10:24:45+01:00", 60.0),
        ("03/25/2024 11:59:58 AM", "03/25/2024 12:00:00 PM", 2.0),
        ("10:23:45,120", "10:23:45,620", 0.5),
    ],
)
def test_a_date_is_a_time(first: str, second: str, between: float) -> None:
    np.testing.assert_allclose(np.diff(numbers_of([first, second])), [between], atol=1e-6)
