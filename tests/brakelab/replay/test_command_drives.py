"""Whole recorded drives of three real cars: what is found, and that nothing is learned for nothing."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.bench.log_formats import FORMATS, convert
from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.replay.command import replay
from brakelab.report.command import report
from brakelab.results.files import read_result
from brakelab.results.prediction import SHORT
from ecu.contract.signals import FAILED
from ecu.settings.resources import resource

pytestmark = pytest.mark.drives


def run(log: Path, car: str, config: str, out: Path) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    replay(
        [log],
        resource(f"config/{config}.toml"),
        resource(f"config/maps/{car}.toml"),
        None,
        None,
        out,
    )
    return read_result(out).columns, read_result(out.with_suffix(".brakes.parquet")).columns


def test_mustang_shows_its_three_brakings(drives: Path, tmp_path: Path) -> None:
    log = drives / "mustang" / "mustang_s550.candump.log"
    columns, brakes = run(log, "mustang", "mustang", tmp_path / "out.parquet")
    assert len(columns["t"]) == 7038
    long = (brakes["duration"] >= SHORT) & (brakes["corner"] == "fl")
    np.testing.assert_allclose(3.6 * brakes["v_in"][long], [45, 48, 53], atol=3)
    np.testing.assert_allclose(3.6 * brakes["v_end"][long], [14, 23, 0.5], atol=2)
    assert (brakes["decel_mean"][long] > 1.5).all()
    np.testing.assert_allclose(brakes["decel_predicted"][long], brakes["decel_mean"][long], rtol=0.25)


@pytest.mark.parametrize(("car", "log"), [("rav4", "rav4_bus0_bus1"), ("kona", "kona")])
def test_nothing_is_learned_where_nothing_can_be(drives: Path, tmp_path: Path, car: str, log: str) -> None:
    columns, brakes = run(drives / car / f"{log}.candump.log", car, "suv", tmp_path / "out.parquet")
    for corner in ("fl", "fr", "rl", "rr"):
        assert set(columns[f"mu_b_{corner}"]) == {0.45}
        assert not (columns[f"mode_{corner}"] == 1).any()
    assert "learned" not in brakes["learning"]


@pytest.mark.parametrize("end", FORMATS)
@pytest.mark.parametrize(
    ("car", "log"), [("mustang", "mustang_s550"), ("rav4", "rav4_bus0_bus1"), ("kona", "kona")]
)
def test_every_format_gives_the_results_of_candump(
    drives: Path, tmp_path: Path, car: str, log: str, end: str
) -> None:
    """The first 20,000 frames, in the order of their stamps: python-can's writers let no time fall."""
    lines = (drives / car / f"{log}.candump.log").read_text().splitlines(keepends=True)[:20_000]
    source = tmp_path / "drive.log"
    source.write_text("".join(sorted(lines, key=lambda line: line.split()[0])))
    other = convert(source, tmp_path / f"other{end}")
    frames = [
        np.concatenate(list(read_frames(path, ["can0", "can1"], LogQuality()))) for path in (source, other)
    ]
    if end == ".mf4":  # frames of one stamp come bus by bus
        frames[0] = frames[0][np.lexsort((frames[0]["bus"], frames[0]["stamp_ns"]))]
    for name in ("can_id", "flags", "bus", "length", "data"):
        np.testing.assert_array_equal(frames[1][name], frames[0][name])
    np.testing.assert_array_equal(np.diff(frames[1]["stamp_ns"]), np.diff(frames[0]["stamp_ns"]))
    config = "mustang" if car == "mustang" else "suv"
    expected, _ = run(source, car, config, tmp_path / "a.parquet")
    found, _ = run(other, car, config, tmp_path / "b.parquet")
    for name, column in expected.items():
        np.testing.assert_array_equal(found[name], column, err_msg=name)


def test_a_recorded_car_without_pressure_or_demand_is_no_alarm(
    drives: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    columns, _ = run(drives / "rav4" / "rav4_bus0_bus1.candump.log", "rav4", "suv", tmp_path / "out.parquet")
    out, err = capsys.readouterr()
    assert out.startswith("no brakings and no friction: no calliper pressure")
    assert "mu_b" not in out
    assert err.count("not mapped") == 1
    assert "request lost" not in err
    assert not (columns["mode"] == FAILED).any()
    report(tmp_path / "out.parquet", None, tmp_path / "out.html")
    page = (tmp_path / "out.html").read_text("utf-8")
    assert "nothing is known of brake applications and friction" in page
    assert "Friction front [-]" not in page
