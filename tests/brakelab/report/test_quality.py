"""Data quality from a result's metadata: logs put together, what is off marked."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.report.drive import DriveResult
from brakelab.report.quality import quality_tiles, read_quality
from ecu.errors import UserError

from .conftest import INPUT_COUNTS, MESSAGE_COUNTS


def log(
    input: dict[str, Any] | None = None, message: dict[str, Any] | None = None, **more: Any
) -> dict[str, Any]:
    counts = {"rows": 1000, "frames": 5000, "samples": 0, "seconds": 0.05, "dropped": 0}
    return (
        counts
        | {"inputs": [INPUT_COUNTS | (input or {})], "messages": [MESSAGE_COUNTS | (message or {})]}
        | more
    )


def drive(*logs: dict[str, Any]) -> DriveResult:
    names = [{"name": f"{place}.log", "sha256": ""} for place in range(len(logs))]
    return DriveResult(np.arange(2.0), {}, {"quality": json.dumps(logs), "inputs": json.dumps(names)})


def row(*logs: dict[str, Any]) -> list[tuple[str, bool]]:
    quality = read_quality(drive(*logs), Path("r.parquet"))
    assert quality is not None
    return [tuple(cell) for cell in quality.inputs[0][1]]


CLEAN = [
    ("100.0", False),
    ("100", False),
    ("0.02", False),
    ("0", False),
    ("0", False),
    ("0", False),
    ("0", False),
]


@pytest.mark.parametrize(
    ("change", "place", "cell"),
    [
        ({}, 0, ("100.0", False)),
        ({"samples": 800}, 0, ("80.0", True)),
        ({"samples": 1200}, 0, ("120.0", True)),
        ({"samples": 800, "expected_hz": [10.0, 100.0]}, 0, ("80.0", False)),
        ({"samples": 800, "expected_hz": []}, 0, ("80.0", False)),
        ({"greatest_gap_s": 0.3}, 2, ("0.30", True)),
        ({"invalid": 10}, 3, ("1.00", True)),
        ({"outside": 1}, 4, ("0.10", True)),
        ({"clipped": 3}, 5, ("3", True)),
        ({"jumps": 1}, 6, ("1", True)),
    ],
)
def test_what_is_off_is_marked(change: dict[str, Any], place: int, cell: tuple[str, bool]) -> None:
    found = row(log(change))
    assert found[place] == cell
    same = [other for other in range(len(CLEAN)) if other not in (place, 0, 1)]
    if change.get("samples", 1000) == 1000:
        assert [found[other] for other in same] == [CLEAN[other] for other in same]


def test_logs_are_put_together() -> None:
    found = row(log({"jumps": 1, "least": None, "greatest": None}), log({"jumps": 2, "greatest_gap_s": 0.05}))
    assert [text for text, _ in found] == [
        "100.0", "100", "0.05", "0", "0", "0", "3", "\N{MINUS SIGN}4", "1", "m/s²",
    ]  # fmt: skip
    quality = read_quality(drive(log(message={"lost": 2}), log(message={"lost": 3})), Path("r.parquet"))
    assert quality is not None
    assert [cell.text for cell in quality.messages[0][1]] == [
        "072",
        "2000",
        "100.0",
        "100",
        "0",
        "0",
        "0",
        "0",
        "5",
    ]


def test_tiles() -> None:
    long = {"rows": 30_000, "seconds": 1.5} | {"inputs": [INPUT_COUNTS | {"samples": 30_000}]}
    clean = read_quality(drive(log(**long), log(**long)), Path("r.parquet"))
    assert clean is not None
    marked, speed = quality_tiles(clean)
    assert (marked.value, marked.warns) == ("0", False)
    assert (speed.value, speed.note) == ("200", "60000 rows in 3.0 s: 20000 rows/s")
    damaged = read_quality(drive(log({"jumps": 1}, damaged_lines=7, dropped=2)), Path("r.parquet"))
    assert damaged is not None
    tile = quality_tiles(damaged)[0]
    assert (tile.value, tile.warns) == ("1", True)
    assert tile.note == "7 lines damaged, 2 frames dropped by the kernel; accel_x"


def test_what_never_came_is_named_and_no_metadata_is_no_page() -> None:
    quality = read_quality(drive(log({"samples": 0})), Path("r.parquet"))
    assert quality is not None
    assert (quality.silent, quality.inputs) == (["accel_x"], [])
    assert read_quality(DriveResult(np.arange(2.0), {}, {}), Path("r.parquet")) is None


@pytest.mark.parametrize("text", ["{", '[{"rows": 3}]', "[3]", '[{"rows": 1, "samples": 0, "inputs": [{}]}]'])
def test_damaged_metadata_gives_one_line(text: str) -> None:
    metadata = {"quality": text, "inputs": '[{"name": "a.log"}]'}
    with pytest.raises(UserError, match=r"^r\.parquet: metadata quality: not readable"):
        read_quality(DriveResult(np.arange(2.0), {}, metadata), Path("r.parquet"))
