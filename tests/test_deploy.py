"""The files for a machine: systemd itself is asked about its own."""

import re
import shutil
import subprocess
from importlib.util import find_spec
from pathlib import Path

import pytest

from ecu.runtime.notify import Manager

DEPLOY = Path(__file__).parent.parent / "tools" / "deploy"


def test_systemd_accepts_the_unit(tmp_path):
    program = shutil.which("systemd-analyze")
    if program is None:
        pytest.skip("no systemd-analyze on this machine")
    text = (DEPLOY / "brake-ecu.service").read_text()
    unit = tmp_path / "brake-ecu.service"
    unit.write_text(text.replace("/opt/brake-ecu/bin/brake-ecu", "/bin/true"))  # it wants to find the program
    said = subprocess.run([program, "verify", unit], capture_output=True, text=True, check=False)
    assert (said.returncode, said.stderr) == (0, "")
    unit.write_text(unit.read_text().replace("WatchdogSec", "WatchdogSecs"))
    assert "WatchdogSecs" in subprocess.run([program, "verify", unit], capture_output=True, text=True).stderr


def test_the_watchdog_waits_for_four_signs_of_life():
    text = (DEPLOY / "brake-ecu.service").read_text()
    assert "\nWatchdogSec=1\n" in text
    assert Manager({"NOTIFY_SOCKET": "x", "WATCHDOG_USEC": "1000000"}).watchdog_cycles == 25


def test_nothing_in_the_unit_forbids_what_the_daemon_does():
    text = (DEPLOY / "brake-ecu.service").read_text()
    assert "MemoryDenyWriteExecute" not in text  # kernels are compiled
    assert "AF_CAN" in text
    assert "AF_UNIX" in text


def test_the_image_belongs_to_root_but_for_the_kernels_and_says_whether_it_is_well():
    text = (DEPLOY.parents[1] / "Dockerfile").read_text()
    before, user, after = text.partition("USER brake")
    assert user
    assert re.findall(r"install-onboard.sh (\S+)", before) == ["/opt/brake-ecu"]
    assert re.findall(r"chown -R brake: (\S+)", text) == ["/opt/brake-ecu/cache"]
    assert not re.search(r"install .*-o brake", text)
    assert find_spec(re.search(r"HEALTHCHECK (?:.|\n)*? -m (\S+)", after)[1])
