"""Tables and maps in place of files: the same bits, whatever the table is of; errors that name it."""

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.api import Simulation, UserError, load, replay
from brakelab.table import Table

pandas = pytest.importorskip("pandas")


@pytest.fixture(scope="module")
def signals(drive: Simulation) -> Table:
    return drive.inputs


@pytest.fixture(scope="module")
def friction(signals: Table, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Friction by the same signals as a file, shape (n, 4)."""
    path = tmp_path_factory.mktemp("given") / "signals.parquet"
    signals.to_pandas().to_parquet(path)
    return replay(path, config="suv")["mu_b"]


def of_polars(table: Table) -> Any:
    return pytest.importorskip("polars").DataFrame(table)


def timed_by(kind: Callable[[Any], Any]) -> Callable[[Table], Any]:
    def frame(table: Table) -> Any:
        found = table.to_pandas()
        return found.set_index(kind(found.pop("t")))

    return frame


FORMS = {
    "Table": lambda table: table,
    "pandas": Table.to_pandas,
    "pandas, an index of seconds": lambda table: table.to_pandas().set_index("t"),
    "pandas, an index of durations": timed_by(lambda t: pandas.to_timedelta(t.to_numpy(), unit="s")),
    "pandas, an index of dates": timed_by(
        lambda t: pandas.to_datetime(1.7e9 + t.to_numpy().round(2), unit="s").round("ms")
    ),
    "pandas, rows that were filtered": lambda table: table.to_pandas().iloc[np.arange(len(table))],
    "Polars": of_polars,
    "Arrow": Table.to_arrow,
    "arrays": lambda table: dict(table.columns),
    "lists": lambda table: {name: column.tolist() for name, column in table.columns.items()},
}


@pytest.mark.parametrize("form", FORMS)
def test_a_table_is_replayed_to_the_bits_of_a_file(form: str, signals: Table, friction: Any) -> None:
    result = replay(FORMS[form](signals), config="suv")
    np.testing.assert_array_equal(result["mu_b"], friction)
    assert "/tmp" not in " ".join(result.notes)


def test_a_drive_of_two_tables_is_one(signals: Table, friction: Any) -> None:
    half = signals["t"] < 8.0
    both = replay([signals.where(half), signals.where(~half).to_pandas()], config="suv")
    assert len(both) == len(friction)
    assert [one["name"] for one in json.loads(both.metadata["inputs"])] == [
        "table.parquet",
        "table-2.parquet",
    ]


def renamed(signals: Table) -> Any:
    frame = signals.to_pandas()
    return frame.rename(columns={name: f"x_{name}" for name in frame if name != "t"})


def test_a_map_of_columns_is_given_by_its_content(signals: Table, friction: Any) -> None:
    inputs: dict[str, Any] = {
        name: {"column": f"x_{name}", "unit": signals.units[name]} for name in signals if name != "t"
    }
    result = replay(renamed(signals), config="suv", map={"inputs": inputs})
    np.testing.assert_array_equal(result["mu_b"], friction)


def test_units_come_with_what_to_pandas_gave(signals: Table) -> None:
    frame = signals.to_pandas()
    frame["speed"] = 3.6 * frame.pop("vehicle_speed")
    frame.attrs["units"]["speed"] = "km/h"
    drive = load(frame, map={"inputs": {"vehicle_speed": {"column": "speed"}}})
    np.testing.assert_allclose(drive["vehicle_speed"][:50], load(signals)["vehicle_speed"][:50])


def test_a_map_of_frames_is_given_by_its_content(monkeypatch: pytest.MonkeyPatch) -> None:
    root = Path(__file__).parents[2]
    monkeypatch.chdir(root / "config/maps")
    content = tomllib.loads(Path("mustang.toml").read_text("utf-8"))
    log = root / "tests/data/mustang.log"
    by_name, by_content = (load(log, map=one) for one in ("mustang", content))
    np.testing.assert_array_equal(by_content["wheel_speed"], by_name["wheel_speed"])


@pytest.mark.parametrize(
    ("log", "map", "says"),
    [
        ({"t": [1, 2], "x": [1]}, None, "log: dict: is neither a log nor a table of columns of one length ("),
        (None, None, "log: NoneType: is neither a log nor a table"),
        ({"t": [1.0, 0.5], "accel_x": [0.0] * 2}, None, "table: row 1, t: time falls by 0.5 s"),
        (
            {"t": [0.0], "a": [0.0]},
            {"inputs": {"accel": {"column": "a"}}},
            "map: inputs.accel: no such input",
        ),
        ({"t": [0.0], "a": [0.0]}, {"inputs": {"accel_x": {"column": "b"}}}, "no column 'b' in table"),
    ],
)
def test_errors_name_the_table_or_the_map(log: Any, map: Any, says: str) -> None:
    with pytest.raises(UserError) as error:
        replay(log, config="suv", map=map)
    assert says in str(error.value)
    assert "brake-ecu-" not in str(error.value)
