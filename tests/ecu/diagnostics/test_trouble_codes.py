"""Trouble codes: a number that no other fault has and that stays, as a workshop reads it."""

import re

import pytest

from ecu.contract import faults
from ecu.contract.faults import FAULTS
from ecu.diagnostics.trouble_codes import FAILURE_TYPES, TROUBLE_CODES, code_text


def test_every_fault_has_one_code_and_no_two_the_same():
    assert [code.fault for code in TROUBLE_CODES] == list(FAULTS)
    assert len({code.number >> 8 for code in TROUBLE_CODES}) == len(FAULTS)


@pytest.mark.parametrize("code", TROUBLE_CODES, ids=lambda code: code.text)
def test_a_code_is_of_the_chassis_and_of_the_manufacturers_range(code):
    assert re.fullmatch(r"C1[0-9A-F]{3}-[0-9A-F]{2}", code.text)
    assert 0x400000 <= code.number < 0x800000  # C in DTCs of three bytes
    assert code.number & 0xFF in FAILURE_TYPES


@pytest.mark.parametrize(
    ("bit", "text"),
    [
        (faults.WHEEL_SPEED_LOST, "C1000-08"),
        (faults.BUS_OFF, "C1010-88"),
        (faults.E2E_REJECTIONS, "C101C-83"),
        (faults.BRAKE_FAILED, "C101D-93"),
        (faults.IMPLAUSIBLE["wheel_speed_fl"], "C1020-64"),
        (faults.REAR_HELD, "C103E-00"),
    ],
)
def test_published_codes_stay(bit, text):
    assert {code.fault.bit: code.text for code in TROUBLE_CODES}[bit] == text


@pytest.mark.parametrize(
    ("number", "text"),
    [(0x000000, "P0000-00"), (0x500308, "C1003-08"), (0x9FFF11, "B1FFF-11"), (0xC10087, "U0100-87")],
)
def test_codes_of_other_groups_are_read_too(number, text):
    assert code_text(number) == text
