"""`brake-ecu identify thermal`: from a simulated drive to a configuration; what bad arguments give."""

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.identify.thermal.command import with_fits
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import Phase, load_scenario
from brakelab.simulation.simulate import write_columns
from ecu import cli
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config, new_params, store_key

from .series import TRUE, XI, discs, series

pytestmark = pytest.mark.study

ROOT = Path(__file__).parents[4]
CONFIG = ROOT / "config" / "suv.toml"


@pytest.fixture(scope="session")
def log(tmp_path_factory) -> Path:
    """Six brakings and two cruises of a drawn car, thermocouples on its discs but for the rear right."""
    base = load_scenario(ROOT / "config" / "scenarios" / "fade.toml")
    phases = []
    for fast in (20.0, 33.0):
        for _ in range(3):
            phases += [
                Phase(kind="cruise", speed=fast + 1.0, until_speed=fast),
                Phase(kind="cruise", speed=fast, seconds=25.0),
                Phase(kind="brake", kept_decel=3.0, until_speed=3.0),
            ]
        phases.append(Phase(kind="cruise", speed=fast, seconds=80.0))
    scenario = base.model_copy(update={"phase": phases, "repeat": 1, "draw": "wide", "initial_speed": 5.0})
    drive = run(new_loop(scenario, load_config(CONFIG), 4))
    random, columns = np.random.default_rng(1), dict(drive.inputs)
    for corner in CORNERS[:3]:
        read = drive.truth[f"disc_temperature_{corner}"] + random.normal(0.0, 1.0, len(drive.t))
        columns[f"disc_temperature_measured_{corner}"] = np.where(
            np.arange(len(read)) % 20 == 0, read, np.nan
        )
    path = tmp_path_factory.mktemp("thermal") / "drive.parquet"
    write_columns(path, drive.t, columns, {})
    return path


def identify(*arguments: object) -> int:
    return cli.main(["identify", "thermal", *map(str, arguments)])


def documented() -> list[list[str]]:
    """Return the commands of the documentation's page, words without the program's name."""
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "docs/disc-temperature.md").read_text("utf-8"), re.DOTALL)
    lines = [line.split() for block in blocks for line in block.splitlines()]
    return [words[1:] for words in lines if words[0] == "brake-ecu"]


def test_the_documented_commands_make_a_configuration_a_page_and_a_result(
    log, tmp_path, capsys, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dry.parquet").symlink_to(log)
    fit, replay = documented()
    fit.remove("rain.parquet")
    assert cli.main(fit) == 0
    out = Path("out/car.toml")
    config, before = load_config(out), load_config(CONFIG)
    assert store_key(config) == store_key(before)  # what was learned of friction goes on
    assert config.front.disc_heating != before.front.disc_heating
    assert config.front.sigma_disc_heating < before.front.sigma_disc_heating
    assert config.vehicle == before.vehicle
    said = capsys.readouterr()
    assert "front δ0 in rain: not identified by these logs" in said.out
    assert said.err.splitlines()[-1].endswith(
        f"next: brake-ecu replay LOG --config {out} --out drive.parquet"
    )
    page = out.with_suffix(".md").read_text()
    assert "| dry.parquet | rl |" in page
    assert "| dry.parquet | rr |" not in page
    before_now = [line.split("|")[8:10] for line in page.splitlines() if line.startswith("| dry.parquet")]
    assert all(float(now) < 5.0 for _, now in before_now)
    assert out.with_suffix(".svg").is_file()
    assert cli.main(replay) == 0
    said = pq.read_table("out/drive.parquet")["disc_temperature_fl"].to_numpy()
    assert 60.0 < np.nanmax(said) < 500.0


def change(path: Path, out: Path, **columns) -> Path:
    table = pq.read_table(path)
    for name, values in columns.items():
        place = table.column_names.index(name)
        if values is None:
            table = table.remove_column(place)
        else:
            table = table.set_column(place, name, pa.array(values(table[name].to_numpy()), from_pandas=True))
    pq.write_table(table, out)
    return out


MEASURED = tuple(f"disc_temperature_measured_{c}" for c in CORNERS[:3])


@pytest.mark.parametrize(
    ("columns", "text"),
    [
        (dict.fromkeys(MEASURED), "disc_temperature_measured_*: not in this log"),
        (dict.fromkeys(MEASURED, lambda x: x + 273.15), "K? convert it to degC"),
        (dict.fromkeys(MEASURED, lambda x: 1.8 * x + 32.0), "degF? convert it to degC"),
        (dict.fromkeys([f"calliper_pressure_{c}" for c in CORNERS]), "calliper_pressure_fl: mostly missing"),
    ],
    ids=["none", "K", "degF", "pressure"],
)
def test_a_bad_log_is_one_line_and_exit_code_2(log, tmp_path, capsys, columns, text) -> None:
    bad, out = change(log, tmp_path / "bad.parquet", **columns), tmp_path / "car.toml"
    assert identify(bad, "--config", CONFIG, "--out", out) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert "bad.parquet" in lines[-1]
    assert text in lines[-1]
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["absent.csv", "--config", CONFIG, "--out", "car.toml"], "no such file"),
        (["{log}", "--config", CONFIG, "--out", "car.parquet"], "let the name end in .toml"),
        (["{log}", "--config", "tank", "--out", "car.toml"], "tank"),
    ],
)
def test_bad_arguments_are_one_line_and_exit_code_2(
    log, tmp_path, capsys, monkeypatch, arguments, text
) -> None:
    monkeypatch.chdir(tmp_path)
    assert identify(*(str(one).format(log=log) for one in arguments)) == 2
    assert text in capsys.readouterr().err


def test_the_configuration_in_memory_is_that_of_the_file() -> None:
    from brakelab.identify.thermal.fit import fit_axle
    from brakelab.identify.thermal.result import start_of

    config = load_config(CONFIG)
    fit = fit_axle(discs(series(1500, rain=True)), config.front.disc_heating, start_of(config.front))
    row = new_params(with_fits(config, {"front": fit}))[0]
    assert row["disc_heating"][0] == pytest.approx(XI, rel=0.03)
    assert row["disc_cooling_by_speed_wet"][0] == pytest.approx(TRUE.by_speed_wet, rel=0.1)
    assert row["disc_heating"][2] == config.rear.disc_heating
