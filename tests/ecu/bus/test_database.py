"""A database that cannot be used gives one line: where, what, and what would mend it."""

from pathlib import Path

import cantools.database
import pytest
from cantools.database import diagnostics

from ecu.bus.database import attribute, find_message, find_signal, load_database, read_database
from ecu.errors import UserError

HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: A\n'
OVERLAP = HEAD + 'BO_ 1 M: 8 A\n SG_ one : 0|8@1+ (1,0) [0|0] "" A\n SG_ two : 4|8@1+ (1,0) [0|0] "" A\n'
OUTSIDE = HEAD + 'BO_ 1 M: 1 A\n SG_ one : 4|8@1+ (1,0) [0|0] "" A\n'
SYNTAX = HEAD + 'BO_ 1 M: 8 A\n SG_ one : 0|8@1+ (.5,0) [0|0] "" A\n'


SYNTAX_NEAR = 'SG_ one : 0|8@1+ (».5,0) [0|0] "" A'


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (OVERLAP, "line 7, M.two: overlaps one; if that is meant, set strict = false in the map"),
        (
            OUTSIDE,
            "line 6, M.one: does not fit its message of 1 bytes; mend start bit or length, or set "
            "strict = false in the map, if it is not used",
        ),
        (SYNTAX, "line 6, column 20: syntax not understood at » in: " + SYNTAX_NEAR + "; mend that line"),
        ("", "the file is empty; give a database (.dbc, .arxml, .kcd, .sym)"),
        ("hello", "line 1, column 1: syntax not understood at » in: »hello; mend that line"),
    ],
)
def test_refusal_is_one_line(tmp_path: Path, text: str, line: str) -> None:
    path = tmp_path / "car.dbc"
    path.write_text(text)
    with pytest.raises(UserError) as refusal:
        load_database(path)
    assert str(refusal.value) == f"{path}: {line}"


def test_what_is_only_strictly_refused_loads_when_asked(tmp_path: Path) -> None:
    path = tmp_path / "car.dbc"
    path.write_text(OVERLAP)
    assert [signal.name for signal in load_database(path, strict=False).messages[0].signals] == ["one", "two"]


def test_missing_file() -> None:
    with pytest.raises(UserError, match="no such file"):
        load_database(Path("nowhere.dbc"))


def test_names_that_are_missing_get_a_hint(contract: Path) -> None:
    database = load_database(contract)
    with pytest.raises(UserError, match=r"^map.toml: inputs.x.message: .*did you mean WheelSpeedFront"):
        find_message(database, "WheelSpedFront", Path("map.toml"), "inputs.x.message")
    with pytest.raises(
        UserError, match=r"^map.toml: x.signal: message Imu has no signal accel_z; did you mean accel_"
    ):
        find_signal(database.get_message_by_name("Imu"), "accel_z", contract, Path("map.toml"), "x.signal")


def test_a_message_without_signals_is_reported(tmp_path: Path) -> None:
    (tmp_path / "car.dbc").write_text('VERSION ""\nBU_: A\nBO_ 10 Empty: 8 A\n')
    (empty,) = load_database(tmp_path / "car.dbc").messages
    with pytest.raises(UserError, match="message Empty has no signal v; it has none that can be read"):
        find_signal(empty, "v", tmp_path / "car.dbc", Path("map.toml"), "x.signal")


def test_attributes(contract: Path) -> None:
    database = load_database(contract)
    assert attribute(database.get_message_by_name("VehicleSpeed"), "CycleTimeSlowest") == 100
    assert attribute(database.get_message_by_name("EcuStatus"), "E2EDataId") == 0


@pytest.mark.drives
@pytest.mark.parametrize(
    ("name", "strict", "lenient"),
    [
        ("toyota_new_mc_pt_generated", "PCS_HUD.PCS_TEMP: overlaps SET_ME_X10", ""),
        ("toyota_nodsu_pt_generated", "PCS_HUD.PCS_TEMP: overlaps SET_ME_X10", ""),
        ("hyundai_canfd_generated", "SCC_CONTROL.SCC_ObjSta: overlaps ZEROS_10", ""),
        ("vw_mqb", "PLA_01.PLA_Bremsverzoegerung: overlaps PLA_Bremsmoment", ""),
        (
            "chrysler_pacifica_2017_hybrid_generated",
            "line 20, column 33: syntax",
            "line 20, column 33: syntax",
        ),
    ],
)
def test_databases_of_real_cars_that_are_refused(drives: Path, name: str, strict: str, lenient: str) -> None:
    path = drives / "dbc" / f"{name}.dbc"
    with pytest.raises(UserError) as refusal:
        load_database(path)
    assert strict in str(refusal.value)
    if lenient:
        with pytest.raises(UserError, match=lenient):
            load_database(path, strict=False)
    else:
        assert load_database(path, strict=False).messages


@pytest.mark.drives
@pytest.mark.parametrize("name", ["hyundai_can_generated", "honda_civic_touring_2016_can_generated"])
def test_a_comment_that_is_no_syntax_spoils_no_message(drives: Path, name: str) -> None:
    path = drives / "dbc" / f"{name}.dbc"
    readable = read_database(path)
    assert [mistake.message for mistake in readable.mistakes] == ["", ""]
    assert load_database(path).messages
    assert readable.left_out(path, []).endswith("(and 1 more); only a comment is lost")


def test_a_file_of_another_kind_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "car.arxml"
    path.write_text("<html><body>not found</body></html>")
    with pytest.raises(UserError, match=r"car.arxml: not a database that can be read \(.+\)$"):
        load_database(path)


def test_a_diagnostics_database_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "car.cdd"
    path.write_text("<CANDELA/>")
    monkeypatch.setattr(cantools.database, "load_file", lambda path, strict: diagnostics.Database())
    with pytest.raises(UserError, match="a diagnostics database; give one that describes CAN messages"):
        load_database(path)


@pytest.mark.parametrize(
    ("start", "mistake"), [(0, ""), (60, "M.which: start bit, length or scale is wrong")]
)
def test_the_multiplexer_of_a_signal_has_to_be_readable_too(tmp_path: Path, start: int, mistake: str) -> None:
    path = tmp_path / "car.dbc"
    which = f' SG_ which M : {start}|8@1+ (1,0) [0|0] "" A\n'
    path.write_text(HEAD + f'BO_ 1 M: 8 A\n{which} SG_ one m1 : 8|8@1+ (1,0) [0|0] "" A\n')
    message = load_database(path, strict=False).messages[0]
    if mistake:
        with pytest.raises(UserError, match=mistake):
            find_signal(message, "one", path, path, "x")
    else:
        assert find_signal(message, "one", path, path, "x").name == "one"
