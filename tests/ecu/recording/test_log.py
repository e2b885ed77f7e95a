"""Format and level of the daemon's log, chosen for all its processes by the environment."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ecu.output import LOG_FORMAT, LOG_LEVEL
from ecu.recording.log import Throttle

SCRIPT = (
    "import structlog\nfrom ecu.recording.log import configure_logging\nconfigure_logging()\n"
    "log = structlog.get_logger('ecu')\nlog.debug('read')\nlog.info('ready', cycle=1)\nlog.error('fault')"
)


@pytest.mark.parametrize(
    ("form", "level", "events"),
    [
        ("", "", ["ready", "fault"]),
        ("json", "quiet", ["fault"]),
        ("json", "verbose", ["read", "ready", "fault"]),
        ("console", "", ["ready", "fault"]),
        ("console", "quiet", ["fault"]),
    ],
)
def test_format_and_level(form: str, level: str, events: list[str]) -> None:
    """Standard error is no terminal here: JSON unless the console's format is asked for."""
    environment = {**os.environ, LOG_FORMAT: form, LOG_LEVEL: level}
    said = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        cwd=Path(__file__).parents[3],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    ).stderr.splitlines()
    if form == "console":
        assert [line.split("]")[1].split()[0] for line in said] == events
        assert "\x1b" not in "".join(said)
    else:
        assert [json.loads(line)["event"] for line in said] == events


def test_one_line_a_second_per_cause() -> None:
    clock = iter([0.0, 0.5, 0.6, 0.7, 1.1])
    throttle = Throttle(lambda: next(clock))
    passed = [throttle.passes(cause) for cause in ("late", "late", "missed", "late", "late")]
    assert passed == [0, None, 0, None, 2]
