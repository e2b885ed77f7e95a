"""Many tunings through recorded drives at once: open loop, a whole population in one compiled call.

The estimate changes the pressures little, and these the measurements little; so a tuning may be judged on
inputs recorded with another one.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Array
from brakelab.identify.tuning.recording import Errors, Recording, mean_errors
from ecu.algorithm.step import new_state, step
from ecu.contract.records import OUTPUTS, RecordArray, new_record
from ecu.jit import kernel
from ecu.settings.config import Config, new_params


@kernel
def _replay(
    params: Any, states: Any, outputs: Any, inputs: Any, mu_b: Array, braking: NDArray[np.int64], sums: Array
) -> None:
    """Add squares, truth, samples, samples inside 2 sigma to `sums`, shape (tunings, applications, 2, 4)."""
    for one in range(len(params)):
        for k in range(len(inputs)):
            step(params[one : one + 1], states[one : one + 1], inputs[k : k + 1], outputs[one : one + 1])
            if braking[k] < 0:
                continue
            for i in range(4):
                error = outputs[one].mu_b[i] - mu_b[k, i]
                total = sums[one, braking[k], i // 2]
                total[0] += error * error
                total[1] += mu_b[k, i]
                total[2] += 1.0
                total[3] += abs(error) <= 2.0 * outputs[one].sigma_mu_b[i]


def replay_errors(recordings: Iterable[Recording], configs: Sequence[Config]) -> list[Errors]:
    """Return the errors over the recorded session for each tuning; every recording brakes at least once."""
    params = np.concatenate([new_params(config) for config in configs])
    start = np.concatenate([new_state(params[i : i + 1]) for i in range(len(params))])
    per_drive = [_drive_errors(recording, params, start) for recording in recordings]
    return [mean_errors(errors) for errors in zip(*per_drive, strict=True)]


def _drive_errors(recording: Recording, params: RecordArray, start: RecordArray) -> list[Errors]:
    sums = np.zeros((len(params), recording.braking.max() + 1, 2, 4))
    _replay(params, start.copy(), new_record(OUTPUTS, len(params)), *recording, sums)
    squares, truth, samples, inside = np.moveaxis(sums, -1, 0)
    nrmse = 100.0 * np.sqrt(squares / samples) / (truth / samples)
    return [
        Errors(*both)
        for both in zip(nrmse.mean(axis=1), (100.0 * inside / samples).mean(axis=1), strict=True)
    ]
