"""What is said while kernels compile; whole starts are in tests/system."""

import sys
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from ecu.errors import UserError
from ecu.runtime import prepare
from ecu.runtime.notify import Manager


def test_compiling_is_a_line_at_once_then_every_five_seconds_and_none_in_operation(monkeypatch):
    now_s = [100.0]
    monkeypatch.setattr(prepare.time, "monotonic", lambda: now_s[0])
    monkeypatch.setattr(prepare, "lower_priority", lambda: None)
    progress = prepare.CompileProgress(Manager({}))
    with capture_logs() as lines:
        for count in range(60):
            progress(count)
            now_s[0] += 0.5
        progress.is_over = True
        for count in range(60, 120):
            progress(count)
            now_s[0] += 0.5
    assert [line["done"] for line in lines] == [0, 10, 20, 30, 40, 50]
    assert all("python -m ecu.warm" in line["remedy"] for line in lines)


def test_a_package_that_is_missing_is_installed_for_the_python_that_runs(monkeypatch):
    monkeypatch.setattr(prepare, "find_spec", lambda name: None)
    options = prepare.RunOptions(Path("suv.toml"), "virtual", "x", metrics="127.0.0.1:9476")
    with pytest.raises(UserError) as refused:
        prepare.prepare(options)
    assert str(refused.value).endswith(f"{sys.executable} -m pip install prometheus-client")
