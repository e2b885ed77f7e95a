"""A drive of one log or several through one ECU: learned values are carried over, time goes on."""

from collections.abc import Callable, Iterator, Sequence
from time import perf_counter
from typing import Final

import numpy as np
from numpy.typing import NDArray

from brakelab.logs.formats import Advance, kind_of, read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.replay.engine import Rows, new_ecu
from brakelab.replay.log import replay_log
from brakelab.replay.quality import Findings
from brakelab.replay.source import Source
from brakelab.results.mcap_file import Frames
from ecu.contract.records import RecordArray
from ecu.contract.signals import CYCLE_NS
from ecu.recording.recorder import Recording, read_recording

_PERIOD: Final = 1e-9 * CYCLE_NS  # s

Write = Callable[[NDArray[np.float64], NDArray[np.float64]], None]


def replay_drive(
    findings: Sequence[Findings],
    params: RecordArray,
    learned: RecordArray | None,
    source: Source,
    write: Write,
    end_log: Callable[[], None],
    advance: Advance,
    recording: Recording | None = None,
) -> RecordArray | None:
    """Replay the logs that `findings` name, in order, and return the learned values, LEARNED of shape (1,).

    `learned` is from before the drive. `write(t, rows)` takes the rows as they come: t [s], shape (n,), and
    shape (n, N_ROW); `end_log()` is called where a log ends, `advance(bytes)` as it is read. `recording`
    gives initial state, T_k and missed periods to an independent log of the same drive.

    Raises:
        UserError: a log is not right.
    """
    shift = 0.0
    for place, found in enumerate(findings):
        ecu = new_ecu(params, learned)
        end, kind, began = shift, kind_of(found.path), perf_counter()
        for rows in replay_log(found.path, ecu, source, recording, found, advance):
            t = _seconds(rows, found, kind)
            if place and found.rows == len(t):  # the first block of a log that goes on
                shift = round(shift - t[0], 9)
            t = np.round(t + shift, 9) if place else t
            found.shift_s = shift
            write(t, rows.values)
            end = float(t[-1]) + _PERIOD
        end_log()
        found.seconds = perf_counter() - began
        shift = end
        learned = ecu.state["learned"].copy()
    return learned


def _seconds(rows: Rows, found: Findings, kind: str) -> NDArray[np.float64]:
    """Return `t` on the log's own axis: a signal file's own, seconds since the first frame otherwise."""
    if kind == "signals":
        return np.where(np.isnan(rows.t), np.round(rows.t_ns * 1e-9, 9), rows.t)
    return np.round((rows.t_ns - found.start_ns) * 1e-9, 9)


def drive_frames(findings: Sequence[Findings]) -> Iterator[Frames]:
    """Read the frames of logs that were replayed once more; stamps from the first row of the drive on."""
    for found in findings:
        if kind_of(found.path) == "signals":
            continue
        recorded = found.path.is_dir()
        log = read_recording(found.path).frames if recorded else found.path
        interfaces: list[str] = []
        for block in read_frames(log, interfaces, LogQuality(), mended=not recorded):
            moved = block.copy()
            moved["stamp_ns"] += round(1e9 * found.shift_s) - found.start_ns
            yield Frames(moved, interfaces)
