"""A slave without a transport, and a run whose ring is written by the test."""

import numpy as np
import pytest

from ecu.settings.config import load_config
from ecu.settings.resources import resource
from ecu.xcp.memory import IMAGE_BYTES
from ecu.xcp.slave import Slave
from ecu.xcp.transport import ETHERNET

from ..watch.conftest import loop, rings

__all__ = ["loop", "rings"]

OUTPUTS, INPUTS, ESTIMATE, PARAMETERS = 0x10000, 0x20000, 0x30000, 0x40000


@pytest.fixture(scope="session")
def configuration():
    """The shipped SUV as a run describes it."""
    return load_config(resource("config/suv.toml")).model_dump()


class Master:
    """Sends commands in hexadecimal and returns the responses so; `image` is what the slave reads."""

    def __init__(self, size=ETHERNET, connects=True):
        self.image = np.arange(IMAGE_BYTES, dtype=np.uint32).astype(np.uint8)
        self.slave = Slave(
            size, lambda: self.image, lambda: 5_000_000_123_456, lambda: "ASAP2_VERSION 1 71\n"
        )
        if connects:
            self.ask("FF 00")

    def ask(self, command):
        response = self.slave.answer(bytes.fromhex(command))
        return None if response is None else response.hex(" ").upper()

    def set_up(self, *odts, mode=0x10, prescaler=1):
        """Fill list 0: of each ODT the entries, as address and length."""
        daq = self.slave.daq
        daq.free()
        daq.allocate(1)
        daq.allocate_odts(0, len(odts))
        for number, entries in enumerate(odts):
            daq.allocate_entries(0, number, len(entries))
        for number, entries in enumerate(odts):
            daq.point(0, number, 0)
            for address, length in entries:
                daq.write(0xFF, length, 0, address)
        daq.set_mode(0, mode, 0, prescaler)
        return daq


@pytest.fixture
def master():
    """Return a connected master."""
    return Master()
