"""A database with mistakes: all are reported at once with their lines, and spoil their own message alone."""

import pickle
from pathlib import Path

import cantools
import pytest

from ecu.bus.database import load_database, read_database
from ecu.bus.signal_map import load_signal_map, receive_plan
from ecu.cli import main
from ecu.errors import Mistakes

GOOD = """VERSION ""
BU_: A
BO_ 1 Wheels: 8 A
 SG_ v_fl : 0|16@1+ (0.01,0) [0|0] "rad/s" A
 SG_ v_fr : 16|16@1+ (0.01,0) [0|0] "rad/s" A

BO_ 2 Other: 8 A
 SG_ a : 0|8@1+ (1,0) [0|0] "" A
 SG_ b : 8|8@1+ (1,0) [0|0] "" A

CM_ BO_ 2 "of
two lines";
"""
MAP = """database = "car.dbc"
[messages.Wheels]
period = 0.01
[inputs]
wheel_speed_fl = { message = "Wheels", signal = "v_fl" }
wheel_speed_fr = { message = "Wheels", signal = "v_fr" }
"""
# the text before, after, and the error message
MISTAKES = {
    "overlap": (
        "b : 8|8@1+",
        "b : 4|8@1+",
        "line 9, Other.b: overlaps a; if that is meant, set strict = false",
    ),
    "beyond": (
        "b : 8|8@1+",
        "b : 60|8@1+",
        "line 9, Other.b: does not fit its message of 8 bytes; mend start",
    ),
    "beyond, big endian": ("b : 8|8@1+", "b : 60|8@0+", "line 9, Other.b: does not fit its message of 8"),
    "no bits": ("b : 8|8@1+", "b : 8|0@1+", "line 9, Other.b: has 0 bits; give its length, or remove it"),
    "name twice": ("SG_ b : 8", "SG_ a : 8", "line 9, Other.a: its message has two signals of this name;"),
    "no number": (
        '(1,0) [0|0] "" A\n\n',
        '(.5,0) [0|0] "" A\n\n',
        "line 9, column 18: syntax",
    ),
}


def written(folder: Path, text: str) -> Path:
    path = folder / "car.dbc"
    path.write_text(text)
    (folder / "map.toml").write_text(MAP)
    return path


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_elsewhere_is_reported_and_the_map_works(tmp_path: Path, case: str) -> None:
    before, after, message = MISTAKES[case]
    path = written(tmp_path, GOOD.replace(before, after))
    said: list[str] = []
    plan = receive_plan(tmp_path / "map.toml", said.append)
    assert [str(message["name"]) for message in plan.messages] == ["Wheels"]
    (line,) = said
    assert line.startswith(f"{path}: {message.partition(';')[0]}")
    assert line.endswith("; 1 message left out, which the map does not use")
    with pytest.raises(Mistakes) as refusal:
        load_database(path)
    assert str(refusal.value).startswith(f"{path}: {message}")


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_in_a_message_of_the_map_refuses_it(tmp_path: Path, case: str) -> None:
    before, after, message = MISTAKES[case]
    written(tmp_path, GOOD.replace(before, after))
    other = MAP.replace("Wheels", "Other").replace("v_fl", "a").replace("v_fr", "a")
    (tmp_path / "map.toml").write_text(other)
    with pytest.raises(Mistakes) as refusal:
        load_signal_map(tmp_path / "map.toml")
    assert message in str(refusal.value)


def test_a_message_defined_twice_is_refused_where_it_is_used(tmp_path: Path) -> None:
    again = GOOD + 'BO_ 3 Wheels: 8 A\n SG_ v_fl : 32|16@1+ (0.01,0) [0|0] "rad/s" A\n'
    written(tmp_path, again)
    with pytest.raises(Mistakes, match="line 13, Wheels: this message is defined twice; remove"):
        load_signal_map(tmp_path / "map.toml")


def test_all_mistakes_are_reported_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of the messages that the map uses; one that it does not use is none of its business."""
    text = GOOD.replace("v_fr : 16|16", "v_fr : 8|16").replace("b : 8|8@1+", "b : 4|8@1+")
    more = ' SG_ far : 60|8@1+ (1,0) [0|0] "" A\n SG_ odd : 50|2@1+ (.5,0) [0|0] "" A\n'
    path = written(tmp_path, text.replace("\nBO_ 2", f"{more}\nBO_ 2"))
    assert main(["doctor", "--map", str(tmp_path / "map.toml")]) == 2
    assert [line.partition(";")[0] for line in capsys.readouterr().err.splitlines()] == [
        f"brake-ecu: {path}: line 7, column 21: syntax not understood at » in: {more.splitlines()[1][1:20]}»"
        '.5,0) [0|0] "" A',
        f"brake-ecu: {path}: line 5, Wheels.v_fr: overlaps v_fl",
        f"brake-ecu: {path}: line 6, Wheels.far: does not fit its message of 8 bytes",
    ]


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("8 A\n SG_ v_fl : 0|16", "8 A SG_ v_fl : 0|0", "v_fl length 0 is not greater than 0"),
        ("BO_ 1 W", "BO_ 9999 W", "id 0x270f is more than 11 bits in message Wheels"),
    ],
    ids=["no line of its own", "no identifier"],
)
def test_what_spoils_no_signal_s_line_refuses_the_database(
    tmp_path: Path, before: str, after: str, message: str
) -> None:
    path = written(tmp_path, GOOD.replace(before, after))
    with pytest.raises(Mistakes, match=rf"^{path}: .*{message}"):
        read_database(path)


def test_comments_that_are_no_syntax_are_lost_alone(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD + 'CM_ SG_ 7 "signal\nmissing";\nCM_ 9 "no kind";\nCM_ BO_ 1 "wheels";\n')
    readable = read_database(path)
    assert [mistake.place.partition(",")[0] for mistake in readable.mistakes] == ["line 13", "line 15"]
    assert load_database(path).get_message_by_name("Wheels").comment == "wheels"
    assert load_database(path).get_message_by_name("Other").comment == "of\ntwo lines"


@pytest.mark.parametrize("ends", ["\n", "\r\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "latin-1"])
def test_units_read_the_same_in_every_encoding(tmp_path: Path, encoding: str, ends: str) -> None:
    path = tmp_path / "car.dbc"
    path.write_bytes(GOOD.replace('"rad/s"', '"°/s"').replace("\n", ends).encode(encoding))
    assert load_database(path).get_message_by_name("Wheels").signals[0].unit == "°/s"


def test_signals_of_different_selections_may_lie_on_each_other(tmp_path: Path) -> None:
    """As cantools judges: one that is always there overlaps each of them."""
    signals = [' SG_ M M : 0|8@1+ (1,0) [0|0] "" A\n']
    signals += [f' SG_ m{k} m{k} : 8|8@1+ (1,0) [0|0] "" A\n' for k in range(3)]
    text = f'VERSION ""\nBU_: A\nBO_ 1 Mux: 8 A\n{"".join(signals)}'
    assert not read_database(written(tmp_path, text)).mistakes
    (mistake,) = read_database(
        written(tmp_path, text + ' SG_ s : 15|4@1+ (1,0) [0|0] "" A\n BO_ 2 N: 8 A\n')
    ).mistakes
    assert mistake.place == "line 8, Mux.s"
    assert mistake.remedy.startswith("overlaps m0, m1, m2;")


def test_other_kinds_of_databases_name_message_and_signal(tmp_path: Path) -> None:
    path = tmp_path / "car.kcd"
    text = GOOD.replace("b : 8|8@1+", "b : 4|8@1+")
    path.write_text(cantools.database.load_string(text, "dbc", strict=False).as_kcd_string())
    (mistake,) = read_database(path).mistakes
    assert (mistake.message, mistake.place) == ("Other", "Other.b")


def test_mistakes_pass_between_processes() -> None:
    mistakes = pickle.loads(pickle.dumps(Mistakes("car.dbc", [("line 1", "mend it"), ("line 2", "and it")])))
    assert str(mistakes) == "car.dbc: line 1: mend it (and 1 more mistake)"
    assert mistakes.lines == ["car.dbc: line 1: mend it", "car.dbc: line 2: and it"]
