"""The vehicle in real time, on a clock and a bus of the test."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.plant.description import load_plant
from brakelab.rig import vehicle_node
from brakelab.rig.vehicle_node import drive_in_real_time, new_node, stay_with_ecu, write_truth_file
from brakelab.simulation.closed_loop import plans
from brakelab.simulation.faults import Fault
from brakelab.simulation.scenario import Scenario, load_scenario
from brakelab.simulation.scenario_car import scenario_plant
from brakelab.simulation.vehicle_bus import TRUTH_COLUMNS
from ecu import cli
from ecu.bus.protocol import BusStatus
from ecu.bus.transmit import frame_buffer, new_transmission, transmit
from ecu.contract.records import RecordArray
from ecu.contract.signals import N_OUTPUTS, OUTPUT
from ecu.errors import UserError
from ecu.runtime.clock import TimeSource
from ecu.settings.config import load_config

CONFIG = Path(__file__).parents[3] / "config"
EPOCH_NS = 1_700_000_000_000_000_000


class FakeClock:
    """Time passes only in sleep, which oversleeps where the test says so."""

    def __init__(self, late: dict[int, int] | None = None) -> None:
        self.now_ns, self.naps, self.late = 5_000_000_000, 0, late or {}

    def source(self) -> TimeSource:
        return TimeSource(lambda: self.now_ns, lambda: self.now_ns + EPOCH_NS, self.sleep)

    def sleep(self, deadline_ns: int) -> None:
        self.naps += 1
        self.now_ns = deadline_ns + self.late.get(self.naps, 0)


class FakeBus:
    """Keeps what is sent; `ecu` answers every cycle with these pressure demands [bar], or nobody does."""

    name = "fake"

    def __init__(self, clock: FakeClock, ecu: float | None = None) -> None:
        self.sent: list[RecordArray] = []
        self.clock, self.ecu = clock, ecu
        self.plan = plans().ecu_sends
        self.transmission, self.frames = new_transmission(self.plan), frame_buffer(self.plan)
        self.cycle = 0

    def drain(self, frames: RecordArray, start: int) -> int:
        self.cycle += 1
        if self.ecu is None:
            return 0
        values = np.full(N_OUTPUTS, np.nan)
        first = OUTPUT["pressure_demand_fl"]
        values[first : first + 4] = self.ecu
        values[OUTPUT["pressure_demand_valid"]] = 1.0
        count: int = transmit(self.plan, self.transmission, values, self.cycle, self.frames)
        self.frames["stamp_ns"] = self.clock.now_ns + EPOCH_NS - 1_000_000
        frames[start : start + count] = self.frames[:count]
        return count

    def send(self, frames: RecordArray, count: int) -> int:
        self.sent.append(frames[:count].copy())
        return count

    def status(self) -> BusStatus:
        return BusStatus(False, False, 0, 0)

    def close(self) -> None:
        pass


def scenario(seconds: float) -> Scenario:
    """Return a braking of this length from 120 km/h."""
    whole = load_scenario(CONFIG / "scenarios" / "stop-1.toml")
    brake = whole.phase[1].model_copy(update={"until_speed": None, "seconds": seconds})
    return whole.model_copy(update={"phase": [brake]})


def column(values: Any, name: str) -> Any:
    return values[:, TRUTH_COLUMNS.index(name)]


def test_frames_leave_every_10_ms_with_running_counters() -> None:
    clock = FakeClock()
    bus = FakeBus(clock)
    truth = drive_in_real_time(new_node(scenario(0.5), 1), bus, clock.source())
    assert len(bus.sent) == len(truth.t) == 50
    speed = [frames[frames["can_id"] == 0x70] for frames in bus.sent]
    assert [len(found) for found in speed] == [1] * 50
    assert [int(found[0]["data"][1] & 0xF) for found in speed] == [k % 15 for k in range(50)]
    assert truth.start_ns == EPOCH_NS + 5_010_000_000
    assert np.allclose(np.diff(truth.t), 0.01)


def test_without_an_ecu_the_hydraulics_brake() -> None:
    clock = FakeClock()
    truth = drive_in_real_time(new_node(scenario(2.0), 1), FakeBus(clock), clock.source())
    assert column(truth.values, "accel_x_road")[-1] == pytest.approx(-4.0, rel=0.25)


def test_demands_of_the_ecu_are_obeyed() -> None:
    clock = FakeClock()
    truth = drive_in_real_time(new_node(scenario(1.0), 1), FakeBus(clock, ecu=22.0), clock.source())
    assert column(truth.values, "calliper_pressure_rr")[-1] == pytest.approx(22.0, abs=0.2)


def test_after_its_script_the_car_goes_on_until_it_stands() -> None:
    clock = FakeClock()
    bus, node = FakeBus(clock, ecu=22.0), new_node(scenario(1.0), 1)
    truth = drive_in_real_time(node, bus, clock.source())
    reached = column(truth.values, "vehicle_speed")[-1]
    stay_with_ecu(node, bus, clock.source(), len(truth.t), lambda: len(bus.sent) >= 400)
    assert node.side.vehicle.state[0]["speed_x"] < reached - 5.0
    stay_with_ecu(node, bus, clock.source(), len(bus.sent), lambda: len(bus.sent) >= 2000)
    assert node.side.vehicle.state[0]["speed_x"] == pytest.approx(0.0, abs=0.01)
    front = [frames[frames["can_id"] == 0x74]["data"][0][2:] for frames in bus.sent[-400:]]
    assert len(set(map(bytes, front))) > 300, "pressures with noise, not the last reading again"


def test_missed_periods_are_lived_through() -> None:
    lost = 5
    on_time, late = FakeClock(), FakeClock({20: lost * 10_000_000 + 1_000_000})
    punctual = drive_in_real_time(new_node(scenario(1.0), 1), FakeBus(on_time), on_time.source())
    delayed = drive_in_real_time(new_node(scenario(1.0), 1), FakeBus(late), late.source())
    assert len(punctual.t) - len(delayed.t) == lost
    assert delayed.t[-1] == pytest.approx(punctual.t[-1])
    assert np.allclose(
        column(delayed.values, "vehicle_speed")[-1], column(punctual.values, "vehicle_speed")[-1]
    )


def test_frames_are_lost_as_often_as_asked_and_always_the_same() -> None:
    def sent(share: float, seed: int) -> list[int]:
        clock = FakeClock()
        bus = FakeBus(clock)
        lossy = [Fault(kind="lost", t=0.0, share=share)] if share else []
        node = new_node(scenario(5.0).model_copy(update={"fault": lossy}), seed)
        drive_in_real_time(node, bus, clock.source())
        return [len(frames) for frames in bus.sent]

    all_of_them, some = sum(sent(0.0, 1)), sent(0.05, 1)
    assert sum(some) / all_of_them == pytest.approx(0.95, abs=0.01)
    assert sent(0.05, 1) == some != sent(0.05, 2)


def test_it_leaves_when_it_is_stopped() -> None:
    clock = FakeClock()
    bus = FakeBus(clock)
    truth = drive_in_real_time(
        new_node(scenario(60.0), 1), bus, clock.source(), stopped=lambda: len(bus.sent) >= 7
    )
    assert len(truth.t) == 7


def test_truth_file_knows_when_it_started(tmp_path: Path) -> None:
    clock = FakeClock()
    truth = drive_in_real_time(new_node(scenario(0.2), 1), FakeBus(clock), clock.source())
    path = tmp_path / "new" / "truth.parquet"
    write_truth_file(path, truth, "short", 1)
    table = pq.read_table(path)
    assert table.num_rows == 20
    assert int(table.schema.metadata[b"start_time_ns"]) == truth.start_ns


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere", "-i", "virtual", "-c", "x"], "nowhere"),
        (["stop-1", "-i", "no-such-interface", "-c", "x"], "no-such-interface"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["vehicle", *arguments]) == 2
    line = capsys.readouterr().err.strip().splitlines()
    assert len(line) == 1
    assert said in line[0]


@pytest.mark.parametrize("plant", [None, "sedan", "as-config"])
def test_the_command_drives_the_car_that_is_named(
    plant: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    masses, truth = [], tmp_path / "truth.parquet"
    clock = FakeClock()
    short = tmp_path / "short.toml"
    short.write_text('initial_speed = 20.0\nplant = "suv"\n[[phase]]\nkind = "coast"\nseconds = 0.2\n')
    config = ["--config", "lcv"] if plant == "as-config" else []
    monkeypatch.setattr(vehicle_node, "open_channel", lambda *bus, receive_ids: FakeBus(clock))
    monkeypatch.setattr(vehicle_node, "system_time", clock.source)
    monkeypatch.setattr(vehicle_node, "ask_for_priority", lambda: None)
    monkeypatch.setattr(
        vehicle_node, "warm_up", lambda driven: masses.append(scenario_plant(driven).vehicle.body.mass)
    )
    options = ["--plant", plant] if plant else []
    words = ["vehicle", str(short), "-i", "virtual", "-c", "x", "--alone", "--truth", str(truth)]
    assert cli.main([*words, *options, *config]) == 0
    car = {None: "suv", "sedan": "sedan"}.get(plant)
    expected = (
        load_config(CONFIG / "lcv.toml").vehicle.mass
        if car is None
        else load_plant(CONFIG / "plant" / f"{car}.toml").vehicle.body.mass
    )
    assert masses == [pytest.approx(expected)]
    assert pq.read_table(truth).num_rows == 20


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--plant", "as-config"], "--plant: as-config: of which car? give --config"),
        (["--config", "lcv"], "--config: lcv: is the car of --plant as-config; give that, too"),
        (["--plant", "tractor"], "tractor"),
    ],
)
def test_the_command_names_a_car_that_is_none(
    options: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["vehicle", "stop-1", "-i", "virtual", "-c", "x", *options]) == 2
    line = capsys.readouterr().err
    assert says in line
    assert line.count("\n") == 1


@pytest.mark.parametrize(("options", "left"), [([], ["bus_off"]), (["--bus-goes-off"], [])])
def test_a_bus_that_goes_off_itself_is_no_fault_of_the_car(
    options: list[str], left: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def look(driven: Scenario) -> None:
        assert [fault.kind for fault in driven.fault] == left
        raise UserError("seen", "", "enough")

    path = tmp_path / "off.toml"
    path.write_text('[[phase]]\nkind = "coast"\nseconds = 1.0\n[[fault]]\nkind = "bus_off"\nt = 0.1\n')
    monkeypatch.setattr(vehicle_node, "warm_up", look)
    monkeypatch.setattr("signal.signal", lambda number, handler: None)
    assert cli.main(["vehicle", str(path), "-i", "virtual", "-c", "x", *options]) == 2
