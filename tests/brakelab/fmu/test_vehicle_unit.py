"""The vehicle as an FMU drives as in `simulate`: by the same demands to the bit, and with the ECU's FMU."""

from pathlib import Path

import cantools
import numpy as np
import pytest

from brakelab.fmu.vehicle_unit import DEMANDED, vehicle_unit
from brakelab.simulation.closed_loop import START_NS, Drive, new_loop, run
from brakelab.simulation.scenario import Scenario, load_scenario
from ecu.contract.signals import CYCLE_NS
from ecu.errors import UserError
from ecu.settings.config import load_config
from ecu.settings.resources import resource

from .conftest import Make
from .master import OK, WARNING, Fmu

pytestmark = pytest.mark.study


def simulated(scenario: str, config: str) -> Drive:
    path = resource(f"config/scenarios/{scenario}.toml")
    return run(new_loop(load_scenario(path), load_config(resource(f"config/{config}.toml")), 0))


def demands_by_cycle(drive: Drive) -> dict[int, dict[str, float]]:
    """What the frames of the ECU say, decoded by cantools, by the cycle that they were sent in."""
    database = cantools.database.load_file(str(resource("dbc/brake_ecu.dbc")))
    wanted = {
        message.frame_id: message
        for message in database.messages
        if message.name.startswith(("PressureDemand", "MotorDemand"))
    }
    found: dict[int, dict[str, float]] = {}
    for frame in drive.frames:
        if (message := wanted.get(int(frame["can_id"]))) is not None:
            values = message.decode(bytes(frame["data"][: frame["length"]]), decode_choices=False)
            cycle = (int(frame["stamp_ns"]) - START_NS) // CYCLE_NS
            sent = {name: float(value) for name, value in values.items() if name in DEMANDED}
            found.setdefault(cycle, {}).update(sent)
    return found


@pytest.mark.parametrize(
    ("scenario", "config"),
    [("stop-1", "suv"), ("blending-40", "suv-blended"), ("faults/calliper-dead", "suv")],
)
def test_the_same_demands_give_the_same_drive_to_the_bit(
    make_vehicle: Make, scenario: str, config: str
) -> None:
    drive, fmu = simulated(scenario, config), make_vehicle(scenario)
    demands = demands_by_cycle(drive)
    true = [name for name in fmu.outputs if name.startswith("truth.")]
    with fmu.instantiate() as vehicle:
        assert vehicle.initialise() == OK
        for k in range(len(drive.t)):
            expected = np.array([drive.truth[name.removeprefix("truth.")][k] for name in true])
            assert vehicle.get(true).tobytes() == expected.tobytes(), k
            assert not vehicle.terminates
            assert vehicle.put(demands[k]) == OK
            assert vehicle.step() == OK
        assert vehicle.terminates


def test_what_it_measures_is_what_simulate_sends(stop: Fmu) -> None:
    """But for the bits of a frame: the ECU of `simulate` reads rounded values."""
    drive = simulated("stop-1", "suv")
    names = ["wheel_speed_fl", "accel_x", "calliper_pressure_rr", "yaw_rate", "vehicle_speed"]
    steps = dict(zip(names, (0.01, 0.005, 0.01, 0.001, 0.01), strict=True))
    demands = demands_by_cycle(drive)
    with stop.instantiate() as vehicle:
        vehicle.initialise()
        for k in range(len(drive.t)):
            for name, value in zip(names, vehicle.get(names).tolist(), strict=True):
                assert value == pytest.approx(drive.inputs[name][k], abs=steps[name], nan_ok=True)
            vehicle.put(demands[k])
            vehicle.step()


def loop(ecu: Fmu, car: Fmu) -> dict[str, np.ndarray]:
    """Drive to the scenario's end: measure, ECU, car. Returns the car's true values by name."""
    measured = [name for name in car.outputs if name in ecu.inputs]
    true = [name for name in car.outputs if name.startswith("truth.")]
    rows = []
    with ecu.instantiate() as brain, car.instantiate() as body:
        assert brain.initialise() == body.initialise() == OK
        while not body.terminates:
            rows.append(body.get(true))
            brain.put(dict(zip(measured, body.get(measured).tolist(), strict=True)))
            assert brain.step() == OK
            body.put(dict(zip(car.inputs, brain.get(car.inputs).tolist(), strict=True)))
            assert body.step() == OK
    return dict(zip((name.removeprefix("truth.") for name in true), np.array(rows).T, strict=True))


CLOSE = {
    # of true values over the whole drive, to `simulate`: frames round and stamp what FMUs hand over as it is,
    # and at the edge of grip (stop-4) that moves by a cycle when the slip guard cuts
    "vehicle_speed": 0.005,  # m/s
    "distance": 0.03,  # m
    "accel_x_road": 0.1,  # m/s^2
    "calliper_pressure_fl": 0.2,  # bar
    "calliper_pressure_rr": 0.2,
    "mu_b_fl": 1e-4,
    "disc_temperature_fl": 0.05,  # K
}


@pytest.mark.parametrize(("scenario", "config"), [("stop-1", "suv"), ("stop-4", "suv")])
def test_the_loop_of_two_fmus_brakes_as_simulate_does(
    make_ecu: Make, make_vehicle: Make, scenario: str, config: str
) -> None:
    drive = simulated(scenario, config)
    found = loop(make_ecu(config), make_vehicle(scenario))
    assert len(found["distance"]) == pytest.approx(len(drive.t), abs=1)
    rows = min(len(found["distance"]), len(drive.t))
    off = {name: np.max(np.abs(found[name][:rows] - drive.truth[name][:rows])) for name in CLOSE}
    print(scenario, {name: float(f"{value:.2g}") for name, value in off.items()})
    assert {name for name, value in off.items() if value > CLOSE[name]} == set()


def test_without_demands_the_hydraulics_brake(stop: Fmu) -> None:
    with stop.instantiate() as vehicle:
        vehicle.initialise()
        while not vehicle.terminates:
            assert vehicle.step() == OK
        heard, speed = vehicle.get(["truth.demand_heard", "truth.vehicle_speed"])
    assert heard == 0.0
    assert speed < 0.1


def test_after_the_scenario_values_are_held(stop: Fmu) -> None:
    with stop.instantiate() as vehicle:
        vehicle.initialise()
        while not vehicle.terminates:
            vehicle.step()
        assert [status for status, *_ in vehicle.messages] == [WARNING]
        last, time = vehicle.get(stop.outputs), vehicle.time
        assert vehicle.step() == OK
        assert vehicle.terminates
        assert vehicle.get(stop.outputs).tobytes() == last.tobytes()
        assert vehicle.time == pytest.approx(time + 0.01)
        assert len(vehicle.messages) == 1


def test_faults_of_frames_are_refused() -> None:
    scenario: Scenario = load_scenario(resource("config/scenarios/faults/lost.toml"))
    with pytest.raises(UserError, match='lost: fault: "lost" acts on frames') as caught:
        vehicle_unit(scenario, 0, "lost")
    assert "leave it out" in str(caught.value)


@pytest.mark.parametrize("seed", range(3))
def test_no_demand_makes_the_car_anything_but_a_car(stop: Fmu, seed: int) -> None:
    """What no frame could say is its range's end, and of demands that belong together all arrive, or none."""
    random = np.random.default_rng(seed)
    odd = [1e300, -1e300, 1e6, 30.0, 1.0, 0.0, 5e-324, np.nan, np.inf, -np.inf]
    true = [name for name in stop.outputs if name.startswith("truth.")]
    with stop.instantiate() as vehicle:
        vehicle.initialise()
        for _ in range(300):
            vehicle.put({name: float(random.choice(odd)) for name in stop.inputs})
            assert vehicle.step() == OK
            assert np.isfinite(vehicle.get(true)).all()
        vehicle.put(dict.fromkeys(stop.inputs, 0.0) | dict.fromkeys(stop.inputs[:4], 1e3) | {VALID: 1.0})
        for _ in range(100):
            assert vehicle.step() == OK
        pressure = vehicle.get(["truth.calliper_pressure_fl"])[0]
        assert 100.0 < pressure <= 200.0
        vehicle.put({"pressure_demand_fr": np.nan})
        for _ in range(10):
            vehicle.step()
        assert vehicle.get(["truth.demand_heard"])[0] == 0.0


VALID = "pressure_demand_valid"
OWN = """
NUMBERS = {"mu": ("-", 0.1, 0.8)}


def step(numbers, memory, pressure, speed, slowing, temperature, dt):
    return memory, numbers[0]
"""
LINING = """
[lining.A.friction.OWN]
law = "own"
code = "own.py"
rig_mass = 996.0
numbers = { mu = 0.42 }
"""


def test_a_friction_law_of_ones_own_is_refused(tmp_path: Path) -> None:
    """Its row holds an address in this process, which would be called in another one."""
    for name, more in (("suv.toml", ""), ("linings.toml", LINING)):
        text = resource(f"config/plant/{name}").read_text("utf-8") + more
        (tmp_path / name).write_text(
            text.replace('lining = "A" ', 'friction = "OWN"\nlining = "A" '), "utf-8"
        )
    (tmp_path / "own.py").write_text(OWN)
    stop = load_scenario(resource("config/scenarios/stop-1.toml"))
    changed = {"plant": str(tmp_path / "suv.toml"), "draw": "nominal"}  # a wide one draws the law, too
    with pytest.raises(UserError, match="mine: plant: a friction law of one's own"):
        vehicle_unit(stop.model_copy(update=changed), 0, "mine")


def test_a_longer_step_is_several_cycles_with_the_same_demands(stop: Fmu) -> None:
    demands = {name: 20.0 if name.startswith("pressure") else 0.0 for name in stop.inputs}
    rows = []
    for cycles in (1, 5):
        with stop.instantiate() as vehicle:
            vehicle.put(demands | {"pressure_demand_valid": 1.0})
            vehicle.initialise()
            for _ in range(100 // cycles):
                assert vehicle.step(0.01 * cycles) == OK
            rows.append(vehicle.get(stop.outputs).tobytes())
    assert rows[0] == rows[1]
