"""No command writes over what it reads, by whatever name; TOML is written to names that end in .toml."""

import errno
import os
import re
import shutil
from pathlib import Path

import pytest

from brakelab.results.outputs import whole, write_text
from ecu import cli
from ecu.errors import UserError
from ecu.settings.resources import resource

OVERWRITING = {
    # command line: file that it would replace
    "identify vehicle drive.csv --config car.toml --out car.toml": "car.toml",
    "identify vehicle drive.csv --config car.toml --out base.toml": "base.toml",
    "identify vehicle drive.csv --config base.toml --map car-map.toml --out car.toml": "car-map.toml",
    "identify thermal drive.csv --config car.toml --out base.toml": "base.toml",
    "identify wear blocks.svg --config base.toml --out blocks.toml": "blocks.svg",
    "identify wear blocks.csv --config car.toml --out base.toml": "base.toml",
    "identify wear rig.csv --config base.toml --out block.toml": "block.svg",
    "identify dust rig.csv --config base.toml --out trip.toml": "trip.md",
    "identify dust trips.md --config base.toml --out trips.toml": "trips.md",
    "identify dust trips.csv --config linked.toml --out base.toml": "linked.toml",
    "identify friction brake.csv --out brake.toml": "brake.toml",
    "identify friction brake.csv --columns mine.toml --out mine.toml": "mine.toml",
    "identify friction brake.csv --own mine.py --discover mine.py --out own.toml": "mine.py",
    "lab run mine.toml --brake A --out mine.csv": "mine.toml",
    "lab run cpc --brake A --linings brake.toml --law SIM --out brake.csv": "brake.toml",
    "lab report brake.csv --columns mine.html --out mine.html": "mine.html",
    "tune --config car.toml --out base.toml": "base.toml",
    "map suggest drive.csv --config car.toml --out base.toml": "base.toml",
    "replay drive.brakes.parquet --config base.toml --out drive.parquet": "drive.brakes.parquet",
    "fleet fleet.csv --config base.toml --out .": "drives.parquet",
}
NOT_ITS_OWN = {
    # command line: file of somebody that stands where a new output would have its neighbour
    "lab run ams --brake A --out own.csv": "own.toml",
    "identify wear rig.csv --config base.toml --out own.toml": "own.svg",
    "identify dust rig.csv --config base.toml --out own.toml": "own.md",
    "identify thermal drive.csv --config base.toml --out own.toml": "own.svg",
    "identify friction brake.csv --out own.toml": "own.html",
    "simulate stop-4 --config base.toml --out own": "own.truth.parquet",
    "replay drive.csv --config base.toml --out own.parquet": "own.brakes.parquet",
}
NO_TOML = (
    "identify vehicle drive.csv --config base.toml --out car.txt",
    "identify thermal drive.csv --config base.toml --out car.txt",
    "identify wear blocks.csv --config base.toml --out car.txt",
    "identify dust trips.csv --config base.toml --out car.txt",
    "identify friction brake.csv --out car.txt",
    "tune --config base.toml --out car.txt",
    "map suggest drive.csv --out car.txt",
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    names = " ".join([*OVERWRITING, *NOT_ITS_OWN, *NO_TOML]).split()
    for name in {name for name in names if "." in name[1:]} - {"car.txt"} | {"drives.parquet"}:
        (tmp_path / name).write_text(name)
    shutil.copy(resource("config/suv.toml"), tmp_path / "base.toml")
    (tmp_path / "car.toml").write_text('include = "base.toml"\n')
    (tmp_path / "linked.toml").unlink()
    (tmp_path / "linked.toml").symlink_to("base.toml")
    (tmp_path / "rig.csv").write_text("block,trip,file\n1,1,block.svg\n2,2,trip.md\n")
    for name in ("block.svg", "trip.md"):
        (tmp_path / name).write_text(name)
    for name in ("block.toml", "trip.toml", "own.csv", "own.toml", "own.parquet"):
        (tmp_path / name).unlink()
    (tmp_path / "fleet.csv").write_text("vehicle,log\none,drives.parquet\n")
    return tmp_path


@pytest.mark.parametrize("line", OVERWRITING)
def test_an_output_or_its_neighbour_is_no_input(
    line: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert cli.main(line.split()) == 2
    said = capsys.readouterr().err
    assert re.search(
        rf"--(out|discover): .*: would overwrite (/.*/)?{OVERWRITING[line]}, which this command reads", said
    )
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize("line", NOT_ITS_OWN)
def test_a_new_output_takes_the_place_of_nobodys_file(
    line: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    theirs = folder / NOT_ITS_OWN[line]
    theirs.write_text("theirs")
    assert cli.main(line.split()) == 2
    assert f"would overwrite {theirs.name}, which was not written with it" in capsys.readouterr().err
    assert theirs.read_text() == "theirs"


@pytest.mark.parametrize("line", NO_TOML)
def test_toml_is_written_to_a_name_that_says_so(
    line: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(line.split()) == 2
    assert "--out: car.txt: is written as TOML; let the name end in .toml" in capsys.readouterr().err
    assert not (folder / "car.txt").exists()


@pytest.mark.parametrize(
    ("mistake", "says"),
    [
        (
            OSError(errno.ENOSPC, "of pyarrow"),
            "page.html: cannot be written (No space left on device); choose",
        ),
        (KeyboardInterrupt("by Ctrl-C"), "by Ctrl-C"),
    ],
)
def test_an_output_is_whole_or_as_it_was(tmp_path: Path, mistake: BaseException, says: str) -> None:
    out = tmp_path / "sub" / "page.html"
    write_text(out, "before")

    def fail() -> None:
        with whole(out) as part:
            part.write_text("hal")
            raise mistake

    with pytest.raises((UserError, KeyboardInterrupt), match=re.escape(says)):
        fail()
    assert out.read_text() == "before"
    assert [*out.parent.iterdir()] == [out]


def test_an_output_that_is_a_pipe_is_written_to() -> None:
    with pytest.raises(UserError, match="/dev/full: cannot be written"):
        write_text(Path("/dev/full"), "text")
    assert Path("/dev/full").is_char_device()


def test_an_output_that_is_a_link_stays_one(tmp_path: Path) -> None:
    (tmp_path / "link.html").symlink_to(tmp_path / "page.html")
    write_text(tmp_path / "link.html", "text")
    assert (tmp_path / "link.html").is_symlink()
    assert (tmp_path / "page.html").read_text() == "text"


@pytest.mark.parametrize(
    "command",
    [
        "rig single --config suv --lock-step --junit {}",
        "replay drive.csv --config suv --out {}.parquet",
        "simulate single --config suv --out {}",
        "map suggest drive.csv --config suv --out {}.toml",
    ],
)
@pytest.mark.parametrize(
    ("place", "says"), [("/proc/page", "Permission denied"), ("/dev/null/page", "Not a directory")]
)
def test_what_cannot_be_written_is_known_before_the_work(
    command: str, place: str, says: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: not str(path).startswith("/proc"))  # root may all
    assert cli.main(command.format(place).split()) == 2
    line = capsys.readouterr().err
    assert line.startswith(f"brake-ecu: {place}")
    assert f"cannot be written ({says}); choose another --" in line
