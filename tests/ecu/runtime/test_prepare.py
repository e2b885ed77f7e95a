"""What is said while kernels compile; whole starts are in tests/system."""

from structlog.testing import capture_logs

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
