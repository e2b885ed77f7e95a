"""The example of docs/testing.md as a user runs it, in virtual and in real time."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from brakelab.testing.daemon import PATIENCE_S

ROOT = Path(__file__).parents[3]


@pytest.mark.multicast
@pytest.mark.study
def test_the_example_passes_in_both_times(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.+?)```", (ROOT / "docs/testing.md").read_text("utf-8"), re.S)
    (tmp_path / "test_town.py").write_text(code, "utf-8")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-m", "pytest", "-p", "brakelab.testing.plugin", "--strict-markers"]
    done = subprocess.run(
        [*command, "-p", "no:cacheprovider", "-rs", "test_town.py"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 passed" in done.stdout


def test_a_daemon_that_cannot_start_says_so(daemon) -> None:
    unit = daemon("--config", "nosuch", "-i", "virtual", "-c", "x")
    assert unit.end(None) == 2
    assert "nosuch" in unit.other[0]
