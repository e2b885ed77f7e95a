"""Rear wheels that the slip guard caps by what the road carries at others: for the heading, or unseen.

A rear wheel has no more than `ABOVE_LOW` of what the road carries at the other one (select-low): with ice on
one side its tyre has the force across that keeps the car's heading. One that does not slip itself follows
the other's cap, and shows nothing of the road.

A rear wheel whose speed is not known is capped by what the road carries at the front wheel of its side, at
`SLIDING` of that, since frictions differ by axle; on an even road, where both front wheels slip, at `BESIDE`
of what the other rear wheel carries. One that was pressed harder may stand: it is eased until it has spun up.
A front wheel that stands costs little force and no stability, so it is left.

Assumption: all constants; found with simulated vehicles on friction of 0.1 to 1.2.
"""

from ecu.algorithm.brake import brake_gain
from ecu.algorithm.inputs import usable
from ecu.contract.params import BAR
from ecu.contract.signals import WHEEL_SPEED
from ecu.jit import Record, kernel

ABOVE_LOW = 1.2
SLIDING, BESIDE = 0.6, 0.9  # of what the road carries at most: a tyre that slides, and as the seen rear one
CLIMBS = 1.3  # over `grip`, until a wheel slips anew
EASED, EMPTIES_S = 0.5, 0.12  # of what a sliding tyre carries; dead time and lag of the hydraulics


@kernel
def _shows(state: Record, inputs: Record, i: int) -> bool:
    """Return whether a wheel's slip shows what the road carries."""
    capped = state.capped[i] != 0 and state.follows[i] == 0
    shows: bool = capped and state.denied[i] == 0 and usable(inputs, WHEEL_SPEED + i)
    return shows


@kernel
def _force(params: Record, estimate: Record, i: int, pressure: float) -> float:
    """Return the force along the road [N] of a pressure [Pa] at a wheel."""
    mu = estimate.mu[i] if estimate.mu[i] > 0.0 else params.mu_nominal[i]
    force: float = brake_gain(params, i) * mu * pressure / params.wheel_radius[i]
    return force


@kernel
def _adhesion(params: Record, state: Record, estimate: Record, i: int) -> float:
    """Return the adhesion that a wheel's slip shows, less its climb until it slips anew."""
    known = state.grip[i] if state.slides[i] else max(state.grip[i], state.cap[i] / CLIMBS)
    adhesion: float = _force(params, estimate, i, max(known, BAR)) / max(estimate.load[i], 1.0)
    return adhesion


@kernel
def hold_unseen(
    params: Record, state: Record, inputs: Record, estimate: Record, speed: float, i: int, dt: float
) -> None:
    """Cap a rear wheel whose speed is not known by what the road carries; before, let it spin up."""
    if usable(inputs, WHEEL_SPEED + i):
        state.let_go_s[i] = 0.0
        return
    state.follows[i] = 0
    state.let_go_s[i] = max(state.let_go_s[i] - dt, 0.0)
    ahead, across, beside = i - 2, 3 - i, 5 - i
    known, share = 0.0, 0.0
    if _shows(state, inputs, ahead):
        known, share = _adhesion(params, state, estimate, ahead), SLIDING
        if _shows(state, inputs, across) and usable(inputs, WHEEL_SPEED + beside):
            known *= _adhesion(params, state, estimate, beside) / _adhesion(params, state, estimate, across)
            share = BESIDE if _shows(state, inputs, beside) else 0.0
    if share > 0.0:
        carried = max(BAR, known * estimate.load[i] / _force(params, estimate, i, 1.0))
        most = share / SLIDING * carried if state.capped[i] else carried
        if state.pressed[i] > most and state.let_go_s[i] == 0.0:
            mass = params.wheel_inertia[i] / params.wheel_radius[i] ** 2
            gains = (1.0 - EASED) * SLIDING * _force(params, estimate, i, carried)
            state.let_go_s[i] = EMPTIES_S + abs(speed) * mass / gains
        state.capped[i], state.grip[i], state.cap[i] = 1, carried, share * carried
    if state.let_go_s[i] > 0.0:
        state.slides[i], state.cap[i] = 1, EASED * SLIDING * state.grip[i]


@kernel
def select_low(state: Record, inputs: Record, sent: Record, wanted: Record) -> None:
    """Cap a rear wheel by what the road carries at the other one; hold it while that slips."""
    for i in range(2, 4):
        low = 5 - i
        if not _shows(state, inputs, low):
            continue
        most = ABOVE_LOW * (state.cap[low] if state.follows[i] else max(state.cap[low], state.grip[low]))
        if state.slides[low]:
            most = max(sent[i], state.pressed[i])
        if most < wanted[i]:
            if not state.capped[i]:
                state.capped[i], state.grip[i], state.cap[i] = 1, most, most
                state.follows[i] = 1 if usable(inputs, WHEEL_SPEED + i) else 0
            state.cap[i] = most if state.follows[i] else min(state.cap[i], most)
