"""One step, two lives: what the daemon computed on a real bus, an independent log of that bus gives again.

`candump` writes the log beside the daemon; only the instants of the cycles and the state before the first
one come from the daemon's own recording. Every column must agree in every bit, also when a share of the
frames is lost and when the daemon was held up for several periods.
"""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.replay.command import replay
from ecu.contract.records import output_vector
from ecu.contract.signals import OUTPUT_COLUMNS
from ecu.recording.recorder import read_recording

from .conftest import ENVIRONMENT, ROOT

pytestmark = pytest.mark.socketcan

CONFIG = ROOT / "config" / "suv.toml"
SCENARIO = """
plant = "suv"
initial_speed = 22.0
[[phase]]
kind = "coast"
seconds = 3.0
[[phase]]
kind = "brake"
decel = 4.0
until_speed = 0.5
"""


@pytest.mark.parametrize(
    ("lost_share", "held_up_s"),
    [(0.0, ()), (0.05, ()), (0.05, (0.035, 0.12))],
    ids=["undisturbed", "5 % of frames lost", "5 % lost and overruns"],
)
def test_an_independent_log_gives_the_same_bits(daemon, witness, tmp_path, lost_share, held_up_s):
    scenario = tmp_path / "scenario.toml"
    lossy = f'[[fault]]\nkind = "lost"\nt = 0.0\nshare = {lost_share}\n' if lost_share else ""
    scenario.write_text(SCENARIO + lossy, encoding="utf-8")
    unit = daemon("--config", CONFIG, "-i", "socketcan", "-c", "vcan0", "--record", tmp_path / "record")
    unit.wait_for("ready")
    independent = witness()
    command = [
        sys.executable,
        "-m",
        "ecu.cli",
        "vehicle",
        scenario,
        "--alone",
        "-i",
        "socketcan",
        "-c",
        "vcan0",
    ]
    with subprocess.Popen(command, env=ENVIRONMENT, stdout=-1) as vehicle:
        assert vehicle.stdout is not None
        vehicle.stdout.readline()
        for seconds in held_up_s:
            time.sleep(2.5)
            unit.process.send_signal(signal.SIGSTOP)
            os.waitpid(unit.process.pid, os.WUNTRACED)  # it stands still
            time.sleep(seconds)
            unit.process.send_signal(signal.SIGCONT)
        vehicle.wait()
    assert unit.end() == 0

    recording = read_recording(tmp_path / "record")
    independent.lines_until(recording.frames.read_text().splitlines()[-1])
    result = tmp_path / "result.parquet"
    replay([independent.log], CONFIG, None, None, None, result, recording.folder)
    live = np.array([output_vector(row.reshape(1)) for row in recording.outputs])
    table = pq.read_table(result)
    assert table.num_rows == len(live)
    assert (recording.cycles["missed"] + 1).sum() > 500  # the whole drive, however many cycles it took
    if held_up_s:
        assert recording.cycles["missed"].sum() >= len(held_up_s)
    for place, name in enumerate(OUTPUT_COLUMNS):
        again = table[name].to_numpy(zero_copy_only=False).astype(float)
        differing = np.flatnonzero((live[:, place] != again) & ~(np.isnan(live[:, place]) & np.isnan(again)))
        assert not len(differing), f"{name}: {len(differing)} of {len(live)} rows, first {differing[0]}"
