"""Columns of a drive, read when they are asked for."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.report.drive import DriveResult
from brakelab.results import columns as module
from brakelab.results.columns import Columns, open_columns

ROWS = 100


@pytest.mark.parametrize(
    ("kept", "asked", "read"),
    [(2, "aab", "ab"), (2, "abcab", "abcab"), (2, "abacb", "abcb"), (3, "abcabc", "abc"), (0, "aaba", "aba")],
)
def test_the_last_columns_are_kept(monkeypatch: pytest.MonkeyPatch, kept: int, asked: str, read: str) -> None:
    monkeypatch.setattr(module, "KEPT", kept * 8 * ROWS)
    reads = []

    def column(name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        reads.append(name)
        return np.full(ROWS, float(ord(name)))

    columns = Columns("abc", column)
    assert [columns[name][0] for name in asked] == [ord(name) for name in asked]
    assert "".join(reads) == read


def test_a_drive_without_columns_holds_no_number_of_them() -> None:
    drive = DriveResult(np.arange(3.0), {"a": np.ones(3), "b": np.ones(3)}, {}).without({"a"})
    assert (drive.has("a"), drive.has("b"), list(drive.columns)) == (False, True, ["b"])


def test_a_file_whose_name_is_gone_is_read_on(tmp_path: Path) -> None:
    path = tmp_path / "drive.parquet"
    pq.write_table(pa.table({"t": [0.0, 0.01], "word": ["a", None]}), path)
    stored = open_columns(path, "give another")
    path.unlink()
    assert stored.numbers("t").tolist() == [0.0, 0.01]
    assert stored.columns["word"].tolist() == ["a", None]
