"""A stream that may lose lines and does nothing else to who writes."""

import os
import socket
import stat
import subprocess
import sys
from contextlib import suppress

import pytest

from ecu.recording.sink import Sink

LINE = "x" * 1000 + "\n"


@pytest.fixture
def pipe():
    reading, writing = os.pipe()
    yield reading, writing
    for handle in (reading, writing):
        with suppress(OSError):
            os.close(handle)


def test_what_is_written_can_be_read(pipe):
    Sink(pipe[1]).write("said\n")
    assert os.read(pipe[0], 100) == b"said\n"


@pytest.mark.parametrize("late", [False, True], ids=["from the start", "later"])
@pytest.mark.requirement("REQ-LOOP-5")
def test_a_reader_that_is_gone_is_no_matter(pipe, late):
    if not late:
        os.close(pipe[0])
    sink = Sink(pipe[1])
    if late:
        os.close(pipe[0])
    assert sink.write(LINE) == len(LINE)
    assert sink.dropped == 1


def test_a_closed_descriptor_is_no_matter_nor_is_who_gets_its_number(pipe, tmp_path):
    os.close(pipe[1])
    sink = Sink(pipe[1])
    other = os.open(tmp_path / "other", os.O_RDWR | os.O_CREAT)
    os.dup2(other, pipe[1])
    sink.write(LINE)
    assert sink.dropped == 1
    assert (tmp_path / "other").read_bytes() == b""


def test_closed_standard_streams_are_nobody_else_s(tmp_path):
    script = (
        "import os, sys; from ecu.recording.sink import free_output; os.closerange(0, 3); free_output()\n"
        "os.write(os.open(sys.argv[1], os.O_WRONLY | os.O_CREAT), b'%d' % os.dup(0))"
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path / "number")], check=True)
    assert int((tmp_path / "number").read_bytes()) > 2


@pytest.mark.requirement("REQ-LOOP-5")
def test_a_reader_that_does_not_read_costs_lines_that_are_counted(pipe):
    sink = Sink(pipe[1])
    for _ in range(200):
        sink.write(LINE)
    lost = sink.dropped
    assert 100 < lost < 200
    content = b""
    while len(content) < (200 - lost) * len(LINE):
        content += os.read(pipe[0], 1 << 16)
    sink.write("again\n")
    end = os.read(pipe[0], 1 << 16).decode()
    assert end.splitlines()[-2:] == [f'{{"event": "lines_dropped", "count": {lost}}}', "again"]


def test_one_that_cannot_be_opened_anew_does_not_block_either(pipe, monkeypatch):
    monkeypatch.setattr("ecu.recording.sink._set_free", lambda handle: False)  # another user's terminal
    sink = Sink(pipe[1])
    for _ in range(200):
        sink.write(LINE)
    assert sink.dropped > 100


def test_a_socket_as_the_journal_gives_it(pipe):
    ours, theirs = socket.socketpair()
    sink = Sink(ours.fileno())
    sink.write("said\n")
    assert theirs.recv(100) == b"said\n"
    for _ in range(2000):
        sink.write(LINE)
    assert sink.dropped > 0


@pytest.mark.requirement("REQ-LOOP-5")
def test_a_full_disk_is_no_matter():
    with open("/dev/full", "wb") as full:
        sink = Sink(full.fileno())
        sink.write(LINE)
    assert sink.dropped == 1


def test_the_shell_keeps_its_stream_as_it_was(pipe):
    own = os.dup(pipe[1])
    Sink(own)
    assert stat.S_ISFIFO(os.fstat(own).st_mode)
    assert not os.get_blocking(own)
    assert os.get_blocking(pipe[1])
    os.close(own)


@pytest.mark.parametrize("redirection", [">", ">>"])
def test_lines_of_a_shared_file_follow_each_other(redirection, tmp_path):
    ours = "from ecu.recording.sink import free_output; free_output(); print('ours')"
    script = f'{{ echo before; "$0" -c "$1"; echo after; }} {redirection} log'
    (tmp_path / "log").write_text("earlier\n")
    subprocess.run(["sh", "-c", script, sys.executable, ours], cwd=tmp_path, check=True)
    kept = ["earlier"] if redirection == ">>" else []
    assert (tmp_path / "log").read_text().split() == [*kept, "before", "ours", "after"]
