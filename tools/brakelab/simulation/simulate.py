"""`brake-ecu simulate`: a scenario in closed loop; frames, decoded inputs and true values as files."""

from contextlib import ExitStack
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from brakelab.arrays import arrow_array
from brakelab.logs.candump_text import candump_text
from brakelab.results.outputs import check_outputs, whole
from brakelab.results.progress import progress_bar
from brakelab.simulation.closed_loop import START_NS, VEHICLE_BUS, new_loop, run_blocks
from brakelab.simulation.scenario import Scenario, load_scenario
from brakelab.simulation.scenario_car import other_car, with_draw, with_plant_for
from brakelab.simulation.vehicle_bus import TRUTH_COLUMNS
from ecu.contract.signals import CYCLE_NS, INPUT_SIGNALS, N_OUTPUTS
from ecu.output import argument, give, say, wrote
from ecu.settings.config import Config, load_config
from ecu.settings.resources import command_name

ROWS: Final = 100_000
"""Of a row group: minutes of a drive, so that one of hours needs no second copy of itself."""
SIGNALS: Final = tuple(signal.name for signal in INPUT_SIGNALS)


def write_columns(
    path: Path, t: NDArray[np.float64], columns: dict[str, NDArray[np.float64]], metadata: dict[str, str]
) -> None:
    """Write columns as Parquet (zstd) with `t` [s]; NaN becomes null, an empty column is left out."""
    given = {"t": t} | {name: column for name, column in columns.items() if not np.all(np.isnan(column))}
    types = [(name, pa.from_numpy_dtype(column.dtype)) for name, column in given.items()]
    schema = pa.schema(types).with_metadata(metadata)
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        for first in range(0, len(t), ROWS):
            rows = slice(first, first + ROWS)
            arrays = [arrow_array(given[field.name][rows], field.type) for field in schema]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))


class Simulated(NamedTuple):
    """A simulated drive whose files are written."""

    scenario: Scenario
    """With the car and the draw that were asked for."""
    vehicle: Config
    t: NDArray[np.float64]
    outputs: NDArray[np.float64]
    """By `OUTPUT_COLUMNS`, shape (n, N_OUTPUTS); without a row where the scenario expects nothing."""
    truth: NDArray[np.float64]
    """By `TRUTH_COLUMNS`, shape (n, N_TRUTH)."""
    path: Path
    """File of the truth."""


def simulate(
    scenario: Path,
    config: Path,
    out: Path,
    seed: int = 0,
    draw: str | None = None,
    plant: str | None = None,
    printed: bool = True,
) -> Simulated:
    """Run a scenario with the ECU of `config`, armed; write OUT.log, OUT.parquet, OUT.truth.parquet.

    `draw`: width of the car's draw, see `Scenario.draw`; `plant`: the car's file or name, or "as-config",
    which is made in OUT.plant/; None: the scenario's. `printed`: False for use from Python, which
    prints nothing.

    Raises:
        UserError: a file cannot be read, is wrong, or cannot be written.
    """
    log, inputs, truth = (out.with_name(out.name + end) for end in (".log", ".parquet", ".truth.parquet"))
    check_outputs(out, (log, inputs, truth), (scenario, config))
    vehicle = load_config(config)
    driven = with_plant_for(load_scenario(scenario), plant, vehicle, out.with_name(out.name + ".plant"))
    if printed and (differs := other_car(driven, vehicle)):
        say(f"brake-ecu: {differs}")
    if draw is not None:
        driven = with_draw(driven, draw)
    metadata = {
        "start_time_ns": str(START_NS),
        "scenario": scenario.stem,
        "seed": str(seed),
        "draw": driven.draw,
    }
    decoded: list[NDArray[np.float64]] = []
    true: list[NDArray[np.float64]] = []
    outputs = [np.empty((0, N_OUTPUTS))]
    frames = 0
    with progress_bar("simulate", None, printed):
        loop = new_loop(driven, vehicle, seed)
        with ExitStack() as files:
            parts = [files.enter_context(whole(path)) for path in (log, inputs, truth)]
            with parts[0].open("wb") as text:
                for block in run_blocks(loop):
                    text.write(candump_text(block.frames, VEHICLE_BUS))
                    decoded.append(block.decoded.copy())
                    true.append(block.truth.copy())
                    if driven.expect:
                        outputs.append(block.outputs.copy())
                    frames += len(block.frames)
            t = np.arange(sum(map(len, true)), dtype=np.float64) * (1e-9 * CYCLE_NS)
            for path, names, blocks in ((parts[1], SIGNALS, decoded), (parts[2], TRUTH_COLUMNS, true)):
                write_columns(path, t, dict(zip(names, np.concatenate(blocks).T, strict=True)), metadata)
    if printed:
        give(seconds=float(t[-1]), frames=frames)
        car, result = argument(command_name(config)), argument(f"{out}.result.parquet")
        again = f"brake-ecu replay {argument(log)} --config {car} --out {result}"
        wrote(log, inputs, truth, next=again)
    return Simulated(driven, vehicle, t, np.concatenate(outputs), np.concatenate(true), truth)
