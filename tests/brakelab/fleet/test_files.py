"""Logs on any file system: their size, a mark of their content, and copies to read them."""

import os
from pathlib import Path

import fsspec
import pytest

from brakelab.fleet.files import expand, local_copies, state_of
from ecu.errors import UserError


def test_a_log_far_away_is_copied_and_the_copy_goes() -> None:
    memory = fsspec.filesystem("memory")
    memory.pipe("/far/car/1.log", b"frames")
    assert expand("memory://far/car/*.log") == ["memory:///far/car/1.log"]
    with local_copies(["memory://far/car/1.log"]) as (copy,):
        assert copy.name == "1.log"
        assert copy.read_bytes() == b"frames"
    assert not copy.exists()


def test_a_log_here_is_read_where_it_is(tmp_path: Path) -> None:
    log = tmp_path / "1.log"
    log.write_bytes(b"frames")
    with local_copies([str(log)]) as (path,):
        assert path == log
    assert log.exists()


def test_the_mark_changes_with_the_content(tmp_path: Path) -> None:
    folder = tmp_path / "recording"
    folder.mkdir()
    (folder / "frames.log").write_bytes(b"frames")
    for url in (str(folder), str(folder / "frames.log")):
        size, mark = state_of(url)
        assert (size, mark) == state_of(url)
        assert size == 6
        os.utime(folder / "frames.log", (1.0, 1.0 + len(url)))
        assert state_of(url)[1] != mark


@pytest.mark.parametrize(
    ("url", "line"),
    [("/nowhere/1.log", "no such file"), ("nothing://1.log", "Protocol not known: nothing")],
)
def test_what_cannot_be_had_is_one_line(url: str, line: str) -> None:
    with pytest.raises(UserError, match=line):
        state_of(url)
