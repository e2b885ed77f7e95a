"""Errors of a window's pressures and motor torques, for every measurement predicted from them."""

from ecu.jit import Record, kernel

COLOURED = 20.0  # factor on the variance of white noise: the error of an inverter's torque is not white
SKEW_FOLLOWED, SKEW_REPORTED = 0.5, 3.0  # windows between pressure and force; more in foreign logs


@kernel
def skew(state: Record, i: int) -> float:
    """Return the error of a pressure [bar] that acts earlier or later than its time stamp."""
    windows = SKEW_FOLLOWED if state.follows[i] else SKEW_REPORTED
    return windows * (state.smooth_pressure[i] - state.last_smooth[i])


@kernel
def motor_variance(state: Record, i: int, braking: bool) -> float:
    """Return the variance of a wheel's mean motor torque in this window [(N m)^2]."""
    variance: float = state.motors.variance[i] / state.window.cycles
    return variance if braking else COLOURED * variance
