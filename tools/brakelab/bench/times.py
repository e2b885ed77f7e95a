"""Benches of times: subject of each, and the note below its table."""

from collections.abc import Callable
from typing import Final, NamedTuple

from brakelab.bench import codec, cycle, plant, step
from brakelab.studies.accuracy.table import time_table
from brakelab.studies.measure import Row, machine, plain_row
from brakelab.studies.study import Measured
from ecu.runtime.exchange import LEAD_NS


class Bench(NamedTuple):
    """One bench of times."""

    rows: Callable[[], list[Row]]
    title: str
    below: str


BENCHES: Final = {
    "step": Bench(
        step.step_rows,
        "step",
        f"Processor time of a cycle with four wheels, {step.CYCLES} cycles of braking in each of "
        f"{step.ROUNDS} rounds. All filters get the same inputs and give the same friction.",
    ),
    "codec": Bench(
        codec.codec_rows,
        "codec",
        f"Processor time of a message: the 13 protected inputs of the contract, {codec.CYCLES} cycles in "
        f"each of {codec.ROUNDS} rounds. Ours with CRC, counter and (decoding) freshness, the peer without.",
    ),
    "plant": Bench(
        plant.plant_rows,
        "plant",
        f"Time of the simulated vehicle per millisecond of its drive: {plant.STEPS} steps of 1 ms in each of "
        f"{plant.ROUNDS} rounds, braking in a curve on a rough road from 50 m/s. Processor time "
        "unless by the clock.",
    ),
    "cycle": Bench(
        cycle.cycle_rows,
        "cycle",
        f"Time by the clock, {cycle.CYCLES} cycles of 10 ms in each of {cycle.ROUNDS} rounds, in real time "
        "but without real-time rights: 39 frames in, 6 out, over a socket pair that carries can_frames. Ours "
        f"is the daemon's cycle: awake {LEAD_NS // 1000} µs before the deadline, it drains what has come by "
        "then, here all, and rehearses, which is in no stage. The peer checks nothing and runs the four "
        "filters alone.",
    ),
}


def run_times(name: str | None) -> Measured:
    """Run one of `BENCHES`, or all."""
    line = machine()
    chosen = {key: value for key, value in BENCHES.items() if name in (None, key)}
    rows = {key: value.rows() for key, value in chosen.items()}
    plain = {"machine": line} | {key: [plain_row(row) for row in value] for key, value in rows.items()}
    tables = [time_table(chosen[key].title, rows[key], chosen[key].below) for key in rows]
    return Measured(tables, f". {line}", plain)
