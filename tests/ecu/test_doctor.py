import json
import subprocess
from pathlib import Path

import pytest

from ecu.bus.receive import new_reception
from ecu.bus.receive_plan import contract_receive_plan
from ecu.bus.transmit import contract_transmit_plan
from ecu.doctor import bit_rate, bus_load, doctor, hydraulics, kernels, machine, messages, rights, unit
from ecu.errors import UserError
from ecu.recording.ring import RingReader
from ecu.settings.config import load_config
from ecu.settings.resources import resource
from ecu.watch.daemons import running

from .watch.conftest import loop, rings

__all__ = ["loop", "rings"]

DBC = Path(__file__).parents[2] / "dbc" / "brake_ecu.dbc"

# message, what was counted in 2 s -> good, a word of the finding
FOUND = {
    "in time": ("Imu", {"received": 200, "accepted": 200}, True, "100/s"),
    "never": ("Imu", {}, False, "not seen"),
    "never, but optional": ("WheelForceFront", {}, True, "optional: friction is estimated without"),
    "a car without motors": ("MotorRear", {}, True, "nothing is learned of the mass"),
    "a unit that says nothing": ("HydraulicStatus", {}, True, "counts as ready"),
    "no thermometer": ("Ambient", {}, True, "that of CONFIG"),
    "no steering angle": ("Steering", {}, False, "not seen"),
    "no pressures": ("CalliperPressureFront", {}, False, "not seen"),
    "too rare": ("Imu", {"received": 50, "accepted": 50}, False, "least"),
    "checksum": ("Imu", {"received": 200, "accepted": 190, "checksum_errors": 10}, False, "10 checksum"),
    "counter stuck": ("Imu", {"received": 200, "accepted": 1, "repeated": 199}, False, "199 repeated"),
    "another's counts": ("Imu", {"received": 9, "accepted": 1, "sequence_errors": 8}, False, "8 sequence"),
    "late ones": ("Imu", {"received": 200, "accepted": 200, "late": 7}, True, "100/s, 7 late, all accepted"),
    "lost ones": ("Imu", {"received": 190, "accepted": 190, "lost": 3}, True, "95/s, 3 gaps, all accepted"),
    "slow by right": ("Ambient", {"received": 2, "accepted": 2}, True, "1/s"),
}


@pytest.mark.parametrize(("name", "counted", "good", "found"), FOUND.values(), ids=FOUND)
def test_a_message_is_judged_by_what_came_of_it(name, counted, good, found):
    plan = contract_receive_plan(DBC)
    reception = new_reception(plan)
    row = plan.messages["name"].tolist().index(name)
    for field, value in counted.items():
        reception.messages[field][row] = value
    if counted:
        reception.messages["stamp_ns"][row] = 1
    check = next(check for check in messages(plan, reception, 2.0) if check.name == name)
    assert (check.good, found in check.found) == (good, True)
    assert good or check.remedy


def test_our_own_frames_are_not_expected():
    plan = contract_receive_plan(DBC)
    assert not any("Demand" in check.name for check in messages(plan, new_reception(plan), 2.0))


def test_the_machine_is_looked_at_and_every_refusal_has_a_remedy():
    checks = {check.name: check for check in machine()}
    assert {"Python", "SCHED_FIFO", "mlockall", "clock", "wake-up", "kernel cache"} <= set(checks)
    assert all(check.good or check.remedy for check in checks.values())


def test_a_kernel_that_cannot_be_compiled_is_a_row(monkeypatch):
    def refuse(ecu, compiled):
        raise UserError("/opt/cache", "", "lacks ecu.step and cannot be written; set NUMBA_CACHE_DIR")

    monkeypatch.setattr("ecu.doctor.warm_up", refuse)
    row = kernels(None, contract_receive_plan(DBC), contract_transmit_plan(DBC, "BrakeEcu"))
    assert (row.good, row.found) == (False, "/opt/cache")
    assert row.remedy.startswith("lacks ecu.step")


@pytest.mark.parametrize(
    ("rate", "good", "found"),
    [
        (None, True, "48% of 500 kbit/s (assumed) at worst: sends 72, receives 169 kbit/s"),
        (1_000_000, True, "24% of 1000 kbit/s at worst"),
        (250_000, False, "96% of 250 kbit/s at worst"),
    ],
)
def test_what_the_frames_take_of_the_bus_is_stated_beforehand(monkeypatch, rate, good, found):
    monkeypatch.setattr("ecu.doctor.bit_rate", lambda channel: rate)
    plans = contract_receive_plan(DBC), contract_transmit_plan(DBC, "BrakeEcu")
    row = bus_load("socketcan", "can0", *plans)
    assert (row.good, found in row.found) == (good, True), row.found
    assert bus_load(None, None, *plans).found == bus_load("virtual", "x", *plans).found


LINK = {"linkinfo": {"info_kind": "can", "info_data": {"bittiming": {"bitrate": 250000}}}}


@pytest.mark.parametrize(
    ("answer", "rate"),
    [(json.dumps([LINK]), 250_000), (json.dumps([{"linkinfo": {"info_kind": "vcan"}}]), None), ("", None)],
    ids=["can", "vcan", "nothing"],
)
def test_the_bit_rate_is_what_ip_says(monkeypatch, answer, rate):
    monkeypatch.setattr(
        subprocess, "run", lambda *given, **more: subprocess.CompletedProcess(given, 0, answer.encode())
    )
    assert bit_rate("can0") == rate


def test_without_ip_the_bit_rate_is_unknown(monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert bit_rate("can0") is None


@pytest.mark.parametrize("arguments", [("virtual", None), (None, "x")])
def test_half_a_bus_is_a_bad_argument(arguments):
    with pytest.raises(UserError, match="give both or none"):
        doctor(None, None, *arguments)


def test_kernels_are_prepared_where_only_the_folder_of_rings_can_be_written(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "read-only"))
    plan = contract_receive_plan(DBC)
    assert kernels(None, plan, contract_transmit_plan(DBC, "BrakeEcu")).found.startswith("from ")


def test_the_rights_are_asked_for_by_the_program_that_runs_wherever_it_is_called(tmp_path, monkeypatch):
    (tmp_path / "ecu").mkdir()
    (tmp_path / "ecu/__init__.py").write_text("raise SystemExit(1)  # a clone's, without its packages\n")
    monkeypatch.chdir(tmp_path)
    assert {"SCHED_FIFO", "mlockall"} <= {check.name for check in rights()}
    monkeypatch.setattr("sys.executable", "/bin/false")
    assert [(check.name, check.good) for check in rights()] == [("real time", False)]


# the unit that is installed -> whether it will do, and what is said
UNITS = {
    "none": (None, True, "not installed"),
    "ours": (resource("tools/deploy/brake-ecu.service").read_text(), True, "brake-ecu.service"),
    "no watchdog": (
        "[Service]\nType=notify\nRestart=always\nExecStopPost=x\n",
        False,
        "WatchdogSec=",
    ),
    "nothing of it": ("[Service]\n#Type=notify\n", False, "Type=notify, WatchdogSec=, Restart="),
}


@pytest.mark.parametrize(("text", "good", "found"), UNITS.values(), ids=UNITS)
def test_the_unit_has_what_the_daemon_relies_on(tmp_path, text, good, found):
    if text is not None:
        (tmp_path / "brake-ecu.service").write_text(text)
    check = unit((tmp_path,))
    assert (check.good, found in check.found) == (good, True)
    assert good or "tools/deploy" in check.remedy


@pytest.mark.parametrize(
    ("rise", "good", "found", "remedy"),
    [
        (0.126, True, "pressures rise 126 ms after their demands (CONFIG: 63 ms): not certain", ""),
        (0.065, True, "pressures follow as [hydraulics] says", ""),
        (float("nan"), True, "not learned in this run", ""),
        (None, True, "not learned in this run", ""),  # no cycle yet
    ],
)
def test_a_running_daemon_says_how_late_its_pressures_are(rise, good, found, remedy, loop):
    run = loop(configuration=load_config(resource("config/suv.toml")).model_dump())
    if rise is not None:
        run.publish(1, pressure_lateness_rise=rise, pressure_lateness_fall=float("nan"))
    check = hydraulics(RingReader(run.ring.path))
    assert (check.name, check.good) == ("hydraulics of suv", good)
    assert found in check.found
    assert remedy in check.remedy


@pytest.mark.parametrize(
    ("interface", "channel", "on"),
    [("socketcan", "can0", True), ("socketcan", "can1", False), ("udp_multicast", "can0", False)],
)
def test_only_daemons_of_that_bus_are_asked(interface, channel, on, loop):
    run = loop()
    assert [one.on_bus(interface, channel) for one in running()] == [on], run
