"""docs/tutorial-pad-life.md, command by command, its drives a quarter shorter."""

import re
import shlex
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from brakelab.bench import fleet_drives as generate
from ecu.cli import main
from ecu.settings.resources import resource

pytestmark = pytest.mark.study

PAGE = (resource("docs") / "tutorial-pad-life.md").read_text("utf-8")


def _run(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    words = shlex.split(line)
    match words:
        case ["brake-ecu", *arguments]:
            assert main(arguments) == 0, line
        case ["python", "-c", code]:
            exec(compile(code, "tutorial", "exec"), {})
        case ["python", "-m", "brakelab.bench.fleet_drives", *arguments]:
            monkeypatch.setattr(sys, "argv", ["generate", *arguments])
            generate.main()
        case ["mkdir", "-p", folder]:
            Path(folder).mkdir(parents=True)
        case ["sed", "-n", _, source, ">>", target]:
            section = re.search(r"^\[front\.dust\].*", Path(source).read_text(), re.DOTALL | re.MULTILINE)
            assert section
            with Path(target).open("a") as file:
                file.write(section[0])
        case _:
            pytest.fail(f"the tutorial has a command that nobody tests: {line}")


def _follow(page: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    for kind, block in re.findall(r"```(sh|csv)\n(.*?)```", page, re.DOTALL):
        if kind == "csv":
            Path("out/fleet.csv").write_text(block)
        else:
            for line in block.splitlines():
                _run(line, monkeypatch)


def test_all_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _follow(PAGE.replace("--seconds 2400", "--seconds 1800"), tmp_path, monkeypatch)
    said = capsys.readouterr().out
    for line in re.findall(r"^(out/car\..*)$", PAGE, re.MULTILINE):
        assert line in said  # what the page shows
    assert "as measured: fl" in said
    assert "fitted as new, by the law" in Path("out/second.html").read_text("utf-8")
    pads = pq.read_table("out/fleet/pads.parquet")
    assert pads.column("vehicle").to_pylist() == ["suv-000"] * 4 + ["sedan-001"] * 4
    assert pads.column("measurements").to_pylist() == [1, 1, *[0] * 6]
    assert all(low is not None for low in pads.column("remaining_low").to_pylist())
    assert "Who needs pads when" in Path("out/fleet/report.html").read_text("utf-8")
    assert "dirtiest brake applications, by particles" in Path("out/third.html").read_text("utf-8")
