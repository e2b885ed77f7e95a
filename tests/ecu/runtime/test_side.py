"""What the loop makes of what its side process says, or no longer says."""

import os
import socket

import pytest

from ecu.errors import UserError
from ecu.runtime import side as side_module
from ecu.runtime.side import AWAY, KEPT, NOT_KEPT, READY, REFUSED, SILENCE_NS, Side, word

S = 1_000_000_000


class Started:
    """Stands for the process that was started; the test says what it says."""

    def __init__(self, command, *, pass_fds, **_):
        self.end = socket.socket(fileno=os.dup(pass_fds[0]))
        self.command = command

    def wait(self, timeout=None):
        return 0


@pytest.fixture
def side(tmp_path, monkeypatch):
    monkeypatch.setattr(side_module.subprocess, "Popen", Started)
    side = Side(tmp_path / "ring", ["--state", "x"])
    side.says = side._process.end.send
    return side


def test_one_that_is_ready_and_says_so_again_and_again_keeps(side):
    side.says(READY)
    side.await_ready()
    for second in range(60):
        side.says(word(KEPT, 100 * second))
        assert side.look(second * S)
        assert side.followed == 100 * second


# words after READY, seconds until the loop looks again -> kept
WORDS = {
    "nothing yet": ([], 1, True),
    "nothing for long": ([], SILENCE_NS / S + 1, False),
    "it died": ([word(KEPT, 1), AWAY], 0, False),
    "it died and is back": ([AWAY, word(KEPT, 1)], 0, True),
    "its store is refused": ([word(NOT_KEPT, 1)], 0, False),
    "its store is mended": ([word(NOT_KEPT, 1), word(KEPT, 2)], 0, True),
    "many words": ([word(KEPT, 1)] * 12 + [AWAY], 0, False),
}


@pytest.mark.parametrize(("words", "seconds", "kept"), WORDS.values(), ids=WORDS)
def test_its_words_and_its_silence(side, words, seconds, kept):
    side.says(READY)
    side.await_ready()
    side.look(100 * S)
    for one in words:
        side.says(one)
    assert side.look(int((100 + seconds) * S)) is kept


@pytest.mark.requirement("REQ-PROC-2")
def test_when_all_of_them_are_gone_nothing_is_kept(side):
    side.says(READY)
    side.await_ready()
    side._process.end.close()
    assert not side.look(S)
    assert side.await_end(1.0)


def test_what_the_user_can_mend_is_said(side):
    side.says(REFUSED + b"DIR: cannot record here")
    with pytest.raises(UserError, match="cannot record here"):
        side.await_ready()


@pytest.mark.parametrize("answer", [AWAY, None], ids=["it died", "it does not come"])
def test_brakes_do_not_wait_for_one_that_does_not_come(side, answer, monkeypatch):
    monkeypatch.setattr(side_module, "START_PATIENCE_S", 0.05)
    if answer:
        side.says(answer)
    side.await_ready()
    assert not side.look(S)


def test_one_that_hangs_at_the_end_is_left_alone(side):
    assert not side.await_end(0.05)
