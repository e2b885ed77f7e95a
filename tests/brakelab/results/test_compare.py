"""Two results side by side: what differs comes first, what does not matters not."""

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.replay.command import replay
from brakelab.results.compare import differences
from ecu import cli
from ecu.contract.faults import BRAKE_FADE, LATE
from ecu.contract.signals import STARTING
from ecu.settings.resources import resource

LOG = Path(__file__).parents[2] / "golden" / "mustang_braking.log.gz"
UNITS = {"vehicle_speed": "m/s", "mu_b_fl": "-", "mode_fl": "-", "calliper_pressure_fl": "bar"}
N = 200

# column, value of a, change of b in one row, times what matters
CHANGES = [
    ("vehicle_speed", 20.0, 0.1, 0.5),  # 1 % of 20 m/s is more than 0.05 m/s
    ("vehicle_speed", 2.0, 0.1, 2.0),
    ("calliper_pressure_fl", 10.0, 1.5, 3.0),
    ("mu_b_fl", 0.40, 0.02, 5.0),
    ("mode_fl", 1.0, 1.0, 2.0),
]


@pytest.mark.parametrize(("name", "value", "change", "weight"), CHANGES)
def test_a_difference_is_weighed_by_what_matters(
    name: str, value: float, change: float, weight: float
) -> None:
    a, b = np.full(N, value), np.full(N, value)
    b[17] += change
    (found,) = differences({name: a, "k_f": a}, {name: b, "k_f": a}, UNITS)
    assert (found.name, found.place, found.nulls) == (name, 17, 0)
    assert found.greatest == pytest.approx(change)
    assert found.rms == pytest.approx(change / np.sqrt(N))
    assert found.weight == pytest.approx(weight, rel=1e-6)


def test_a_value_that_only_one_has_matters() -> None:
    a, b = np.full(N, 0.4), np.full(N, 0.4)
    b[5:8] = np.nan
    (found,) = differences({"mu_b_fl": a}, {"mu_b_fl": b}, UNITS)
    assert (found.place, found.nulls) == (5, 3)
    assert found.weight > 1.0


def test_the_weightiest_comes_first() -> None:
    a = {"mu_b_fl": np.full(N, 0.4), "vehicle_speed": np.full(N, 20.0)}
    b = {"mu_b_fl": a["mu_b_fl"] + 0.02, "vehicle_speed": a["vehicle_speed"] + 0.3}
    assert [row.name for row in differences(a, b, UNITS)] == ["mu_b_fl", "vehicle_speed"]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("results")
    found = {}
    for observer in ("joint", "observer2"):
        found[observer] = folder / f"{observer}.parquet"
        car, map = resource("config/mustang.toml"), resource("config/maps/mustang.toml")
        replay([LOG], car, map, observer, None, found[observer])
    return found


def test_a_result_equals_itself(results, capsys) -> None:
    assert cli.main(["compare", str(results["joint"]), str(results["joint"])]) == 0
    assert "0 columns differ" in capsys.readouterr().out


def test_another_observer_is_named_and_shown(results, capsys) -> None:
    assert cli.main(["compare", str(results["joint"]), str(results["observer2"])]) == 1
    said = capsys.readouterr().out
    print(said)
    assert "observer: joint -> observer2" in said
    lines = dict(line.split(": ", 1) for line in said.splitlines() if ": " in line)
    assert re.fullmatch(r"[\d.]+ % on the mean, bias .* -> .* % on the mean, .*", lines["prediction off by"])
    assert re.fullmatch(r"0\.\d+ front, 0\.\d+ rear -> 0.*", lines["friction at the end"])
    assert "mu_b" in said
    assert "braking 1" in said


def test_faults_that_only_one_has_are_named(results, tmp_path, capsys) -> None:
    """Bits that both have, and those of the start, are no difference."""
    table = pq.read_table(results["joint"])
    place = table.column_names.index("active_faults")
    mask = table["active_faults"].to_numpy().copy()
    mask[table["mode"].to_numpy() == STARTING] |= BRAKE_FADE
    mask[-5:] |= LATE
    other = tmp_path / "late.parquet"
    pq.write_table(table.set_column(place, table.field(place), [mask]), other)
    assert cli.main(["compare", str(results["joint"]), str(other)]) == 1
    assert "faults that only one has: none -> late\n" in capsys.readouterr().out


def test_what_is_no_result_is_one_line(results, capsys) -> None:
    brakes = results["joint"].with_name("joint.brakes.parquet")
    assert cli.main(["compare", str(results["joint"]), str(brakes)]) == 2
    assert capsys.readouterr().err == (
        f"brake-ecu: {brakes}: columns: no result; give what `brake-ecu replay` wrote\n"
    )


def test_a_page_shows_both_with_the_verdict_first(results, tmp_path, capsys) -> None:
    page = tmp_path / "both.html"
    words = ["compare", str(results["joint"]), str(results["observer2"])]
    assert cli.main([*words, "--out", str(page)]) == 1
    said = capsys.readouterr().out
    text = page.read_text("utf-8")
    off = re.search(r"off by: ([\d.]+) % .*-> ([\d.]+) %", said)
    assert off is not None
    first = text[text.index('aria-label="Summary"') :]
    assert first.index(f"{off[1]} → {off[2]}") < first.index("that differ</h2>")
    assert "observer: joint -&gt; observer2" in text
    for drawn in ("vehicle_speed [m/s]", "mu_b_fl [-]"):
        assert drawn in text


@pytest.mark.parametrize(
    ("out", "words"), [("a.txt", "let the name end in .html"), ("", "which this command reads")]
)
def test_a_page_replaces_no_result(results, tmp_path, capsys, out: str, words: str) -> None:
    joint, other = results["joint"], results["observer2"]
    before = joint.read_bytes()
    assert cli.main(["compare", str(joint), str(other), "--out", str(tmp_path / out if out else joint)]) == 2
    assert words in capsys.readouterr().err
    assert joint.read_bytes() == before


def test_true_values_are_compared_without_faults_or_modes(tmp_path, capsys) -> None:
    t = np.arange(0.0, 1.0, 0.01)
    paths = [tmp_path / f"{name}.truth.parquet" for name in ("a", "b")]
    for path, friction in zip(paths, (0.40, 0.42), strict=True):
        pq.write_table(pa.table({"t": t, "mu_b_fl": np.full(len(t), friction)}), path)
    page = tmp_path / "both.html"
    assert cli.main(["compare", *map(str, paths), "--out", str(page)]) == 1
    assert "rows: 1 columns differ" in capsys.readouterr().out
    assert "mu_b_fl" in page.read_text("utf-8")
