"""One policy for what commands print: what stands on standard output and what on standard error."""

import json
import os
import shlex
import subprocess
import sys
import threading
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from ecu import cli
from ecu.errors import UserError
from ecu.output import (
    LOG_FORMAT,
    LOG_LEVEL,
    Level,
    argument,
    asked,
    detail,
    fault,
    give,
    give_table,
    log_as,
    new_policy,
    print_given,
    say,
    wrote,
)


class Table(NamedTuple):
    title: str
    rows: list[tuple[str, ...]]


@pytest.mark.parametrize(
    ("level", "as_json", "out", "err"),
    [
        (Level.NORMAL, False, "result\n", "words\nwritten: a, b; next: go on\nfault\n"),
        (Level.QUIET, False, "result\n", "fault\n"),
        (Level.VERBOSE, False, "result\n", "words\ndetails\nwritten: a, b; next: go on\nfault\n"),
        (Level.NORMAL, True, "", "result\nwords\nwritten: a, b; next: go on\nfault\n"),
        (Level.QUIET, True, "", "fault\n"),
    ],
)
def test_where_lines_go(
    level: Level, as_json: bool, out: str, err: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with new_policy() as policy:
        policy.level, policy.json = level, as_json
        with asked():
            print("result")
            say("words")
            detail("details")
            wrote(Path("a"), Path("b"), next="go on")
            fault("fault")
        printed = capsys.readouterr()
        assert (printed.out, printed.err) == (out, err)
        assert policy.given == ({"written": [Path("a"), Path("b")], "next": "go on"} if as_json else {})


def test_what_is_given_becomes_plain_json(capsys: pytest.CaptureFixture[str]) -> None:
    with new_policy() as policy:
        policy.json = True
        give(rows=np.int64(3), error=np.float64(np.nan), file=Path("a.log"), torque=np.array([1.5, np.inf]))
        give_table(Table("Friction", [("front", "0.42")]))
        print_given()
    assert json.loads(capsys.readouterr().out) == {
        "rows": 3,
        "error": None,
        "file": "a.log",
        "torque": [1.5, None],
        "tables": [{"title": "Friction", "rows": [["front", "0.42"]]}],
    }


@pytest.mark.parametrize(
    "line", ["--json config check suv", "config check suv --json", "config check --json -q suv"]
)
def test_options_stand_before_or_after_the_command(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(line.split()) == 0
    printed = capsys.readouterr()
    front = json.loads(printed.out)["figures"]["torque_per_bar_front"]
    assert cli.main(["config", "check", "suv"]) == 0
    assert f"front {front:.1f}, rear" in capsys.readouterr().out
    assert ("nothing wrong" in printed.err) == ("-q" not in line)


def test_the_next_command_line_begins_anew(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["config", "check", "suv", "--json"]) == 0
    json.loads(capsys.readouterr().out)
    assert cli.main(["config", "check", "suv"]) == 0
    assert "nothing wrong" in capsys.readouterr().out


def test_an_error_is_a_line_and_an_object(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["config", "check", "nosuch.toml", "--json", "--quiet"]) == 2
    printed = capsys.readouterr()
    assert printed.err == "brake-ecu: nosuch.toml: no such file\n"
    assert json.loads(printed.out) == {"error": "nosuch.toml: no such file"}


def test_mistakes_of_a_configuration_are_a_list(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    car = tmp_path / "car.toml"
    car.write_text('name = "car"\nmas = 1620\n')
    assert cli.main(["config", "check", str(car), "--json"]) == 2
    printed = capsys.readouterr()
    mistakes = json.loads(printed.out)["mistakes"]
    assert len(mistakes) > 1
    assert len(printed.err.splitlines()) == len(mistakes)


def test_the_schema_as_json_is_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["config", "schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert cli.main(["config", "schema", "--json"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out) == schema
    assert printed.err == ""


def test_verbose_says_what_is_read(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["config", "check", "suv", "-v"]) == 0
    assert "reading " in (said := capsys.readouterr().err)
    assert "config/suv.toml" in said


def test_the_log_of_the_daemon(monkeypatch: pytest.MonkeyPatch) -> None:
    environment: dict[str, str] = {}
    monkeypatch.setattr("os.environ", environment)
    with new_policy():
        log_as(None, Level.NORMAL)
        assert environment == {}
        log_as("console", Level.VERBOSE)
        assert environment == {LOG_FORMAT: "console", LOG_LEVEL: "verbose"}
        with pytest.raises(UserError, match="--log-format: xml: not known; take console or json"):
            log_as("xml", Level.NORMAL)


def test_a_thread_says_details_by_the_same_policy(capsys: pytest.CaptureFixture[str]) -> None:
    with new_policy() as policy:
        policy.level = Level.VERBOSE
        thread = threading.Thread(target=detail, args=("compiling",))
        thread.start()
        thread.join()
    assert capsys.readouterr().err == "compiling\n"


@pytest.mark.parametrize(
    ("path", "word"),
    [("out/a.log", "out/a.log"), ("a b.log", "'a b.log'"), ("-a.log", "./-a.log"), ("it's", "'it'\"'\"'s'")],
)
def test_a_next_command_can_be_pasted(path: str, word: str) -> None:
    assert argument(Path(path)) == word
    assert shlex.split(word) == [path if path[0] != "-" else f"./{path}"]


def test_what_a_terminal_has_no_character_for_is_a_question_mark() -> None:
    said = subprocess.run(
        [sys.executable, "-m", "ecu.cli", "config", "check", b"f\xe4hrt \xe2\x82\xac.toml"],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
    )
    assert said.returncode == 2
    assert said.stderr.startswith(b"brake-ecu: f?hrt ?.toml: ")
