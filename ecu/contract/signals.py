"""Table of every signal: its name, unit, message and time-out. Everything else is derived from it.

Names and units are the project's public contract: add, but never rename, remove or change a unit.
A four-wheel quantity stands as four signals in the order `CORNERS`; `INPUT[name]` is a signal's place in
`inputs.value`, and a constant such as `WHEEL_SPEED` is the place of the front-left one.
"""

from typing import Final, NamedTuple

CORNERS: Final = ("fl", "fr", "rl", "rr")


def without_corner(name: str) -> str:
    """Return a name without its corner suffix."""
    return name[:-3] if name[-3:] in {f"_{corner}" for corner in CORNERS} else name


def topic_of(column: str) -> tuple[str, str]:
    """Return the topic of a column in MCAP results and live Foxglove, and its name there."""
    name = without_corner(column)
    return ("/ecu", column) if name == column else (f"/corner/{column[-2:]}", name)


class InputSignal(NamedTuple):
    """Quantity that the ECU reads."""

    name: str
    unit: str
    message: str
    timeout_s: float
    """After this long without a new sample the signal is not alive any more."""
    low: float
    """Physical range: a sample outside is invalid."""
    high: float


def _corners(name: str, *rest: object) -> list[InputSignal]:
    message = str(rest[1])
    axle = ("Front", "Front", "Rear", "Rear")
    return [
        InputSignal(f"{name}_{c}", str(rest[0]), message + a if message else "", *map(float, rest[2:]))  # type: ignore[arg-type]
        for c, a in zip(CORNERS, axle, strict=True)
    ]


INPUT_SIGNALS: Final[tuple[InputSignal, ...]] = (
    *_corners("wheel_speed", "rad/s", "WheelSpeed", 0.1, -20.0, 400.0),
    InputSignal("accel_x", "m/s^2", "Imu", 0.1, -40.0, 40.0),
    InputSignal("accel_y", "m/s^2", "Imu", 0.1, -40.0, 40.0),
    InputSignal("yaw_rate", "rad/s", "Imu", 0.1, -6.0, 6.0),
    *_corners("calliper_pressure", "bar", "CalliperPressure", 0.1, -10.0, 250.0),
    InputSignal("pedal_position", "%", "BrakeRequest", 0.1, 0.0, 100.0),
    InputSignal("pedal_pressed", "-", "BrakeRequest", 0.1, 0.0, 1.0),
    InputSignal("decel_demand", "m/s^2", "BrakeRequest", 0.1, 0.0, 15.0),
    InputSignal("decel_demand_valid", "-", "BrakeRequest", 0.1, 0.0, 1.0),
    InputSignal("accelerator_position", "%", "BrakeRequest", 0.1, 0.0, 100.0),
    InputSignal("reverse", "-", "BrakeRequest", 0.1, 0.0, 1.0),
    InputSignal("abs_active", "-", "BrakeRequest", 0.1, 0.0, 1.0),
    InputSignal("esp_active", "-", "BrakeRequest", 0.1, 0.0, 1.0),
    InputSignal("steering_angle", "rad", "Steering", 0.1, -1.5, 1.5),
    *_corners("motor_torque", "N m", "Motor", 0.1, -8000.0, 8000.0),
    *_corners("motor_limit", "N m", "Motor", 0.1, 0.0, 8000.0),
    InputSignal("vehicle_speed", "m/s", "VehicleSpeed", 0.5, -30.0, 150.0),
    InputSignal("vehicle_speed_valid", "-", "VehicleSpeed", 0.5, 0.0, 1.0),
    InputSignal("accumulator_pressure", "bar", "HydraulicStatus", 0.2, 0.0, 300.0),
    InputSignal("hydraulic_ready", "-", "HydraulicStatus", 0.2, 0.0, 1.0),
    InputSignal("ambient_temperature", "degC", "Ambient", 3.0, -60.0, 80.0),
    InputSignal("rain", "-", "Ambient", 3.0, 0.0, 1.0),
    *_corners("wheel_force_x", "N", "WheelForce", 0.1, -40000.0, 40000.0),
    *_corners("wheel_torque_y", "N m", "WheelForce", 0.1, -10000.0, 10000.0),
    # A reference in recordings only: not in any message of ours.
    *_corners("disc_temperature_measured", "degC", "", 3.0, -60.0, 1200.0),
)
INPUT: Final = {signal.name: place for place, signal in enumerate(INPUT_SIGNALS)}
N_INPUTS: Final = len(INPUT_SIGNALS)

# Places for kernels (numba takes module constants at compile time).
WHEEL_SPEED: Final = INPUT["wheel_speed_fl"]
ACCEL_X: Final = INPUT["accel_x"]
ACCEL_Y: Final = INPUT["accel_y"]
DISC_TEMPERATURE_MEASURED: Final = INPUT["disc_temperature_measured_fl"]
YAW_RATE: Final = INPUT["yaw_rate"]
CALLIPER_PRESSURE: Final = INPUT["calliper_pressure_fl"]
PEDAL_POSITION: Final = INPUT["pedal_position"]
PEDAL_PRESSED: Final = INPUT["pedal_pressed"]
DECEL_DEMAND: Final = INPUT["decel_demand"]
DECEL_DEMAND_VALID: Final = INPUT["decel_demand_valid"]
ACCELERATOR_POSITION: Final = INPUT["accelerator_position"]
REVERSE: Final = INPUT["reverse"]
ABS_ACTIVE: Final = INPUT["abs_active"]
ESP_ACTIVE: Final = INPUT["esp_active"]
STEERING_ANGLE: Final = INPUT["steering_angle"]
MOTOR_TORQUE: Final = INPUT["motor_torque_fl"]
MOTOR_LIMIT: Final = INPUT["motor_limit_fl"]
VEHICLE_SPEED: Final = INPUT["vehicle_speed"]
VEHICLE_SPEED_VALID: Final = INPUT["vehicle_speed_valid"]
ACCUMULATOR_PRESSURE: Final = INPUT["accumulator_pressure"]
HYDRAULIC_READY: Final = INPUT["hydraulic_ready"]
WHEEL_FORCE_X: Final = INPUT["wheel_force_x_fl"]
WHEEL_TORQUE_Y: Final = INPUT["wheel_torque_y_fl"]
AMBIENT_TEMPERATURE: Final = INPUT["ambient_temperature"]
RAIN: Final = INPUT["rain"]

# The three verdicts on an input, as bits of `inputs.verdict`.
ALIVE: Final = 1  # a sample arrived within its time-out
RATE_OK: Final = 2  # samples arrive at about the expected rate
VALID: Final = 4  # the last sample was available, in range and declared valid by its sender
USABLE: Final = ALIVE | VALID

# EcuStatus `mode`
STARTING, READY, ACTIVE, DEGRADED, FAILED = range(5)
# `mode_*` of a corner's friction estimate
NOMINAL, OBSERVING, HOLDING, FAULT = range(4)


class OutputSignal(NamedTuple):
    """Quantity that the ECU sends or writes into results. NaN means "not available"."""

    name: str
    unit: str
    corners: bool
    message: str
    """DBC message (for a corner quantity split over the axles: its stem), empty: results only."""
    meaning: str
    """For the reference of columns."""


OUTPUT_SIGNALS: Final[tuple[OutputSignal, ...]] = (
    OutputSignal("vehicle_speed", "m/s", False, "", "speed over ground, as estimated"),
    OutputSignal("k_f", "-", False, "", "scale of the tyre model (4.18), 1 where it fits"),
    OutputSignal("mode", "-", False, "EcuStatus", "0 starting, 1 ready, 2 active, 3 degraded, 4 failed"),
    OutputSignal("slip", "-", True, "", "longitudinal, negative while braking; null at standstill"),
    OutputSignal("wheel_force_x", "N", True, "", "between tyre and road, negative while braking"),
    OutputSignal("wheel_force_z", "N", True, "", "wheel load"),
    OutputSignal("mu_b", "-", True, "Blcf", "friction of the linings, as estimated"),
    OutputSignal("sigma_mu_b", "-", True, "Blcf", "its standard deviation"),
    # Sent and written as mode_fl, …
    OutputSignal("mode_mu_b", "-", True, "Blcf", "0 nominal, 1 observing, 2 holding, 3 fault"),
    OutputSignal("brake_torque", "N m", True, "", "torque of the linings on the wheel, a magnitude"),
    OutputSignal("pressure_demand", "bar", True, "PressureDemand", "demanded of the calliper, as sent"),
    OutputSignal(
        "pressure_demand_valid", "-", False, "PressureDemandFront PressureDemandRear", "1: to be obeyed"
    ),
    OutputSignal("motor_demand", "N m", True, "MotorDemand", "demanded at the wheel, positive brakes"),
    OutputSignal("motor_demand_valid", "-", False, "MotorDemandFront MotorDemandRear", "1: to be obeyed"),
    OutputSignal("disc_temperature", "degC", True, "DiscTemperature", "of the disc, by its model"),
    OutputSignal("pad_wear", "mm", True, "PadWear", "thickness that the pads have lost"),
    OutputSignal("pad_remaining", "%", True, "PadWear", "share of their wearable thickness that is left"),
    OutputSignal("pad_wear_mass", "g", True, "", "mass that the two pads of the calliper have lost"),
    OutputSignal("particles_last_brake", "-", False, "ParticleEmissions", "of all brakes that have a model"),
    OutputSignal("particles_per_km", "1/km", False, "ParticleEmissions", "since these models count"),
    OutputSignal("active_faults", "-", False, "EcuStatus", "fault bits, see faults.md"),
    OutputSignal("active_faults_2", "-", False, "EcuFaults", "fault bits from the 33rd on"),
    OutputSignal("overruns", "-", False, "EcuStatus", "periods that were missed"),
    OutputSignal("worst_lateness_us", "us", False, "EcuStatus", "greatest of a cycle so far"),
    # Beyond the contract: quantities for the interpretation of results.
    OutputSignal("decel_demand_total", "m/s^2", False, "", "the larger of pedal map and decel_demand"),
    OutputSignal("accel_x_road", "m/s^2", False, "", "specific force in road axes, pitch removed"),
    OutputSignal("accel_x_model", "m/s^2", False, "", "the same by torques and drag"),
    OutputSignal("accel_x_zero", "m/s^2", False, "", "zero error of the accelerometer, as learned"),
    OutputSignal("vehicle_mass", "kg", False, "", "mass of the car, as learned"),
    OutputSignal("sigma_brake_force", "-", False, "", "of the force of all linings together, relative"),
    OutputSignal("overrun", "m/s^2", False, "", "unreported engine drag while braking"),
    OutputSignal("braking", "-", False, "", "1 while a brake application lasts"),
    OutputSignal("calliper_pressure", "bar", True, "", "as measured, last sample"),
    OutputSignal("pressure_zero", "bar", True, "", "what the sensor reads without pressure"),
    OutputSignal("pressure_uncompensated", "bar", True, "", "the demand with the base friction"),
    OutputSignal("sigma_disc_temperature", "K", True, "", "standard deviation of the disc temperature"),
    OutputSignal("sigma_pad_wear", "mm", True, "", "standard deviation of the wear"),
    OutputSignal("particles_last_brake_low", "-", False, "", "lower limit of 95 %"),
    OutputSignal("particles_last_brake_high", "-", False, "", "upper limit"),
    OutputSignal("particle_mass_per_km", "mg/km", False, "", "airborne wear of all linings, up to 10 µm"),
    OutputSignal("test_ratio", "-", True, "", "of wheel speed in the last window; above 1 it counts less"),
    OutputSignal("test_ratio_balance", "-", False, "", "of the forces along the car, likewise"),
    OutputSignal("test_ratio_speed", "-", False, "", "of the speed reference, likewise"),
    OutputSignal("grip_limit", "m/s^2", False, "", "ceiling of deceleration by road and tyres"),
    OutputSignal("sigma_grip_limit", "m/s^2", False, "", "its standard deviation"),
    OutputSignal("grip_knee", "-", False, "", "exponent of the bend towards it; null where the ECU brakes"),
    OutputSignal("motor_torque_share", "-", False, "", "share of reported torques that counts"),
    OutputSignal("torque_demand", "N m", True, "", "of the linings: that of the pressure demand"),
    OutputSignal("pressure_lateness_rise", "s", False, "", "of pressures behind their demands, as learned"),
    OutputSignal("pressure_lateness_fall", "s", False, "", "likewise, of falling ones"),
    OutputSignal("sigma_overrun", "m/s^2", False, "", "its standard deviation, with the noise of a mean"),
    OutputSignal("overrun_power", "W/kg", False, "", "drag of constant power beyond that at 10 m/s"),
    OutputSignal(
        "grip_fall", "-", False, "", "share of the grip lost beyond the limit; null where the ECU brakes"
    ),
)

DEMANDS: Final = {
    "pressure_demand": "pressure_demand_valid",
    "pressure_uncompensated": "pressure_demand_valid",
    "torque_demand": "pressure_demand_valid",
    "decel_demand_total": "pressure_demand_valid",
    "motor_demand": "motor_demand_valid",
}
"""Outputs that ask for torque, and the output that declares each valid."""


def column_names(signal: OutputSignal) -> tuple[str, ...]:
    """Return the names of an output in results and on the bus, one per corner where it has four."""
    if not signal.corners:
        return (signal.name,)
    stem = "mode" if signal.name == "mode_mu_b" else signal.name
    return tuple(f"{stem}_{corner}" for corner in CORNERS)


OUTPUT_COLUMNS: Final = tuple(name for signal in OUTPUT_SIGNALS for name in column_names(signal))
OUTPUT: Final = {name: place for place, name in enumerate(OUTPUT_COLUMNS)}
N_OUTPUTS: Final = len(OUTPUT_COLUMNS)

CYCLE_NS: Final = 10_000_000
