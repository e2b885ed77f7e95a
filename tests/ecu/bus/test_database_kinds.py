"""KCD, SYM and ARXML beside the DBC of the same frames: what is read, and the line that damage gives."""

import re
from pathlib import Path
from typing import Any

import cantools
import pytest

from ecu.bus.database import load_database
from ecu.bus.signal_map import load_signal_map
from ecu.errors import UserError

HERE = Path(__file__).parents[2] / "data" / "databases"
DBC = cantools.database.load_file(HERE / "chassis.dbc")
ARXML = (HERE / "chassis.arxml").read_text("utf-8")
TEXT = {
    "dbc": (HERE / "chassis.dbc").read_text("utf-8"),
    "kcd": DBC.as_kcd_string(),
    "sym": DBC.as_sym_string(),
    "arxml": ARXML,
}
LAYOUT = ("name", "start", "length", "byte_order", "is_signed", "scale", "offset", "unit", "multiplexer_ids")


def load(folder: Path, kind: str, text: str, strict: bool = True) -> Any:
    path = folder / f"car.{kind}"
    path.write_text(text, "utf-8")
    return load_database(path, strict)


def refusal(folder: Path, kind: str, text: str) -> str:
    with pytest.raises(UserError) as error:
        load(folder, kind, text)
    said = str(error.value)
    assert said.startswith(f"{folder / f'car.{kind}'}: ")
    assert "\n" not in said
    return said.partition(": ")[2]


@pytest.mark.parametrize("kind", ["kcd", "sym", "arxml"])
def test_every_kind_lays_out_the_same_signals(tmp_path: Path, kind: str) -> None:
    """The multiplexer itself is left out: ARXML gives it no name of its own."""

    def layout(database: Any) -> dict[str, Any]:
        return {
            message.name: (
                message.frame_id,
                message.length,
                message.cycle_time,
                [
                    [getattr(signal, key) for key in LAYOUT]
                    for signal in message.signals
                    if not signal.is_multiplexer
                ],
            )
            for message in database.messages
        }

    found = layout(load(tmp_path, kind, TEXT[kind]))
    assert found == layout(DBC)
    assert sum(len(signals) for *_, signals in found.values()) == 11


@pytest.mark.parametrize("kind", TEXT)
def test_the_period_is_that_of_the_database(tmp_path: Path, kind: str) -> None:
    load(tmp_path, kind, TEXT[kind])
    source = '{ message = "BrakeSnData_3", signal = "VehLongComp_A_Actl" }'
    (tmp_path / "map.toml").write_text(f'database = "car.{kind}"\n[inputs]\naccel_x = {source}\n')
    plan = load_signal_map(tmp_path / "map.toml").plan
    assert plan.messages["name"].tolist() == ["BrakeSnData_3"]
    (tmp_path / f"car.{kind}").write_text(re.sub("CycleTime=.*|interval=.20.", "", TEXT[kind]))
    if kind in ("kcd", "sym"):
        with pytest.raises(
            UserError, match=r"messages.BrakeSnData_3.period: missing, and the database has none"
        ):
            load_signal_map(tmp_path / "map.toml")


def overlapping(kind: str) -> str:
    """The front right wheel on top of the front left one."""
    old, new = {
        "dbc": ("WhlFr_W_Meas : 22|", "WhlFr_W_Meas : 6|"),
        "kcd": ('name="WhlFr_W_Meas" offset="17"', 'name="WhlFr_W_Meas" offset="1"'),
        "sym": ('Sig="WhlFr_W_Meas" 17', 'Sig="WhlFr_W_Meas" 1'),
        "arxml": ("<START-POSITION>22<", "<START-POSITION>6<"),
    }[kind]
    assert TEXT[kind].count(old) == 1
    return TEXT[kind].replace(old, new)


@pytest.mark.parametrize("kind", TEXT)
def test_overlapping_signals_are_reported_with_message_and_signal(tmp_path: Path, kind: str) -> None:
    said = refusal(tmp_path, kind, overlapping(kind))
    remedy = "if that is meant, set strict = false in the map"
    assert re.fullmatch(
        rf"(line 11, )?WheelSpeed\.WhlF[lr]_W_Meas: overlaps WhlF[lr]_W_Meas; {remedy}", said
    ), said
    assert load(tmp_path, kind, overlapping(kind), strict=False).messages


@pytest.mark.parametrize("kind", ["kcd", "arxml"])
def test_a_truncated_file_is_reported_with_line_and_column(tmp_path: Path, kind: str) -> None:
    lines = TEXT[kind].splitlines()
    half = len(lines) // 2
    said = refusal(tmp_path, kind, "\n".join(lines[:half]))
    remedy = "the file is cut off or damaged, export it again"
    assert re.fullmatch(rf"line {half}, column \d+: no XML from there on \([a-z ]+\); {remedy}", said), said


@pytest.mark.parametrize("kind", TEXT)
def test_wherever_a_file_is_cut_there_is_one_line_or_a_database(tmp_path: Path, kind: str) -> None:
    """A SYM or DBC cut between two entries is whole in itself: what is missing is then missed by the map."""
    refusals = []
    for place in range(1, len(TEXT[kind]) - 20, len(TEXT[kind]) // 25):
        try:
            load(tmp_path, kind, TEXT[kind][:place])
        except UserError as error:
            refusals.append(str(error))
    assert not [line for line in refusals if "\n" in line or "NoneType" in line]
    assert len(refusals) > (20 if kind in ("kcd", "arxml") else 4)


WITHOUT_CLUSTER = re.sub(r"<CAN-CLUSTER>.*</CAN-CLUSTER>", "", ARXML, flags=re.DOTALL)
SHIFTED = ARXML.replace("<START-POSITION>0</START-POSITION>", "<START-POSITION>16</START-POSITION>", 1)
NO_PACKAGES = '<AUTOSAR xmlns="http://autosar.org/schema/r4.0"></AUTOSAR>'
NO_SIGNAL = ARXML.replace("/Signals/WhlFl_W_Meas", "/Signals/WhlFl")
BAD: dict[str, tuple[str, str, str]] = {
    "no cluster": (
        "arxml",
        WITHOUT_CLUSTER,
        r"no CAN cluster with a frame in it; give the database of a CAN bus",
    ),
    "no package": (
        "arxml",
        NO_PACKAGES,
        r"not a database .*an element that describes messages is missing; export",
    ),
    "of a later AUTOSAR": (
        "arxml",
        ARXML.replace("schema/r4.0", "schema/r9.0"),
        r"not a database .*namespace",
    ),
    "a PDU in the middle of its frame": (
        "arxml",
        SHIFTED,
        r"WheelSpeed: its PDU begins at bit 16, which is not",
    ),
    "a reference to nothing": (
        "arxml",
        NO_SIGNAL,
        r"not a database .*dangling reference I-SIGNAL-REF .*WhlFl",
    ),
    "a name that tells nothing": (
        "xml",
        ARXML,
        r"no database by its name; let it end as its content is \(\.dbc, \.a",
    ),
    "no bus": (
        "kcd",
        re.sub(r"<Bus.*</Bus>", "", TEXT["kcd"], flags=re.DOTALL),
        r"no message in it; give the",
    ),
    "no message": (
        "dbc",
        'VERSION ""\nNS_ :\nBS_:\nBU_: A\n',
        r"no message in it; give the database of a CAN bus",
    ),
    "an older SYM": ("sym", TEXT["sym"].replace("6.0", "5.0"), r"not a database .*Only SYM version 6.0"),
    "another kind by its name": (
        "kcd",
        TEXT["dbc"],
        r"line 1, column 0: no XML from there on \(syntax error\)",
    ),
}


@pytest.mark.parametrize(("kind", "text", "line"), BAD.values(), ids=BAD)
def test_what_is_no_database_of_messages_is_one_line(tmp_path: Path, kind: str, text: str, line: str) -> None:
    assert re.match(line, refusal(tmp_path, kind, text))
