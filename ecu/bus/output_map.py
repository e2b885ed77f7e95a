"""Outputs of a signal map: demands, status and estimates in messages of another maker's database.

A map's `[outputs]` names the message and the signal of each; `docs/signal-maps.md` has an example. What is
sent is (output in `unit` · factor + offset) as the database scales it. A demand that is invalid leaves as
that: its validity signal, or the value that stands for invalid, is part of the map, or the map is refused.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from cantools.database import Message
from cantools.database.errors import Error as DatabaseError

from ecu.bus import e2e
from ecu.bus.bits import FLOAT32, first_bit
from ecu.bus.database import LONGEST_PAYLOAD, find_message, find_signal, read_database, set_sender
from ecu.bus.plan import not_available_code, signal_row
from ecu.bus.protection import Protection
from ecu.bus.receive_plan import ReceivePlan, accepted_ids
from ecu.bus.signal_map import (
    MappedMessage,
    MappedOutput,
    SignalMap,
    period_of,
    protection_of,
    read_signal_map,
)
from ecu.bus.transmit import (
    LONGEST_CLASSICAL,
    SentMessage,
    TransmitPlan,
    compile_transmit,
    contract_messages,
)
from ecu.bus.units import conversion
from ecu.contract.records import EXTENDED_ID, FRAME_FD, RecordArray
from ecu.contract.signals import CYCLE_NS, DEMANDS, OUTPUT, OUTPUT_SIGNALS, column_names, without_corner
from ecu.errors import UserError, closest
from ecu.settings.resources import resource

CYCLE_S: Final = CYCLE_NS * 1e-9
SLOWEST_DEMAND_S: Final = 0.1
"""Longest period of a message with a demand: that it is invalid has to arrive at the end of a run, too."""
FD_LENGTHS: Final = (12, 16, 20, 24, 32, 48, 64)
LAST_STANDARD: Final = 0x7FF

_BEYOND: Final = 2.0**64
"""Greater than any raw code."""
_UNITS: Final = {column: one.unit for one in OUTPUT_SIGNALS for column in column_names(one)}
_ALWAYS_KNOWN: Final = {
    *("mode", "active_faults", "active_faults_2", "overruns", "worst_lateness_us", "braking"),
    *("pressure_demand_valid", "motor_demand_valid"),
}


def transmit_plan(map_file: Path | None, receiving: ReceivePlan) -> TransmitPlan:
    """Return what the ECU sends: its own frames, and those of a signal map; `receiving`: what comes in.

    Raises UserError for a map that cannot be sent, and names the key.
    """
    dbc = resource("dbc/brake_ecu.dbc")
    if map_file is None:
        return compile_transmit(contract_messages(dbc, "BrakeEcu"))
    signal_map = read_signal_map(map_file)
    mapped = _mapped_messages(map_file, signal_map)
    own = signal_map.own_frames if signal_map.own_frames is not None else not mapped
    if not own and not mapped:
        raise UserError(str(map_file), "own_frames", "without [outputs] nothing is sent; use run --silent")
    sent = [*(contract_messages(dbc, "BrakeEcu", signal_map.own_offset) if own else ()), *mapped]
    plan = compile_transmit(sent)
    _refuse_shared(map_file, plan, receiving)
    return plan


def refuse_fd(plan: TransmitPlan, can_fd: bool, config: Path) -> None:
    """Raise UserError for CAN FD frames on a bus that `config` opens as a classical one."""
    names = plan.messages["name"][plan.messages["flags"] & FRAME_FD != 0]
    if len(names) and not can_fd:
        raise UserError(str(config), "can_fd", f"{names[0]} of the map is a CAN FD frame; set it to true")


def _refuse_shared(path: Path, plan: TransmitPlan, receiving: ReceivePlan) -> None:
    """Raise UserError where two messages have one identifier, or one beyond 11 bits."""
    names = accepted_ids(receiving.messages)
    for message in plan.messages:
        number, name = int(message["id"]), str(message["name"])
        if LAST_STANDARD < number < EXTENDED_ID:
            raise UserError(
                str(path), "own_offset", f"moves {name} to {number:X}, beyond 7FF; give a smaller one"
            )
        if number in names:
            remedy = f"{names[number]} has this identifier, too; own_offset moves the ECU's own frames"
            raise UserError(str(path), f"frame {number & ~EXTENDED_ID:03X} ({name})", remedy)
        names[number] = name


def _mapped_messages(path: Path, signal_map: SignalMap) -> list[SentMessage]:
    names = list(dict.fromkeys(mapped.message for mapped in signal_map.outputs.values()))
    if not names:
        return []
    database_path = path.parent / (signal_map.output_database or signal_map.database)
    readable = read_database(database_path)
    readable.refuse(database_path, True, names)
    sent: list[SentMessage] = []
    for name in names:
        outputs = {key: one for key, one in signal_map.outputs.items() if one.message == name}
        message = find_message(readable.database, name, path, f"outputs.{next(iter(outputs))}.message")
        one = _sent_message(
            path, database_path, message, signal_map.messages.get(name, MappedMessage()), outputs
        )
        phase = sum(other.period == one.period for other in sent) % one.period
        sent.append(one._replace(phase=phase))
    return sent


def _sent_message(
    path: Path,
    database_path: Path,
    message: Message,
    settings: MappedMessage,
    outputs: dict[str, MappedOutput],
) -> SentMessage:
    key = f"messages.{message.name}"
    if settings.priority == "any":
        raise UserError(str(path), f"{key}.priority", "a message that is sent has one; give a number, 0 to 7")
    set_sender(message, settings.source, settings.priority, path, key)
    if message.length > LONGEST_CLASSICAL and message.length not in FD_LENGTHS:
        lengths = ", ".join(map(str, FD_LENGTHS))
        raise UserError(
            str(database_path), message.name, f"{message.length} bytes are no CAN FD frame; give {lengths}"
        )
    if settings.slowest_period is not None:
        raise UserError(str(path), f"{key}.slowest_period", "is of messages that come in; remove it")
    period_s = period_of(path, message, settings, key)
    period = round(period_s / CYCLE_S)
    if period < 1 or abs(period * CYCLE_S - period_s) > 1e-6:
        raise UserError(str(path), f"{key}.period", f"{period_s:g} s is no multiple of 0.01 s; give one")
    demands = [name for name in outputs if without_corner(name) in DEMANDS]
    if demands and period_s > SLOWEST_DEMAND_S:
        remedy = f"{demands[0]} has to leave every {SLOWEST_DEMAND_S:g} s at least"
        raise UserError(str(path), f"{key}.period", remedy)
    protection = protection_of(path, database_path, message, settings, key)
    rows: list[RecordArray] = []
    for name, mapped in outputs.items():
        rows += _rows(path, database_path, message, name, mapped)
    _refuse_shared_bits(path, message, outputs, protection)
    payload = _payload(path, message, settings.constants, outputs)
    return SentMessage(message, np.concatenate(rows), period, 0, protection, payload=payload)


def _rows(
    path: Path, database_path: Path, message: Message, name: str, mapped: MappedOutput
) -> list[RecordArray]:
    """Return the row of an output, and that of its validity signal."""
    key = f"outputs.{name}"
    if name not in OUTPUT:
        hint = closest(name, [*OUTPUT]) or "; docs/signal-maps.md lists them"
        raise UserError(str(path), key, f"no such output{hint}")
    signal = find_signal(message, mapped.signal, database_path, path, f"{key}.signal")
    if signal.is_float and signal.length < 32:
        raise UserError(str(path), f"{key}.signal", f"{signal.name} is a float of 16 bits, which is not sent")
    if not mapped.factor:
        raise UserError(
            str(path), f"{key}.factor", "0 sends nothing; give what turns the output into the signal"
        )
    unit = mapped.unit if mapped.unit is not None else signal.unit or ""
    factor, offset = conversion(unit, _UNITS[name], None, str(path), f"{key}.unit")
    inverse, value = factor / mapped.factor, signal_row(signal)
    value["place"], value["scale"] = OUTPUT[name], signal.scale * inverse
    value["offset"] = (signal.offset - mapped.offset) * inverse + offset
    gate = DEMANDS.get(without_corner(name), "")
    unknown = gate or (
        without_corner(name) not in _ALWAYS_KNOWN
        and not_available_code(signal) is None
        and not signal.is_float
    )
    if unknown and mapped.validity is None and mapped.invalid is None:
        remedy = (
            "say how it leaves while invalid or unknown: validity = { signal, valid, invalid }, or invalid"
        )
        raise UserError(str(path), key, remedy)
    if mapped.invalid is not None:
        _set_invalid(path, key, signal, value, mapped.invalid)
        value["validity"] = OUTPUT[gate] if gate else -1
    if mapped.validity is None:
        return [value]
    flag = find_signal(message, mapped.validity.signal, database_path, path, f"{key}.validity.signal")
    row = signal_row(flag)
    codes = [
        _raw(path, f"{key}.validity", flag, code) for code in (mapped.validity.valid, mapped.validity.invalid)
    ]
    if codes[0] == codes[1]:
        raise UserError(str(path), f"{key}.validity", "valid and invalid are one code; give two")
    row["place"], row["validity"] = OUTPUT[name], OUTPUT[gate] if gate else -1
    row["raw_low"] = row["raw_high"] = mapped.validity.valid  # the only code of any value
    row["not_available"] = codes[1]
    return [value, row]


def _codes(signal: Any) -> tuple[int, int]:
    """Return the least and the greatest raw code of an integer signal."""
    if signal.is_signed:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


def _raw(path: Path, key: str, signal: Any, code: int) -> int:
    """Return the bits of a raw code; raises UserError for one that the signal cannot hold."""
    low, high = _codes(signal)
    if signal.is_float or not low <= code <= high:
        kind = "a float, it has no codes" if signal.is_float else f"{low} to {high}"
        raise UserError(str(path), key, f"{signal.name} cannot be {code}; its codes: {kind}")
    return code % (1 << signal.length)


def _set_invalid(path: Path, key: str, signal: Any, row: RecordArray, value: float) -> None:
    """Make the row send `value`, as the database scales it, for what is invalid, and for nothing but that."""
    scaled = (value - signal.offset) / signal.scale
    if signal.is_float:
        kind: Any = np.float32 if int(row["kind"][0]) == FLOAT32 else np.float64
        if abs(scaled) > float(np.finfo(kind).max):
            raise UserError(
                str(path), f"{key}.invalid", f"{signal.name} cannot be {value:g}; give another value"
            )
        row["not_available"] = kind(scaled).view(f"u{signal.length // 8}")
        return
    code = round(min(max(scaled, -_BEYOND), _BEYOND))
    if abs(scaled - code) > 1e-6 * max(1.0, abs(scaled)):
        remedy = f"{signal.name} has steps of {signal.scale:g}; give {code * signal.scale + signal.offset:g}"
        raise UserError(str(path), f"{key}.invalid", remedy)
    row["not_available"] = _raw(path, f"{key}.invalid", signal, code)
    stands_for_none = code * row["scale"][0] + row["offset"][0] != 0.0
    if stands_for_none and code == row["raw_high"][0]:
        row["raw_high"] -= 1
    if stands_for_none and code == row["raw_low"][0]:
        row["raw_low"] += 1


def _bits(signal: Any) -> set[tuple[int, int]]:
    """Return byte and bit of every bit of a signal."""
    big_endian = signal.byte_order == "big_endian"
    start = first_bit(signal.start, big_endian)
    return {
        (place // 8, 7 - place % 8 if big_endian else place % 8)
        for place in range(start, start + signal.length)
    }


def _refuse_shared_bits(
    path: Path, message: Message, outputs: dict[str, MappedOutput], protection: Protection
) -> None:
    """Raise UserError where two write the same bits: outputs, validity signals, counter and checksum."""
    by_name = {signal.name: signal for signal in message.signals}
    taken: dict[tuple[int, int], str] = {}
    if protection.rule != e2e.NO_CHECKSUM:
        byte = e2e.checksum_place(protection.rule, message.length)
        first = 4 if protection.rule in (e2e.HYUNDAI_XOR, e2e.J1939) else 0
        taken |= {(byte, bit): "the checksum" for bit in range(first, 8)}
    if protection.counter is not None:
        if taken.keys() & _bits(protection.counter):
            remedy = f"{protection.counter.name} lies where the checksum is; give another signal or rule"
            raise UserError(str(path), f"messages.{message.name}.counter", remedy)
        taken |= dict.fromkeys(_bits(protection.counter), "the counter")
    for name, mapped in outputs.items():
        written = [(mapped.signal, f"outputs.{name}", name)]
        if mapped.validity is not None:
            stem = without_corner(name)
            shared = stem if stem in DEMANDS else name  # the demands of four wheels are valid together
            codes = f"{mapped.validity.valid} or {mapped.validity.invalid}"
            written.append(
                (mapped.validity.signal, f"outputs.{name}.validity", f"the validity of {shared} ({codes})")
            )
        for signal, key, writer in written:
            places = _bits(by_name[signal])
            others = {taken[place] for place in places if place in taken} - {writer}
            if others:
                raise UserError(
                    str(path), key, f"{signal} is written by {', '.join(sorted(others))}; give another signal"
                )
            taken |= dict.fromkeys(places, writer)


def _payload(
    path: Path, message: Message, constants: dict[str, int], outputs: dict[str, MappedOutput]
) -> bytes:
    """Return a payload before its values: constants, else initial values, else "not available", else 0."""
    key = f"messages.{message.name}.constants"
    by_name = {signal.name: signal for signal in message.signals}
    written = {mapped.signal for mapped in outputs.values()}
    written |= {mapped.validity.signal for mapped in outputs.values() if mapped.validity is not None}
    for name, code in constants.items():
        if name not in by_name:
            hint = closest(name, by_name)
            raise UserError(str(path), f"{key}.{name}", f"{message.name} has no such signal{hint}")
        if name in written:
            raise UserError(str(path), f"{key}.{name}", "is an output, too; keep one of them")
        _raw(path, f"{key}.{name}", by_name[name], code)
    codes = {name: constants.get(name, _unused(signal)) for name, signal in by_name.items()}
    try:
        payload = message.encode(codes, scaling=False, strict=False)
        present = message.decode(payload, decode_choices=False, scaling=False)
    except (DatabaseError, ValueError) as error:
        raise UserError(str(path), key, f"give the multiplexer's code ({error})") from None
    for name in sorted(written - {*present}):
        selector = by_name[name].multiplexer_signal
        raise UserError(
            str(path), key, f"{name} is not in the message; give {selector} a code that selects it"
        )
    return payload.ljust(LONGEST_PAYLOAD, b"\0")


def _unused(signal: Any) -> float:
    """Return the raw code of a signal that the map does not name."""
    low, high = _codes(signal)
    codes = (signal.raw_initial, not_available_code(signal))
    return next((code for code in codes if code is not None and (signal.is_float or low <= code <= high)), 0)
