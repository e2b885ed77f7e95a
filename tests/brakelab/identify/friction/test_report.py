"""`brake-ecu lab report`: a recorded programme of sections, as a table, a page and JSON; two linings."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pyarrow.parquet as pq
import pytest

from brakelab.identify.friction import command
from brakelab.identify.friction.recording import HEADER
from ecu import cli

PROGRAMME = """
title = "short"

[gate]
warm_speed = 80.0
warm_pressure = 20.0
cool_speed = 80.0

[[section]]
name = "1 green μ"
speed = 80.0
end_speed = 30.0
level = [30.0]
temperature = [100.0]
times = 4

[[section]]
name = "2 pressure"
speed = 80.0
end_speed = 30.0
level = [20.0, 40.0, 60.0, 80.0]
temperature = [100.0]

[[section]]
name = "3 pressure"
speed = 120.0
end_speed = 80.0
level = [20.0, 40.0, 60.0, 80.0]
temperature = [100.0]

[[section]]
name = "4 characteristic value"
speed = 80.0
end_speed = 30.0
level = [30.0]
temperature = [100.0]
times = 3

[[section]]
name = "5 fade"
control = "deceleration"
speed = 100.0
end_speed = 5.0
level = [3.9]
temperature = [100.0, 250.0, 400.0, 550.0]

[[section]]
name = "6 cold"
speed = 40.0
end_speed = 5.0
level = [30.0]
temperature = [50.0]
"""
COUNTS = ["4", "4", "4", "3", "4", "1"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a programme and recordings of two pads of brake A and one of brake C."""
    folder = tmp_path_factory.mktemp("rig")
    programme = folder / "short-programme.toml"
    programme.write_text(PROGRAMME, "utf-8")
    for name, brake, seed in (("one", "A", 1), ("two", "A", 2), ("third", "C", 1)):
        command.run(str(programme), brake, seed, folder / f"{name}.parquet")
    command.run("ams", "A", 1, folder / "ams.csv")
    (folder / "empty").mkdir()
    return folder


@pytest.fixture(autouse=True)
def there(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)


def given(line: str, capsys: pytest.CaptureFixture[str]) -> dict:
    capsys.readouterr()
    assert cli.main([*line.split(), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_sections_of_a_recording(capsys: pytest.CaptureFixture[str]) -> None:
    found = given("lab report one.parquet --programme short-programme.toml", capsys)
    assert found["programme"] == "short"
    sections, values, lines = found["tables"]
    assert [row[1] for row in sections["rows"]] == COUNTS
    stops = found["recordings"][0]["stops"]
    for row in sections["rows"]:
        mu = [stop["mu"] for stop in stops if stop["section"] == row[0]]
        assert row[2:6] == [f"{mu_of:.3f}" for mu_of in (sum(mu) / len(mu), min(mu), max(mu), mu[-1])]
    by_name = {row[0]: row for row in values["rows"]}
    assert list(by_name) == ["green", "nominal", "least in fade", "cold"]
    fade = [stop for stop in stops if stop["section"] == "5 fade"]
    least = min(fade, key=lambda stop: stop["mu"])
    nominal = [stop["mu"] for stop in stops if stop["section"] == "4 characteristic value"]
    change = 100.0 * (least["mu"] * len(nominal) / sum(nominal) - 1.0)
    assert by_name["least in fade"][1:3] == [f"{least['mu']:.3f}", f"{change:+.1f}"]
    assert f"from {least['start']:.0f} °C" in by_name["least in fade"][3]
    assert [(row[0], row[1]) for row in lines["rows"]] == [
        ("2 pressure", "pressure"),
        ("3 pressure", "pressure"),
        ("those over pressure", "speed"),
    ]


def test_uncertainty_is_that_of_the_file_of_columns(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The simulated rig states 0.3 % of torque and 0.03 bar, 0.15 % of 20 bar; 1 % of radius is added."""
    text = (folder / "one.toml").read_text("utf-8")
    bare, more = text.partition("[uncertainty]")[0], f"{text}effective_radius = 0.01\n"
    for given_text, u in ((bare, None), (text, 0.0034), (more, 0.0105)):
        (folder / "mine.toml").write_text(given_text, "utf-8")
        found = given("lab report one.parquet --columns mine.toml --programme short-programme.toml", capsys)
        assert ("U" in found["tables"][0]["columns"]) == (u is not None)
        stop = next(s for s in found["recordings"][0]["stops"] if s["section"] == "2 pressure")
        if u is not None:
            assert stop["u"] / stop["mu"] == pytest.approx(u, rel=0.03)


def test_two_linings(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Against itself nothing differs; brake C's pad does, by what its sections' means say."""
    same = given("lab report one.parquet one.parquet --programme short-programme.toml", capsys)
    assert all(
        row["change"] == 0.0 and not row["adjusted"] < 0.05 for row in same["compared"] if row["pairs"] > 2
    )
    line = "lab report one.parquet third.parquet --programme short-programme.toml --out page.html"
    other = given(line, capsys)
    assert [row["pairs"] for row in other["compared"]] == [*(int(count) for count in COUNTS), 20]
    green = other["compared"][0]
    assert green["change"] == pytest.approx(100.0 * (green["mu"][1] / green["mu"][0] - 1.0), abs=0.5)
    assert green["adjusted"] < 0.05
    page = (folder / "page.html").read_text("utf-8")
    assert "one and third" in page
    assert not re.search(r"<script|src=|href=|url\(", page)
    charts = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    for chart in charts:
        ElementTree.fromstring(chart)
    assert "dasharray" in charts[1]
    assert page.count("<table>") == 7


def test_the_page_of_one(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = given("lab report one.parquet --programme short-programme.toml --out one.html", capsys)
    assert found["written"] == ["one.html"]
    page = (folder / "one.html").read_text("utf-8")
    for title in ("over pressure", "in fade", "in running-in", "application by application"):
        assert f"mean friction {title}" in page
    assert page.count("<table>") == 3


def test_a_column_of_sections_is_read(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Stops of the second section are labelled as the third: what the column says counts, too."""
    found = given("lab report one.parquet --programme short-programme.toml", capsys)
    begins = [stop["begin"] for stop in found["recordings"][0]["stops"]]
    table = pq.read_table(folder / "one.parquet").to_pandas()
    counts = [int(count) for count in COUNTS]
    number = sum((table["time_s"] >= begins[sum(counts[:k])] - 0.2).astype(int) for k in range(len(counts)))
    table["step"] = number
    table.to_csv(folder / "labelled.csv", index=False)
    text = (folder / "one.toml").read_text("utf-8").replace("[brake]", 'section = "step"\n\n[brake]', 1)
    (folder / "labelled.toml").write_text(text, "utf-8")
    found = given("lab report labelled.csv --programme short-programme.toml", capsys)
    assert [row[1] for row in found["tables"][0]["rows"]] == COUNTS
    table["step"] = "Druck"
    table.to_csv(folder / "labelled.csv", index=False)
    assert cli.main(["lab", "report", "labelled.csv", "--programme", "short-programme.toml"]) == 0
    assert "step has no numbers; sections follow from the stops alone" in capsys.readouterr().err
    (folder / "labelled.toml").write_text(text.replace('"step"', '"Schritt"'), "utf-8")
    assert cli.main(["lab", "report", "labelled.csv", "--programme", "short-programme.toml"]) == 2
    assert "Schritt: no such column" in capsys.readouterr().err


@pytest.fixture(scope="module")
def stops(folder: Path) -> Path:
    """Return a folder with a file a stop, as another rig writes them; beside it the file of columns."""
    stops = folder / "stops"
    stops.mkdir()
    table = pq.read_table(folder / "one.parquet").to_pandas()
    table["stop"] = (table["time_s"].diff() > 2.0).cumsum() + 1
    for number, rows in table.groupby("stop"):
        lines = ["Prüfstand;3", f"Bremsung;{number}", "", "Zeit;Druck;Moment;v;T", "s;bar;Nm;km/h;°C"]
        of = rows.assign(time_s=rows["time_s"] - rows["time_s"].iloc[0]).drop(columns="stop")
        lines += [";".join(f"{cell:.3f}" for cell in row).replace(".", ",") for row in of.to_numpy()]
        (stops / f"AKM_{number}.csv").write_bytes("\r\n".join(lines).encode("latin-1"))
    text = (folder / "one.toml").read_text("utf-8")
    for ours, theirs in zip(HEADER, ("Zeit", "Druck", "Moment", "v", "T"), strict=True):
        text = text.replace(f'"{ours}"', f'"{theirs}"')
    (folder / "stops.toml").write_text(text, "utf-8")
    return stops


def test_a_file_a_stop_is_a_recording(stops: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder of them, or one after the other as a shell writes them: AKM_1, AKM_10, … AKM_2."""
    whole = given("lab report one.parquet --programme short-programme.toml", capsys)
    names = " ".join(sorted(f"stops/{path.name}" for path in stops.iterdir()))
    assert names.startswith("stops/AKM_1.csv stops/AKM_10.csv")
    for data in ("stops", f"{names} --columns stops.toml"):
        found = given(f"lab report {data} --programme short-programme.toml", capsys)
        one, other = (of["recordings"][0]["stops"] for of in (whole, found))
        assert [stop["section"] for stop in one] == [stop["section"] for stop in other]
        assert [stop["mu"] for stop in other] == pytest.approx([stop["mu"] for stop in one], abs=1e-3)
    compared = given("lab report stops one.parquet --programme short-programme.toml", capsys)["compared"]
    assert [row["pairs"] for row in compared] == [*(int(count) for count in COUNTS), 20]


def test_a_folder_is_looked_at(stops: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert given("lab look stops", capsys)["stops"] == 20


def test_a_shipped_programme_is_recognised(capsys: pytest.CaptureFixture[str]) -> None:
    found = given("lab report ams.csv", capsys)
    assert found["programme"] == "AMS"
    assert [row[0] for row in found["tables"][0]["rows"]] == [f"{t} °C, 100 km/h" for t in range(50, 301, 50)]


@pytest.mark.parametrize(("factor", "said"), [(0.78, "at 0.7"), (0.95, ""), (1.15, "at 1.1")])
def test_speeds_of_no_such_programme_are_said(
    folder: Path, capsys: pytest.CaptureFixture[str], factor: float, said: str
) -> None:
    """rad/s that were called km/h, say, on a tyre of 0.36 m: 0.77 of the speeds."""
    table = pq.read_table(folder / "one.parquet").to_pandas()
    table.assign(speed_km_h=factor * table["speed_km_h"]).to_csv(folder / "slow.csv", index=False)
    text = re.sub(r"inertia = .*\n", "", (folder / "one.toml").read_text("utf-8"))
    (folder / "slow.toml").write_text(text, "utf-8")
    assert cli.main(["lab", "report", "slow.csv", "--programme", "short-programme.toml"]) == 0
    error = capsys.readouterr().err
    assert ("times the speeds of short: check the unit of speed" in error) == bool(said)
    assert said in error


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("lab report none.csv", "none.csv: no such file"),
        ("lab report one.parquet --columns none.toml", "none.toml: no such file"),
        ("lab report one.parquet --programme nothing", "nothing: no such file, and none that is shipped"),
        ("lab report ams.csv --programme ak-master", "only 1 of 6 stops are of it; give --programme"),
        ("lab report one.parquet --programme one.toml", "one.toml: "),
        ("lab report empty", "empty: is a folder without recordings; give files of .csv"),
        ("lab report one.parquet --out one.txt", "let the name end in .html"),
        ("lab report one.parquet --out one.parquet", "let the name end in .html"),
        ("lab report one.parquet ams.csv --programme short-programme.toml", "ams.csv: short: only"),
    ],
)
def test_one_line_says_what_to_do(line: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(line.split()) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
