"""Records that `step` reads and overwrites, and the frame: one memory layout for all users.

Every record is a numpy structured array of length 1 (kernels take `array[0]`), so that daemon, replay and
simulation pass identical bytes and the ring can copy them unchanged.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ecu.contract.faults import IMPLAUSIBLE
from ecu.contract.signals import INPUT, N_INPUTS, N_OUTPUTS, OUTPUT_SIGNALS

RecordArray = NDArray[np.void]

# One CAN frame as received. `stamp_ns` is the kernel's receive time on the real-time clock, cut to whole
# microseconds as in candump logs, so that a log replays to the same bits; in a run less what that clock was
# set by since the start.
FRAME: Final = np.dtype(
    [
        ("stamp_ns", "i8"),
        ("can_id", "u4"),  # 11 or 29 bits, without the kernel's flags
        ("flags", "u1"),
        ("bus", "u1"),
        ("length", "u1"),
        ("spare", "u1"),
        ("data", "u1", (64,)),
    ],
    align=True,
)
FRAME_EXTENDED, FRAME_REMOTE, FRAME_ERROR, FRAME_FD = 1, 2, 4, 8
EXTENDED_ID: Final = 1 << 31
"""Marks a 29-bit identifier wherever one number stands for an identifier."""

E2E_COUNTS: Final = ("late", "lost", "repeated", "wrong")
"""Troubles of protected frames: later than their sender's grid, gaps of lost ones, a count that came again,
checksum, length or sequence wrong. Only the last two are rejected."""

# Inputs of step in cycle k. `value` keeps a signal's last valid sample (never NaN).
INPUTS: Final = np.dtype(
    [
        ("t_ns", "i8"),  # T_k
        ("dt_ns", "i8"),  # (missed periods + 1) * 10 ms
        ("value", "f8", (N_INPUTS,)),
        ("age_ns", "i8", (N_INPUTS,)),  # T_k minus the stamp of the last sample
        ("new", "u1", (N_INPUTS,)),  # a valid sample arrived in this cycle
        ("verdict", "u1", (N_INPUTS,)),  # ALIVE | RATE_OK | VALID
        ("bus_faults", "u4"),  # fault bits known to the service alone (bus off, foreign sender, …)
        ("e2e_faults", "u4"),  # fault bits known to the receiver alone: streams that are loud
        ("overruns", "u4"),
        ("e2e_unsure", "u4"),  # 1: content of a stream may be another sender's: nothing is learned
        ("worst_lateness_us", "f8"),
    ],
    align=True,
)

# Outputs are all float64, so the encoder and results see a plain vector of `OUTPUT_COLUMNS`.
OUTPUTS: Final = np.dtype(
    [(signal.name, "f8", (4,)) if signal.corners else (signal.name, "f8") for signal in OUTPUT_SIGNALS],
    align=True,
)
assert OUTPUTS.itemsize == 8 * N_OUTPUTS

WATCHED: Final = tuple(INPUT[name] for name in IMPLAUSIBLE)
"""Places of the inputs that are compared with others."""
# What the others say of each input, in its unit; see monitoring/witness.py.
INPUT_WATCH: Final = np.dtype(
    [
        ("value", "f8", (N_INPUTS,)),  # as received, NaN: not usable
        ("innovation", "f8", (N_INPUTS,)),  # what it differs from the others by, in the last comparison
        ("sigma", "f8", (N_INPUTS,)),  # standard deviation of that
        ("ratio", "f8", (N_INPUTS,)),  # test ratio, 1 at the gate
        ("judged_s", "f8", (N_INPUTS,)),  # age of that comparison
        ("unused_s", "f8", (N_INPUTS,)),  # since a cycle in which it was used, inf: never
        ("rejected", "u1", (N_INPUTS,)),  # left out, or replaced, in this cycle
    ],
    align=True,
)

# Cycle record of the service beside the outputs; with it and the frames a replay repeats the run.
CYCLE: Final = np.dtype(
    [
        ("number", "i8"),
        ("t_ns", "i8"),  # T_k on the run's time line, that of the frames' stamps: see ecu/runtime/clock.py
        ("t_mono_ns", "i8"),  # T_k on the monotonic clock
        ("clock_set_ns", "i8"),  # by how much the real-time clock was set since the start
        ("missed", "i4"),  # periods missed before this cycle
        ("bus_faults", "u4"),
        ("overruns", "u4"),
        ("frames", "u4"),  # frames consumed in this cycle
        ("late_frames", "u4"),  # of these: stamped before the previous deadline
        ("dropped", "u4"),  # frames the kernel dropped so far (SO_RXQ_OVFL)
        ("e2e", "u4", (len(E2E_COUNTS),)),  # troubles of protected frames so far
        ("worst_lateness_us", "f8"),
        ("lateness_ns", "i8"),
        ("stage_ns", "i8", (5,)),  # drain, receive, step, transmit, send
        ("speaks", "i8"),  # 0: a standby, one that yielded, or a silent run; nothing was sent
    ],
    align=True,
)
N_JOINT: Final = 35
N_KEPT: Final = 24
N_REGRESSORS: Final = 7
N_MEASURED: Final = 8
N_LEGS: Final = 8
# Work of the linings since they were fitted, independent of the wear law: (7.16) and its errors.
WEAR: Final = np.dtype(
    [
        ("regressors", "f8", (N_REGRESSORS, 4)),  # see `REGRESSORS` of monitoring/wear.py
        ("friction_error", "f8", (N_REGRESSORS, 4)),  # standard deviation of these by that of friction
        ("temperature_error", "f8", (N_REGRESSORS, 4)),  # by that of the disc's temperature
        ("odometer", "f8"),  # m, since the record was first made
        ("fitted_at", "f8", (4,)),  # m of the odometer
        ("told", "i8", (4,)),  # 1: these linings were registered as new then
        ("measurements", "i8", (4,)),  # number of measurements stored
        ("measured_wear", "f8", (N_MEASURED, 4)),  # mm below new
        ("measured_sigma", "f8", (N_MEASURED, 4)),  # mm
        ("measured_at", "f8", (N_MEASURED, N_REGRESSORS, 4)),  # regressors then
        ("legs", "i8"),  # distance legs of equal length driven
        ("leg_ends", "f8", (N_LEGS, N_REGRESSORS, 4)),  # regressors at the end of the last legs, in a ring
    ],
    align=True,
)
# Emission of the brakes by the emission models of one version; see monitoring/dust.py.
DUST: Final = np.dtype(
    [
        ("version", "i8"),  # of the models that counted it
        ("particles", "f8"),
        ("way", "f8"),  # m, since these models count
        ("work", "f8"),  # J, of the brakes with a model
        ("told_work", "f8"),  # J, of the applications whose particles are counted
        ("applications", "i8"),  # the particles
    ],
    align=True,
)
# Learned values, carried between brake applications, drives and restarts.
LEARNED: Final = np.dtype(
    [
        ("mu_b", "f8", (4,)),  # base of the next compensation
        ("sigma_mu_b", "f8", (4,)),
        ("observed_s", "f8", (4,)),  # time that this friction was observed, 0: nominal
        ("radius_error", "f8", (4,)),  # relative error of the free rolling radius
        ("radius_sigma", "f8", (4,)),
        ("joint", "f8", (N_JOINT,)),  # the joint observer's states, see its layout
        ("joint_covariance", "f8", (N_KEPT * (N_KEPT + 1) // 2,)),  # covariance, lower triangle by rows
        ("joint_known", "u1"),  # 0: nothing learned yet
        ("spare", "u1", (7,)),  # a gap would be left undefined by copies, and the bytes are compared
        ("whole", "f8", (6,)),  # states learned from whole applications, see its module
        ("whole_covariance", "f8", (21,)),  # lower triangle by rows; 0: nothing learned yet
        ("disc_excess", "f8", (4,)),  # greatest excess over the air left by the last application [K]
        ("brakings", "i8"),  # brake applications since the record was first made
        ("wear", WEAR),
        ("dust", DUST),
    ],
    align=True,
)
STAGES: Final = ("drain", "receive", "step", "transmit", "send")
STAGE_SHARES_NS: Final = (2_000_000, 2_000_000, 2_000_000, 1_000_000, 2_000_000)
"""Of a cycle: four times what 99 % take on a busy machine, and more; together they leave a tenth."""


def e2e_counts(cycle: RecordArray) -> dict[str, int]:
    """Return the troubles of protected frames so far by `E2E_COUNTS`; `cycle` is `CYCLE`, shape (1,)."""
    return dict(zip(E2E_COUNTS, cycle["e2e"][0].tolist(), strict=True))


def new_record(dtype: np.dtype[Any], length: int = 1) -> RecordArray:
    """Return zeroed records of `dtype`, shape (length,)."""
    return np.zeros(length, dtype)


def output_vector(outputs: RecordArray) -> NDArray[np.float64]:
    """Return the outputs as a plain vector in the order of `OUTPUT_COLUMNS` (a view), shape (N_OUTPUTS,)."""
    return outputs.view(np.float64)
