"""`run --xcp` with a key: a loop on a real bus is calibrated, refuses what it may not take, is replayed."""

import os
import signal
import struct
import time

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.bench.xcp_master import VARIABLES, CanWire, Master, Refused
from brakelab.replay.command import replay
from brakelab.testing.daemon import wait_for
from ecu.bus.channel import open_bus
from ecu.contract.records import output_vector
from ecu.contract.signals import OUTPUT_COLUMNS
from ecu.recording.recorder import read_recording
from ecu.settings.config import load_config

from .conftest import ROOT, free_port, process_of, unharmed

pytestmark = pytest.mark.multicast

GROUP = f"239.83.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"
CONFIG = ROOT / "config" / "suv.toml"
SECRET = bytes(range(32))
PEDAL, DECEL = "parameters.control.pedal_position", "parameters.control.pedal_decel"
RATE, PRESSURE = "parameters.control.max_pressure_rate", "parameters.control.max_pressure"
OUT_OF_RANGE, WRITE_PROTECTED, ACCESS_LOCKED, TEMPORARY = "34", "35", "37", "51"
NAN = float("nan")


@pytest.fixture
def unit(daemon, car, start_driving, tmp_path):
    """Start a daemon that may be calibrated, beside a car that drives, or stands."""
    key = tmp_path / "key"
    key.write_text(SECRET.hex())
    key.chmod(0o600)

    def start(transport, *more, stands=False):
        if stands:
            car.set(vehicle_speed=0, **{f"wheel_speed_{corner}": 0.0 for corner in ("fl", "fr", "rl", "rr")})
        bus = ("--config", CONFIG, "-i", "udp_multicast", "-c", GROUP, "--record", tmp_path / "record")
        files = ("--xcp-key", key, "--xcp-save", tmp_path / "saved.toml")
        one = daemon(*bus, "--xcp", transport, *files, *more)
        one.wait_for("ready")
        start_driving()
        return one

    return start


def stop(car):
    """Brake at 5 m/s² to a standstill."""
    speeds = iter(np.maximum(0.0, 20.0 - 0.05 * np.arange(1, 10**5)))

    def slower():
        speed = float(next(speeds))
        car.set(vehicle_speed=speed, accel_x=-5.0 if speed else 0.0)
        car.set(**{f"wheel_speed_{corner}": speed * 55.0 / 20.0 for corner in ("fl", "fr", "rl", "rr")})

    car.each_period = slower


def refused(code, ask, *values):
    with pytest.raises(Refused, match=f"^{code}$"):
        ask(*values)


def taken(master):
    """Take the working page over; return whether that is possible now."""
    try:
        master.take_over()
    except Refused:
        return False
    return True


def same_bits(folder, result, config=CONFIG):
    """Replay a recording; return the columns that differ in a bit from what the loop sent."""
    replay([folder], config, None, None, None, result)
    recorded = read_recording(folder)
    live, table = np.array([output_vector(row.reshape(1)) for row in recorded.outputs]), pq.read_table(result)
    assert table.num_rows == len(live)
    again = [table[name].to_numpy(zero_copy_only=False).astype(float) for name in OUTPUT_COLUMNS]
    return [
        name
        for name, column, values in zip(OUTPUT_COLUMNS, again, live.T, strict=True)
        if not np.array_equal(column, values, equal_nan=True)
    ]


def test_a_shadow_is_calibrated_as_it_drives_the_loop_goes_by_it_and_the_replay_gives_the_same_bits(
    unit, connect, car, tmp_path
):
    port = free_port()
    one = unit(f"udp:{port}")
    master = connect("udp", port)
    refused(ACCESS_LOCKED, master.download, DECEL, 0.0, 2.0)
    refused(ACCESS_LOCKED, master.take_over)
    master.unlock(SECRET)
    car.set(decel_demand=0, decel_demand_valid=0, pedal_position=40, pedal_pressed=1)
    wait_for(lambda: 1.0 < master.value("outputs.decel_demand_total") < 2.9)
    before = master.value("outputs.decel_demand_total")
    half = [0.5 * value for value in load_config(CONFIG).control.pedal_decel]
    master.download(DECEL, *half, *[NAN] * (8 - len(half)))
    time.sleep(0.3)
    assert master.value("outputs.decel_demand_total") == before  # a draft is a draft
    refused(OUT_OF_RANGE, master.take_over)  # Annex 3: all of the pedal has to brake hard enough
    rest = load_config(CONFIG).control.pedal_decel
    given = [value if value == rest[-1] else 0.9 * value for value in rest]
    master.download(DECEL, *given)
    master.take_over()
    wait_for(lambda: master.value("outputs.decel_demand_total") < before)
    assert master.ask("BBB", 0xEA, 1, 0)[2] == 1
    master.take_over(0)
    wait_for(lambda: master.value("outputs.decel_demand_total") == before)
    time.sleep(0.5)
    unharmed(one, tmp_path / "record")
    assert one.said("calibration_refused")
    assert one.said("calibrated", number=1)
    recorded = read_recording(tmp_path / "record")
    assert [note.number for note in recorded.calibrations] == [1, 2]
    assert same_bits(recorded.folder, tmp_path / "result.parquet") == []
    (recorded.folder / "calibrations.jsonl").unlink()
    assert "decel_demand_total" in same_bits(recorded.folder, tmp_path / "result.parquet")


def test_armed_and_moving_nothing_is_taken_over_standing_it_is(unit, connect, car, tmp_path):
    port = free_port()
    one = unit(f"udp:{port}", "--armed")
    master = connect("udp", port)
    master.unlock(SECRET)
    master.download(RATE, 2000.0)
    wait_for(lambda: master.value("outputs.vehicle_speed") > 10.0)
    refused(TEMPORARY, master.take_over)
    one.wait_for(
        "calibration_refused", reason="the car is armed and does not stand; stop, or calibrate a shadow"
    )
    assert master.ask("BBB", 0xEA, 1, 0)[2] == 0
    stop(car)
    wait_for(lambda: taken(master))
    assert master.value(RATE) == 2000.0
    unharmed(one, tmp_path / "record")
    recorded = read_recording(tmp_path / "record")
    assert [note.tables["control"]["max_pressure_rate"] for note in recorded.calibrations] == [2000.0]
    assert same_bits(recorded.folder, tmp_path / "result.parquet") == []


@pytest.mark.study
def test_a_master_that_dies_with_half_a_value_downloaded_leaves_nothing_behind(unit, connect, tmp_path):
    port = free_port()
    one = unit(f"udp:{port}", stands=True)
    first = connect("udp", port)
    first.unlock(SECRET)
    first.ask("BHBL", 0xF6, 0, 0, VARIABLES[RATE][0])
    first.ask("BB4s", 0xF0, 4, struct.pack("<d", 2000.0)[4:])
    assert first.value(RATE) != 3000.0
    first.close()
    second = connect("udp", port)
    assert second.value(RATE) == 3000.0
    refused(ACCESS_LOCKED, second.take_over)
    second.unlock(SECRET)
    second.take_over()
    assert second.ask("BBB", 0xEA, 1, 0)[2] == 0
    unharmed(one, tmp_path / "record")
    assert read_recording(tmp_path / "record").calibrations == []


@pytest.mark.study
def test_what_is_stored_is_a_config_file_and_a_slave_that_is_killed_goes_on_with_it(unit, connect, tmp_path):
    port = free_port()
    one = unit(f"udp:{port}", "--armed", stands=True)
    master = connect("udp", port)
    master.unlock(SECRET)
    for name, code in ((RATE, None), ("parameters.vehicle.mass", WRITE_PROTECTED)):
        if code:
            refused(code, master.download, name, 1500.0)
        else:
            master.download(name, 2000.0)
    wait_for(lambda: taken(master))
    master.ask("BBH", 0xF9, 1, 0)
    assert master.take() == b"\xfd\x03"  # EV_STORE_CAL
    saved = load_config(tmp_path / "saved.toml")
    assert (saved.control.max_pressure_rate, saved.transmit) == (2000.0, False)
    os.kill(process_of(one, "ecu.xcp.process"), signal.SIGKILL)
    again = connect("udp", port)
    assert again.value(RATE) == 2000.0
    assert again.ask("BBB", 0xEA, 1, 0)[2] == 1
    again.unlock(SECRET)
    again.take_over(0)
    unharmed(one, tmp_path / "record")
    recorded = read_recording(tmp_path / "record")
    assert [note.number for note in recorded.calibrations] == [1, 2]
    assert same_bits(recorded.folder, tmp_path / "result.parquet") == []


@pytest.mark.study
def test_on_the_bus_of_the_run_all_comes_in_pieces(unit, tmp_path):
    one = unit("can:0x7A0:0x7A8")
    master = Master(CanWire(open_bus("udp_multicast", GROUP), 0x7A0, 0x7A8)).connect()
    master.unlock(SECRET, most=6)
    master.download(RATE, 2000.0, most=6)
    master.take_over()
    address = VARIABLES[RATE][0]
    assert struct.unpack("<d", master.upload(address, 7) + master.upload(address + 7, 1)) == (2000.0,)
    master.close()
    unharmed(one, tmp_path / "record")


@pytest.mark.study
def test_a_recorder_that_dies_notes_it_all_the_same(unit, connect, tmp_path):
    port = free_port()
    one = unit(f"udp:{port}")
    master = connect("udp", port)
    master.unlock(SECRET)
    for number, rate in enumerate((2000.0, 2100.0, 2200.0), 1):
        master.download(RATE, rate)
        if number == 2:
            os.kill(process_of(one, "ecu.runtime.side_process"), signal.SIGKILL)
        wait_for(lambda: taken(master))
    assert one.end() == 0
    recorded = read_recording(tmp_path / "record")
    assert recorded.cycles["number"].tolist() == list(range(len(recorded.cycles)))
    rates = [note.tables["control"]["max_pressure_rate"] for note in recorded.calibrations]
    assert rates == [2000.0, 2100.0, 2200.0]
    assert same_bits(recorded.folder, tmp_path / "result.parquet") == []
