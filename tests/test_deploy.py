"""The files for a machine: systemd itself is asked about its own."""

import re
import shlex
import shutil
import subprocess
from importlib.util import find_spec, module_from_spec, spec_from_file_location
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


@pytest.mark.requirement("REQ-PROC-3")
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
    assert "MemoryDenyWriteExecute" not in text  # kernels may have to be compiled
    assert "ReadWritePaths" not in text  # a path that is not there would end every start
    assert "AF_CAN" in text
    assert "AF_UNIX" in text


def test_the_image_is_root_s_without_a_compiler_and_says_whether_it_is_well():
    text = (DEPLOY.parents[1] / "Dockerfile").read_text()
    made, _, image = text.rpartition("\nFROM ")
    before, user, after = image.partition("USER brake")
    assert user
    assert re.findall(r"install-onboard.sh (\S+)", made) == ["/opt/brake-ecu"]
    assert re.findall(r"COPY --from=build (\S+) (\S+)", before) == [("/opt/brake-ecu", "/opt/brake-ecu")]
    assert "apt-get" not in image
    assert "\nVOLUME /home/brake\n" in after, "as its user, whose folder it is"
    assert re.search(r"-v \S+:/home/brake .*\n.*--state /home/brake/", text)
    assert "chown" not in text
    assert find_spec(re.search(r"HEALTHCHECK (?:.|\n)*? -m (\S+)", after)[1])


@pytest.mark.parametrize("words", [(), ("--metrics",), ("/a", "/b"), ("--metrics", "/a", "/b")])
def test_the_installation_on_board_takes_one_folder(words):
    script = DEPLOY.parent / "install-onboard.sh"
    said = subprocess.run(["sh", script, *words], capture_output=True, text=True)
    assert (said.returncode, said.stdout) == (2, "")
    assert said.stderr == "install-onboard: usage: tools/install-onboard.sh [--metrics] PREFIX\n"


@pytest.mark.parametrize("made", [True, False])
def test_a_wheel_is_of_one_platform_where_it_holds_a_library(made, tmp_path):
    pytest.importorskip("hatchling")
    spec = spec_from_file_location("wheel_tag", DEPLOY.parent / "wheel_tag.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    if made:
        (tmp_path / "ecu" / "compiled").mkdir(parents=True)
        (tmp_path / "ecu" / "compiled" / "manifest.json").write_text("{}")
    hook = module.WheelTag(str(tmp_path), {}, None, None, str(tmp_path), "wheel")
    for version in ("standard", "editable"):
        changed = {}
        hook.initialize(version, changed)
        assert ("tag" in changed) is (made and version == "standard")
