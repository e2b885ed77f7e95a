"""Keys of CONFIG, with their units, ranges and meaning."""

from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from ecu.algorithm.inputs import MAX_DECEL
from ecu.contract.params import PEDAL_POINTS
from ecu.settings.annex3 import GREATEST_PRESSURE
from ecu.settings.annex5 import Load
from ecu.settings.dust import Dust
from ecu.settings.hydraulics import Hydraulics
from ecu.settings.pad import Pad
from ecu.settings.toml_file import Section, Unit

Share = Annotated[float, Field(gt=0, lt=1)]
FrontAxle = Annotated[float, Field(gt=0, lt=8), Unit("m")]
Cooling = Annotated[float, Field(gt=1e-5, lt=0.1), Unit("1/s")]
Doubt = Annotated[float, Field(gt=1e-3, lt=1), Unit("-")]

WET = 1.5
"""Rain on delta_1 where CONFIG has no number for it: Figure 7.15 shows more cooling at speed, no numbers."""
PEDAL_GAIN = 1.0  # m/s^2 per % of the pedal's travel: its sensor's noise shall not jolt. Assumption.
HALFWAY = 1.0  # m/s^2, the least that half of the travel asks for. Assumption.


class Vehicle(Section):
    """Masses and lengths of the car as driven."""

    mass: Annotated[float, Field(gt=200, lt=10000), Unit("kg")]
    """As driven."""
    wheelbase: Annotated[float, Field(gt=1, lt=8), Unit("m")]
    """Front to rear axle."""
    front_axle: FrontAxle
    """Centre of gravity to front axle, m."""
    cog_height: Annotated[float, Field(gt=0.1, lt=3), Unit("m")]
    """Centre of gravity above the road."""
    track: Annotated[float, Field(gt=0.8, lt=3), Unit("m")]
    """Mean of both axles."""
    drag_coefficient: Annotated[float, Field(gt=0.05, lt=2), Unit("-")]
    """Of the body in air."""
    frontal_area: Annotated[float, Field(gt=0.5, lt=12), Unit("m^2")]
    """Of the body."""
    rolling_resistance: Annotated[float, Field(ge=0, lt=0.1), Unit("-")]
    """Force over weight."""
    pitch_gradient: Annotated[float, Field(ge=0, lt=0.02), Unit("rad/(m/s^2)")]
    """Nose-down pitch per deceleration, rad per m/s^2."""
    imu_x: Annotated[float, Field(gt=-5, lt=5), Unit("m")]
    """Acceleration sensor ahead of the centre of gravity, m."""
    load_transfer_lag: Annotated[float, Field(ge=0, lt=1), Unit("s")]
    """Of the wheel loads behind the accelerations."""
    ambient_temperature: Annotated[float, Field(gt=-50, lt=60), Unit("degC")] = 15.0
    """Where no sensor reports it, degC."""
    laden_mass: Annotated[float, Field(gt=200, lt=10000), Unit("kg")] | None = None
    """Greatest mass allowed, kg. Without the three of `laden_` the car counts as driven at `mass` alone."""
    laden_front_axle: FrontAxle | None = None
    """Centre of gravity to front axle when laden, m."""
    laden_cog_height: Annotated[float, Field(gt=0.1, lt=3), Unit("m")] | None = None
    """Centre of gravity above the road when laden, m."""

    def loads(self) -> tuple[Load, ...]:
        """Return the states of load that the car is driven in: as configured, and laden if that is given."""
        unladen = Load("unladen", self.mass, self.front_axle, self.cog_height)
        if self.laden_mass is None or self.laden_front_axle is None or self.laden_cog_height is None:
            return (unladen,)
        return unladen, Load("laden", self.laden_mass, self.laden_front_axle, self.laden_cog_height)

    @model_validator(mode="after")
    def _laden(self) -> "Vehicle":
        given = [self.laden_mass, self.laden_front_axle, self.laden_cog_height]
        if given != [None] * 3 and None in given:
            raise ValueError("give all of laden_mass, laden_front_axle and laden_cog_height, or none")
        if self.laden_mass is not None and self.laden_mass < self.mass:
            raise ValueError("laden_mass must not be smaller than mass")
        return self


class Axle(Section):
    """One axle: tyre and brake of each of its two corners."""

    unloaded_radius: Annotated[float, Field(gt=0.15, lt=0.8), Unit("m")]
    """Of the tyre."""
    vertical_stiffness: Annotated[float, Field(gt=5e4, lt=2e6), Unit("N/m")]
    """Of the tyre."""
    wheel_inertia: Annotated[float, Field(gt=0.1, lt=20), Unit("kg m^2")]
    """Of one wheel with disc and hub."""
    slip_stiffness: Annotated[float, Field(gt=3, lt=100), Unit("-")]
    """Longitudinal slip stiffness per wheel load at static load, -."""
    stiffness_degression: Annotated[float, Field(ge=0, lt=0.5), Unit("-")]
    """e in C_L ~ F_Z^(1-e); 0: stiffness proportional to load."""
    pistons: Annotated[int, Field(ge=1, le=12), Unit("-")]
    """Pistons on one side of the disc."""
    piston_diameter: Annotated[float, Field(gt=0.01, lt=0.15), Unit("m")]
    """Of one piston."""
    effective_radius: Annotated[float, Field(gt=0.03, lt=0.4), Unit("m")]
    """Lever of the friction force."""
    mu_nominal: Annotated[float, Field(gt=0.1, lt=1), Unit("-")]
    """Friction of the lining before anything is learned, SAE J2522."""
    push_out_pressure: Annotated[float, Field(ge=0, lt=10), Unit("bar")]
    """Pressure below which the pads do not touch the disc."""
    activation_decel: Annotated[float, Field(ge=0, lt=10), Unit("m/s^2")]
    """The observer of this axle works above this deceleration, m/s^2."""
    disc_heating: Annotated[float, Field(gt=2e-5, lt=2e-3), Unit("K/J")] = 2.111e-4
    """Rise of the disc's temperature per brake work, xi of (3.7), K/J: share of the heat / (mass c_p)."""
    disc_cooling: Cooling = 1.792e-3
    """At standstill, delta_0 of (3.7), 1/s."""
    disc_cooling_by_speed: Annotated[float, Field(ge=0, lt=0.01), Unit("1/m")] = 9.108e-5
    """delta_1 of (3.7), 1/m. Table C.1 prints ten times as much: 400 to 100 degC in a minute at 100 km/h."""
    disc_cooling_wet: Cooling | None = None
    """delta_0 in rain, 1/s; without it as dry."""
    disc_cooling_by_speed_wet: Annotated[float, Field(ge=0, lt=0.02), Unit("1/m")] | None = None
    """delta_1 in rain, 1/m; without it 1.5 times the dry one: Figure 7.15 has no numbers in print."""
    sigma_disc_heating: Doubt = 0.10
    """Relative standard deviation of disc_heating: section 3.4 has c_p of 450 to 550 J/(kg K)."""
    sigma_disc_cooling: Doubt = 0.20
    """Of the cooling rate, relative. Assumption."""
    sigma_disc_cooling_wet: Doubt = 0.40
    """Of the cooling rate in rain, relative. Assumption."""
    pad: Pad = Pad()
    """Its linings and what they wear by."""
    dust: Dust | None = None
    """Particle emission of its brakes; without it the outputs are not available."""

    def wet_cooling(self) -> tuple[float, float]:
        """Return delta_0 [1/s] and delta_1 [1/m] in rain."""
        still, by_speed = self.disc_cooling_wet, self.disc_cooling_by_speed_wet
        return (
            self.disc_cooling if still is None else still,
            WET * self.disc_cooling_by_speed if by_speed is None else by_speed,
        )


class Sensors(Section):
    """Standard deviations of the sensors (Table 4.1), the accelerometer's range, the reference's delay."""

    wheel_speed: Annotated[float, Field(gt=1e-3, lt=10), Unit("rad/s")] = 0.1
    """Standard deviation."""
    accel: Annotated[float, Field(gt=1e-4, lt=5), Unit("m/s^2")] = 0.01
    """Standard deviation."""
    accel_range: Annotated[float, Field(ge=5.0, le=40.0), Unit("m/s^2")] = 20.0
    """A reading beyond it is none, m/s^2: more than car and tyres can do."""
    pressure: Annotated[float, Field(gt=0.01, lt=20), Unit("bar")] = 1.8
    """Standard deviation."""
    vehicle_speed: Annotated[float, Field(gt=1e-3, lt=10), Unit("m/s")] = 0.027
    """Standard deviation."""
    vehicle_speed_delay: Annotated[float, Field(ge=0, lt=1), Unit("s")] = 0.0
    """Of the reference behind the other signals."""
    motor_torque: Annotated[float, Field(ge=0, le=1), Unit("-")] = 0.03
    """Standard deviation over what is reported."""


class Observer(Section):
    """The friction observer and its tuning."""

    kind: Literal["joint", "observer1", "observer2"] = "joint"
    """One filter for the whole car, or the thesis's observers with measured or with virtual wheel forces."""

    relaxation_length: Annotated[float, Field(gt=0.01, lt=5), Unit("m")] = 0.25
    """Of the tyres."""
    cornering_stiffness: Annotated[float, Field(gt=1, lt=100), Unit("1/rad")] = 15.0
    """Of a tyre over its load."""
    min_speed: Annotated[float, Field(gt=0.5, lt=20), Unit("m/s")] = 15 / 3.6
    """Below it nothing is observed."""
    rls_forgetting: Annotated[float, Field(gt=0.01, lt=1), Unit("-")] = 0.7
    """Of K_f, per 10 ms: tyre and road may change within 100 ms (section 4.6)."""
    mu_drift: Annotated[float, Field(gt=1e-4, lt=1), Unit("1/sqrt(s)")] = 0.02
    """Random walk of friction, 1/sqrt(s)."""
    omega_walk: Annotated[float, Field(gt=0.01, lt=100), Unit("rad/s/sqrt(s)")] = 2.0
    """Random walk of wheel speed by torques that are not modelled (road), rad/s/sqrt(s)."""
    force_walk: Annotated[float, Field(gt=1e-3, lt=100), Unit("1/sqrt(s)")] = 0.10
    """Model error of the tyre force relative to the wheel load, 1/sqrt(s)."""
    time_correlation: Annotated[float, Field(gt=0.01, lt=1000), Unit("-")] = 3.0
    """Low-passed slip samples are correlated: the virtual force's variance counts this often."""
    sigma_mu_initial: Annotated[float, Field(gt=1e-3, lt=0.4), Unit("-")] = 0.15
    """Of friction over nominal, before anything is learned."""
    sigma_mass: Doubt = 0.02
    """Relative."""
    sigma_slip_stiffness_ratio: Doubt = 0.04
    """Front to rear, relative."""


class Control(Section):
    """Pedal map, holding at rest, distribution, limits of the pressure demand."""

    pedal_position: Annotated[list[Annotated[float, Field(ge=0, le=100)]], Unit("%")] = Field(
        min_length=2, max_length=PEDAL_POINTS
    )
    """Points of the pedal map."""
    pedal_decel: Annotated[list[Annotated[float, Field(ge=0, le=MAX_DECEL)]], Unit("m/s^2")] = Field(
        min_length=2, max_length=PEDAL_POINTS
    )
    """Deceleration asked for at these points."""
    hold_grade: Annotated[float, Field(ge=0, le=0.5), Unit("-")] = 0.2
    """Steepest grade (tangent) on which the standing car is held, laden and with the linings at - 2 sigma."""
    distribution: Literal["ideal", "fixed", "electronic"] = "ideal"
    """Equal adhesion at both axles, a constant share, or a constant share until the ideal one passes it."""
    front_share: Annotated[Share, Unit("-")] | None = None
    """Of the brake force, for the distributions "fixed" and "electronic"."""
    rear_slip_margin: Annotated[float, Field(ge=0.002, le=0.05), Unit("-")] = 0.01
    """Slip of a rear wheel beyond the front one of its side that takes back the torque of the rear."""
    minimise: Literal["off", "dust", "wear"] = "off"
    """Share the linings' part between the axles, within Annex 5, for least particles or least worn mass, and
    leave to the motors what they can take."""
    max_pressure: Annotated[float, Field(gt=20, le=GREATEST_PRESSURE), Unit("bar")] = GREATEST_PRESSURE
    """Of a demand."""
    max_pressure_rate: Annotated[float, Field(ge=1500, le=18000), Unit("bar/s")] = 3000.0
    """Of a demand; the greatest is all of it in one cycle."""
    compensation: Literal["second-order", "inverse", "off"] = "inverse"
    """How pressure follows friction in a brake application: by (5.8) corrected, by the plain ratio or not."""
    slip_guard: bool = True
    """Hold the pressure back at a wheel that slips beyond its tyre's range."""

    @field_validator("pedal_position", "pedal_decel")
    @classmethod
    def _rising(cls, points: list[float]) -> list[float]:
        if any(b < a for a, b in pairwise(points)):
            raise ValueError("must rise from zero or more")
        return points

    @field_validator("pedal_decel")
    @classmethod
    def _free_at_rest(cls, points: list[float]) -> list[float]:
        if points[0] != 0.0:
            raise ValueError("must start at 0: a pedal at rest brakes nothing")
        return points

    @field_validator("pedal_position")
    @classmethod
    def _distinct(cls, points: list[float]) -> list[float]:
        if len(set(points)) < len(points):
            raise ValueError("names the same position twice")
        return points

    @model_validator(mode="after")
    def _paired(self) -> "Control":
        if len(self.pedal_position) != len(self.pedal_decel):
            raise ValueError("pedal_position and pedal_decel need the same number of points")
        points = list(zip(self.pedal_position, self.pedal_decel, strict=True))
        if any(b[1] - a[1] > PEDAL_GAIN * (b[0] - a[0]) for a, b in pairwise(points)):
            raise ValueError(f"pedal_decel must rise by no more than {PEDAL_GAIN:g} m/s^2 per % of the pedal")
        if float(np.interp(50.0, self.pedal_position, self.pedal_decel)) < HALFWAY:
            raise ValueError(f"pedal_decel must reach {HALFWAY:g} m/s^2 in the first half of the pedal")
        if (self.front_share is None) != (self.distribution == "ideal"):
            raise ValueError('distributions "fixed" and "electronic" need a front_share, "ideal" has its own')
        return self


class Blending(Section):
    """Share f of the brake torque for the motors (5.2): 0 off, 1 series phasing, parallel in between."""

    front: Annotated[float, Field(ge=0, le=1), Unit("-")] = 0.0
    """Of the front axle."""
    rear: Annotated[float, Field(ge=0, le=1), Unit("-")] = 0.0
    """Of the rear axle."""
    fade_speed: Annotated[float, Field(ge=0, lt=20), Unit("m/s")] = 3.0
    """Below it the motors' limit falls with the speed, m/s (Figure A.7); a motor's own map knows better."""


class Config(Section):
    """One vehicle's configuration."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    """Of the vehicle: what is learned is kept under it."""
    transmit: bool = False
    """Armed: pressure demands are flagged valid. Otherwise a shadow that only listens and publishes."""
    can_fd: bool = False
    """Frames of CAN FD are received."""
    vehicle: Vehicle
    """The car."""
    front: Axle
    """Front axle."""
    rear: Axle
    """Rear axle."""
    sensors: Sensors = Sensors()
    """Its sensors."""
    observer: Observer = Observer()
    """Estimation of friction."""
    control: Control
    """From pedal to pressure."""
    hydraulics: Hydraulics = Hydraulics()
    """From pressure demand to pressure."""
    blending: Blending = Blending()
    """Motors and friction brakes."""

    @field_validator("name")
    @classmethod
    def _printable(cls, name: str) -> str:
        if not name.isprintable():
            raise ValueError("must be printable")
        return name

    @model_validator(mode="after")
    def _axles(self) -> "Config":
        if any(load.front_axle >= self.vehicle.wheelbase for load in self.vehicle.loads()):
            raise ValueError(
                "vehicle.front_axle and vehicle.laden_front_axle must be smaller than vehicle.wheelbase"
            )
        if self.control.minimise == "dust" and None in (self.front.dust, self.rear.dust):
            raise ValueError(
                'control.minimise = "dust" needs front.dust and rear.dust; find them by `identify dust`'
            )
        return self
