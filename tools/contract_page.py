"""The page of the bus contract, docs/contract.md, from the database and the tables of the code.

`write_reference.py` writes it.
"""

from pathlib import Path
from typing import Final

import numpy as np
from cantools.database import Message

from brakelab.plant.cycle import DEMAND_TIMEOUT
from ecu.algorithm.control import demand, mode
from ecu.bus import e2e, link, sequence
from ecu.bus.database import attribute, load_database
from ecu.bus.foreign import SENDS
from ecu.bus.load import received_load, sent_load
from ecu.bus.plan import not_available_code
from ecu.bus.receive_plan import contract_receive_plan
from ecu.bus.transmit import contract_transmit_plan
from ecu.contract import faults
from ecu.contract.signals import CYCLE_NS, INPUT, INPUT_SIGNALS
from ecu.doctor import OPTIONAL
from ecu.runtime.cycle import FAREWELLS
from ecu.runtime.loop import GIVEN_UP_NS
from ecu.runtime.prepare import LISTEN_S
from ecu.runtime.standby import SILENCE_NS
from ecu.settings.hydraulics import BUILD_UP, RELEASE
from page_tables import table

ROOT: Final = Path(__file__).parent.parent
DBC: Final = ROOT / "dbc" / "brake_ecu.dbc"
EXAMPLE: Final = ROOT / "examples" / "plant.py"
MISSED: Final = {
    "WheelSpeed": faults.WHEEL_SPEED_LOST,
    "Imu": faults.IMU_LOST,
    "CalliperPressure": faults.PRESSURE_LOST,
    "BrakeRequest": faults.REQUEST_LOST,
    "Steering": faults.STEERING_LOST,
}
"""The fault without a needed message."""
CHECKED: Final = 0x123
"""Data ID of the worked example."""


def contract_text() -> str:
    """Return the page."""
    messages = sorted(load_database(DBC).messages, key=lambda message: int(message.frame_id))
    parts = (_head(), _frames(messages), _signals(messages), _protection(), _times(), _start(), _unit())
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def _head() -> str:
    sent = sent_load(contract_transmit_plan(DBC, "BrakeEcu")) / 1e3
    received = received_load(contract_receive_plan(DBC)) / 1e3
    return f"""
# The contract of the bus

What a car, a plant or a brake unit sends to the ECU and gets from it, where no [signal map](signal-maps.md)
says otherwise. A small plant that is braked by it, with python-can alone:
[examples/plant.py](../examples/plant.py).

Written by `python tools/write_reference.py` from [the database](../dbc/brake_ecu.dbc) and the code.

Classical CAN, identifiers of 11 bits, 500 kbit/s, signals little-endian. SI units, but pressures in bar and
disc temperatures in degC; axes of ISO 8855: x forward, y left; braking is `accel_x` < 0. Corners: fl, fr, rl, rr.
At worst stuffing the ECU sends {sent:.0f} kbit/s and expects {received:.0f} kbit/s, {(sent + received) / 500:.0%} of
the bus; `brake-ecu doctor` reckons it for a map and the bit rate of the interface.
"""


def _frames(messages: list[Message]) -> str:
    rows = []
    for message in messages:
        cycle, slowest = attribute(message, "GenMsgCycleTime"), attribute(message, "CycleTimeSlowest")
        data_id = attribute(message, "E2EDataId")
        ours = "BrakeEcu" in message.senders
        rows.append((
            f"0x{message.frame_id:03X}",
            message.name,
            "ECU" if ours else "car",
            f"{cycle} to {slowest} ms" if slowest else f"{cycle} ms",
            f"0x{data_id:04X}" if data_id else "not protected",
            _without(message.name),
        ))  # fmt: skip
    found = table("| id | message | sender | cycle | Data ID | without it |", rows)
    return "\n".join(["## Frames", "", *found])


def _without(name: str) -> str:
    """Return what happens without a message."""
    if name.startswith("PressureDemand"):
        return "the hydraulic unit falls back on the pedal"
    if name.startswith("MotorDemand"):
        return "motors do what the accelerator asks for"
    for stem, held in OPTIONAL.items():
        if name.startswith(stem):
            return f"optional: {held}"
    bits = [bit for stem, bit in MISSED.items() if name.startswith(stem)]
    lost = [fault for fault in faults.FAULTS if fault.bit in bits]
    return "".join(f'"{fault.name}": {fault.meaning}' for fault in lost)


def _signals(messages: list[Message]) -> str:
    rows = []
    for message in messages:
        for signal in message.signals:
            if signal.name in ("crc", "alive_counter"):
                continue
            place, code = INPUT.get(signal.name), not_available_code(signal)
            kind = "float" if signal.is_float else "signed" if signal.is_signed else "unsigned"
            rows.append((
                message.name,
                f"`{signal.name}`",
                f"{signal.start}, {signal.length} {kind}",
                f"{signal.scale:g}, {signal.offset:g}",
                "" if signal.minimum is None else f"{signal.minimum:.10g} to {signal.maximum:.10g}",
                signal.unit or "",
                "" if place is None else f"{INPUT_SIGNALS[place].timeout_s:g} s",
                "NaN" if code is None else str(code),
            ))  # fmt: skip
    head = "| message | signal | start, bits | scale, offset | range | unit | time-out | not available |"
    return "\n".join(
        [
            "## Signals",
            "",
            "Value = raw · scale + offset. A sender that has no value sends the code of the last column. An "
            "input is\nlost at the age of its time-out.",
            "",
            *table(head, rows),
        ]
    )


def _protection() -> str:
    data = np.zeros(8, np.uint8)
    e2e.protect(e2e.AUTOSAR_P01, data, 8, 0, CHECKED)
    return f"""
## Checksum and counter

AUTOSAR E2E Profile 1, Data ID mode BOTH, on every frame with a Data ID: in byte 0 a CRC-8 (SAE J1850,
polynomial 0x1D; start and XOR value cancel to 0) over the Data ID's low byte, its high byte and bytes 1 to 7; in
the low nibble of byte 1 a counter, 0 to {e2e.P01_MODULO - 1} and again 0. From examples/plant.py:

```python
{_crc_source()}
```

Worked example: eight zero bytes, Data ID 0x{CHECKED:03X}, counter 0: `crc(0x{CHECKED:03X}, bytes(7))` gives byte 0
as 0x{int(data[0]):02X}.
"""


def _crc_source() -> str:
    _, begin, rest = EXAMPLE.read_text("utf-8").partition("def crc(")
    return begin + rest.partition("\n\n")[0]


def _times() -> str:
    return f"""
## Late, lost and repeated frames

The ECU's cycle is {CYCLE_NS / 1e6:.0f} ms; it takes what was stamped up to its deadline. A signal without a new
sample keeps its value until its time-out, then the table of frames says what follows.

A counter says which place on its sender's grid a frame has (`ecu/bus/sequence.py`). AUTOSAR asks for less:

- A frame up to half a period off its place, or off by its sender's usual jitter, is taken; so is a later one, if
  nobody else claims its place. Late is no fault, early is: keep a grid of deadlines, do not sleep a cycle a turn.
- A repeated count, one out of sequence, a wrong checksum or length: nothing that the frame carries is taken.
- {int(sequence.LIVING) - 1} frames may be lost in a row. After a longer gap a sender that starts again is taken with frame
  {sequence.CONFIRMED} in sequence. Where two streams claim one place, neither lowers a demand for {sequence.DOUBT_NS / 1e9:.0f} s.
- "E2E rejections" is reported for {link.REPORTED_NS / 1e9:.0f} s when {link.MANY_REJECTED} of the last {link.WINDOW} checks rejected a
  frame, or {link.CROWD:.0f} frames more came than one sender makes.

Measured reactions: [safety.md](safety.md#signals-and-e2e).
"""


def _start() -> str:
    return f"""
## Start and end

1. The ECU listens for {LISTEN_S:.0f} s once everything is loaded. After {SENDS} frames with one of its identifiers it
   refuses to start.
2. `mode` is 0 (starting) for at most {mode.START_UP:.0f} s, until every needed input has come; then 1 (ready), 2 (active:
   brakes are demanded or applied), 3 (degraded: a needed input is lost) or 4 (failed: nobody can ask for brakes).
3. `pressure_demand_valid` is 1 only while it is armed (`transmit = true` in CONFIG, or `--armed`), in modes 1 to 3.
4. However it ends, {FAREWELLS} cycles flag every demand invalid. After a kill nothing comes any more.
5. A demand {GIVEN_UP_NS / 1e6:.0f} ms old is not sent. A standby takes over {SILENCE_NS / 1e6:.0f} ms after the last frame,
   and counts on.

Demand = max(pedal map, `decel_demand` where `decel_demand_valid` is 1). `pedal_pressed` 0 with a position above
{mode.PEDAL_REST:.0f} % is a fault. A car that stands for {demand.STANDING_TIME:g} s with a demand is held until the pedal is back
and no automated demand is left, or until `accelerator_position` passes {demand.ACCELERATOR_PRESSED:.0f} %.
"""


def _unit() -> str:
    rise, fall = BUILD_UP, RELEASE
    return f"""
## The hydraulic unit

It makes the pressures demanded of each calliper. It falls back on the driver's pedal, and motors on what the
accelerator asks for, when the valid flag is not 1 or no intact demand has come for {DEMAND_TIMEOUT * 1e3:.0f} ms: so does the
simulated car. The ECU expects pressures to follow by

    a p'' + b p' + p = demand

with a = {rise.inertia:g} s², b = {rise.lag:g} s after a dead time of {1e3 * rise.dead_time:.0f} ms for a rise,
and a = {fall.inertia:g} s², b = {fall.lag:g} s after {1e3 * fall.dead_time:.0f} ms for a fall, or as `[hydraulics]` of
CONFIG has it. Where sensors disagree for long, they count alone.

## Over UDP multicast

`-i udp_multicast -c 239.x.y.z` needs no CAN hardware. Open python-can's bus with `hop_limit=0`, or frames leave the
machine. Linux hands a socket the frames of every group that any process of the machine joined on this port, so a
plant hears other ECUs as well, unless it sets `IP_MULTICAST_ALL` (49) to 0 on its socket as the ECU does
(`ecu/bus/channel.py`).
"""
