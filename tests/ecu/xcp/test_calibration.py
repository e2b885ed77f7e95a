"""Commands of calibration and the slave's responses, byte for byte; the run is the test's own."""

import hmac
import struct

import numpy as np
import pytest

from ecu.xcp.calibration import Calibration
from ecu.xcp.memory import base_of
from ecu.xcp.parameters import PARAMETERS, parameters, to_record
from ecu.xcp.protocol import Error, Refused
from ecu.xcp.slave import Slave
from ecu.xcp.transport import CAN, ETHERNET

from .conftest import Master

SECRET, SEED = b"s" * 32, bytes(range(16))
KEY = hmac.digest(SECRET, SEED, "sha256")[:16]
LENGTH = f"{PARAMETERS.itemsize:04X}"


class Run:
    """Takes over what the test allows."""

    def __init__(self, reference):
        self.reference, self.now, self.saved, self.error = reference, reference, [], None

    def current(self):
        return self.now

    def take_over(self, parameters):
        if self.error:
            raise Refused(self.error)
        self.now = parameters

    def save(self, parameters):
        self.saved.append(parameters)


class Calibrated(Master):
    """A master of a slave that may be calibrated."""

    def __init__(self, configuration, size=ETHERNET):
        super().__init__(size, connects=False)
        self.run = Run(to_record(configuration).tobytes())
        calibration = Calibration(self.run, SECRET, lambda: SEED)
        self.slave = Slave(size, lambda: self.image, lambda: 0, lambda: "", calibration)
        self.ask("FF 00")

    def unlock(self):
        self.ask("F8 00 01")
        assert self.ask(f"F7 10 {KEY.hex()}") == "FF 00"
        return self

    def number(self):
        """Return max_pressure_rate of the page that is read."""
        return struct.unpack("<d", bytes.fromhex(self.ask(f"F4 08 00 00 {RATE}"))[1:])[0]


def place(key):
    address = base_of("parameters") + PARAMETERS.fields[key][1]
    return address.to_bytes(4, "little").hex(" ").upper()


RATE, MASS = place("control.max_pressure_rate"), place("vehicle.mass")
TWO_THOUSAND = struct.pack("<d", 2000.0).hex()


@pytest.fixture
def master(configuration):
    return Calibrated(configuration)


@pytest.mark.parametrize(
    ("command", "response"),
    [
        ("FF 00", "FF 05 80 F8 78 05 01 01"),  # CAL/PAG and DAQ
        ("FD", "FF 00 01 00 00 00"),  # CAL/PAG is locked
        ("F8 00 01", "FF 10 " + SEED.hex(" ").upper()),
        ("F8 00 04", "FF 00"),  # DAQ is not locked
        ("F8 00 10", "FE 22"),
        ("F8 01 01", "FE 29"),  # the rest of a seed that was not asked for
        ("F7 10 " + KEY.hex(), "FE 29"),  # a key without a seed
        ("E9", "FF 01 00"),
        ("E8 00 00 00 00", "FF 00 00 00 00 00 04 00"),
        ("E8 00 00 01 00", "FF 00 00 00 " + bytes.fromhex(LENGTH)[::-1].hex(" ").upper() + " 00 00"),
        ("E8 01 00 00 00", "FF 02 00 00 00 00"),
        ("E8 02 00 00 00", "FE 22"),
        ("E8 01 01 00 00", "FE 28"),  # there is one segment
        ("E7 00 00 00", "FF 0F 00"),
        ("E7 00 00 01", "FF 3F 00"),
        ("E7 00 00 02", "FE 26"),
        ("EA 01 00", "FF 00 00 00"),  # the ECU goes by the reference page
        ("EA 02 00", "FF 00 00 01"),  # a master reads the working page
        ("EA 03 00", "FE 27"),
        ("EB 01 00 01", "FE 25"),  # locked
        ("E4 00 00 00 01", "FE 25"),
        ("F9 01 00 00", "FE 25"),
        (f"ED 08 00 00 {RATE} {TWO_THOUSAND}", "FE 25"),
    ],
)
def test_a_command_and_its_response(master, command, response):
    assert master.ask(command) == response


@pytest.mark.parametrize(
    ("command", "response"),
    [
        ("FD", "FF 00 00 00 00 00"),
        ("F8 00 01", "FF 00"),  # nothing is locked: no seed
        ("EB 00 00 01", "FE 27"),
        ("EB 11 00 01", "FE 27"),
        ("EB 01 01 01", "FE 28"),
        ("EB 01 00 02", "FE 26"),
        ("EB 83 07 00", "FF"),  # of all segments
        ("E4 00 01 00 00", "FE 23"),  # the reference page cannot be written
        ("E4 00 00 00 01", "FF"),
        ("F9 02 00 00", "FE 27"),  # lists are not stored
        (f"ED 08 00 00 {RATE} {TWO_THOUSAND}", "FF"),
        (f"ED 08 00 00 {MASS} {TWO_THOUSAND}", "FE 23"),
        (f"ED 09 00 00 {RATE} {TWO_THOUSAND} 00", "FE 23"),  # into the neighbour, a word
        (f"ED 08 00 00 {RATE} 00", "FE 21"),
        (f"ED 00 00 00 {RATE}", "FE 22"),
        (f"ED 08 00 01 {RATE} {TWO_THOUSAND}", "FE 24"),
        (f"ED 08 00 00 00 00 01 00 {TWO_THOUSAND}", "FE 23"),  # outputs
        (f"ED 08 00 00 00 00 00 00 {TWO_THOUSAND}", "FE 24"),
    ],
)
def test_with_the_key(master, command, response):
    master.unlock()
    assert master.ask(command) == response


def test_a_wrong_key_ends_the_session(master):
    master.ask("F8 00 01")
    assert master.ask(f"F7 10 {bytes(16).hex()}") == "FE 25"
    assert master.ask("FD") is None
    master.ask("FF 00")
    assert master.ask("FD") == "FF 00 01 00 00 00"
    assert master.ask(f"F7 10 {KEY.hex()}") == "FE 29"  # a seed is good for one key


def test_on_can_seed_and_key_come_in_pieces(configuration):
    master = Calibrated(configuration, CAN)
    parts = [bytes.fromhex(master.ask(f"F8 0{mode} 01")) for mode in (0, 1, 1)]
    assert [part[1] for part in parts] == [16, 10, 4]
    assert b"".join(part[2:] for part in parts) == SEED
    assert master.ask(f"F7 10 {KEY[:6].hex()}") == "FF 01"
    assert master.ask(f"F7 0A {KEY[6:12].hex()}") == "FF 01"
    assert master.ask(f"F7 04 {KEY[12:].hex()}") == "FF 00"
    before = master.run.now
    master.ask(f"F6 00 00 00 {RATE}")
    assert [master.ask(f"F0 04 {TWO_THOUSAND[at : at + 8]}") for at in (0, 8)] == ["FF", "FF"]
    assert master.ask("EB 01 00 01") == "FF"
    assert np.frombuffer(master.run.now, PARAMETERS)["control.max_pressure_rate"] == 2000.0
    assert before == master.run.reference


def test_what_is_downloaded_is_a_draft_until_it_is_taken_over(master):
    master.unlock()
    before = master.number()
    master.ask(f"ED 08 00 00 {RATE} {TWO_THOUSAND}")
    assert master.number() == 2000.0
    assert master.run.now == master.run.reference
    assert master.ask("EB 02 00 00") == "FF"
    assert master.number() == before  # of the reference page
    assert master.ask(f"ED 08 00 00 {RATE} {TWO_THOUSAND}") == "FE 23"  # which cannot be written
    assert master.ask("EB 03 00 01") == "FF"
    assert master.ask("EA 01 00") == "FF 00 00 01"
    assert master.ask("EB 01 00 00") == "FF"
    assert master.run.now == master.run.reference


@pytest.mark.parametrize("error", [Error.OUT_OF_RANGE, Error.RESOURCE_TEMPORARY_NOT_ACCESSIBLE])
def test_one_that_is_refused_stays_a_draft(master, error):
    master.unlock()
    master.ask(f"ED 08 00 00 {RATE} {TWO_THOUSAND}")
    master.run.error = error
    assert master.ask("EB 03 00 01") == f"FE {error:02X}"
    assert master.number() == 2000.0
    assert master.ask("EA 01 00") == "FF 00 00 00"


def test_a_new_session_is_locked_and_its_draft_is_what_the_loop_goes_by(master):
    """A master that dies between two downloads leaves nothing behind."""
    master.unlock()
    before = master.number()
    master.ask(f"F6 00 00 00 {RATE}")
    master.ask(f"F0 04 {TWO_THOUSAND[8:]}")
    assert master.number() != before
    master.ask("FF 00")
    assert master.number() == before
    assert master.ask("EB 01 00 01") == "FE 25"


def test_storing_is_done_at_once_and_an_event_says_so(master):
    master.unlock()
    assert master.ask("F9 01 00 00") == "FF"
    assert master.slave.events() == [b"\xfd\x03"]
    assert master.slave.events() == []
    assert master.run.saved == [master.run.reference]


def test_numbers_of_four_tables_may_be_written_and_nothing_else():
    writable = {one.key for one in parameters() if one.writable}
    assert {key.partition(".")[0] for key in writable} == {"sensors", "observer", "control", "blending"}
    assert writable.isdisjoint(
        {"control.slip_guard", "control.distribution", "observer.kind", "vehicle.mass"}
    )
    assert {"control.pedal_decel", "observer.mu_drift", "sensors.pressure", "blending.front"} <= writable


def test_any_bytes_are_answered_and_write_nothing_that_may_not_be_written(configuration):
    draw, master = np.random.default_rng(5), Calibrated(configuration).unlock()
    commands = (0xF0, 0xED, 0xEB, 0xEA, 0xE9, 0xE8, 0xE7, 0xE4, 0xF9, 0xF6)
    for _ in range(5000):
        command = bytes([draw.choice(commands)]) + draw.bytes(draw.integers(0, 20))
        if draw.random() < 0.5:
            offset = int(draw.integers(0, PARAMETERS.itemsize))
            command = command[:4] + (base_of("parameters") + offset).to_bytes(4, "little") + command[8:]
        response = master.slave.answer(command)
        assert response[0] in (0xFF, 0xFE)
    for page in (master.run.now, *master.run.saved):
        for one in parameters():
            if not one.writable:
                found, given = (np.frombuffer(of, PARAMETERS)[one.key] for of in (page, master.run.reference))
                assert found.tobytes() == given.tobytes(), one.key
