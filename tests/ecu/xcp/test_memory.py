"""Addresses: what has one, what has none, and that an image is the records of a cycle to the bit."""

from itertools import pairwise

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE as ESTIMATE_RECORD
from ecu.contract.records import OUTPUTS as OUTPUTS_RECORD
from ecu.contract.records import RecordArray
from ecu.recording.ring import RingReader
from ecu.xcp.memory import BEGINS, EPK, IMAGE_BYTES, images, place_of
from ecu.xcp.parameters import PARAMETERS as PARAMETERS_RECORD
from ecu.xcp.parameters import to_record
from ecu.xcp.variables import RECORDS

from .conftest import ESTIMATE, INPUTS, OUTPUTS, PARAMETERS

TORQUES_KNOWN = ESTIMATE_RECORD.fields["torques_known"][1]  # a byte, before seven of padding


@pytest.mark.parametrize(
    ("address", "length", "place"),
    [
        (OUTPUTS, 8, 0),
        (OUTPUTS, OUTPUTS_RECORD.itemsize, 0),  # all fields, one after the other
        (OUTPUTS + 3, 2, 3),
        (INPUTS, 8, BEGINS["inputs"]),
        (ESTIMATE + TORQUES_KNOWN, 1, BEGINS["estimate"] + TORQUES_KNOWN),
        (PARAMETERS + 8, 8, BEGINS["parameters"] + 8),
        (OUTPUTS - 1, 1, None),
        (OUTPUTS - 1, 2, None),
        (OUTPUTS + OUTPUTS_RECORD.itemsize, 1, None),
        (OUTPUTS + OUTPUTS_RECORD.itemsize - 1, 2, None),
        (ESTIMATE + TORQUES_KNOWN, 2, None),  # padding
        (ESTIMATE + TORQUES_KNOWN + 1, 1, None),
        (PARAMETERS + PARAMETERS_RECORD.itemsize, 1, None),
        (0, 1, None),
        (0xFFFFFFFF, 255, None),
    ],
)
def test_what_has_an_address(address, length, place):
    assert place_of(address, length) == place


def test_an_image_is_the_cycle_to_the_bit(loop, configuration):
    run = loop()
    reader = RingReader(run.ring.path)
    draw = np.random.default_rng(7)
    for record in (run.inputs, run.estimate):
        record.view(np.uint8)[:] = draw.integers(0, 256, record.nbytes)
    run.publish(2, mu_b=[0.1, 0.2, 0.3, np.nan], vehicle_speed=20.0)
    batch, parameters = reader.read(), to_record(configuration)
    found = images(batch, parameters)
    assert found.shape == (2, IMAGE_BYTES)

    def of(name: str, kind: np.dtype) -> RecordArray:
        begin = BEGINS[name]
        return found[1, begin : begin + kind.itemsize].view(kind)

    assert of("outputs", OUTPUTS_RECORD)["mu_b"].tobytes() == run.outputs["mu_b"].tobytes()
    assert of("estimate", ESTIMATE_RECORD)["load"].tobytes() == run.estimate["load"].tobytes()
    assert of("parameters", PARAMETERS_RECORD).tobytes() == parameters.tobytes()


def test_the_name_of_the_addresses_has_version_and_layout():
    assert EPK.split()[0] == "brake-ecu"
    assert len(EPK.split()[2]) == 8


def test_records_do_not_touch_each_other():
    for one, next_one in pairwise(RECORDS):
        assert one.base + one.dtype.itemsize < next_one.base
