"""Records whose bytes are compared, stored or sent have no gaps: what lies in one is undefined."""

import numpy as np
import pytest

from ecu.contract.records import DUST, FRAME, LEARNED, WEAR


@pytest.mark.parametrize("record", [FRAME, LEARNED, WEAR, DUST], ids=["frame", "learned", "wear", "dust"])
def test_every_byte_of_a_record_belongs_to_a_field(record: np.dtype) -> None:
    assert sum(record[name].itemsize for name in record.names) == record.itemsize


def test_what_is_learned_is_copied_byte_by_byte() -> None:
    state = np.zeros(3, [("other", "u1"), ("learned", LEARNED)])
    state["learned"]["joint_known"] = 1
    np.full(10 * LEARNED.itemsize, 255, np.uint8)  # what memory may have held before
    copies = {state["learned"][:1].copy().tobytes() for _ in range(20)}
    assert copies == {state["learned"][0].tobytes()}
