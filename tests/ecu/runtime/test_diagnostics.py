"""What `run --diagnostics` is refused for before it starts, and the arguments of its process."""

import json
import sys
from pathlib import Path

import pytest

from ecu.errors import UserError
from ecu.runtime import diagnostics
from ecu.runtime.diagnostics import Settings, checked_settings, read_secret


def key_file(folder, text="00112233445566778899aabbccddeeff\n", mode=0o600):
    path = folder / "key"
    path.write_text(text)
    path.chmod(mode)
    return path


def test_what_is_checked_reaches_the_process(tmp_path):
    key = key_file(tmp_path)
    word = checked_settings("socketcan", "can 0", "7E0:7E8", key, {0x50}, silent=False)
    assert Settings(*json.loads(word)) == Settings("socketcan", "can 0", "7E0:7E8", str(key))
    assert read_secret(key) == bytes.fromhex("00112233445566778899aabbccddeeff")


def test_without_can_isotp_it_is_one_line(monkeypatch):
    monkeypatch.setattr(diagnostics, "find_spec", lambda name: None)
    with pytest.raises(UserError) as refused:
        checked_settings("socketcan", "can0", "7E0:7E8", None, set(), silent=False)
    assert str(refused.value) == f"--diagnostics: needs can-isotp: {sys.executable} -m pip install can-isotp"


def test_without_diagnostics_there_is_nothing_to_tell():
    assert checked_settings("socketcan", "can0", None, None, set(), silent=True) is None


@pytest.mark.parametrize(
    ("text", "mode", "says"),
    [
        ("00112233445566778899aabbccddeeff", 0o640, "others may read this secret; chmod 600 it"),
        ("00112233445566778899aabbccddee", 0o600, "no key: write 16 bytes or more in hexadecimal"),
        ("a secret", 0o600, "no key: write 16 bytes"),
        ("schlüssel", 0o600, "no key: write 16 bytes"),
        ("", 0o600, "no key: write 16 bytes"),
    ],
)
def test_a_key_file_that_is_none_is_one_line(text, mode, says, tmp_path):
    with pytest.raises(UserError, match=says):
        read_secret(key_file(tmp_path, text, mode))


def test_a_key_file_that_is_not_there_is_one_line():
    with pytest.raises(UserError, match="cannot be read: No such file"):
        read_secret(Path("/nowhere/key"))


@pytest.mark.parametrize(
    ("addresses", "key", "silent", "says"),
    [
        (None, Path("key"), False, "--diagnostics-key: key: is for a tester; give --diagnostics too"),
        ("7E0:7E8", None, True, "answers on the bus, where a --silent run sends nothing"),
        ("7E0", None, False, "give the identifiers of request and response"),
        ("50:7E8", None, False, "0x50: another message has it"),
    ],
)
def test_what_cannot_be_served_is_one_line(addresses, key, silent, says):
    with pytest.raises(UserError) as refused:
        checked_settings("socketcan", "can0", addresses, key, {0x50}, silent)
    assert says in str(refused.value)
