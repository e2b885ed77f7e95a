"""Recordings of one brake in one or more files, as identification takes them."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.recording import Recording, write_recording
from brakelab.identify.friction.whole import files_of, read_whole
from brakelab.plant.linings import Lining
from ecu.errors import UserError


def test_files_are_in_the_order_of_their_numbers_unless_somebody_orders_them() -> None:
    by_letters = [Path("s1.csv"), Path("s10.csv"), Path("s2.csv")]
    assert [path.name for path, _ in files_of(by_letters, None)] == ["s1.csv", "s2.csv", "s10.csv"]
    given = [Path("s2.csv"), Path("s10.csv"), Path("s1.csv")]
    assert [path for path, _ in files_of(given, None)] == given


@pytest.mark.parametrize(("torque", "said"), [(700.0, "torque_Nm: stands at 700 N m"), (0.0, "")])
def test_a_torque_that_hangs_where_it_could_be_is_refused(
    tmp_path: Path, recording: Recording, lining: Lining, columns: Columns, torque: float, said: str
) -> None:
    """Of eight stops in a row; a torque of nothing is no reading, and its stops are left out elsewhere."""
    ends = np.flatnonzero(np.diff(recording.time) > 1.0) + 1
    hung = np.arange(len(recording.time)) < ends[7]
    spoilt = recording._replace(torque=np.where(hung, torque, recording.torque))
    path = tmp_path / "one.csv"
    assert columns.rig.inertia is not None
    write_recording(path, spoilt, lining, columns.rig.inertia)
    if not said:
        assert len(read_whole([path], None).recording.time) == len(recording.time)
        return
    with pytest.raises(UserError, match=f"{said}.*over [678] brake applications: it hangs"):
        read_whole([path], None)
