"""What a replay says of the times in which the ECU was degraded or failed."""

from pathlib import Path

import pytest

from brakelab.replay.needed import fault_lines
from brakelab.replay.quality import Findings
from ecu.contract.faults import PEDAL_LOST, WHEEL_SPEED_LOST


@pytest.mark.parametrize(
    ("faulty", "by_fault", "said"),
    [
        (0, {}, []),
        (
            11,
            {WHEEL_SPEED_LOST: 11},
            ["d.log: degraded or failed for 0.11 s of the drive: wheel speed lost (0.11 s)"],
        ),
        (
            900,
            {PEDAL_LOST: 900, WHEEL_SPEED_LOST: 20},
            ["d.log: degraded or failed for 90 % of the drive: pedal lost (90 %), wheel speed lost (0.20 s)"],
        ),
    ],
    ids=["healthy", "a frame missing for 200 ms", "no pedal for most of it"],
)
def test_faults_are_told_with_how_long_they_lasted(faulty, by_fault, said) -> None:
    found = Findings(Path("d.log"), rows=1000, faulty_rows=faulty)
    found.fault_rows.update(by_fault)
    assert fault_lines(found) == said
