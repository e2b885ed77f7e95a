"""Compilation ahead of use: a second process finds every kernel in the cache."""

import subprocess
import sys

import pytest


@pytest.mark.compiled
def test_what_was_compiled_once_is_loaded_by_the_next_process() -> None:
    runs = [
        subprocess.run([sys.executable, "-m", "brakelab.warm"], capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert runs[1].stdout.splitlines() == ["0 kernels compiled", "0 kernels of the laboratory compiled"]
