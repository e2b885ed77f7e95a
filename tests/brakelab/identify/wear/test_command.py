"""`brake-ecu identify wear`: from the simulated dynamometer to a configuration; what bad blocks give."""

import csv
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pytest

from brakelab.identify.wear.command import identify_wear
from brakelab.identify.wear.curves import specific_wear
from brakelab.simulation.campaigns.wear_blocks import (
    COLUMNS,
    drawn_car,
    programme,
    road_stops,
    write_programme,
)
from ecu.errors import UserError
from ecu.settings.config import load_config

pytestmark = pytest.mark.study

CONFIG = Path(__file__).parents[4] / "config" / "suv.toml"


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> Path:
    """Folder of a small programme: four blocks, two roads by two drivers."""
    folder = tmp_path_factory.mktemp("dynamometer")
    car = drawn_car(1)
    write_programme(car, 0, 1, folder, programme(car, 0, 1, ("town", "motorway")))
    return folder


@pytest.fixture
def blocks(made, tmp_path) -> Path:
    shutil.copytree(made, tmp_path / "blocks")
    return tmp_path / "blocks"


@pytest.fixture(scope="session")
def plain(made, tmp_path_factory) -> Path:
    """The configuration of the blocks as they are, its page beside it."""
    out = tmp_path_factory.mktemp("plain") / "car.toml"
    identify_wear(made / "manifest.csv", CONFIG, "front", out)
    return out


def test_a_programme_becomes_a_configuration_and_a_page(blocks, capsys):
    out = blocks / "car.toml"
    identify_wear(blocks / "manifest.csv", CONFIG, "front", out)
    pad = load_config(out).front.pad
    assert pad.thickness_new == load_config(CONFIG).front.pad.thickness_new
    middle = specific_wear(np.array(pad.coefficients), np.array([80.0]), 0.02, 0.15)[0]
    assert 0.05 < middle < 0.3  # g/MJ, as Table 7.1
    page = (blocks / "car.md").read_text()
    assert all(name in page for name in ("town-calm", "motorway-lively", "γ10", "quasi-static"))
    assert "K " in (blocks / "car.svg").read_text("utf-8")  # Figures 7.7 and 7.8
    assert "4 blocks" in capsys.readouterr().out


def test_what_a_gram_is_worth_is_taken_from_the_blocks(plain):
    """Pads lose K g/mm: measured, it is the density of the lining on board, whose area is CONFIG's."""
    page = plain.with_suffix(".md").read_text()
    slope = float(page.partition("linear wear K: ")[2].partition(" ± ")[0])
    pad = load_config(plain).front.pad
    assert 2.0 * pad.density * pad.area == pytest.approx(slope, rel=1e-3)


def test_a_disc_that_was_weighed_is_on_the_page(blocks):
    """It loses half of what the pads lose, on a balance of ± 0.05 g."""

    def weigh(rows):
        random = np.random.default_rng(2)
        for row in rows:
            lost = 0.5 * (float(row["mass_before"]) - float(row["mass_after"]))
            row["disc_mass_before"] = f"{9000.0 + 0.05 * random.normal():.2f}"
            row["disc_mass_after"] = f"{9000.0 - lost + 0.05 * random.normal():.2f}"

    rewrite(blocks / "manifest.csv", weigh)
    identify_wear(blocks / "manifest.csv", CONFIG, "front", blocks / "car.toml")
    page = (blocks / "car.md").read_text()
    share = int(page.partition("block 0.")[2].partition("), ")[2].partition(" %")[0])
    assert share == pytest.approx(33, abs=2)
    assert "| taper along [µm] |" in page
    assert "inboard [g]" not in page


def test_blocks_in_mdf4_give_the_same_law(blocks, plain):
    mdf = pytest.importorskip("asammdf")
    with (blocks / "manifest.csv").open(newline="") as file:
        names = [row["file"] for row in csv.DictReader(file)]
    for name in names:
        columns = np.loadtxt(blocks / name, delimiter=",", skiprows=1).T
        signals = [
            mdf.Signal(samples, columns[0], name=channel)
            for channel, samples in zip(COLUMNS[1:], columns[1:], strict=True)
        ]
        with mdf.MDF() as file:
            file.append(signals)
            file.save(blocks / Path(name).with_suffix(".mf4"), overwrite=True)
    rewrite(blocks / "manifest.csv", lambda rows: [
        row.update(file=row["file"].replace(".csv", ".mf4")) for row in rows
    ])  # fmt: skip
    identify_wear(blocks / "manifest.csv", CONFIG, "front", blocks / "mdf.toml")
    laws = [load_config(path).front.pad.coefficients for path in (plain, blocks / "mdf.toml")]
    assert laws[0] == pytest.approx(laws[1], rel=1e-6)
    (blocks / Path(names[0]).with_suffix(".mf4")).write_bytes(b"no MDF4")
    with pytest.raises(UserError, match=r"calm.mf4: cannot be read as MDF4"):
        identify_wear(blocks / "manifest.csv", CONFIG, "front", blocks / "mdf.toml")


def test_linings_of_both_axles_of_a_configuration_that_includes_another(blocks):
    start, one, both = CONFIG.with_name("suv-blended.toml"), blocks / "one.toml", blocks / "both.toml"
    identify_wear(blocks / "manifest.csv", start, "front", one)
    identify_wear(blocks / "manifest.csv", one, "rear", both)
    config = load_config(both)
    assert config.front.pad.coefficients == config.rear.pad.coefficients
    assert config.blending == load_config(start).blending


def test_a_block_has_at_least_250_applications_of_its_road():
    stops = road_stops("motorway", "lively", 2)
    assert len(stops) >= 250
    assert stops[:, 0].min() > 90 / 3.6
    assert (stops[:, 0] > stops[:, 1]).all()


def rewrite(path: Path, change) -> None:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    change(rows)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def alter(path: Path, name: str, values) -> None:
    """Replace a column of a block by what `values` makes of it."""
    table = pa_csv.read_csv(path)
    column = pa.array(values(table[name].to_numpy().astype(float)))
    changed = table.set_column(table.column_names.index(name), name, column)
    pa_csv.write_csv(changed, path, pa_csv.WriteOptions(quoting_style="none"))


def few(folder: Path) -> None:
    path = folder / "town-calm.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:2000]))


def grown(folder: Path) -> None:
    def change(rows):
        for k in range(1, 7):
            rows[1][f"thickness_after_{k}"] = "12.4"

    rewrite(folder / "manifest.csv", change)


def heavier(folder: Path) -> None:
    rewrite(folder / "manifest.csv", lambda rows: rows[0].update(mass_after="500"))


def fahrenheit(folder: Path) -> None:
    alter(folder / "town-calm.csv", "disc_temperature", lambda degrees: 32.0 + 1.8 * degrees)


def kelvin(folder: Path) -> None:
    alter(folder / "town-calm.csv", "disc_temperature", lambda degrees: 273.15 + degrees)


def late(folder: Path) -> None:
    path = folder / "town-calm.csv"
    period = np.median(np.diff(pa_csv.read_csv(path)["t"].to_numpy()))
    alter(path, "disc_temperature", lambda degrees: np.roll(degrees, round(6.0 / period)))


def alike(folder: Path) -> None:
    def change(rows):
        for row in rows:
            row["file"] = "town-calm.csv"

    rewrite(folder / "manifest.csv", change)


def without_column(folder: Path) -> None:
    path = folder / "town-calm.csv"
    path.write_text(path.read_text().replace("omega", "speed", 1))


def text(folder: Path) -> None:
    rewrite(folder / "manifest.csv", lambda rows: rows[0].update(mass_before="heavy"))


def scaled(column: str, factor: float):
    """Return what writes a column of one block in another unit."""

    return lambda folder: alter(folder / "town-calm.csv", column, lambda values: factor * values)


def weighed(factor: float):
    def spoil(folder: Path) -> None:
        rewrite(folder / "manifest.csv", lambda rows: [
            row.update({name: f"{factor * float(row[name]):.9g}" for name in ("mass_before", "mass_after")})
            for row in rows
        ])  # fmt: skip

    return spoil


def programmed(name: str, energy: str = ""):
    """Return what names a programme in the first block's row."""

    def spoil(folder: Path) -> None:
        for control, file in (("pressure", "pressures.toml"), ("deceleration", "held.toml")):
            (folder / file).write_text(
                'title = "x"\n[gate]\nwarm_speed = 80\nwarm_pressure = 20\ncool_speed = 80\n[[section]]\n'
                f'name = "1"\ncontrol = "{control}"\nspeed = 50\nend_speed = 5\nlevel = [2]\n'
                "temperature = [100]\n"
            )

        def change(rows):
            for row in rows:
                row.update(programme="", road_energy="")
            rows[0].update(programme=name, road_energy=energy)

        rewrite(folder / "manifest.csv", change)

    return spoil


def mistyped_thickness(folder: Path) -> None:
    rewrite(folder / "manifest.csv", lambda rows: rows[2].update(thickness_after_3="1.1"))


def mistyped_mass(folder: Path) -> None:
    def change(rows):
        rows[1]["mass_before"] = f"{float(rows[1]['mass_before']) + 30.0:.3f}"

    rewrite(folder / "manifest.csv", change)


def without_torque(folder: Path) -> None:
    def gap(torque):
        torque[40:140] = np.nan
        return torque

    alter(folder / "town-calm.csv", "brake_torque", gap)


def german(folder: Path) -> None:
    """Write every block as a rig does that its file of columns, one for all, describes."""
    for path in folder.glob("*-*.csv"):
        columns = np.loadtxt(path, delimiter=",", skiprows=1).T * [[1.0], [30.0 / np.pi], [1.0], [1.0], [1.0]]
        rows = "\r\n".join(";".join(f"{v:.4f}".replace(".", ",") for v in row) for row in columns.T)
        head = "Prüfstand;4\r\nBelag;Ä 5\r\nZeit;Drehzahl;p;Moment;T °C\r\ns;1/min;bar;Nm;°C\r\n"
        path.write_bytes((head + rows + "\r\n").encode("latin-1"))
    (folder / "map.toml").write_text(
        '[columns]\ntime = ["Zeit", "s"]\npressure = ["p", "bar"]\ntorque = ["Moment", "Nm"]\n'
        'speed = ["Drehzahl", "1/min"]\ntemperature = ["T °C", "°C"]\n',
        encoding="utf-8",
    )


def slow_thermocouple(folder: Path) -> None:
    for path in folder.glob("*-*.csv"):
        alter(path, "disc_temperature", lambda degrees: [
            value if place % 3 == 0 else None for place, value in enumerate(degrees)
        ])  # fmt: skip


def mistyped_sample(folder: Path) -> None:
    def mistype(torque):
        torque[800] = 1e6
        return torque

    alter(folder / "town-calm.csv", "brake_torque", mistype)


def anew(folder: Path) -> None:
    def from_zero(t):
        begins = np.concatenate([[True], np.diff(t) > 1.0])
        return np.round(t - np.maximum.accumulate(np.where(begins, t, -np.inf)), 4)

    alter(folder / "town-calm.csv", "t", from_zero)


@pytest.mark.parametrize("write", [german, slow_thermocouple, mistyped_sample, anew])
def test_blocks_as_rigs_write_them_give_the_same_law(blocks, plain, write, capsys):
    write(blocks)
    columns = blocks / "map.toml" if write is german else None
    capsys.readouterr()
    identify_wear(blocks / "manifest.csv", CONFIG, "front", blocks / "car.toml", columns)
    laws = [load_config(path).front.pad.coefficients for path in (plain, blocks / "car.toml")]
    assert laws[1] == pytest.approx(laws[0], rel=0.03, abs=1e-5)
    assert ("stands alone" in capsys.readouterr().err) == (write is mistyped_sample)


BAD = {
    "a thermocouple beside the disc": (
        lambda folder: alter(
            folder / "town-calm.csv", "disc_temperature", lambda degrees: np.full_like(degrees, 25.0)
        ),
        "disc_temperature: does not rise when the brake is applied",
    ),
    "a thickness with a digit too few": (
        mistyped_thickness,
        "line 4, thickness_before_3 .* correct the read",
    ),
    "a mass that its thickness contradicts": (mistyped_mass, r"block town-lively: lost 3\d.* by the balance"),
    "masses in kg": (weighed(1e-3), "give masses in g"),
    "masses in mg": (weighed(1e3), "give masses in g"),
    "torque in kN m": (scaled("brake_torque", 1e-3), "brake_torque .* reads like kN m: convert it to N m"),
    "torque of one pad": (scaled("brake_torque", 0.5), "brake_torque .* one pad: give that of both"),
    "torque with gaps": (without_torque, "brake_torque: has gaps"),
    "time in ms": (scaled("t", 1e3), "t .* reads like ms: convert it to s"),
    "time in min": (scaled("t", 1.0 / 60.0), "t .* reads like min: convert it to s"),
    "speed in rpm": (scaled("omega", 9.5493), "omega .* reads like rpm: convert it to rad/s"),
    "pressure in Pa": (scaled("calliper_pressure", 1e5), "calliper_pressure .* like Pa: convert it to bar"),
    "pressure in MPa": (scaled("calliper_pressure", 0.1), "calliper_pressure .* MPa: convert it to bar"),
    "a block with too few applications": (few, "applications; a block needs"),
    "a thickness that grows": (grown, "the pads grew by"),
    "a mass that grows": (heavier, "pads gained mass"),
    "a temperature in °F": (fahrenheit, "°F"),
    "a thermocouple 6 s late": (late, "disc_temperature: follows the braking 6.* s late"),
    "a temperature in K": (kelvin, "cannot be degC"),
    "collinear regressors": (alike, "collinear"),
    "a column that is missing": (without_column, "no such column"),
    "a mass that is no number": (text, "give a number"),
    "a programme that is not there": (programmed("no.toml"), "line 2, programme: no.toml: no such file"),
    "a programme of pressures": (
        programmed("pressures.toml"),
        "line 2, programme: .*, section 1 asks for a pressure",
    ),
    "a programme that is none": (programmed("manifest.csv"), "manifest.csv: .*not valid TOML"),
    "an energy that is none": (programmed("held.toml", "much"), "line 2, road_energy: give a number of MJ"),
}


@pytest.mark.parametrize(("spoil", "said"), BAD.values(), ids=BAD)
def test_what_is_wrong_is_one_line_that_names_file_and_place(blocks, spoil, said):
    spoil(blocks)
    with pytest.raises(UserError, match=said) as caught:
        identify_wear(blocks / "manifest.csv", CONFIG, "front", blocks / "car.toml")
    assert "\n" not in str(caught.value)
    assert ".csv" in str(caught.value)
    assert not (blocks / "car.toml").exists()


def test_columns_are_those_of_the_contract():
    assert COLUMNS == ("t", "omega", "calliper_pressure", "brake_torque", "disc_temperature")
