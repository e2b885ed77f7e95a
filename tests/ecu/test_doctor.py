from pathlib import Path

import pytest

from ecu.bus.receive import new_reception
from ecu.bus.receive_plan import contract_receive_plan
from ecu.doctor import doctor, kernels, machine, messages, unit
from ecu.errors import UserError
from ecu.settings.resources import resource

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
    row = kernels(None, contract_receive_plan(resource("dbc/brake_ecu.dbc")))
    assert (row.good, row.found) == (False, "/opt/cache")
    assert row.remedy.startswith("lacks ecu.step")


@pytest.mark.parametrize("arguments", [("virtual", None), (None, "x")])
def test_half_a_bus_is_a_bad_argument(arguments):
    with pytest.raises(UserError, match="give both or none"):
        doctor(None, None, *arguments)


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
