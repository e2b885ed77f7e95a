"""DAQ lists: what a master may do when, and the packets of a cycle."""

import struct

import numpy as np
import pytest

from ecu.xcp.daq import MOST_ENTRIES, MOST_ODTS, DaqLists
from ecu.xcp.memory import BEGINS, IMAGE_BYTES
from ecu.xcp.protocol import Error, Refused

from .conftest import ESTIMATE, INPUTS, OUTPUTS, PARAMETERS

IMAGE = np.random.default_rng(3).integers(0, 256, IMAGE_BYTES, np.uint8)


def lists(*steps, max_dto=1400):
    """DAQ lists after some commands, each a name and its arguments."""
    found = DaqLists(max_dto, min(max_dto - 1, 248))
    for name, *arguments in steps:
        getattr(found, name)(*arguments)
    return found


FREE, ONE, ODT, ENTRY = ("free",), ("allocate", 1), ("allocate_odts", 0, 1), ("allocate_entries", 0, 0, 1)
POINT, WRITE = ("point", 0, 0, 0), ("write", 0xFF, 8, 0, OUTPUTS)
MODE, START = ("set_mode", 0, 0x10, 0, 1), ("start_stop", 1, 0)
READY = (FREE, ONE, ODT, ENTRY, POINT, WRITE, MODE)


@pytest.mark.parametrize(
    ("steps", "error"),
    [
        ([ONE], "SEQUENCE"),  # lists before the old ones are freed
        ([FREE, ODT], "SEQUENCE"),
        ([FREE, ONE, ENTRY], "SEQUENCE"),
        ([FREE, ONE, ODT, ENTRY, ODT], "SEQUENCE"),
        ([FREE, ONE, ONE], "SEQUENCE"),
        ([FREE, ONE, ODT, ENTRY, WRITE], "SEQUENCE"),  # no pointer
        ([FREE, ONE, ("allocate_odts", 1, 1)], "OUT_OF_RANGE"),
        ([FREE, ONE, ODT, ("allocate_entries", 0, 1, 1)], "OUT_OF_RANGE"),
        ([FREE, ONE, ODT, ENTRY, ("point", 0, 0, 1)], "OUT_OF_RANGE"),
        ([FREE, ONE, ODT, ENTRY, POINT, WRITE, WRITE], "OUT_OF_RANGE"),  # behind the last entry
        ([FREE, ONE, ODT, ENTRY, POINT, ("write", 3, 8, 0, OUTPUTS)], "OUT_OF_RANGE"),  # a bit
        ([FREE, ONE, ODT, ENTRY, POINT, ("write", 0xFF, 0, 0, OUTPUTS)], "OUT_OF_RANGE"),
        ([FREE, ONE, ODT, ENTRY, POINT, ("write", 0xFF, 249, 0, OUTPUTS)], "OUT_OF_RANGE"),
        ([FREE, ONE, ODT, ENTRY, POINT, ("write", 0xFF, 8, 0, 0)], "ACCESS_DENIED"),
        ([FREE, ONE, ODT, ENTRY, POINT, ("write", 0xFF, 8, 1, OUTPUTS)], "ACCESS_DENIED"),
        ([FREE, ("allocate", MOST_ODTS + 1)], "MEMORY_OVERFLOW"),
        ([FREE, ("allocate", 2), ("allocate_odts", 0, 251), ("allocate_odts", 1, 2)], "MEMORY_OVERFLOW"),
        (
            [FREE, ONE, ("allocate_odts", 0, 17), *[("allocate_entries", 0, n, 255) for n in range(17)]],
            "MEMORY_OVERFLOW",
        ),
        ([FREE, ONE, ODT, ENTRY, MODE, START], "DAQ_CONFIG"),  # an entry that was not written
        ([FREE, ONE, START], "DAQ_CONFIG"),
        ([FREE, ONE, ODT, START], "DAQ_CONFIG"),
        ([*READY, ("start_stop", 3, 0)], "MODE_NOT_VALID"),
        ([*READY, ("start_stop_selected", 4)], "MODE_NOT_VALID"),
        ([*READY, ("set_mode", 0, 0x02, 0, 1)], "MODE_NOT_VALID"),  # stimulation
        ([*READY, ("set_mode", 0, 0x20, 0, 1)], "MODE_NOT_VALID"),  # without packet numbers
        ([*READY, ("set_mode", 0, 0x10, 1, 1)], "OUT_OF_RANGE"),  # another event
        ([*READY, ("set_mode", 0, 0x10, 0, 0)], "OUT_OF_RANGE"),  # every 0th cycle
        ([*READY, ("start_stop", 1, 1)], "OUT_OF_RANGE"),
        ([*READY, START, ONE], "DAQ_ACTIVE"),
        ([*READY, START, POINT], "DAQ_ACTIVE"),
        ([*READY, START, MODE], "DAQ_ACTIVE"),
        ([*READY, POINT, START, WRITE], "DAQ_ACTIVE"),
    ],
)
def test_what_is_refused(steps, error):
    *before, last = steps
    found = lists(*before)
    with pytest.raises(Refused) as refused:
        getattr(found, last[0])(*last[1:])
    assert refused.value.error == Error[error]


def test_the_most_entries_are_allowed():
    odts = MOST_ENTRIES // 255
    lists(FREE, ONE, ("allocate_odts", 0, odts), *[("allocate_entries", 0, n, 255) for n in range(odts)])


def test_a_packet_is_number_stamp_and_entries(master):
    daq = master.set_up([(OUTPUTS, 8), (INPUTS + 16, 8)], [(ESTIMATE, 4), (PARAMETERS + 8, 8)])
    daq.start_stop(1, 0)
    first, second = daq.packets(12, 3_000_002_000, IMAGE)
    assert first[0] == 0
    assert struct.unpack("<L", first[1:5])[0] == 3_000_002
    outputs, inputs = BEGINS["outputs"], BEGINS["inputs"] + 16
    assert first[5:] == IMAGE[outputs : outputs + 8].tobytes() + IMAGE[inputs : inputs + 8].tobytes()
    estimate, parameters = BEGINS["estimate"], BEGINS["parameters"] + 8
    assert second == b"\x01" + IMAGE[estimate : estimate + 4].tobytes() + IMAGE[parameters:][:8].tobytes()


def test_without_a_stamp_the_entries_follow_the_number(master):
    daq = master.set_up([(OUTPUTS, 2)], mode=0)
    daq.start_stop(1, 0)
    assert list(daq.packets(0, 5_000, IMAGE)) == [b"\x00" + IMAGE[:2].tobytes()]


def test_a_prescaler_leaves_out_cycles(master):
    daq = master.set_up([(OUTPUTS, 1)], prescaler=4)
    daq.start_stop(1, 0)
    assert [number for number in range(12) if list(daq.packets(number, 0, IMAGE))] == [0, 4, 8]


def test_packets_of_several_lists_are_numbered_through():
    found = lists(FREE, ("allocate", 2), ("allocate_odts", 0, 2), ("allocate_odts", 1, 1))
    for number, odt in ((0, 0), (0, 1), (1, 0)):
        found.allocate_entries(number, odt, 1)
    for number, odt in ((0, 0), (0, 1), (1, 0)):
        found.point(number, odt, 0)
        found.write(0xFF, 1, 0, OUTPUTS)
    assert [found.start_stop(2, number) for number in (0, 1)] == [0, 2]
    found.start_stop_selected(1)
    assert [packet[0] for packet in found.packets(0, 0, IMAGE)] == [0, 1, 2]
    found.start_stop(0, 0)
    assert [packet[0] for packet in found.packets(0, 0, IMAGE)] == [2]
    found.start_stop(2, 1)
    found.start_stop_selected(2)
    assert not found.running


def test_none_is_started_where_one_is_not_complete():
    found = lists(FREE, ("allocate", 2), ("allocate_odts", 0, 1), ("allocate_entries", 0, 0, 1), POINT, WRITE)
    found.start_stop(2, 0)
    found.start_stop(2, 1)
    with pytest.raises(Refused):
        found.start_stop_selected(3)
    with pytest.raises(Refused):
        found.start_stop_selected(1)
    assert not found.running


@pytest.mark.parametrize(("mode", "entries", "starts"), [(0x10, 1, True), (0, 2, True), (0x10, 2, False)])
def test_an_odt_is_no_longer_than_a_packet(mode, entries, starts):
    """On CAN: a number and a stamp leave three bytes, a number alone seven."""
    found = lists(FREE, ONE, ODT, ("allocate_entries", 0, 0, entries), POINT, max_dto=8)
    for _ in range(entries):
        found.write(0xFF, 3, 0, OUTPUTS)
    found.set_mode(0, mode, 0, 1)
    if starts:
        found.start_stop(1, 0)
    else:
        with pytest.raises(Refused) as refused:
            found.start_stop(1, 0)
        assert refused.value.error == Error.DAQ_CONFIG


def test_a_cleared_list_is_stopped_and_empty(master):
    daq = master.set_up([(OUTPUTS, 8)])
    daq.start_stop(1, 0)
    daq.clear(0)
    assert not daq.running
    with pytest.raises(Refused):
        daq.start_stop(1, 0)
