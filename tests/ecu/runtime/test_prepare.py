"""What is said while kernels compile; whole starts are in tests/system."""

import sys
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from ecu.errors import UserError
from ecu.runtime import prepare
from ecu.runtime.notify import Manager
from ecu.runtime.xcp import Calibrating
from ecu.settings.resources import resource

CONFIG = resource("config/suv.toml")


def test_compiling_is_a_line_at_once_then_every_five_seconds_and_none_in_operation(monkeypatch):
    now_s = [100.0]
    monkeypatch.setattr(prepare.time, "monotonic", lambda: now_s[0])
    monkeypatch.setattr(prepare, "lower_priority", lambda: None)
    progress = prepare.CompileProgress(Manager({}))
    with capture_logs() as lines:
        for count in range(60):
            progress(count)
            now_s[0] += 0.5
        progress.is_over = True
        for count in range(60, 120):
            progress(count)
            now_s[0] += 0.5
    assert [line["done"] for line in lines] == [0, 10, 20, 30, 40, 50]
    assert all("python -m ecu.warm" in line["remedy"] for line in lines)


def test_a_package_that_is_missing_is_installed_for_the_python_that_runs(monkeypatch):
    monkeypatch.setattr(prepare, "find_spec", lambda name: None)
    options = prepare.RunOptions(Path("suv.toml"), "virtual", "x", metrics="127.0.0.1:9476")
    with pytest.raises(UserError) as refused:
        prepare.prepare(options)
    assert str(refused.value).endswith(f"{sys.executable} -m pip install prometheus-client")


DBC = """VERSION ""
BU_: Car Unit
BO_ 10 Wheels: 8 Car
 SG_ v_fl : 0|16@1+ (0.01,0) [0|655] "km/h" Unit
BO_ 20 Brake: 8 Unit
 SG_ p : 0|16@1+ (1,0) [0|0] "kPa" Car
BO_ 21 Long: 12 Unit
 SG_ t : 0|16@1+ (1,0) [0|0] "N m" Car
"""
MAP = """database = "car.dbc"
rolling_radius = 0.3
[messages]
Wheels = { period = 0.01 }
MESSAGE = { period = 0.01 }
[inputs]
wheel_speed_fl = { message = "Wheels", signal = "v_fl" }
[outputs]
OUTPUT
"""
PRESSURE = 'pressure_demand_fl = { message = "Brake", signal = "p", invalid = 0 }'
TORQUE = 'torque_demand_fl = { message = "Long", signal = "t", invalid = 0 }'


@pytest.mark.parametrize(
    ("message", "output", "more", "line"),
    [
        ("Long", TORQUE, {}, "can_fd: Long of the map is a CAN FD frame; set it to true"),
        (
            "Brake",
            PRESSURE,
            {"standby": True},
            "--standby: knows the first one by 2 messages with a checksum",
        ),
        (
            "Brake",
            PRESSURE,
            {"silent": True, "armed": True},
            "--silent: sends nothing, so it is neither armed",
        ),
        ("Brake", PRESSURE, {"silent": True, "standby": True}, "--silent: sends nothing, so it is neither"),
    ],
    ids=["FD", "standby", "silent and armed", "silent and standby"],
)
def test_what_a_run_cannot_send_is_refused(tmp_path, message, output, more, line):
    (tmp_path / "car.dbc").write_text(DBC)
    (tmp_path / "car.toml").write_text(MAP.replace("MESSAGE", message).replace("OUTPUT", output))
    options = prepare.RunOptions(CONFIG, "virtual", "x", tmp_path / "car.toml", **more)
    with pytest.raises(UserError, match=line):
        prepare.prepare(options)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"diagnostics": "0x7E0"}, "--diagnostics: 0x7E0: give the identifiers of request and response"),
        (
            {"diagnostics": "0x50:0x7E8"},
            "--diagnostics: 0x50: another message has it; choose one that is free",
        ),
        (
            {"diagnostics": "0x7E0:0x7E8", "silent": True},
            "--diagnostics: 0x7E0:0x7E8: answers on the bus, where a --silent run",
        ),
        ({"diagnostics_key": Path("short")}, "is for a tester; give --diagnostics too"),
        (
            {"diagnostics": "0x7E0:0x7E8", "diagnostics_key": Path("short")},
            "no key: write 16 bytes or more in hex",
        ),
        ({"xcp": "5555"}, "--xcp: 5555: give udp:[ADDRESS:]PORT, tcp:[ADDRESS:]PORT or can:REQUEST:RESPONSE"),
        ({"xcp": "can:0x50:0x7A8"}, "--xcp: 0x50: another message has it; choose one that is free"),
        (
            {"xcp": "can:0x7E0:0x7A8", "diagnostics": "0x7E0:0x7E8"},
            "--xcp: 0x7E0: another message has it; choose one that is free",
        ),
        (
            {"xcp": "can:0x7A0:0x7A8", "silent": True},
            "answers on the bus, where a --silent run sends nothing; give udp: or tcp:",
        ),
        ({"calibrating": Calibrating(Path("key"))}, "is for a master; give --xcp too"),
        (
            {"xcp": "udp:1", "calibrating": Calibrating(None, Path("new.toml"))},
            "is for calibration; give --xcp-key too",
        ),
        ({"xcp": "udp:1", "calibrating": Calibrating(Path("key"), Path("car.toml"))}, "is read by this run"),
        (
            {"xcp": "udp:1", "calibrating": Calibrating(Path("key"), Path("key"))},
            "exists, and no calibration wrote it",
        ),
        (
            {"xcp": "udp:1", "calibrating": Calibrating(Path("key"), Path("none/x.toml"))},
            "its folder does not exist",
        ),
        (
            {"xcp": "udp:1", "calibrating": Calibrating(Path("open"))},
            "others may read this secret; chmod 600 it",
        ),
    ],
)
def test_what_cannot_be_served_is_refused_before_the_bus_is_opened(tmp_path, monkeypatch, options, says):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(prepare, "open_channel", None)
    config = Path("car.toml")
    config.write_bytes(CONFIG.read_bytes())
    for key, text, mode in (("key", "0" * 64, 0o600), ("short", "0" * 6, 0o600), ("open", "0" * 64, 0o644)):
        Path(key).write_text(text)
        Path(key).chmod(mode)
    with pytest.raises(UserError) as refused:
        prepare.prepare(prepare.RunOptions(config, "virtual", "x", **options))
    assert says in str(refused.value)
    assert config.read_bytes() == CONFIG.read_bytes()
