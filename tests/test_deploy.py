"""The files for a machine: systemd itself is asked about its own."""

import re
import shlex
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


@pytest.mark.parametrize(("status", "waits"), [("2", True), ("1", False), ("0", False), ("KILL", False)])
def test_no_exit_code_ends_the_service_for_good_and_one_alone_makes_it_wait(status, waits, tmp_path):
    text = (DEPLOY / "brake-ecu.service").read_text()
    assert re.findall(r"^Restart\w*=.*", text, re.M) == ["Restart=always", "RestartSec=0"]
    assert "\nStartLimitIntervalSec=0\n" in text
    command = re.search(r"^ExecStopPost=(.*)", text, re.M)[1].replace("$$", "$")
    pause = tmp_path / "sleep"
    pause.write_text("#!/bin/sh\necho paused for $1\n")
    pause.chmod(0o755)
    environment = {"PATH": str(tmp_path), "EXIT_STATUS": status}
    said = subprocess.run(shlex.split(command), env=environment, capture_output=True, text=True, check=True)
    assert said.stdout == ("paused for 5\n" if waits else "")


def test_nothing_in_the_unit_forbids_what_the_daemon_does():
    text = (DEPLOY / "brake-ecu.service").read_text()
    assert "MemoryDenyWriteExecute" not in text  # kernels are compiled
    assert "AF_CAN" in text
    assert "AF_UNIX" in text


@pytest.mark.parametrize(
    ("given", "taken"), [(None, "/opt/p/cache"), ("", "/opt/p/cache"), ("/run/k", "/run/k")]
)
def test_the_launcher_keeps_to_a_cache_that_is_given(given, taken):
    text = (DEPLOY.parent / "install-onboard.sh").read_text()
    here_document = re.search(r"^cat .*(<<LAUNCHER\n(?:.|\n)*?\nLAUNCHER\n)", text, re.M)[1]
    launcher = subprocess.run(
        ["sh", "-c", f"prefix=/opt/p; cat {here_document}"], capture_output=True, text=True, check=True
    )
    lines = launcher.stdout.replace("exec ", "echo $NUMBA_CACHE_DIR # ")
    environment = {} if given is None else {"NUMBA_CACHE_DIR": given}
    said = subprocess.run(["/bin/sh", "-euc", lines], env=environment, capture_output=True, text=True)
    assert said.stdout == f"{taken}\n"


def test_kernels_that_root_compiled_are_read_by_all_and_written_by_nobody_else():
    lines = (DEPLOY.parent / "install-onboard.sh").read_text().splitlines()
    compiling = next(place for place, line in enumerate(lines) if line.endswith("-m ecu.warm"))
    assert lines[compiling + 1] == 'chmod -R a+rX,go-w "$NUMBA_CACHE_DIR"'


def test_the_image_belongs_to_root_but_for_the_kernels_and_says_whether_it_is_well():
    text = (DEPLOY.parents[1] / "Dockerfile").read_text()
    before, user, after = text.partition("USER brake")
    assert user
    assert re.findall(r"install-onboard.sh (\S+)", before) == ["/opt/brake-ecu"]
    assert re.findall(r"chown -R brake: (\S+)", text) == ["/opt/brake-ecu/cache"]
    assert not re.search(r"install .*-o brake", text)
    assert find_spec(re.search(r"HEALTHCHECK (?:.|\n)*? -m (\S+)", after)[1])
