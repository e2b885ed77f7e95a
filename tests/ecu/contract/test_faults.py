"""The list of faults: one bit each, and the page that users read says the same."""

import re
from pathlib import Path

import numpy as np
import pytest

from ecu.contract.faults import DEGRADING, FAULTS, IMPLAUSIBLE, WORD, WORDS, fault_mask, fault_names
from ecu.contract.records import OUTPUTS
from ecu.contract.signals import INPUT

PAGE = Path(__file__).parents[3] / "docs" / "faults.md"


def test_each_fault_has_a_bit_of_its_own_and_none_the_last_of_a_word():
    bits = [fault.bit for fault in FAULTS]
    assert len(set(bits)) == len(bits)
    assert all(bit.bit_count() == 1 and bit not in (1 << 31, 1 << 63) and bit < 1 << 63 for bit in bits)


def test_every_watched_input_is_one_and_its_bit_bears_its_name():
    assert set(IMPLAUSIBLE) <= set(INPUT)
    assert [fault_names(bit) for bit in IMPLAUSIBLE.values()] == [
        [f"{name} implausible"] for name in IMPLAUSIBLE
    ]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_mask_survives_the_columns_of_results_and_records(fault):
    words = {"active_faults": float(fault.bit & (1 << WORD) - 1), "active_faults_2": float(fault.bit >> WORD)}
    record = np.zeros(2, OUTPUTS)
    for name in WORDS:
        record[name] = words[name]
    assert int(fault_mask(words)) == fault.bit
    assert fault_mask(record).tolist() == [fault.bit] * 2
    assert int(fault_mask(record[0])) == fault.bit


def test_older_results_have_one_word_and_what_is_not_available_is_no_fault():
    assert fault_mask({"active_faults": np.array([5.0, np.nan])}).tolist() == [5, 0]


def test_the_page_lists_every_fault_as_the_code_does():
    rows = re.findall(r"^\| \d.*$", PAGE.read_text("utf-8"), re.M)
    places = [divmod(fault.bit.bit_length() - 1, WORD) for fault in FAULTS]
    expected = [
        f"| {bit if word == 0 else f'2: {bit}'} | {fault.name} | {'yes' if fault.bit & DEGRADING else ''} "
        f"| {fault.meaning} | {fault.remedy} |"
        for fault, (word, bit) in zip(FAULTS, places, strict=True)
    ]
    assert rows == expected


def test_a_mask_is_named():
    assert fault_names(FAULTS[0].bit | FAULTS[-1].bit) == [FAULTS[0].name, FAULTS[-1].name]
