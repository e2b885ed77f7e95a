"""Plant and ECU over frames in memory: the car stops, the same seed gives the same bits, replay agrees."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.replay.engine import new_ecu, run_frames
from brakelab.simulation.closed_loop import START_NS, VEHICLE_BUS, Drive, new_loop, plans, run
from brakelab.simulation.scenario import Scenario, load_scenario
from brakelab.simulation.scenario_car import with_draw
from brakelab.simulation.simulate import simulate
from ecu.bus.receive import new_reception
from ecu.contract.signals import CORNERS, OUTPUT_COLUMNS
from ecu.errors import UserError
from ecu.recording.recorder import candump_lines
from ecu.settings.config import Config, load_config, new_params

CONFIG = Path(__file__).parents[3] / "config"
STOPS = {1: 4.0, 2: 7.0, 3: 4.0, 4: 6.0}


@pytest.fixture(scope="module")
def config() -> Config:
    return load_config(CONFIG / "suv.toml")


def scenario(name: str) -> Scenario:
    return load_scenario(CONFIG / "scenarios" / f"{name}.toml")


@pytest.fixture(scope="module")
def stop(config: Config) -> Drive:
    return run(new_loop(scenario("stop-1"), config, 3))


def achieved(drive: Drive) -> float:
    """Return the mean deceleration while brakes were on between 25 and 8 m/s."""
    speed = drive.truth["vehicle_speed"]
    chosen = (speed < 25.0) & (speed > 8.0)
    return float(-drive.truth["accel_x_road"][chosen].mean())


@pytest.mark.parametrize(("number", "decel"), STOPS.items())
def test_the_car_comes_to_rest_about_as_fast_as_asked(config: Config, number: int, decel: float) -> None:
    drive = run(new_loop(scenario(f"stop-{number}"), config, 1))
    assert drive.truth["vehicle_speed"][0] == pytest.approx(33.333)
    assert abs(drive.truth["vehicle_speed"][-1]) < 0.1
    assert achieved(drive) == pytest.approx(decel, rel=0.15)


def test_every_frame_is_accepted_by_both_sides(config: Config) -> None:
    loop = new_loop(scenario("stop-1"), config, 3)
    run(loop)
    for reception in (loop.sides.ecu_reception, loop.sides.vehicle_reception):
        assert reception.totals[0]["rejected"] == 0
        assert np.all(reception.messages["lost"] == 0)
        assert reception.totals[0]["frames"] > 1000


def test_same_seed_same_bits(config: Config, stop: Drive) -> None:
    again, other = (run(new_loop(scenario("stop-1"), config, seed)) for seed in (3, 4))
    assert again.frames.tobytes() == stop.frames.tobytes()
    assert all(again.truth[name].tobytes() == stop.truth[name].tobytes() for name in stop.truth)
    assert other.frames.tobytes() != stop.frames.tobytes()


def test_replay_of_the_frames_gives_the_same_bits(config: Config, stop: Drive) -> None:
    params = new_params(config)
    params["transmit"] = True
    plan = plans().ecu_hears
    ecu, reception = new_ecu(params, None), new_reception(plan)
    values = np.concatenate([rows.values for rows in run_frames(ecu, plan, reception, [stop.frames])])
    live = np.stack([stop.outputs[name] for name in OUTPUT_COLUMNS], axis=1)
    count = min(len(values), len(live))
    assert count >= len(live) - 1
    assert np.array_equal(values[:count, : live.shape[1]], live[:count], equal_nan=True)


def test_frames_arrive_in_order_and_before_their_cycle(stop: Drive) -> None:
    stamps = stop.frames["stamp_ns"]
    assert np.all(np.diff(stamps) >= 0)
    assert np.all(stamps % 1000 == 0)
    assert stamps[0] == START_NS  # the time grid of a replay starts with the first frame


def test_inputs_are_the_truth_with_noise_quantised(config: Config) -> None:
    stop = run(new_loop(with_draw(scenario("stop-1"), "nominal"), config, 3))
    moving = stop.truth["vehicle_speed"] > 5.0
    error = (stop.inputs["wheel_speed_fl"] - stop.truth["wheel_speed_fl"])[moving]
    assert np.nanstd(error) == pytest.approx(0.1, rel=0.1)
    steps = stop.inputs["wheel_speed_fl"] / 0.0005  # the database's resolution
    assert np.nanmax(np.abs(steps - np.round(steps))) < 1e-3
    assert np.isnan(stop.inputs["wheel_force_x_fl"]).all()  # no transducers in this scenario


def test_options_decide_what_is_on_the_bus(config: Config) -> None:
    bare = scenario("stop-2").model_copy(update={"vehicle_speed": "none", "wheel_transducers": True})
    drive = run(new_loop(bare, config, 0))
    assert np.isnan(drive.inputs["vehicle_speed"]).all()
    force = drive.inputs["wheel_force_x_rl"] - drive.truth["wheel_force_x_rl"]
    assert np.nanstd(force) == pytest.approx(10.0, rel=0.15)


def test_a_shadow_leaves_braking_to_the_hydraulics(config: Config) -> None:
    drive = run(new_loop(scenario("stop-1"), config, 3, armed=False))
    assert np.all(drive.outputs["pressure_demand_valid"] == 0.0)
    assert abs(drive.truth["vehicle_speed"][-1]) < 0.1
    front, rear = (drive.truth[f"calliper_pressure_{c}"] for c in ("fl", "rl"))
    assert np.allclose(front, rear, atol=0.5)  # equal pressure everywhere is the fallback's, not the ECU's


def test_the_ideal_controller_brakes_with_the_true_friction(config: Config) -> None:
    """Brake torque over m r against the demand, steady part, mean error: the law alone is left."""

    def error(ideal: bool, compensation: str) -> float:
        chosen = config.model_copy(
            update={"control": config.control.model_copy(update={"compensation": compensation})}
        )
        drive = run(new_loop(scenario("stop-1"), chosen, 3), ideal)
        speed = drive.truth["vehicle_speed"]
        steady = (speed < 28.0) & (speed > 8.0)
        torque = sum(drive.truth[f"brake_torque_{c}"] for c in CORNERS)
        decel, asked = torque[steady] / (2105.0 * 0.365), drive.truth["decel_demand"][steady]
        return float(np.abs(decel / asked - 1.0).mean())

    ideal, uncompensated = error(True, "second-order"), error(False, "off")
    print(f"mean error: ideal {ideal:.3f}, uncompensated {uncompensated:.3f}")
    assert ideal < 0.04
    assert ideal < 0.5 * uncompensated


def test_simulate_writes_log_inputs_and_truth(tmp_path: Path, stop: Drive) -> None:
    out = tmp_path / "new" / "run.1"
    simulate(CONFIG / "scenarios" / "stop-1.toml", CONFIG / "suv.toml", out, 3)
    lines = (tmp_path / "new" / "run.1.log").read_text().splitlines()
    assert len(lines) == len(stop.frames)
    assert lines[0].startswith(f"({START_NS // 10**9}.000000) can0 ")
    inputs = pq.read_table(tmp_path / "new" / "run.1.parquet")
    truth = pq.read_table(tmp_path / "new" / "run.1.truth.parquet")
    assert inputs.num_rows == truth.num_rows == len(stop.t)
    assert inputs.column_names[0] == truth.column_names[0] == "t"
    assert inputs.schema.metadata[b"start_time_ns"] == str(START_NS).encode()
    assert {f"mu_b_{c}" for c in CORNERS} <= set(truth.column_names)
    found = inputs["wheel_speed_fl"].to_numpy(zero_copy_only=False)
    assert np.array_equal(found, stop.inputs["wheel_speed_fl"], equal_nan=True)
    assert inputs["ambient_temperature"].null_count > 0  # once a second, no sample in between


def test_simulate_refuses_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        simulate(CONFIG / "scenarios" / "stop-2.toml", CONFIG / "suv.toml", tmp_path / "file" / "x", 0)


def test_candump_text_parses_back(tmp_path: Path, stop: Drive) -> None:
    from can import CanutilsLogReader

    path = tmp_path / "a.log"
    path.write_bytes(candump_lines(stop.frames[:500], VEHICLE_BUS))
    read = list(CanutilsLogReader(path))
    assert [message.arbitration_id for message in read] == stop.frames["can_id"][:500].tolist()
    payload = [bytes(frame["data"][: frame["length"]]) for frame in stop.frames[:500]]
    assert [bytes(message.data) for message in read] == payload


def test_simulate_never_overwrites_what_it_reads(tmp_path: Path) -> None:
    scenario = tmp_path / "stop.log"
    scenario.write_bytes((CONFIG / "scenarios" / "stop-1.toml").read_bytes())
    before = scenario.read_bytes()
    with pytest.raises(UserError, match=f"^--out: .*would overwrite {scenario}"):
        simulate(scenario, CONFIG / "suv.toml", tmp_path / "stop", 0)
    assert scenario.read_bytes() == before
