"""Signal maps: assignment of messages and signals of another maker's database to the ECU's inputs.

A map is a TOML file; `docs/signal-maps.md` explains it with an example. A value becomes
((raw as the database scales it) · factor + offset) in `unit`, and that is converted to the contract's unit.
What such a map says of outputs: `output_map.py`.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final, Literal, NamedTuple

from cantools.database import Database, Message
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ecu.bus import e2e
from ecu.bus.database import find_message, find_signal, read_database, set_sender
from ecu.bus.freshness import input_freshness
from ecu.bus.plan import SignalUse
from ecu.bus.protection import Protection
from ecu.bus.receive_plan import MessageUse, ReceivePlan, accepted_ids, compile_receive, contract_receive_plan
from ecu.bus.units import conversion
from ecu.contract.records import EXTENDED_ID
from ecu.contract.signals import INPUT, INPUT_SIGNALS
from ecu.errors import UserError, closest
from ecu.settings.described import describe_keys
from ecu.settings.resources import resource
from ecu.settings.toml_file import Unit, describe, read_toml

SLOWEST_S: Final = 60.0
"""Greatest period and time-out, s: the slowest input, the ambient temperature, comes once a minute."""
Seconds = Annotated[float, Field(gt=0.0, le=SLOWEST_S), Unit("s")]


class _Table(BaseModel):
    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, json_schema_extra=describe_keys
    )


class Validity(_Table):
    """A signal of the same message that must have one of `values` (raw codes)."""

    signal: str
    """Of the same message."""
    values: Annotated[tuple[int, ...], Field(min_length=1), Unit("-")]
    """Raw codes with which the input counts."""


class Sign(_Table):
    """A signal of the same message that turns the value negative with one of `values` (raw codes)."""

    signal: str
    """Of the same message."""
    values: Annotated[tuple[int, ...], Field(min_length=1), Unit("-")]
    """Raw codes with which the value is negative."""


class MappedInput(_Table):
    """Source of one input."""

    message: str
    """Its name in the database."""
    signal: str
    """Its name in the database."""
    unit: str | None = None
    """Of the value after factor and offset; the database's own if it is not given."""
    factor: Annotated[float, Unit("-")] = 1.0
    """Of the value as the database scales it; -1 turns its sign."""
    offset: float = 0.0
    """Added after the factor, in `unit`."""
    sentinels: tuple[float, ...] = ()
    """Values in the database's scaling that are no measurement."""
    validity: Validity | None = None
    """A signal that says whether the value counts."""
    sign: Sign | None = None
    """A signal that says on which side of zero it is, where it is sent as a magnitude."""
    timeout: Seconds | None = None
    """After it the input is stale, if not after the contract's."""


class SentValidity(_Table):
    """A signal of the same message that says whether a sent value counts."""

    signal: str
    """Of the same message."""
    valid: Annotated[int, Unit("-")]
    """Its raw code while the output is valid."""
    invalid: Annotated[int, Unit("-")]
    """Its raw code while the output is invalid or unknown."""


class MappedOutput(_Table):
    """Destination of one output; needs `validity`, `invalid`, or a code "not_available" of the database."""

    message: str
    """Its name in the database."""
    signal: str
    """Its name in the database."""
    unit: str | None = None
    """Of the value before factor and offset; the database's own if it is not given."""
    factor: Annotated[float, Unit("-")] = 1.0
    """Of the output in `unit`: what is sent, as the database scales it; -1 turns its sign."""
    offset: float = 0.0
    """Added after the factor, as the database scales it."""
    validity: SentValidity | None = None
    """A signal that says whether the value counts."""
    invalid: float | None = None
    """Sent instead of an invalid or unknown value, as the database scales it."""


class Counter(_Table):
    """Frame counter of a message: 0 … `modulo` − 1."""

    signal: str
    """Of the same message."""
    modulo: Annotated[int, Field(ge=2), Unit("-")] | None = None
    """Values that it counts through; if it is not given, all of its bits, with autosar_p01 15."""


class MappedMessage(_Table):
    """Rate and protection of a message."""

    period: Seconds | None = None
    """Between frames; the database's cycle time (DBC: GenMsgCycleTime) if it is not given."""
    slowest_period: Seconds | None = None
    """Of a sender that varies its rate, or a logger that loses frames."""
    checksum: str | None = None
    """Name of a rule (docs/signal-maps.md)."""
    data_id: Annotated[int, Field(ge=0, le=0xFFFF), Unit("-")] = 0
    """Of the rule autosar_p01."""
    counter: Counter | None = None
    """Its frame counter."""
    source: Annotated[int, Field(ge=0, le=253), Unit("-")] | None = None
    """J1939: address of its sender, instead of that in the database's identifier."""
    priority: Annotated[int, Field(ge=0, le=7), Unit("-")] | Literal["any"] | None = None
    """J1939: instead of that in the database's identifier; "any": whatever a received frame has."""
    constants: Annotated[dict[str, int], Unit("-")] = {}
    """Raw codes of other signals, by name, in a message that is sent."""


class SignalMap(_Table):
    """Content of a map file."""

    database: str
    """Path, relative to the map file."""
    strict: bool = True
    """Refuse used messages whose signals overlap."""
    bus: str | None = None
    """Interface name in logs that hold several buses; without it every bus."""
    rolling_radius: Annotated[float, Field(gt=0.1, lt=2.0), Unit("m")] | None = None
    """Of the wheels, where their speeds are in km/h or m/s."""
    ignore_checksum: tuple[str, ...] = ()
    """Messages that are taken although checksum or counter are wrong."""
    messages: dict[str, MappedMessage] = {}
    """Rate and protection, by name of the message."""
    inputs: Annotated[dict[str, MappedInput], Field(min_length=1)]
    """Sources, by name of the input."""
    output_database: str | None = None
    """Path of the database of the messages that are sent, if it is not `database`."""
    own_frames: bool | None = None
    """Send the ECU's own frames; if it is not given, only without `outputs`."""
    own_offset: Annotated[int, Field(ge=0, le=0x7FF), Unit("-")] = 0
    """Added to the identifiers of the ECU's own frames."""
    outputs: dict[str, MappedOutput] = {}
    """Destinations, by name of the output."""


class MappedBus(NamedTuple):
    """A map, ready for `receive`."""

    plan: ReceivePlan
    bus: str | None
    """Interface that the frames are taken from; None: every one."""
    left_out: str
    """A line on mistakes in messages of the database that the map does not use; empty: there are none."""


def read_signal_map(path: Path) -> SignalMap:
    """Return the checked content of a map file; raises UserError that names the key."""
    content = read_toml(path)
    inputs = content.get("inputs")
    if isinstance(inputs, dict) and any("column" in one for one in inputs.values() if isinstance(one, dict)):
        raise UserError(str(path), "inputs", "maps columns of signal files; frames need messages")
    try:
        return SignalMap.model_validate(content)
    except ValidationError as error:
        raise describe(error, str(path), SignalMap) from None


def load_signal_map(path: Path) -> MappedBus:
    """Return the plan that a map file describes; raises UserError that names file, key and remedy."""
    signal_map = read_signal_map(path)
    database_path = path.parent / signal_map.database
    readable = read_database(database_path)
    _check_names(path, signal_map)
    names = list(dict.fromkeys(mapped.message for mapped in signal_map.inputs.values()))
    readable.refuse(database_path, signal_map.strict, names)
    uses = [_message_use(path, database_path, signal_map, readable.database, name) for name in names]
    periods = {signal.place: (use.period_s, use.slowest_s) for use in uses for signal in use.signals}
    timeouts = {
        INPUT[name]: mapped.timeout
        for name, mapped in signal_map.inputs.items()
        if mapped.timeout is not None
    }
    plan = compile_receive(uses, input_freshness(periods, timeouts))
    _refuse_shared(path, plan)
    return MappedBus(plan, signal_map.bus, readable.left_out(database_path, names))


def receive_plan(map_file: Path | None, tell: Callable[[str], None] = lambda line: None) -> ReceivePlan:
    """Return the receive plan of the bus: the contract's frames, or those of a signal map.

    `tell` receives a line on what is wrong elsewhere in the map's database.

    Raises UserError for a map or a database that is not usable.
    """
    if map_file is None:
        return contract_receive_plan(resource("dbc/brake_ecu.dbc"))
    mapped = load_signal_map(map_file)
    if mapped.left_out:
        tell(mapped.left_out)
    return mapped.plan


def _refuse_shared(path: Path, plan: ReceivePlan) -> None:
    """Raise UserError where a frame would be two messages: which of them counts is not said."""
    names: dict[int, str] = {}
    for place in range(len(plan.messages)):
        for number, name in accepted_ids(plan.messages[place : place + 1]).items():
            if (other := names.setdefault(number, name)) != name:
                remedy = f"{other} has the identifier {number & ~EXTENDED_ID:X} too; give each its own"
                raise UserError(str(path), f"messages.{name}", remedy)


def _check_names(path: Path, signal_map: SignalMap) -> None:
    for name in signal_map.inputs:
        if name not in INPUT:
            hint = (
                closest(name, [*INPUT]) or f"; there are {', '.join([*INPUT][:5])}, … (docs/signal-maps.md)"
            )
            raise UserError(str(path), f"inputs.{name}", f"no such input{hint}")
    used = {mapped.message for mapped in signal_map.inputs.values()}
    sent = {mapped.message for mapped in signal_map.outputs.values()}
    for name in signal_map.messages:
        if name not in used | sent:
            remedy = "no input and no output uses it; remove it or mend its name"
            raise UserError(str(path), f"messages.{name}", remedy)
    for name in signal_map.ignore_checksum:
        message = signal_map.messages.get(name)
        if message is None or (message.checksum is None and message.counter is None):
            raise UserError(
                str(path), "ignore_checksum", f"{name} has neither checksum nor counter in [messages.{name}]"
            )


def _message_use(
    path: Path, database_path: Path, signal_map: SignalMap, database: Database, name: str
) -> MessageUse:
    first = next(target for target, mapped in signal_map.inputs.items() if mapped.message == name)
    message = find_message(database, name, path, f"inputs.{first}.message")
    settings = signal_map.messages.get(name, MappedMessage())
    key = f"messages.{name}"
    set_sender(message, settings.source, settings.priority, path, key)
    period_s = period_of(path, message, settings, key)
    signals = [
        _signal_use(path, database_path, signal_map, message, f"inputs.{target}", target, mapped)
        for target, mapped in signal_map.inputs.items()
        if mapped.message == name
    ]
    if settings.constants:
        raise UserError(str(path), f"{key}.constants", "belong to a message that is sent; remove them")
    slowest_s, any_priority = settings.slowest_period or period_s, settings.priority == "any"
    use = MessageUse(message, signals, period_s, slowest_s, any_priority=any_priority)
    if name in signal_map.ignore_checksum:
        return use
    return use._replace(protection=protection_of(path, database_path, message, settings, key))


def period_of(path: Path, message: Message, settings: MappedMessage, key: str) -> float:
    """Return the period [s] of a message, of `key` of the map at `path` or its database; else UserError."""
    period_s = settings.period or float(message.cycle_time or 0) * 1e-3
    if not period_s:
        raise UserError(str(path), f"{key}.period", "missing, and the database has none; give it in seconds")
    return period_s


def protection_of(
    path: Path, database_path: Path, message: Message, settings: MappedMessage, key: str
) -> Protection:
    """Return what `key` of the map at `path` says of a message; raises UserError that names the key."""
    rule, counter, modulo = e2e.NO_CHECKSUM, None, 0
    if settings.checksum is not None:
        if settings.checksum not in e2e.RULES:
            known = ", ".join(e2e.RULES)
            raise UserError(
                str(path), f"{key}.checksum", f'unknown rule "{settings.checksum}"; known: {known}'
            )
        if message.length < e2e.SHORTEST_PAYLOAD.get(settings.checksum, 2):
            raise UserError(str(path), f"{key}.checksum", f"{message.name} is too short for this rule")
        rule = e2e.RULES[settings.checksum]
    if settings.counter is not None:
        counter = find_signal(message, settings.counter.signal, database_path, path, f"{key}.counter.signal")
        every = e2e.P01_MODULO if rule == e2e.AUTOSAR_P01 else 1 << min(counter.length, 15)
        modulo = settings.counter.modulo or every
        if counter.length > 15 or modulo > 1 << counter.length:
            raise UserError(
                str(path), f"{key}.counter", f"{counter.name} has {counter.length} bits; at most 15 count"
            )
    return Protection(rule, settings.data_id, counter, modulo)


def _signal_use(
    path: Path,
    database_path: Path,
    signal_map: SignalMap,
    message: Message,
    key: str,
    target: str,
    mapped: MappedInput,
) -> SignalUse:
    signal = find_signal(message, mapped.signal, database_path, path, f"{key}.signal")
    unit = mapped.unit if mapped.unit is not None else signal.unit or ""
    place = INPUT[target]
    factor, offset = conversion(
        unit, INPUT_SIGNALS[place].unit, signal_map.rolling_radius, str(path), f"{key}.unit"
    )
    if mapped.validity is not None:
        find_signal(message, mapped.validity.signal, database_path, path, f"{key}.validity.signal")
    if mapped.sign is not None:
        find_signal(message, mapped.sign.signal, database_path, path, f"{key}.sign.signal")
        if signal.offset or signal.is_signed:
            remedy = (
                f"{signal.name} has a sign or an offset of its own, so is no magnitude; leave the key out"
            )
            raise UserError(str(path), f"{key}.sign", remedy)
    return SignalUse(
        mapped.signal,
        place,
        mapped.factor * factor,
        mapped.offset * factor + offset,
        mapped.sentinels,
        mapped.validity.signal if mapped.validity else "",
        mapped.validity.values if mapped.validity else (),
        mapped.sign.signal if mapped.sign else "",
        mapped.sign.values if mapped.sign else (),
    )
