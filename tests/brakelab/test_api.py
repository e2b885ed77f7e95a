"""The Python interface: the same figures as the command line, columns with units, one error for a mistake."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.api import Result, Simulation, UserError, load, open_result, replay, simulate
from brakelab.table import Table
from ecu import cli
from ecu.contract.signals import INPUT_SIGNALS
from ecu.errors import UserError as EcuUserError

MUSTANG = Path(__file__).parents[1] / "data" / "mustang.log"


def test_replay_gives_what_the_command_writes(drive: Simulation, result: Result, tmp_path: Path) -> None:
    out = tmp_path / "stop.parquet"
    assert cli.main(["replay", str(drive.log), "--config", "suv", "--out", str(out)]) == 0
    table = pq.read_table(out)
    assert list(result) == table.column_names
    for name in ("t", "mu_b_fl", "sigma_mu_b_rr", "pressure_demand_fl", "mode"):
        np.testing.assert_array_equal(result[name], table.column(name).to_numpy().astype(float))
    brakes = pq.read_table(tmp_path / "stop.brakes.parquet")
    np.testing.assert_array_equal(result.brakings["mu_b_mean"], brakes.column("mu_b_mean").to_numpy())
    assert result.metadata["config_hash"]


def test_nothing_is_printed(drive: Simulation, capfd: pytest.CaptureFixture[str]) -> None:
    simulate(Path(__file__).parents[2] / "config/scenarios/stop-1.toml", config="suv")
    notes = replay(drive.log, config="suv").notes
    assert "never received: WheelForceFront" in notes[0]
    said = capfd.readouterr()
    assert (said.out, said.err) == ("", "")


def test_columns_have_the_units_of_the_contract(drive: Simulation, result: Result) -> None:
    assert {name: result.units[name] for name in ("t", "mu_b_fl", "vehicle_speed")} == {
        "t": "s",
        "mu_b_fl": "-",
        "vehicle_speed": "m/s",
    }
    assert result.brakings.units["brake_energy"] == "J"
    units = {signal.name: signal.unit for signal in INPUT_SIGNALS}
    inputs = load(drive.log)
    assert all(inputs.units[name] == units[name] for name in inputs if name != "t")
    assert all(unit for name, unit in drive.inputs.units.items())
    assert {name for name, unit in drive.truth.units.items() if not unit} <= {"demand_heard"}


def test_inputs_of_a_log_are_those_that_were_sent(drive: Simulation) -> None:
    """Within half a step of the frames' resolution and the 10 ms that a frame may take."""
    inputs = load(drive.log)
    n = min(len(inputs), len(drive.truth))
    off = inputs["vehicle_speed"][50:n] - drive.truth["vehicle_speed"][50:n]
    assert np.nanstd(off) < 0.06
    assert np.diff(inputs["t"]) == pytest.approx(0.01)


def test_tables_for_pandas_and_arrow(result: Result) -> None:
    frame = result.to_pandas()
    assert frame.shape == (len(result), len(result.columns))
    assert frame.attrs["units"]["mu_b_fl"] == "-"
    arrow = result.brakings.to_arrow()
    assert arrow.schema.field("brake_energy").metadata == {b"unit": b"J"}
    assert arrow.num_rows == len(result.brakings)
    moving = result.where(result["vehicle_speed"] > 20.0)
    assert 0 < len(moving) < len(result)


def test_polars_has_the_values_of_pandas(result: Result) -> None:
    pytest.importorskip("polars", reason="Polars is not installed")
    for table in (result, result.brakings):
        frame, pandas = table.to_polars(), table.to_pandas()
        assert frame.columns == list(pandas.columns)
        assert frame.height == len(pandas) > 0
        for name in frame.columns:
            np.testing.assert_array_equal(frame[name].to_numpy(), pandas[name].to_numpy(), err_msg=name)


def test_a_package_that_is_missing_is_one_line(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(UserError, match=r"^polars: is not installed: pip install polars; or use \.columns$"):
        result.to_polars()


@pytest.mark.parametrize("config", ["suv", "suv-blended"])
def test_changes_are_keys_of_the_configuration(config: str, drive: Simulation, result: Result) -> None:
    changes = {
        "front.mu_nominal": np.float32(0.35),
        "vehicle.mass": np.int64(2200),
        "observer.mu_drift": 0.03,
    }
    changed = replay(drive.log, config=config, changes=changes)  # type: ignore[arg-type]
    assert (result["mu_b_fl"][100], changed["mu_b_fl"][100]) == pytest.approx((0.45, 0.35))
    assert changed.metadata["config_hash"] != result.metadata["config_hash"]


def test_a_result_is_opened_as_it_was_handed_out(result: Result) -> None:
    opened = open_result(result)
    np.testing.assert_array_equal(opened["mu_b"], result["mu_b"])
    assert opened["mu_b"].shape == (len(result), 4)
    assert (opened.unit("brake_torque"), opened.units, opened.metadata) == (
        "N m",
        result.units,
        result.metadata,
    )
    assert len(opened.brakings) == 4


@pytest.mark.study
def test_a_notebook_shows_the_brake_applications_of_the_page(result: Result, tmp_path: Path) -> None:
    shown, page = result._repr_html_(), result.report(tmp_path / "stop.html").read_text("utf-8")
    cells = [re.findall(r"<td[^>]*>([^<]*)</td>", text.partition("<tbody>")[2]) for text in (shown, page)]
    assert f"suv: Result of {len(result)} rows, {len(result.columns)} columns<" in shown
    assert len(cells[0]) > 8
    assert cells[0][1:9] == cells[1][:8], "the page has a button in place of the number"
    assert 'class="spark"' in shown
    assert "<button" not in shown


def test_a_drive_without_braking_says_so_in_a_notebook(drive: Simulation) -> None:
    quiet = replay(drive.inputs.where(drive.inputs["t"] < 5.0), config="suv")
    assert "no brake application of 0.5 s or longer" in quiet._repr_html_()


@pytest.mark.study
def test_a_page_is_written(drive: Simulation, result: Result, tmp_path: Path) -> None:
    page = result.report(tmp_path / "stop.html", truth=drive.truth_path)
    assert page.stat().st_size > 100_000


def test_a_map_is_taken_by_name(tmp_path: Path) -> None:
    kept = replay(MUSTANG, config="mustang", map="mustang", out=tmp_path / "drive.parquet")
    assert kept.path == tmp_path / "drive.parquet"
    inputs = load(MUSTANG, map="mustang")
    assert 10.0 < np.nanmedian(inputs["wheel_speed_fl"]) < 150.0


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: replay("no.log", config="suv"), "no.log: no such file"),
        (lambda: load("no.log"), "no.log: no such file"),
        (lambda: replay(MUSTANG, config="nosuch"), "nosuch: no such file, and none that is shipped"),
        (lambda: replay(MUSTANG, config="suv"), "give the signal map of this car"),
        (lambda: open_result("no.parquet"), "no.parquet: no such file: give a result"),
        (lambda: load(Table({}, {})), "table: columns: column t is missing"),
        (lambda: replay(5, config="suv"), "log: int: is neither a log nor a table"),
        (lambda: replay([], config="suv"), "logs: the list is empty"),
        (lambda: replay(MUSTANG, config="suv", changes={"front.mu": 0.4}), "changes: front.mu: unknown key"),
        (lambda: replay(MUSTANG, config="suv", changes={"front mu": 0.4}), "changes: front mu: no key"),
        (lambda: replay(MUSTANG, config="suv", changes={"front.mu_nominal": np.nan}), "nan is no value"),
        (lambda: replay(MUSTANG, config="suv", changes={"front.mu_nominal": None}), "None is no value"),  # type: ignore[dict-item]
        (lambda: replay(MUSTANG, config="suv", changes={"vehicle.mass": object()}), "is no value"),  # type: ignore[dict-item]
        (lambda: replay(MUSTANG, config="suv", changes={"vehicle.mass": 1.0}), "give a value above 200 kg"),
        (lambda: replay(MUSTANG, config="suv", out="x.mf4"), "is Parquet here"),
        (lambda: replay(MUSTANG, config="mustang", map="mustang", observer="best"), "take joint, observer1"),
        (lambda: simulate("nosuch", config="suv"), "nosuch: no such file"),
        (lambda: simulate("stop-1", config="suv", seed=-1), "seed: -1: give a whole number"),
        (lambda: simulate("stop-1", config="suv", seed=1.5), "seed: 1.5: give a whole number"),  # type: ignore[arg-type]
    ],
)
def test_a_mistake_is_a_user_error(call: object, says: str) -> None:
    with pytest.raises(EcuUserError) as error:
        call()  # type: ignore[operator]
    assert says in str(error.value)


def test_an_unknown_column_names_the_others(result: Result) -> None:
    with pytest.raises(UserError, match=r"mu_d: no such column; did you mean mu_b_..\?; `.columns` has all"):
        result["mu_d"]


def test_the_package_alone_imports_nothing() -> None:
    script = "import sys, brakelab; print(len([name for name in sys.modules if name.startswith('brakelab')]))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "1"
