"""`brake-ecu simulate`: a scenario in closed loop; frames, decoded inputs and true values as files."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from brakelab.logs.candump_text import candump_text
from brakelab.results.outputs import check_outputs
from brakelab.results.progress import progress_bar
from brakelab.simulation.closed_loop import START_NS, VEHICLE_BUS, new_loop, run
from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.scenario_car import with_draw
from ecu.errors import UserError
from ecu.output import give, wrote
from ecu.settings.config import load_config
from ecu.settings.resources import command_name


def write_columns(
    path: Path, t: NDArray[np.float64], columns: dict[str, NDArray[np.float64]], metadata: dict[str, str]
) -> None:
    """Write columns as Parquet (zstd) with `t` [s]; NaN becomes null, an empty column is left out."""
    arrays = {"t": pa.array(t)}
    for name, column in columns.items():
        if not np.all(np.isnan(column)):
            arrays[name] = pa.array(column, from_pandas=True)
    pq.write_table(pa.table(arrays).replace_schema_metadata(metadata), path, compression="zstd")


def simulate(scenario: Path, config: Path, out: Path, seed: int = 0, draw: str | None = None) -> int:
    """Run a scenario with the ECU of `config`, armed; write OUT.log, OUT.parquet, OUT.truth.parquet.

    `draw`: width of the car's draw, see `Scenario.draw`; None: that of the scenario.

    Raises:
        UserError: a file cannot be read, is wrong, or cannot be written.
    """
    log, inputs, truth = (out.with_name(out.name + end) for end in (".log", ".parquet", ".truth.parquet"))
    check_outputs(out, (log, inputs, truth), (scenario, config))
    driven = load_scenario(scenario)
    if draw is not None:
        driven = with_draw(driven, draw)
    metadata = {
        "start_time_ns": str(START_NS),
        "scenario": scenario.stem,
        "seed": str(seed),
        "draw": driven.draw,
    }
    with progress_bar("simulate", None):
        result = run(new_loop(driven, load_config(config), seed))
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            log.write_bytes(candump_text(result.frames, VEHICLE_BUS))
            write_columns(inputs, result.t, result.inputs, metadata)
            write_columns(truth, result.t, result.truth, metadata)
        except OSError as error:
            remedy = f"cannot be written ({error.strerror}); choose another --out"
            raise UserError(str(out), "", remedy) from None
    give(seconds=float(result.t[-1]), frames=len(result.frames))
    again = f"brake-ecu replay {log} --config {command_name(config)} --out {out}.result.parquet"
    wrote(log, inputs, truth, next=again)
    return 0
