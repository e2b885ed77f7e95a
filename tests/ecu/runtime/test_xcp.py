"""What `run --xcp` is refused for before it starts, and the arguments of its process."""

import pytest

from ecu.errors import UserError
from ecu.runtime.xcp import Settings, Transport, checked_settings, parse_transport, read_settings


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
    word = checked_settings("can:0x7A0:0x7A8", "socketcan", "can 0", {0x50}, silent=False)
    assert read_settings(word) == Settings("can:0x7A0:0x7A8", "socketcan", "can 0")


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
        checked_settings(text, "socketcan", "can0", {0x50, 0x60}, silent)


def test_a_silent_run_is_measured_on_ethernet():
    assert checked_settings("udp:5555", "socketcan", "can0", set(), silent=True)


def test_without_xcp_there_is_nothing_to_tell():
    assert checked_settings(None, "socketcan", "can0", set(), silent=True) is None
