"""A calibration is taken over between two cycles, or refused, by the loop: standing still, or not armed.

The other process has checked the parameters as a CONFIG file is, and made all that is derived from them. What
is left to do here is a look at one number ten times a second, and, once it is another one, a copy. What a
workshop does to the learned values, armed or not, has to stand with released brakes.
"""

from ecu.algorithm.control.demand import STANDING_TIME
from ecu.algorithm.estimate import STANDING
from ecu.algorithm.inputs import LEAST_REQUEST
from ecu.contract.work import from_record
from ecu.recording.calibration import KEPT, check_of
from ecu.recording.ring import Ring
from ecu.runtime.memory import Ecu
from ecu.workshop import do


def consider(ring: Ring, ecu: Ecu, number: int, now_ns: int) -> None:
    """Take over the calibration that is asked for, or refuse it.

    Args:
        ring: of the loop.
        ecu: its parameters are overwritten, and its state where there is work on it.
        number: of the cycle to come.
        now_ns: on the monotonic clock.
    """
    wanted = ring.asked["number"][0]
    header = ring.header
    if wanted == header["answered"][0]:
        return
    page = int(ring.asked["page"][0]) & 1
    if check_of(ring, page) != ring.asked["check"][0] and now_ns < ring.asked["until_ns"][0]:
        return  # not all of it has arrived
    work = from_record(ring.pages["work"][page])
    if now_ns < ring.asked["until_ns"][0] and (may_change(ecu) if work is None else rests(ecu)):
        kept = [ecu.params[name].copy() for name in KEPT]
        ecu.params[0] = ring.pages[page]["params"]
        for name, value in zip(KEPT, kept, strict=True):
            ecu.params[name] = value
        if work is not None:
            do(work, ecu.params, ecu.state)
        header["page"], header["calibrated_from"] = page, number
        header["calibration"] = ring.pages["number"][page]
    header["answered"] = wanted


def may_change(ecu: Ecu) -> bool:
    """Return whether no demand that somebody obeys while driving is made by the parameters."""
    return not ecu.params["transmit"][0] or _stands(ecu)


def rests(ecu: Ecu) -> bool:
    """Return whether the car stands, and nobody brakes or asks for it; False where that is not known."""
    asked, braking = ecu.outputs["decel_demand_total"][0], ecu.state["application"]["braking"][0]
    return _stands(ecu) and bool(asked < LEAST_REQUEST and not braking)


def _stands(ecu: Ecu) -> bool:
    stood_s = float(ecu.state["demand"]["standing_s"][0])
    estimate = ecu.estimate
    return bool(stood_s >= STANDING_TIME and estimate["started"][0] and estimate["speed"][0] < STANDING)
