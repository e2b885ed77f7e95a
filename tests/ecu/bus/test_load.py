"""Bits on the wire: frames laid out bit by bit, and what the contract takes of a bus."""

from pathlib import Path

import pytest

from ecu.bus.load import received_load, sent_load, worst_bits
from ecu.bus.receive_plan import contract_receive_plan
from ecu.bus.transmit import contract_transmit_plan

# bits that can be stuffed: start, identifier(s), control, length, data, checksum
CLASSICAL = 1 + 11 + 3 + 4 + 15
EXTENDED = 1 + 11 + 2 + 18 + 3 + 4 + 15
FD = 1 + 11 + 6 + 4
END = 1 + 2 + 7 + 3


@pytest.mark.parametrize(
    ("length", "extended", "fd", "stuffed", "checksum"),
    [
        (8, False, False, CLASSICAL + 64, 0),
        (0, False, False, CLASSICAL, 0),
        (8, True, False, EXTENDED + 64, 0),
        (8, False, True, FD + 64, 4 + 17 + 6),
        (16, False, True, FD + 128, 4 + 17 + 6),
        (20, False, True, FD + 160, 4 + 21 + 7),
        (64, True, True, FD + 19 + 512, 4 + 21 + 7),
    ],
)
def test_every_fourth_bit_is_stuffed(
    length: int, extended: bool, fd: bool, stuffed: int, checksum: int
) -> None:
    assert worst_bits(length, extended=extended, fd=fd) == stuffed + (stuffed - 1) // 4 + checksum + END


def test_a_frame_of_eight_bytes_has_135_bits_at_worst() -> None:
    assert worst_bits(8, extended=False, fd=False) == 135


def test_the_contract_takes_less_than_half_of_500_kbit(contract: Path) -> None:
    sent = sent_load(contract_transmit_plan(contract, "BrakeEcu"))
    received = received_load(contract_receive_plan(contract))
    assert sent == pytest.approx(135 * (4 * 100 + 2 * 50 + 3 * 10 + 2), rel=1e-9)
    assert sent + received < 250_000.0
