"""What a user reads who typed something wrong: one line, and the exit code."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer import Context
from typer.main import get_command

from ecu import __version__, cli
from ecu.errors import RunFault, UserError
from ecu.settings import resources

COMMANDS = (
    "run",
    "demo",
    "simulate",
    "replay",
    "play",
    "report",
    "compare",
    "map",
    "rig",
    "tune",
    "bench",
    "doctor",
)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("stop", "No such command 'stop'; see brake-ecu --help"),
        ("replya", "Did you mean 'replay'"),
        ("--loud", "No such option: --loud"),
        ("run", "Missing option '--config'; see brake-ecu run --help"),
        ("run --config suv -i socketcan", "Missing option '-c'"),
        ("run --config suv -i socketcan -c can0 --recrod out", "No such option: --recrod"),
        (
            "run --config nosuch -i socketcan -c can0",
            "nosuch: no such file, and none that is shipped (lcv, mustang,",
        ),
        ("play drive.log -i socketcan -c can0 --speed fast", "Invalid value for '--speed'"),
        ("replay drive.log --config suv --out r.parquet --observer best", "take joint, observer1, observer2"),
        ("replay --config suv --out r.parquet", "Missing argument 'LOG'"),
        ("simulate nosuch --config suv --out x", "nosuch: no such file, and none that is shipped ("),
        ("bench step codec", "unexpected extra argument"),
        ("rig stop-7 --config suv", "stop-7: no such file, and none that is shipped (blending-0,"),
        ("rig stop-1 stop-1 --config suv", "stop-1: named twice"),
        ("rig stop-1 --config suv -i socketcan", "-i, -c: give both or none"),
        ("simulate stop-1 --config suv --out x --seed -1", "Invalid value for '--seed'"),
        ("tune --config suv --out tuned.txt", "--out: tuned.txt: is written as TOML"),
        ("tune --config suv --population 3", "Invalid value for '--population'"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(
    line: str,
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(line.split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("brake-ecu: ")
    assert says in printed.err
    assert printed.err.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (
            UserError("suv.toml", "vehicle.mass", "missing; give kg"),
            2,
            "suv.toml: vehicle.mass: missing; give kg",
        ),
        (RunFault("can0: bus off"), 1, "can0: bus off"),
        (OSError(28, "No space left on device"), 2, "no space left on the disk"),
        (
            FileNotFoundError(2, "No such file or directory", "drive.log"),
            2,
            "drive.log: no such file or directory",
        ),
        (
            ModuleNotFoundError("No module named 'bokeh'", name="bokeh.plotting"),
            2,
            "from the repository: pip install '.[lab]' ./tools",
        ),
        (ModuleNotFoundError("No module named 'ecu.x'", name="ecu.x"), 1, "unexpected ModuleNotFoundError"),
        (
            ZeroDivisionError("two\nlines"),
            1,
            "unexpected ZeroDivisionError: two lines (a fault of the program",
        ),
        (KeyboardInterrupt(), 130, ""),
    ],
)
def test_what_a_command_raises_becomes_one_line(
    error: BaseException,
    code: int,
    says: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(*_: object, **__: object) -> int:
        raise error

    monkeypatch.setattr(type(cli.app), "__call__", fail)
    assert cli.main(["demo"]) == code
    printed = capsys.readouterr().err
    assert says in printed
    assert "Traceback" not in printed
    assert printed.count("\n") == (1 if says else 0)


@pytest.mark.parametrize(
    ("arguments", "hint"), [(["simulate2"], True), (["run", "--state", "none/of/it", "--speed"], False)]
)
def test_where_the_laboratory_is_missing_it_is_named_for_its_commands_alone(
    arguments: list[str], hint: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, "_add_commands", lambda: 0)
    assert cli.main(arguments) == 2
    assert ("the laboratory's commands need" in capsys.readouterr().err) == hint


def test_debugging_shows_where(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("BRAKE_ECU_DEBUG", "1")
    cli.main(["stop"])
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([command, "--help"]) == 0
    assert f"Usage: brake-ecu {command}" in capsys.readouterr().out


def test_without_arguments_the_commands_are_listed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["brake-ecu"])
    assert cli.main() == 0
    listed = capsys.readouterr().out
    assert all(f"\n  {command} " in listed for command in COMMANDS)


def test_help_of_every_command_names_the_options_on_output(capsys: pytest.CaptureFixture[str]) -> None:
    for line in ("replay", "config check", "map suggest", "identify vehicle", "bench", "lab run", "doctor"):
        assert cli.main([*line.split(), "--help"]) == 0
        said = capsys.readouterr().out
        assert all(said.count(f"{option} ") == 1 for option in ("--quiet", "--verbose", "--json")), line


def test_a_command_is_made_alone_as_it_is_among_all() -> None:
    """And an unknown one is looked for among all."""
    cli._add_commands()
    whole: Any = get_command(cli.app)
    assert cli.app.only("replya") is cli.app
    for name, command in whole.commands.items():
        part: Any = get_command(cli.app.only(name))
        assert list(part.commands) == [name]
        alone = part.commands[name]
        assert alone.get_help(Context(alone)) == command.get_help(Context(command))


def test_nothing_is_looked_through_when_the_process_ends() -> None:
    last = "import atexit, gc; atexit.register(lambda: print(gc.get_freeze_count() > 0)); import ecu.cli"
    said = subprocess.run([sys.executable, "-c", last], capture_output=True, text=True, check=True)
    assert said.stdout == "True\n"


@pytest.mark.parametrize("words", ["a2l --config car.toml", "pdx"])
def test_no_file_of_another_kind_is_overwritten(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    content = Path("car.toml").write_text('include = "suv"\n')
    assert cli.main([*words.split(), "--out", "car.toml"]) == 2
    assert "brake-ecu: --out: car.toml: " in capsys.readouterr().err
    assert Path("car.toml").stat().st_size == content


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("config check nosuch 2>&-", ""),
        ("config new --out car.toml <&-", "brake-ecu: config new: missing: vehicle.mass"),
    ],
)
def test_a_closed_stream_is_an_empty_one(words: str, says: str, tmp_path: Path) -> None:
    """Errors stay out of the output where nobody reads them, and questions have no answer."""
    command = ["sh", "-c", f'"$0" -P -m ecu.cli {words}', sys.executable]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert ended.returncode == 2
    assert "nosuch" not in ended.stdout
    assert ended.stderr.startswith(says)


def test_a_file_that_is_not_there_is_refused_before_what_would_read_it_is_imported() -> None:
    lines = (
        "identify friction no.csv --out x.toml",
        "identify vehicle no.csv --config suv --out x.toml",
        "identify wear . --config suv --out x.toml",
        "lab look no.csv",
        "map suggest no.log",
        "play no.log -i virtual -c a",
    )
    code = "import sys\nfrom ecu import cli\nfor one in sys.argv[1:]: print(cli.main(one.split()))"
    code += "\nprint({'numpy', 'pyarrow', 'scipy'} & set(sys.modules))"
    ended = subprocess.run([sys.executable, "-P", "-c", code, *lines], capture_output=True, text=True)
    assert ended.stdout.split() == ["2"] * len(lines) + ["set()"]
    assert ended.stderr.count("no such file; give an existing file") == len(lines) - 1


@pytest.mark.parametrize("words", ["config schema", "config check suv", "--help", "nosuch 2>&1", "doctor"])
def test_output_that_nobody_reads_is_no_mistake(words: str) -> None:
    """As a shell reports a program that SIGPIPE ended."""
    command = ["sh", "-c", f'exec 3>&1; ("$0" -P -m ecu.cli {words}; echo $? >&3) | true', sys.executable]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert (ended.stdout, ended.stderr) == ("141\n", "")


@pytest.mark.parametrize("output", [subprocess.PIPE, subprocess.DEVNULL], ids=["a pipe", "nowhere"])
def test_another_broken_pipe_is_a_fault(output: int) -> None:
    code = (
        "import errno\n"
        "from ecu import cli, doctor\n"
        "def run(*_):\n"
        "    raise BrokenPipeError(errno.EPIPE, 'Broken pipe')\n"
        "doctor.doctor = run\n"
        "raise SystemExit(cli.main(['doctor']))\n"
    )
    command = [sys.executable, "-P", "-c", code]
    ended = subprocess.run(command, stdout=output, stderr=subprocess.PIPE, text=True)
    assert ended.returncode == 1
    assert ended.stderr.startswith("brake-ecu: unexpected BrokenPipeError: [Errno 32] Broken pipe (")


def test_an_interruption_while_it_loads_is_quiet() -> None:
    """The signal comes with an import in the middle of them."""
    code = (
        "import os, signal, sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'ecu.arguments':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "import ecu.cli\n"
    )
    ended = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (130, "")


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"brake-ecu {__version__}\n"


@pytest.mark.parametrize(
    ("name", "folder", "expected"),
    [
        ("suv", "config", "suv.toml"),
        ("mustang", "config/maps", "mustang.toml"),
        ("own.toml", "config", None),
        ("cars/suv", "config", None),
    ],
)
def test_only_a_bare_name_means_a_shipped_file(
    name: str, folder: str, expected: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = resources.named(name, folder)
    if expected is None:
        assert str(path) == name
    else:
        assert path == resources.resource(folder) / expected
        assert path.is_file()


def test_a_file_of_that_name_comes_first(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = tmp_path_factory.mktemp("here")
    (here / "suv").write_text("")
    monkeypatch.chdir(here)
    assert str(resources.named("suv", "config")) == "suv"


@pytest.mark.parametrize(
    "command",
    [
        *("run", "demo", "simulate", "rig", "replay", "play", "report", "fleet", "wear", "compare", "tune"),
        *("bench", "doctor", "map suggest", "lab run", "lab look", "lab report"),
        *("identify friction", "identify wear", "identify dust"),
    ],
)
def test_help_is_an_imperative_and_shows_no_python_types(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([*command.split(), "--help"]) == 0
    usage, sentence, *rest = capsys.readouterr().out.split("\n\n")
    assert not re.search(r"[<{\[](str|int|path|Path|list|float)\b", "".join([usage, *rest]))
    first = sentence.split()[0]
    assert first in VERBS, f"{command}: begins with {first}"


VERBS = {
    *("Run", "Brake", "Simulate", "Test", "Replay", "Play", "Write", "Show", "Compare", "Tune", "Measure"),
    *("Check", "Propose", "Analyse", "Identify"),
}


def test_commands_fit_one_line_each(capsys: pytest.CaptureFixture[str]) -> None:
    for group in ([], ["lab"], ["identify"], ["map"], ["config"]):
        assert cli.main([*group, "--help"]) == 0
        assert "..." not in capsys.readouterr().out.partition("Commands:")[2]


def test_help_of_bench_lists_every_bench(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["bench", "nope"]) == 2
    names = capsys.readouterr().err.rpartition("choose one of ")[2].strip().split(", ")
    assert len(names) > 15
    assert cli.main(["bench", "--help"]) == 0
    assert set(names) <= set(re.findall(r"\w+", capsys.readouterr().out.partition("Options:")[0]))
