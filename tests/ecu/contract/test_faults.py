"""The list of faults: one bit each, and the page that users read says the same."""

from pathlib import Path

from ecu.contract.faults import DEGRADING, FAULTS, fault_names

PAGE = Path(__file__).parents[3] / "docs" / "faults.md"


def test_each_fault_has_a_bit_of_its_own_within_32():
    bits = [fault.bit for fault in FAULTS]
    assert len(set(bits)) == len(bits)
    assert all(bit.bit_count() == 1 and bit < 1 << 32 for bit in bits)


def test_the_page_lists_every_fault_as_the_code_does():
    rows = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")][2:]
    expected = [
        f"| {fault.bit.bit_length() - 1} | {fault.name} | {'yes' if fault.bit & DEGRADING else ''} "
        f"| {fault.meaning} | {fault.remedy} |"
        for fault in FAULTS
    ]
    assert rows == expected


def test_a_mask_is_named():
    assert fault_names(FAULTS[0].bit | FAULTS[-1].bit) == [FAULTS[0].name, FAULTS[-1].name]
