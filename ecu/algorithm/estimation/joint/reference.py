"""Measurement of vehicle speed by a reference whose delay is a state."""

from ecu.algorithm.estimation.joint.kalman import clear_derivatives, correct
from ecu.algorithm.estimation.joint.layout import DELAY, REFERENCE_RATIO, V
from ecu.algorithm.estimation.joint.sliding import wheels_agree
from ecu.jit import Record, kernel

JUMP = 100.0  # test ratio squared: above it a reference that no wheel contradicts is trusted at once


@kernel
def correct_by_reference(params: Record, state: Record) -> None:
    """Correct the state by the mean of this window's samples."""
    w, x = state.window, state.x
    clear_derivatives(state)
    state.h[V], state.h[DELAY] = 1.0, -w.reference_change
    ratio = correct(state, w.reference, params.sigma_vehicle_speed**2 / w.reference_samples)
    state.ratio[REFERENCE_RATIO] = ratio
    wheels_slide = state.hold_s > 0.0
    if ratio > JUMP and (wheels_slide or wheels_agree(params, state, x[V] + w.reference)):
        x[V] += w.reference
        state.p[V, V] += 0.25
