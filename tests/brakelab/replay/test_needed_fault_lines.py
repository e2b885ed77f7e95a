"""What a replay says of the times in which the ECU was degraded or failed."""

from pathlib import Path

import pytest

from brakelab.logs.signal_file import freshness_at_any_rate
from brakelab.replay.needed import fault_lines, needed_lines, request_line, transducer_line
from brakelab.replay.quality import Findings
from ecu.contract.faults import IMU_LOST, PEDAL_LOST, PRESSURE_LOST, WHEEL_SPEED_LOST
from ecu.contract.signals import CORNERS, INPUT

WHEELS = [f"wheel_speed_{corner}" for corner in CORNERS]


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
def test_faults_are_reported_with_how_long_they_lasted(faulty, by_fault, said) -> None:
    found = came(*WHEELS)
    found.faulty_rows = faulty
    found.fault_rows.update(by_fault)
    assert fault_lines(found) == said


def came(*names: str) -> Findings:
    """A log in which these inputs came and no other is mapped."""
    found = Findings(Path("d.log"), rows=1000, freshness=freshness_at_any_rate())
    for name in names:
        found.freshness["taken"][INPUT[name]], found.mapped[INPUT[name]] = 1000, True
    return found


def test_missing_pressures_are_reported_once_and_not_as_a_fault() -> None:
    found = came("accel_x", *WHEELS)
    found.faulty_rows = 980
    found.fault_rows[PRESSURE_LOST] = 980
    (line,) = needed_lines(found)
    assert line.startswith("d.log: no calliper pressure, so friction cannot be estimated")
    assert fault_lines(found) == []


def test_one_speed_stands_for_wheels_that_are_not_mapped() -> None:
    pressures = [f"calliper_pressure_{corner}" for corner in CORNERS]
    for names, says in (
        (
            ["vehicle_speed"],
            "wheel_speed_*: not mapped; the speed of the car, which shows no slip, stands for",
        ),
        ([], "wheel_speed_*: no sample in the whole log; fill this column"),
    ):
        found = came("accel_x", "pedal_position", *pressures, *names)
        found.faulty_rows = 980
        found.fault_rows[WHEEL_SPEED_LOST] = 980
        (line,) = needed_lines(found)
        assert says in line
        assert fault_lines(found) == []


@pytest.mark.parametrize(
    ("names", "by_fault", "said"),
    [
        (WHEELS, {IMU_LOST: 990}, []),
        ([*WHEELS, "accel_x"], {IMU_LOST: 990}, ["99 % of the drive: IMU lost (99 %)"]),
        (["accel_x"], {WHEEL_SPEED_LOST: 990, IMU_LOST: 5}, ["0.05 s of the drive: IMU lost (0.05 s)"]),
    ],
)
def test_what_is_not_mapped_is_no_fault_and_blames_no_other(names, by_fault, said) -> None:
    found = came(*names, "calliper_pressure_fl")
    found.faulty_rows = 990
    found.fault_rows.update(by_fault)
    assert fault_lines(found) == [f"d.log: degraded or failed for {one}" for one in said]


@pytest.mark.parametrize(
    ("names", "count"), [(["accel_x", "pedal_pressed"], 1), (["pedal_position"], 0), (["decel_demand"], 0)]
)
def test_a_log_without_a_demand_is_reported(names: list[str], count: int) -> None:
    lines = request_line(came(*names))
    assert len(lines) == count
    assert all("not mapped; nothing is demanded" in line for line in lines)


@pytest.mark.parametrize(
    ("observer", "names", "count"),
    [("observer1", ["accel_x"], 1), ("observer1", ["wheel_force_x_fl"], 0), ("observer2", ["accel_x"], 0)],
)
def test_observer_1_without_wheel_transducers_is_reported_as_observer_2(observer, names, count) -> None:
    lines = transducer_line(came(*names), observer)
    assert len(lines) == count
    assert all(line.startswith("d.log: wheel_force_x_*: no sample for observer1") for line in lines)
