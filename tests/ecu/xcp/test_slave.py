"""Commands of XCP and the slave's responses, byte for byte."""

import random

import pytest

from ecu.xcp.memory import EPK
from ecu.xcp.protocol import Command
from ecu.xcp.transport import CAN

from .conftest import Master

ADDRESS_OF_MODE = "00 10 00 01 00"  # extension, then 0x10010 with the least byte first


@pytest.mark.parametrize(
    ("command", "response"),
    [
        ("FF 00", "FF 04 80 F8 78 05 01 01"),  # DAQ alone; MAX_CTO 248, MAX_DTO 1400
        ("FF 01", "FE 22"),  # no user-defined mode
        ("FD", "FF 00 00 00 00 00"),
        ("FC", "FE 00"),
        ("FB", "FF 00 00 00 00 00 00 10"),
        ("FA 00", "FF 00 00 00 09 00 00 00"),
        ("FA 02", "FF 00 00 00 00 00 00 00"),  # no path: none
        ("F4 02 00 00 10 00 01 00", "FF 10 11"),
        ("F8 00 04", "FF 00"),  # nothing is locked: no seed
        ("F7 00", "FE 29"),
        ("DA", "FF 93 00 00 01 00 00 00"),
        ("D9", "FF 01 F8 01 00 34 01 00"),
        ("D7 00 00 00", "FF 84 FF 05 0A 06 00"),
        ("D7 00 01 00", "FE 22"),
        ("DC", "FF 00 00 00 7B F2 05 2A"),  # 5,000,000.123 ms, modulo 2^32 us
        ("E3 00 00 00", "FE 22"),
        ("F0 01 00", "FE 23"),  # DOWNLOAD: write protected
        ("12", "FE 20"),
        ("ED 01 00 00 00 00 04 00 00", "FE 23"),
        ("EB 01 00 01", "FE 20"),  # no pages
        ("EA 01 00", "FE 20"),
        ("F9 01 00 00", "FE 20"),
        ("F3 00 00 00 01 00 00 00", "FE 20"),  # BUILD_CHECKSUM: not there
        ("F4 01", "FE 21"),  # too short
        ("C7 02 FF 08", "FE 21"),
    ],
)
def test_a_command_and_its_response(master, command, response):
    assert master.ask(command) == response


def test_memory_is_uploaded_piece_by_piece(master):
    assert master.ask("F6 00 00 00 10 00 01 00") == "FF"
    assert master.ask("F5 03") == "FF 10 11 12"
    assert master.ask("F5 01") == "FF 13"
    assert master.ask("F4 01 00 00 20 00 01 00") == "FF 20"
    assert master.ask("F5 01") == "FF 21"


@pytest.mark.parametrize(
    ("kind", "text"), [("00", "brake-ecu"), ("01", "brake_ecu"), ("04", "ASAP2_VERSION 1 71\n"), ("05", EPK)]
)
def test_an_identification_is_uploaded_and_ends(master, kind, text):
    length = int.from_bytes(bytes.fromhex(master.ask(f"FA {kind}"))[4:], "little")
    assert length == len(text)
    assert bytes.fromhex(master.ask(f"F5 {length:02X}"))[1:].decode() == text
    assert master.ask("F5 01") == "FE 24"


def test_the_name_of_the_event_is_uploaded(master):
    master.ask("D7 00 00 00")
    assert bytes.fromhex(master.ask("F5 05"))[1:] == b"cycle"


@pytest.mark.parametrize(
    ("command", "error"),
    [
        ("F4 01 00 00 00 00 00 00", "24"),  # address 0
        ("F4 01 00 00 FF FF 00 00", "24"),  # one byte before the outputs
        ("F4 02 00 00 87 03 01 00", "24"),  # over the end of the outputs
        ("F4 01 00 00 FF FF FF FF", "24"),
        ("F4 01 00 01 00 00 01 00", "24"),  # another address space
        ("F4 00 00 00 00 00 01 00", "22"),
        ("F4 F8 00 00 00 00 01 00", "22"),  # more than a response holds
        ("F5 01", "24"),  # the pointer was never set
        ("F6 00 00 01 00 00 01 00", "24"),
    ],
)
def test_what_may_not_be_read(master, command, error):
    assert master.ask(command) == f"FE {error}"


def test_before_the_first_cycle_there_is_nothing_to_read(master):
    master.image = None
    assert master.ask(f"F4 08 00 {ADDRESS_OF_MODE}") == "FE 33"


def test_without_a_session_nothing_but_connect_is_answered():
    master = Master(connects=False)
    assert [master.ask(command) for command in ("FD", "F4 01 00 00 10 00 01 00", "12", "")] == [None] * 4
    assert master.ask("FF 00")[:2] == "FF"
    assert master.ask("FE") == "FF"
    assert master.ask("FD") is None


def test_on_can_packets_have_eight_bytes():
    master = Master(CAN)
    assert master.ask("FF 00") == "FF 04 80 08 08 00 01 01"
    assert master.ask("D9") == "FF 01 07 01 00 34 01 00"
    assert master.ask("F4 08 00 00 10 00 01 00") == "FE 22"


def test_a_list_is_set_up_started_and_stopped(master):
    for command, response in [
        ("D6", "FF"),
        ("D5 00 01 00", "FF"),
        ("D4 00 00 00 01", "FF"),
        ("D3 00 00 00 00 02", "FF"),
        ("E2 00 00 00 00 00", "FF"),
        ("E1 FF 08 00 10 00 01 00", "FF"),
        ("C7 01 FF 04 00 00 03 00 00 00", "FF"),
        ("E0 10 00 00 00 00 01 00", "FF"),
        ("DE 02 00 00", "FF 00"),
        ("DD 01", "FF"),
        ("FD", "FF 40 00 00 00 00"),
    ]:
        assert master.ask(command) == response, command
    (packet,) = master.slave.daq.packets(7, 1_234_567_000, master.image)
    assert packet[:5].hex(" ") == "00 87 d6 12 00"
    assert packet[5:13] == master.image[0x10:0x18].tobytes()
    assert master.ask("DD 00") == "FF"
    assert master.ask("FD") == "FF 00 00 00 00 00"


def test_a_new_session_begins_without_lists(master):
    master.set_up([(0x10000, 8)]).start_stop(1, 0)
    assert master.slave.daq.running
    master.ask("FF 00")
    assert not master.slave.daq.running
    assert master.ask("DA") == "FF 93 00 00 01 00 00 00"


def test_events_tell_of_lost_cycles_and_of_the_end(master):
    assert master.slave.overload().hex(" ") == "fd 06 00 00"
    assert master.slave.end().hex(" ") == "fd 07"
    assert not master.slave.connected


def set_up(draw):
    """Yield the commands that set up and start a list, of odd sizes and addresses."""
    odts, entries = draw.randint(1, 3), draw.randint(1, 5)
    yield from ("D6", "D5 00 01 00", f"D4 00 00 00 {odts:02X}")
    yield from (f"D3 00 00 00 {odt:02X} {entries:02X}" for odt in range(odts))
    for odt in range(odts):
        yield f"E2 00 00 00 {odt:02X} 00"
        for _ in range(entries):
            address = 0x10000 * draw.randint(1, 3) + 8 * draw.randint(0, 80)
            length = draw.choice((8, 8, 16, 248))
            yield f"E1 FF {length:02X} 00 {address.to_bytes(4, 'little').hex()}"
    yield f"E0 {draw.choice((0, 16)):02X} 00 00 00 00 01 00"
    yield f"DE {draw.randint(1, 2):02X} 00 00"
    yield "DD 01"


@pytest.mark.parametrize("seed", range(20))
def test_any_bytes_are_answered_within_a_packet(seed):
    """Lists are set up and started again and again, with other bytes among these commands and instead."""
    draw, master, measured = random.Random(seed), Master(), 0
    for _ in range(100):
        for text in set_up(draw):
            command = bytes.fromhex(text)
            if draw.random() < 0.03:
                command = draw.choice((draw.randbytes(draw.randint(0, 12)), command[:-1], b""))
            if command[:1] == bytes([Command.DISCONNECT]):
                continue
            response = master.slave.answer(command)
            assert response is None or (response[0] in (0xFF, 0xFE) and len(response) <= 248)
        packets = list(master.slave.daq.packets(0, 1, master.image))
        assert all(1 < len(packet) <= 1400 and packet[0] < 0xFC for packet in packets)
        measured += bool(packets)
    assert measured > 5
    assert master.ask("FF 00") is not None
