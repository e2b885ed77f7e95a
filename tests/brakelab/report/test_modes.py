import numpy as np

from brakelab.report.downsample import buckets
from brakelab.report.drive import DriveResult
from brakelab.report.modes import Bar, faults_seen, mode_bars
from ecu.contract.faults import IMU_LOST
from ecu.contract.signals import ACTIVE, HOLDING, OBSERVING, READY, STARTING


def drive(**columns: list[float]) -> DriveResult:
    values = {name: np.array(column, float) for name, column in columns.items()}
    return DriveResult(np.arange(len(next(iter(values.values()))), dtype=float), values, {})


def test_bars_are_the_stretches_of_a_mode() -> None:
    nan = float("nan")
    made = drive(mode=[READY, READY, ACTIVE, ACTIVE], mode_fl=[nan, OBSERVING, HOLDING, HOLDING])
    assert mode_bars(made, buckets(np.zeros(4, bool), 10)) == [
        Bar("ECU", 0.0, 2.0, "ready", "idle"),
        Bar("ECU", 2.0, 3.0, "active", "working"),
        Bar("FL", 1.0, 2.0, "observing", "working"),
        Bar("FL", 2.0, 3.0, "holding", "holding"),
    ]


def test_faults_have_names_also_a_bit_that_nobody_knows() -> None:
    made = drive(active_faults=[0.0, IMU_LOST, IMU_LOST | 1 << 31, float("nan")])
    assert faults_seen(made) == {IMU_LOST: "IMU lost", 1 << 31: "fault bit 31"}
    bars = mode_bars(made, buckets(np.zeros(4, bool), 10))
    assert Bar("IMU lost", 1.0, 3.0, "IMU lost", "fault") in bars


def test_what_is_missing_at_the_start_is_no_fault() -> None:
    made = drive(mode=[STARTING, READY], active_faults=[IMU_LOST, 0.0])
    assert faults_seen(made) == {}


def test_a_fault_of_one_row_stays_visible_in_a_long_drive() -> None:
    masks = [0.0] * 5000
    masks[1234] = IMU_LOST
    bars = mode_bars(drive(active_faults=masks), buckets(np.zeros(5000, bool), 200))
    assert any(bar.row == "IMU lost" for bar in bars)
