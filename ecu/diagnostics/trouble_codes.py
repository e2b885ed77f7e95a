"""Diagnostic trouble codes: one for each fault bit.

Three bytes as in DTCFormat_00 of SAE J2012-DA (ISO 15031-6): a chassis code of the manufacturer's range,
C1000 plus the number of the fault's bit, and the failure type byte of J2012-DA that fits, else 00 (no
subtype). Bits keep their numbers, and so do codes: testers and service manuals stay valid.
"""

from typing import Final, NamedTuple

from ecu.contract import faults
from ecu.contract.faults import FAULTS, IMPLAUSIBLE, Fault

FORMAT: Final = 0x00
"""DTCFormatIdentifier: SAE_J2012-DA_DTCFormat_00."""
CHASSIS: Final = 0x5000
"""C1000: two bits for the letter (01: C), two for the range (01: the manufacturer's), then three digits."""

# Names of these types: SAE J2012-DA.
INTERNAL: Final = 0x04
MESSAGE: Final = 0x08
DATA_MEMORY: Final = 0x44
CALCULATION: Final = 0x61
COMPARISON: Final = 0x62
PLAUSIBILITY: Final = 0x64
PROTECTION: Final = 0x83
BELOW_RANGE: Final = 0x84
MISSING: Final = 0x87
OFF: Final = 0x88
PERFORMANCE: Final = 0x92
NO_OPERATION: Final = 0x93
LEARNING_LIMIT: Final = 0x99
NO_SUBTYPE: Final = 0x00
FAILURE_TYPES: Final = {
    INTERNAL: "system internal failure",
    MESSAGE: "bus signal or message failure",
    DATA_MEMORY: "data memory failure",
    CALCULATION: "signal calculation failure",
    COMPARISON: "signal compare failure",
    PLAUSIBILITY: "signal plausibility failure",
    PROTECTION: "value of signal protection calculation incorrect",
    BELOW_RANGE: "signal below allowable range",
    MISSING: "missing message",
    OFF: "bus off",
    PERFORMANCE: "performance or incorrect operation",
    NO_OPERATION: "no operation",
    LEARNING_LIMIT: "exceeded learning limit",
    NO_SUBTYPE: "no subtype",
}

_TYPE: Final = {
    faults.WHEEL_SPEED_LOST: MESSAGE,
    faults.IMU_LOST: MESSAGE,
    faults.PRESSURE_LOST: MESSAGE,
    faults.REQUEST_LOST: MESSAGE,
    faults.STEERING_LOST: MESSAGE,
    faults.PEDAL_IMPLAUSIBLE: PLAUSIBILITY,
    faults.FILTER_RESET: CALCULATION,
    faults.PEDAL_LOST: MESSAGE,
    faults.MOTOR_TORQUE_LOST: MESSAGE,
    faults.BRAKE_FADE: PERFORMANCE,
    faults.ACCUMULATOR_LOW: BELOW_RANGE,
    faults.WHEEL_SPEED_IMPLAUSIBLE: PLAUSIBILITY,
    faults.ACCEL_IMPLAUSIBLE: PLAUSIBILITY,
    faults.BUS_OFF: OFF,
    faults.ERROR_PASSIVE: MESSAGE,
    faults.FOREIGN_SENDER: MESSAGE,
    faults.SEND_FAILED: MESSAGE,
    faults.FRAMES_DROPPED: MISSING,
    faults.LATE: INTERNAL,
    faults.COMPILED: INTERNAL,
    faults.MOTOR_SHORT: PERFORMANCE,
    faults.PRESSURE_NOT_FOLLOWING: COMPARISON,
    faults.LEARNED_AT_BOUND: LEARNING_LIMIT,
    faults.NOT_KEPT: DATA_MEMORY,
    faults.E2E_REJECTIONS: PROTECTION,
    faults.BRAKE_FAILED: NO_OPERATION,
    faults.DEMAND_LOST: MESSAGE,
    **dict.fromkeys(IMPLAUSIBLE.values(), PLAUSIBILITY),
}
_EVENTS: Final = faults.FILTER_RESET | faults.LEARNING_GIVEN_UP
"""Bits that stand for a single cycle."""

FAIL_CYCLES: Final = 20  # of 10 ms
PASS_CYCLES: Final = 100


class TroubleCode(NamedTuple):
    """One row of the table."""

    fault: Fault
    number: int
    """Three bytes, the last is the failure type."""
    fail_cycles: int
    """Debounce: cycles with the bit set after which the test has failed."""

    @property
    def text(self) -> str:
        """Return it as a workshop writes it: C1003-08."""
        return code_text(self.number)


def code_text(number: int) -> str:
    """Return a code of three bytes as text, of any group: P, C, B or U."""
    return f"{'PCBU'[number >> 22 & 3]}{number >> 20 & 3}{number >> 8 & 0xFFF:03X}-{number & 0xFF:02X}"


TROUBLE_CODES: Final = tuple(
    TroubleCode(
        fault,
        (CHASSIS + fault.bit.bit_length() - 1) << 8 | _TYPE.get(fault.bit, NO_SUBTYPE),
        1 if fault.bit & _EVENTS else FAIL_CYCLES,
    )
    for fault in FAULTS
)
BY_NUMBER: Final = {code.number: code for code in TROUBLE_CODES}
