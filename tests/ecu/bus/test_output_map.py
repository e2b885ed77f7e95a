"""Outputs in another car's messages: what cantools reads of them, and the line that each mistake gives."""

import re
from pathlib import Path
from typing import Any

import cantools
import e2e.p01
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ecu.bus.output_map import refuse_fd, transmit_plan
from ecu.bus.signal_map import receive_plan
from ecu.bus.transmit import (
    TransmitPlan,
    contract_transmit_plan,
    frame_buffer,
    new_transmission,
    slowest_demand,
    transmit,
)
from ecu.contract.records import EXTENDED_ID, FRAME_EXTENDED, FRAME_FD
from ecu.contract.signals import N_OUTPUTS, OUTPUT
from ecu.errors import UserError

DATABASE = """VERSION ""
BU_: Car Unit
BO_ 10 Wheels: 8 Car
 SG_ v_fl : 0|16@1+ (0.01,0) [0|655] "km/h" Unit
 SG_ p_car : 16|16@1+ (1,0) [0|0] "kPa" Unit
BO_ 273 Brake: 8 Unit
 SG_ sum : 0|8@1+ (1,0) [0|0] "" Car
 SG_ count : 8|4@1+ (1,0) [0|0] "" Car
 SG_ valid_l : 12|2@1+ (1,0) [0|3] "" Car
 SG_ valid_r : 14|2@1+ (1,0) [0|3] "" Car
 SG_ p_l : 23|16@0+ (10,-100) [-100|30000] "kPa" Car
 SG_ p_r : 39|16@0+ (10,-100) [0|0] "kPa" Car
 SG_ style : 48|4@1+ (1,0) [0|0] "" Car
 SG_ spare : 52|4@1+ (1,0) [0|0] "" Car
 SG_ temperature : 56|8@1+ (5,-40) [-40|1200] "degC" Car
BO_ 2566844926 Torque: 16 Unit
 SG_ t_fl : 0|32@1- (1,0) [0|0] "N m" Car
 SG_ t_fr : 32|64@1- (1,0) [0|0] "Nm" Car
 SG_ decel : 96|12@1- (0.01,0) [-20|0] "m/s^2" Car
 SG_ half : 112|16@1- (1,0) [0|0] "bar" Car
BO_ 300 Multiplexed: 8 Unit
 SG_ kind M : 0|8@1+ (1,0) [0|0] "" Car
 SG_ one m1 : 8|16@1+ (0.1,0) [0|0] "bar" Car
 SG_ two m2 : 8|16@1+ (0.1,0) [0|0] "bar" Car
BO_ 301 Odd: 9 Unit
 SG_ odd : 0|8@1+ (1,0) [0|0] "bar" Car
BO_ 302 Last: 8 Unit
 SG_ low : 0|8@1+ (1,0) [0|0] "bar" Car
 SG_ count_l : 56|4@1+ (1,0) [0|0] "" Car
 SG_ sum_l : 60|4@1+ (1,0) [0|0] "" Car
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 100000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 2566844926 10;
BA_ "GenMsgCycleTime" BO_ 300 10;
BA_DEF_ SG_ "GenSigStartValue" FLOAT 0 100000;
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_ "GenSigStartValue" SG_ 273 spare 9;
VAL_ 273 temperature 255 "not_available" ;
SIG_VALTYPE_ 2566844926 t_fl : 1;
SIG_VALTYPE_ 2566844926 t_fr : 2;
SIG_VALTYPE_ 2566844926 half : 1;
"""
GOOD = """database = "car.dbc"
rolling_radius = 0.3
[messages.Wheels]
period = 0.01
[messages.Brake]
period = 0.02
checksum = "autosar_p01"
data_id = 0x1A2B
counter = { signal = "count" }
constants = { style = 5 }
[inputs]
wheel_speed_fl = { message = "Wheels", signal = "v_fl" }
[outputs]
pressure_demand_fr = { message = "Brake", signal = "p_r", invalid = 0, factor = 0.5, offset = 20 }
disc_temperature_fl = { message = "Brake", signal = "temperature" }
[outputs.pressure_demand_fl]
message = "Brake"
signal = "p_l"
validity = { signal = "valid_l", valid = 1, invalid = 2 }
"""
INPUTS_ALONE = """database = "car.dbc"
rolling_radius = 0.3
messages = { Wheels = { period = 0.01 } }
inputs = { wheel_speed_fl = { message = "Wheels", signal = "v_fl" } }
"""
EVERY = dict.fromkeys(("pressure_demand_valid", "motor_demand_valid"), 1.0)


def write(folder: Path, text: str = GOOD, database: str = DATABASE) -> Path:
    (folder / "car.dbc").write_text(database)
    (folder / "car.toml").write_text(text)
    return folder / "car.toml"


def planned(path: Path) -> TransmitPlan:
    return transmit_plan(path, receive_plan(path))


def mapped(folder: Path, messages: str, outputs: str, database: str = DATABASE) -> TransmitPlan:
    head, _, rest = GOOD.partition("[messages.Brake]")
    inputs = rest[rest.index("[inputs]") : rest.index("pressure_demand_fr")]
    return planned(write(folder, f"{head}{messages}{inputs}{outputs}", database))


def values(**given: float) -> NDArray[np.float64]:
    found = np.full(N_OUTPUTS, np.nan)
    for name, value in given.items():
        found[OUTPUT[name]] = value
    return found


def sent(plan: TransmitPlan, cycle: int = 0, **given: float) -> list[tuple[int, int, bytes]]:
    """Identifier, flags and payload of the frames of a cycle."""
    frames = frame_buffer(plan)
    count = transmit(plan, new_transmission(plan), values(**given), cycle, frames)
    return [(int(f["can_id"]), int(f["flags"]), f["data"][: f["length"]].tobytes()) for f in frames[:count]]


def decoded(plan: TransmitPlan, database: str = DATABASE, **given: float) -> dict[str, Any]:
    """What cantools reads of the only frame."""
    [(can_id, _, payload)] = sent(plan, **given)
    return cantools.database.load_string(database, "dbc", strict=False).decode_message(  # type: ignore[return-value]
        can_id, payload, decode_choices=False
    )


def test_without_a_map_and_with_inputs_alone_the_ecu_sends_its_own_frames(
    tmp_path: Path, contract: Path
) -> None:
    own = contract_transmit_plan(contract, "BrakeEcu")
    path = write(tmp_path, INPUTS_ALONE)
    for plan in (transmit_plan(None, receive_plan(None)), planned(path)):
        for one, other in zip(plan, own, strict=True):
            np.testing.assert_array_equal(one, other)


def test_what_leaves_is_what_the_map_says(tmp_path: Path) -> None:
    plan = planned(write(tmp_path))
    found = decoded(
        plan, pressure_demand_fl=40.0, pressure_demand_fr=30.0, disc_temperature_fl=123.0, **EVERY
    )
    assert (found["p_l"], found["valid_l"], found["valid_r"]) == (4000, 1, 0)
    assert found["p_r"] == 1520  # 0.5 · 3000 kPa + 20 kPa
    assert found["temperature"] == 125  # steps of 5 degC
    assert (found["style"], found["spare"]) == (5, 9)  # a constant; the database's initial value


@pytest.mark.parametrize(
    ("demand", "valid", "flag", "left", "right"),
    [
        (40.0, 1.0, 1, 4000, 2020),
        (40.0, 0.0, 2, 4000, 0),  # a shadow's, or a farewell's
        (40.0, np.nan, 2, 4000, 0),
        (np.nan, 1.0, 2, -100, 0),
    ],
)
@pytest.mark.requirement("REQ-DEM-7")
def test_an_invalid_demand_leaves_as_that(
    tmp_path: Path, demand: float, valid: float, flag: int, left: float, right: float
) -> None:
    found = decoded(
        planned(write(tmp_path)),
        pressure_demand_fl=demand,
        pressure_demand_fr=demand,
        pressure_demand_valid=valid,
    )
    assert (found["valid_l"], found["p_l"], found["p_r"]) == (flag, left, right)
    assert found["temperature"] == 255 * 5 - 40  # the database's "not_available"


def test_counter_and_checksum_of_profile_1_as_the_e2e_package_has_them(tmp_path: Path) -> None:
    plan = planned(write(tmp_path))
    frames, transmission, counts = frame_buffer(plan), new_transmission(plan), []
    for cycle in range(0, 64, 2):
        assert transmit(plan, transmission, values(pressure_demand_fl=cycle), cycle, frames) == 1
        payload = bytearray(frames["data"][0, :8].tobytes())
        assert e2e.p01.e2e_p01_check(payload, 0x1A2B, length=8)
        counts.append(payload[1] & 0xF)
        assert transmit(plan, transmission, values(), cycle + 1, frames) == 0
    assert counts == [k % 15 for k in range(32)]


def of_toyota(can_id: int, data: bytes) -> bool:
    return data[-1] == (sum(data[:-1]) + len(data) + (can_id >> 8) + (can_id & 0xFF)) % 256


def of_hyundai(can_id: int, data: bytes) -> bool:
    nibbles = [half for byte in data for half in (byte >> 4, byte & 0xF)]
    checksum = nibbles.pop(-2)
    return checksum == int(np.bitwise_xor.reduce(nibbles))


RULES = {
    "toyota": of_toyota,
    "hyundai_sum": lambda _, data: data[-1] == sum(data[:-1]) % 256,
    "hyundai_xor": of_hyundai,
    "ford_brake_sn_4": lambda _, data: data[2] == (0xFF - data[0] - data[1] - (data[3] >> 4)) % 256,
    "ford_accel_data": lambda _, data: data[6] == (0x16 - sum(data[:6]) - data[7]) % 256,
}


@pytest.mark.parametrize("rule", RULES)
def test_makers_rules_as_they_are_computed_by_hand(tmp_path: Path, rule: str) -> None:
    count = 'counter = { signal = "count_l", modulo = 13 }\n' if rule == "hyundai_xor" else ""
    plan = mapped(
        tmp_path,
        f'[messages.Last]\nperiod = 0.01\nchecksum = "{rule}"\n{count}',
        'pressure_demand_fl = { message = "Last", signal = "low", invalid = 0 }',
    )
    frames, transmission, counts = frame_buffer(plan), new_transmission(plan), []
    for cycle in range(27):
        given = values(pressure_demand_fl=9.0 * cycle, **EVERY)
        assert transmit(plan, transmission, given, cycle, frames) == 1
        payload = frames["data"][0, :8].tobytes()
        assert RULES[rule](302, payload)
        assert payload[0] == 9 * cycle
        counts.append(payload[7] & 0xF)
    assert not count or counts == [k % 13 for k in range(27)]


def test_fd_frames_floats_and_identifiers_of_29_bits(tmp_path: Path) -> None:
    plan = mapped(
        tmp_path,
        "",
        """torque_demand_fl = { message = "Torque", signal = "t_fl", invalid = -1 }
motor_demand_fr = { message = "Torque", signal = "t_fr", invalid = -5.5 }
decel_demand_total = { message = "Torque", signal = "decel", factor = -1, invalid = 0 }""",
    )
    assert plan.ids.tolist() == [EXTENDED_ID | 0x18FEF1FE]
    refuse_fd(plan, True, Path("car.toml"))
    with pytest.raises(UserError, match=r"car.toml: can_fd: Torque of the map is a CAN FD frame; set it"):
        refuse_fd(plan, False, Path("car.toml"))
    given = {"torque_demand_fl": 1234.5, "motor_demand_fr": -800.25, "decel_demand_total": 3.214, **EVERY}
    [(can_id, flags, payload)] = sent(plan, **given)
    assert (can_id, flags, len(payload)) == (0x18FEF1FE, FRAME_EXTENDED | FRAME_FD, 16)
    found = decoded(plan, **given)
    assert (found["t_fl"], found["t_fr"]) == (1234.5, -800.25)
    assert found["decel"] == pytest.approx(-3.21)
    found = decoded(plan, **given | {"pressure_demand_valid": 0.0, "motor_demand_valid": 0.0})
    assert (found["t_fl"], found["t_fr"], found["decel"]) == (-1.0, -5.5, 0.0)


@st.composite
def layouts(draw: st.DrawFn) -> tuple[str, float, float, int, bool]:
    """A signal anywhere in 11 bytes: its DBC line, scale, offset, length, sign."""
    length, signed = draw(st.integers(2, 62)), draw(st.booleans())
    big_endian = draw(st.booleans())
    first = draw(st.integers(0, 88 - length))
    start = 8 * (first // 8) + 7 - first % 8 if big_endian else first
    scale = draw(st.sampled_from([1.0, 0.005, -0.5, 100.0, 1e-4]))
    offset = draw(st.sampled_from([0.0, -100.0, 7.25]))
    kind = f"{0 if big_endian else 1}{'-' if signed else '+'}"
    line = f'SG_ s : {start}|{length}@{kind} ({scale},{offset}) [0|0] "kPa" Car'
    return line, scale, offset, length, signed


@given(layout=layouts(), bar=st.floats(-10.0, 250.0), factor=st.sampled_from([1.0, -2.0, 0.1]))
def test_cantools_reads_every_layout_within_half_a_bit(
    tmp_path_factory: Any, layout: tuple[str, float, float, int, bool], bar: float, factor: float
) -> None:
    line, scale, offset, length, signed = layout
    head, _, _ = DATABASE.partition("BO_ 273")
    database = f'{head}BO_ 20 M: 12 Unit\n {line}\n SG_ ok : 88|2@1+ (1,0) [0|0] "" Car\n'
    validity = 'validity = { signal = "ok", valid = 2, invalid = 1 }'
    output = (
        f'pressure_demand_fl = {{ message = "M", signal = "s", factor = {factor}, offset = 3, {validity} }}'
    )
    plan = mapped(tmp_path_factory.mktemp("layout"), "[messages.M]\nperiod = 0.01\n", output, database)
    low, high = (-(2 ** (length - 1)), 2 ** (length - 1) - 1) if signed else (0, 2**length - 1)
    wanted = bar * 100.0 * factor + 3.0
    nearest = min(max((wanted - offset) / scale, low), high) * scale + offset
    found = decoded(plan, database, pressure_demand_fl=bar, pressure_demand_valid=1.0)
    assert found["s"] == pytest.approx(nearest, abs=0.5001 * abs(scale), rel=1e-12)
    assert found["ok"] == 2


@pytest.mark.parametrize("invalid", [6453.5, -100.0], ids=["the greatest", "the least"])
def test_no_valid_value_is_the_one_that_stands_for_invalid(tmp_path: Path, invalid: float) -> None:
    database = DATABASE.replace("p_r : 39|16@0+ (10,-100)", "p_r : 39|16@0+ (0.1,-100)")
    output = (
        f'pressure_demand_fr = {{ message = "Brake", signal = "p_r", unit = "bar", invalid = {invalid} }}'
    )
    plan = mapped(tmp_path, "[messages.Brake]\nperiod = 0.01\n", output, database)
    assert decoded(plan, database, pressure_demand_fr=1.0)["p_r"] == pytest.approx(invalid)
    for demand in (1e9, -1e9):
        found = decoded(plan, database, pressure_demand_fr=demand, **EVERY)["p_r"]
        assert abs(found - invalid) > 0.09


def test_a_multiplexed_signal_leaves_where_a_constant_selects_it(tmp_path: Path) -> None:
    output = 'pressure_demand_fl = { message = "Multiplexed", signal = "two", invalid = 0 }'
    plan = mapped(tmp_path, "[messages.Multiplexed]\nperiod = 0.01\nconstants = { kind = 2 }\n", output)
    assert decoded(plan, pressure_demand_fl=12.3, **EVERY) == {"kind": 2, "two": pytest.approx(12.3)}


def test_an_initial_value_that_cannot_be_is_none(tmp_path: Path) -> None:
    database = DATABASE.replace("SG_ 273 spare 9", "SG_ 273 spare 16")
    found = decoded(planned(write(tmp_path, database=database)), database)
    assert found["spare"] == 0


def test_messages_of_one_period_leave_in_turn_and_the_slowest_demand_is_known(tmp_path: Path) -> None:
    plan = mapped(
        tmp_path,
        "[messages.Brake]\nperiod = 0.02\n[messages.Last]\nperiod = 0.02\n"
        "[messages.Multiplexed]\nperiod = 1\nconstants = { kind = 1 }\n",
        """pressure_demand_fl = { message = "Brake", signal = "p_l", invalid = 0 }
pressure_demand_fr = { message = "Last", signal = "low", invalid = 0 }
mode = { message = "Multiplexed", signal = "one", unit = "-" }""",
    )
    turns = [[can_id for can_id, _, _ in sent(plan, cycle)] for cycle in range(4)]
    assert turns == [[273, 300], [302], [273], [302]]
    assert slowest_demand(plan) == 2


def test_own_frames_go_out_beside_a_map_if_it_says_so_and_can_be_moved(
    tmp_path: Path, contract: Path
) -> None:
    own = contract_transmit_plan(contract, "BrakeEcu").ids.tolist()
    both = planned(write(tmp_path, f"own_frames = true\nown_offset = 0x300\n{GOOD}"))
    assert both.ids.tolist() == sorted([273, *(number + 0x300 for number in own)])
    assert planned(write(tmp_path)).ids.tolist() == [273]


def test_outputs_of_another_database(tmp_path: Path) -> None:
    (tmp_path / "unit.dbc").write_text(DATABASE.replace("273", "274"))
    assert planned(write(tmp_path, f'output_database = "unit.dbc"\n{GOOD}')).ids.tolist() == [274]


RIGHT = 'signal = "p_r", invalid = 0'
MISTAKES = {
    "no such output": (
        "pressure_demand_fl",
        "presure_demand_fl",
        "outputs.presure_demand_fl: no such output; did you mean pressure_demand_fl?",
    ),
    "an output unlike any": (
        "disc_temperature_fl",
        "foo",
        "outputs.foo: no such output; docs/signal-maps.md",
    ),
    "no such message": (
        'message = "Brake"\nsignal',
        'message = "Brakes"\nsignal',
        "has no message Brakes; did you",
    ),
    "no such signal": ('"p_l"', '"p_left"', "outputs.pressure_demand_fl.signal: message Brake has no signal"),
    "no unit of it": (
        RIGHT,
        f'{RIGHT}, unit = "degC"',
        'fr.unit: "degC" does not turn into bar; known here: bar',
    ),
    "a unit that nothing converts": (
        "disc_temperature_fl = {",
        'pad_wear_fl = { invalid = -40, unit = "m",',
        'pad_wear_fl.unit: "m" does not turn into mm; known here: mm',
    ),
    "a demand that cannot be invalid": (
        RIGHT,
        'signal = "p_r"',
        "fr: say how it leaves while invalid or unknown",
    ),
    "an estimate that cannot be unknown": (
        RIGHT,
        'signal = "p_r", invalid = 0 }\nmu_b_fl = { unit = "-", message = "Brake", signal = "spare"',
        "mu_b_fl: say how it leaves",
    ),
    "no step": (RIGHT, 'signal = "p_r", invalid = 3', "fr.invalid: p_r has steps of 10; give 0"),
    "invalid beyond its bits": (
        RIGHT,
        'signal = "p_r", invalid = -110',
        "fr.invalid: p_r cannot be -1; its codes: 0 to",
    ),
    "invalid beyond any bits": (
        RIGHT,
        'signal = "p_r", invalid = 1e308',
        "fr.invalid: p_r has steps of 10; give",
    ),
    "invalid beyond any float": (
        f'"Brake", {RIGHT}',
        '"Torque", signal = "t_fl", unit = "bar", invalid = 1e308',
        "fr.invalid: t_fl cannot be 1e+308; give another value",
    ),
    "code beyond its bits": (
        "valid = 1,",
        "valid = 4,",
        "fl.validity: valid_l cannot be 4; its codes: 0 to 3",
    ),
    "one code for both": (
        "valid = 1,",
        "valid = 2,",
        "fl.validity: valid and invalid are one code; give two",
    ),
    "no factor": ("factor = 0.5", "factor = 0", "fr.factor: 0 sends nothing"),
    "two in one signal": (
        RIGHT,
        'signal = "p_l", invalid = 0',
        "outputs.pressure_demand_fl: p_l is written by pressure_demand_fr; give another signal",
    ),
    "half a float": (
        f'"Brake", {RIGHT}',
        '"Torque", signal = "half", invalid = 0',
        "fr.signal: half is a float of 16 bits, which is not sent",
    ),
    "codes of a float": (
        f'"Brake", {RIGHT}',
        '"Torque", signal = "t_fl", unit = "bar", validity = { signal = "t_fr", valid = 1, invalid = 0 }',
        "fr.validity: t_fr cannot be 1; its codes: a float, it has no codes",
    ),
    "in the counter": (
        RIGHT,
        'signal = "count", unit = "bar", invalid = 0',
        "count is written by the counter",
    ),
    "in the checksum": (RIGHT, 'signal = "sum", unit = "bar", invalid = 0', "sum is written by the checksum"),
    "counter in the checksum": ('"count"', '"sum"', "messages.Brake.counter: sum lies where the checksum is"),
    "validity of two": (
        RIGHT,
        f'{RIGHT}, validity = {{ signal = "valid_l", valid = 2, invalid = 1 }}',
        "fl.validity: valid_l is written by the validity of pressure_demand (2 or 1)",
    ),
    "no such constant": (
        "style = 5",
        "stile = 5",
        "constants.stile: Brake has no such signal; did you mean style?",
    ),
    "a constant that is an output": ("style = 5", "p_l = 5", "constants.p_l: is an output, too"),
    "a constant beyond its bits": (
        "style = 5",
        "style = 16",
        "constants.style: style cannot be 16; its codes: 0 to 15",
    ),
    "no such rule": ('"autosar_p01"', '"autosar_p02"', 'messages.Brake.checksum: unknown rule "autosar_p02"'),
    "no period": ("period = 0.02\n", "", "messages.Brake.period: missing"),
    "no cycle": (
        "period = 0.02",
        "period = 0.025",
        "messages.Brake.period: 0.025 s is no multiple of 0.01 s",
    ),
    "less than a cycle": ("period = 0.02", "period = 0.001", "0.001 s is no multiple of 0.01 s"),
    "too slow a demand": (
        "period = 0.02",
        "period = 0.2",
        "pressure_demand_fr has to leave every 0.1 s at least",
    ),
    "slowest of what is sent": (
        "period = 0.02",
        "period = 0.02\nslowest_period = 1",
        "slowest_period: is of messages that come in",
    ),
    "constants of what comes in": (
        "period = 0.01",
        "period = 0.01\nconstants = { p_car = 1 }",
        "messages.Wheels.constants: belong to",
    ),
    "in and out": (
        '"Brake", signal = "temperature"',
        '"Wheels", signal = "p_car", unit = "degC", invalid = 0',
        "frame 00A (Wheels): Wheels has this identifier, too",
    ),
    "own frames moved onto a message": (
        "rolling",
        "own_frames = true\nown_offset = 193\nrolling",
        "frame 111 (Brake): PressureDemandFront has this identifier, too; own_offset moves",
    ),
    "own frames moved too far": (
        "rolling",
        "own_frames = true\nown_offset = 1024\nrolling",
        "own_offset: moves ParticleEmissions to 800, beyond 7FF",
    ),
    "no frame of FD": (
        'disc_temperature_fl = { message = "Brake", signal = "temperature"',
        'disc_temperature_fl = { message = "Odd", signal = "odd", unit = "degC", invalid = 0',
        "car.dbc: Odd: 9 bytes are no CAN FD frame; give 12, 16",
    ),
    "no code selects it": (
        'disc_temperature_fl = { message = "Brake", signal = "temperature"',
        'disc_temperature_fl = { message = "Multiplexed", signal = "one", unit = "degC", invalid = 0',
        "messages.Multiplexed.constants: give the multiplexer's code",
    ),
    "another code selects it": (
        'disc_temperature_fl = { message = "Brake", signal = "temperature"',
        'disc_temperature_fl = { message = "Multiplexed", signal = "two", unit = "degC", invalid = 0',
        "messages.Multiplexed.constants: two is not in the message; give kind a code that selects it",
        ("[inputs]", "[messages.Multiplexed]\nperiod = 0.01\nconstants = { kind = 1 }\n[inputs]"),
    ),
    "nothing is sent": (
        GOOD,
        f"own_frames = false\n{INPUTS_ALONE}",
        "own_frames: without [outputs] nothing is sent; use run --silent",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_gives_one_line_with_the_key(tmp_path: Path, mistake: str) -> None:
    old, new, line, *others = MISTAKES[mistake]
    text = GOOD.replace(old, new)
    for one in others:
        text = text.replace(*one)
    with pytest.raises(UserError, match=re.escape(line)) as refusal:
        planned(write(tmp_path, text))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("car", ["mustang", "rav4", "kona"])
def test_own_frames_fit_beside_the_shipped_cars(root: Path, car: str, contract: Path) -> None:
    plan = planned(root / "config" / "maps" / f"{car}.toml")
    assert plan.ids.tolist() == contract_transmit_plan(contract, "BrakeEcu").ids.tolist()
