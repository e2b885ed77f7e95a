"""Result files of a rig's drive, whether driven in real time or in memory."""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.logs.candump_text import candump_text
from brakelab.replay.engine import Rows, new_ecu
from brakelab.replay.log import replay_log
from brakelab.replay.quality import Findings
from brakelab.replay.source import load_source
from brakelab.results.car import KEY as CAR
from brakelab.results.car import car_of
from brakelab.results.files import MEASURED, ResultWriter
from brakelab.results.pads import pads_of
from brakelab.simulation.closed_loop import START_NS, Loop
from brakelab.simulation.closed_loop import Drive as Simulated
from brakelab.simulation.simulate import write_columns
from ecu import __version__
from ecu.bus.receive import Reception
from ecu.contract.signals import CYCLE_NS, N_OUTPUTS, OUTPUT_COLUMNS
from ecu.recording.recorder import Recording, read_recording
from ecu.settings.config import Config, config_hash, new_params


class Frames(NamedTuple):
    """Counts of the vehicle's frames at the ECU."""

    received: int = 0
    rejected: int = 0
    """By E2E: checksum, sequence, repeated, length."""
    lost: int = 0
    """As the counters tell, or dropped by the kernel."""

    def plus(self, reception: Reception, dropped: int) -> "Frames":
        """Return the sum with another run's."""
        ours = reception.messages[reception.messages["accepted"] > 0]
        rejected = int(reception.totals[0]["rejected"])
        lost = int(ours["lost"].sum()) + dropped
        return Frames(self.received + int(ours["received"].sum()), self.rejected + rejected, self.lost + lost)


class Written(NamedTuple):
    """One drive's results."""

    result: Path
    frames: Frames
    differing: int
    """Values that a replay of the recorded frames did not give again; in memory nothing is replayed."""


def _provenance(writer: ResultWriter, config: Config, start_ns: int) -> None:
    writer.provenance = {
        "version": __version__,
        "vehicle": config.name,
        "observer": config.observer.kind,
        "config_hash": config_hash(config),
        CAR: car_of(config),
        "start_time_ns": str(start_ns),
    }


def write_simulated(loop: Loop, drive: Simulated, config: Config, out: Path) -> Written:
    """Write frames.log, truth.parquet and result.parquet of a drive in memory."""
    result = out / "result.parquet"
    (out / "frames.log").write_bytes(candump_text(drive.frames, "can0"))
    write_columns(out / "truth.parquet", drive.t, drive.truth, {"start_time_ns": str(START_NS)})
    measured = [_held(drive.inputs[signal.name]) for signal in MEASURED]
    rows = np.column_stack([*(drive.outputs[name] for name in OUTPUT_COLUMNS), *measured])
    lives = np.isfinite(drive.outputs["mode"])
    params = new_params(config)
    with ResultWriter(result, params) as writer:
        _provenance(writer, config, START_NS)
        writer.write(drive.t[lives], rows[lives])
        writer.pads = pads_of(params, loop.sides.state["learned"], config)
    return Written(result, Frames().plus(loop.sides.ecu_reception, 0), 0)


def _held(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a column with gaps filled by the last value."""
    places = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), 0))
    return values[places]


def write_recorded(recordings: Iterable[Path], config: Config, out: Path) -> Written:
    """Replay the daemons' recordings, one after the other, into result.parquet; compare every value."""
    result, source = out / "result.parquet", load_source(None)
    frames, differing, start_ns, last_ns = Frames(), 0, 0, 0
    params = new_params(config)
    with ResultWriter(result, params) as writer:
        for folder in recordings:
            recording, findings = read_recording(folder), Findings(folder)
            ecu = new_ecu(params, None)
            blocks = list(replay_log(folder, ecu, source, None, findings, lambda size: None))
            differing += _differing(recording, blocks)
            assert findings.reception is not None
            frames = frames.plus(findings.reception, int(recording.cycles["dropped"][-1]))
            for rows in blocks:
                start_ns = start_ns or int(rows.t_ns[0])
                if not writer.provenance:
                    _provenance(writer, config, start_ns)
                later = rows.t_ns >= last_ns + CYCLE_NS // 2  # a standby continues where the first one ended
                if later.any():
                    t = np.array(1e-9 * (rows.t_ns[later] - start_ns), np.float64)
                    writer.write(np.round(t, 9), rows.values[later])
                    last_ns = int(rows.t_ns[-1])
            writer.pads = pads_of(params, ecu.state["learned"], config)
    return Written(result, frames, differing)


def _differing(recording: Recording, blocks: list[Rows]) -> int:
    """Return the number of daemon values that replay did not reproduce bit by bit."""
    live = np.ascontiguousarray(recording.outputs).view(np.float64).reshape(len(recording.outputs), -1)
    again = np.concatenate([rows.values[:, :N_OUTPUTS] for rows in blocks])
    if live.shape != again.shape:
        return max(live.size, again.size)
    return int(np.count_nonzero((live != again) & ~(np.isnan(live) & np.isnan(again))))
