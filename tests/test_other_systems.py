"""Simulation, replay and report where the system has neither SocketCAN nor POSIX locks and schedulers."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.study

WITHOUT = """
import os, socket, sys
for name in [name for name in vars(socket) if name.startswith(("AF_CAN", "PF_CAN", "CAN_"))]:
    delattr(socket, name)
for name in ("fcntl", "resource", "termios", "tty", "pty", "pwd", "grp"):
    sys.modules[name] = None
for name in [name for name in vars(os) if name.startswith("sched_")]:
    delattr(os, name)
from ecu.cli import main
for arguments in (
    "simulate single --config suv --out drive",
    "replay drive.log --config suv --out result.parquet",
    "report result.parquet --truth drive.truth.parquet --out report.html",
):
    assert not (code := main(arguments.split())), (arguments, code)
"""


def test_a_drive_is_simulated_replayed_and_reported(tmp_path) -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "report.html").stat().st_size > 1e6
