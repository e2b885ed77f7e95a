import json
import re
from pathlib import Path

import numpy as np
import pytest
from prometheus_client import CollectorRegistry
from prometheus_client.openmetrics.exposition import generate_latest
from prometheus_client.openmetrics.parser import text_string_to_metric_families

from ecu.contract.faults import FAULTS, IMU_LOST, LATE
from ecu.watch.metrics import families
from ecu.watch.tally import Tally

from .conftest import MONO_NS


@pytest.fixture
def one(loop):
    return loop()


def read(one):
    """Return the samples as another program reads them: {name: {labels: value}}."""
    tally = Tally(one.ring.path, lambda: MONO_NS * 1e-9 + 0.01 * one.number)
    tally.follow()

    class Collector:
        def collect(self):
            return families(tally)

    registry = CollectorRegistry(auto_describe=False)
    registry.register(Collector())
    text = generate_latest(registry).decode()
    samples = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            samples.setdefault(sample.name, {})[tuple(sample.labels.values())] = sample.value
    return samples


def test_before_the_first_cycle(one):
    samples = read(one)
    assert samples["brake_ecu_up"] == {(): 0}
    assert "brake_ecu_cycles_total" not in samples


def test_every_quantity_with_its_unit(one):
    one.cycle["overruns"], one.cycle["dropped"] = 2, 7
    one.publish(
        50,
        mode=3,
        active_faults=IMU_LOST | LATE,
        vehicle_speed=20.0,
        mu_b=[0.41, 0.42, 0.43, np.nan],
        sigma_mu_b=0.02,
        disc_temperature=[101, 102, 103, 104],
        pad_wear=0.5,
        pad_remaining=95.0,
    )
    one.find("yaw_rate", ratio=2.5, rejected=1, unused_s=12.0)
    one.find("accel_x", value=-3.0, unused_s=0.0)
    one.publish(1)
    samples = read(one)
    assert samples["brake_ecu_input_test_ratio"] == {("yaw_rate",): 2.5}
    assert samples["brake_ecu_input_rejected"] == {("accel_x",): 0, ("yaw_rate",): 1}
    assert samples["brake_ecu_input_unused_seconds"] == {("accel_x",): 0, ("yaw_rate",): 12}
    for name, expected in {
        "up": 1,
        "cycles_total": 51,
        "missed_periods_total": 2,
        "frames_dropped_total": 7,
        "vehicle_speed_metres_per_second": 20,
        "speaks": 1,
        "lateness_seconds_count": 51,
    }.items():
        assert samples[f"brake_ecu_{name}"] == {(): expected}, name
    assert samples["brake_ecu_last_cycle_age_seconds"][()] == pytest.approx(0.01)
    assert samples["brake_ecu_lateness_seconds_sum"][()] == pytest.approx(51 * 50e-6)
    assert samples["brake_ecu_lateness_seconds_bucket"][("5e-05",)] == 51
    assert samples["brake_ecu_friction"] == {("fl",): 0.41, ("fr",): 0.42, ("rl",): 0.43}
    assert samples["brake_ecu_friction_sigma"][("rr",)] == 0.02
    assert samples["brake_ecu_disc_temperature_celsius"][("rl",)] == 103
    assert samples["brake_ecu_pad_wear_millimetres"][("fr",)] == 0.5
    assert samples["brake_ecu_pad_remaining_ratio"][("fr",)] == pytest.approx(0.95)
    assert {key for key, value in samples["brake_ecu_mode"].items() if value} == {("degraded",)}
    assert {key for key, value in samples["brake_ecu_fault"].items() if value} == {("IMU lost",), ("late",)}
    assert len(samples["brake_ecu_fault"]) == len(FAULTS)
    assert len(samples["brake_ecu_stage_seconds_total"]) == 5
    assert len(samples["brake_ecu_stage_overruns_total"]) == 5


def test_frames_by_message(one, contract_frames):
    frames = contract_frames("Imu", 8)
    frames["data"][3, 2] ^= 1
    frames["stamp_ns"][6:] += 22_000_000
    one.publish_frames(frames)
    samples = read(one)
    assert samples["brake_ecu_frames_received_total"][("Imu",)] == 8
    assert samples["brake_ecu_frames_accepted_total"][("Imu",)] == 7
    assert samples["brake_ecu_frames_rejected_total"][("Imu", "checksum")] == 1
    assert samples["brake_ecu_frames_behind_total"][("Imu",)] == 2
    assert samples["brake_ecu_frame_gaps_total"][("Imu",)] == 1
    assert ("BlcfFront",) not in samples["brake_ecu_frames_received_total"]  # our own


def test_the_dashboard_and_the_page_name_metrics_that_exist(one):
    one.find("accel_x", value=0.0, ratio=0.1, unused_s=0.0)
    one.publish(4)
    exist = {name.removeprefix("brake_ecu_") for name in read(one)}
    root = Path(__file__).parents[3]
    board = json.loads((root / "tools/deploy/grafana-brake-ecu.json").read_text("utf-8"))
    asked = {
        name
        for panel in board["panels"]
        for target in panel["targets"]
        for name in re.findall(r"brake_ecu_(\w+)", target["expr"])
    }
    assert asked <= exist
    places = [tuple(panel["gridPos"][key] for key in "xy") for panel in board["panels"]]
    assert len(set(places)) == len(places) > 10
    page = (root / "docs/watch.md").read_text("utf-8").partition("## Metrics")[2]
    named = {name for row in re.findall(r"^\| (`.*?) \|", page, re.M) for name in re.findall(r"`(\w+)`", row)}
    stems = {re.sub(r"_(bucket|count|sum)$", "", name) for name in exist}
    assert named == stems
