"""Compilation ahead of use: a second process finds every kernel in the cache."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.study, pytest.mark.compiled]

WARM = [sys.executable, "-m", "brakelab.warm"]


@pytest.fixture(scope="module")
def warmed() -> None:
    subprocess.run(WARM, capture_output=True, check=True)


@pytest.mark.usefixtures("warmed")
def test_what_was_compiled_once_is_loaded_by_the_next_process() -> None:
    again = subprocess.run(WARM, capture_output=True, text=True, check=True)
    assert again.stdout.splitlines() == ["0 kernels compiled", "0 kernels of the laboratory compiled"]


@pytest.mark.usefixtures("warmed")
@pytest.mark.parametrize("scenario", ["fade", "blending-40", "low-grip"])
def test_a_first_drive_compiles_nothing(scenario: str, tmp_path: Path) -> None:
    """Other linings, motors and roads than the one that warming drives."""
    brake_ecu = [sys.executable, "-m", "ecu.cli", "--verbose"]
    for line in (
        f"simulate {scenario} --config suv --out drive",
        "replay drive.log --config suv --out result.parquet",
    ):
        done = subprocess.run(
            [*brake_ecu, *line.split()], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        assert "compiling" not in done.stderr
        assert "next: brake-ecu " in done.stderr
