"""What `run --xcp` is refused for before it starts, and the arguments of its process."""

import json
from pathlib import Path

import pytest

from ecu.errors import UserError
from ecu.runtime.xcp import (
    SAVED,
    Calibrating,
    Settings,
    Transport,
    checked_settings,
    parse_transport,
)

NOTHING = Calibrating()


def checked(text, channel="can0", taken=(), silent=False, calibrating=NOTHING, inputs=()):
    return checked_settings(text, "socketcan", channel, set(taken), silent, calibrating, inputs)


@pytest.fixture
def key(tmp_path):
    path = tmp_path / "key"
    path.write_text("00" * 16)
    path.chmod(0o600)
    return path


@pytest.mark.parametrize(
    ("text", "transport"),
    [
        ("udp:127.0.0.1:5555", Transport("udp", "127.0.0.1", 5555)),
        ("udp:5555", Transport("udp", "127.0.0.1", 5555)),
        ("tcp::5556", Transport("tcp", "127.0.0.1", 5556)),
        ("tcp:0.0.0.0:5556", Transport("tcp", "0.0.0.0", 5556)),
        ("can:0x7A0:0x7A8", Transport("can", request=0x7A0, response=0x7A8)),
        ("can:18DA28F1:18DAF128", Transport("can", request=0x18DA28F1, response=0x18DAF128)),
    ],
)
def test_a_transport_is_read(text, transport):
    assert parse_transport(text) == transport


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "give udp:[ADDRESS:]PORT, tcp:[ADDRESS:]PORT or can:REQUEST:RESPONSE"),
        ("5555", "give udp:"),
        ("udp", "give udp:"),
        ("udp:", "give udp:"),
        ("udp:0", "give udp:"),
        ("udp:65536", "give udp:"),
        ("udp:a", "give udp:"),
        ("http:5555", "give udp:"),
        ("can:0x7A0", "give udp:"),
        ("can:0x7A0:0x7A8:0x7A9", "give udp:"),
        ("can:0x7A0:0x7A0", "need an identifier each"),
        ("udp:localhost:5555", "give an IPv4 address, 127.0.0.1 or 0.0.0.0"),
    ],
)
def test_a_transport_that_is_none_is_one_line(text, says):
    with pytest.raises(UserError) as refused:
        parse_transport(text)
    assert str(refused.value).startswith("--xcp: ")
    assert says in str(refused.value)


def test_what_is_checked_reaches_the_process():
    word = checked("can:0x7A0:0x7A8", channel="can 0")
    assert Settings(*json.loads(word)) == Settings("can:0x7A0:0x7A8", "socketcan", "can 0")


def test_files_of_calibration_reach_it_whole(key, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    word = checked("udp:5555", calibrating=Calibrating(Path("key"), Path("new.toml")))
    assert Settings(*json.loads(word))[3:] == (str(tmp_path / "key"), str(tmp_path / "new.toml"))


def test_what_a_calibration_wrote_it_may_renew_unless_the_run_reads_it(key, tmp_path):
    save = tmp_path / "saved.toml"
    save.write_text(f"{SAVED}\n")
    assert checked("udp:5555", calibrating=Calibrating(key, save))
    with pytest.raises(UserError, match="is read by this run"):
        checked("udp:5555", calibrating=Calibrating(key, save), inputs=[save])
    save.write_text("name = 'mine'\n")
    with pytest.raises(UserError, match="exists, and no calibration wrote it"):
        checked("udp:5555", calibrating=Calibrating(key, save))


@pytest.mark.parametrize(
    ("text", "silent", "says"),
    [
        ("can:0x50:0x7A8", False, "--xcp: 0x50: another message has it"),
        ("can:0x7A0:0x60", False, "--xcp: 0x60: another message has it"),
        ("can:0x7A0:0x7A8", True, "a --silent run sends nothing; give udp: or tcp:"),
    ],
)
def test_what_cannot_be_served_is_refused(text, silent, says):
    with pytest.raises(UserError, match=says):
        checked(text, taken={0x50, 0x60}, silent=silent)


def test_a_silent_run_is_measured_on_ethernet():
    assert checked("udp:5555", silent=True)


def test_without_xcp_there_is_nothing_to_tell():
    assert checked(None, silent=True) is None
