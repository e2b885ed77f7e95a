"""An ECU for the services, without processes: what is read is a number twice, what is cleared is noted."""

from types import SimpleNamespace

import pytest

from ecu.diagnostics.fault_memory import FaultMemory
from ecu.diagnostics.services import respond
from ecu.diagnostics.session import Ecu, Reason, Refused, Session

from ..watch.conftest import loop, rings

__all__ = ["loop", "rings"]

SECRET = bytes(range(16))


class Tester:
    """Sends requests in hexadecimal to a server of its own and keeps the session; `now_s` is its clock."""

    def __init__(self, ecu):
        self.ecu, self.session, self.now_s = ecu, Session(), 100.0

    def ask(self, request, functional=False):
        text = bytes.fromhex(request)
        self.session, response = respond(self.session, text, self.ecu, self.now_s, functional)
        return response.hex(" ").upper()


@pytest.fixture
def world():
    """What the ECU is asked for and what it would answer."""
    return SimpleNamespace(
        memory=FaultMemory(),
        stores=True,
        restartable=True,
        seeds=iter(bytes([n] * 16) for n in range(1, 200)),
        works=[],
        refuses=None,
        read={0x0103: b"\x00\x27\x10", 0xF189: b"1.2.3", 0xF1A1: b"v" * 250},
    )


@pytest.fixture
def tester(world):
    """Return a tester at an ECU; fields of `Ecu` may be given otherwise."""

    def clear(number):
        world.memory.clear(number)
        return world.stores

    def work(kind, values):
        if world.refuses is not None:
            raise Refused(Reason(world.refuses))
        world.works.append((kind.name, values))

    def begin(**fields):
        ecu = Ecu(
            memory=world.memory,
            armed=True,
            read=lambda number: world.read.get(number),
            clear=clear,
            clearing_lasts=True,
            self_test=lambda: b"\x00\x00\x00\x00",
            work=work,
            can_restart=lambda: world.restartable,
            new_seed=lambda: next(world.seeds),
            secret=SECRET,
        )
        return Tester(ecu._replace(**fields))

    return begin
