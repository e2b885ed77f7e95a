import gc

import pytest
from structlog.testing import capture_logs

from ecu.runtime import realtime


def refused():
    raise PermissionError(1, "Operation not permitted")


# what the kernel grants -> the verdicts, the lines that are logged
GRANTS = {
    "everything": ((True, True), [("SCHED_FIFO", True), ("mlockall", True), ("affinity", True)], []),
    "no priority": ((False, True), [("SCHED_FIFO", False), ("mlockall", True)], ["SCHED_FIFO"]),
    "nothing": ((False, False), [("SCHED_FIFO", False), ("mlockall", False)], ["SCHED_FIFO", "mlockall"]),
}


@pytest.mark.parametrize(("granted", "verdicts", "lines"), GRANTS.values(), ids=GRANTS)
def test_each_refusal_is_one_line_with_its_remedy(monkeypatch, granted, verdicts, lines):
    answers = [(lambda: None) if grant else refused for grant in granted]
    requests = tuple(
        (name, answer, remedy) for (name, _, remedy), answer in zip(realtime.REQUESTS, answers, strict=True)
    )
    monkeypatch.setattr(realtime, "REQUESTS", requests)
    monkeypatch.setattr(realtime, "AFFINITY", ("affinity", lambda: None, ""))
    try:
        with capture_logs() as logged:
            found = realtime.make_realtime()
        assert not gc.isenabled()
    finally:
        gc.enable()
        gc.unfreeze()
    assert [(verdict.name, verdict.granted) for verdict in found] == verdicts
    assert [line["what"] for line in logged] == lines
    assert all("limits.conf" in line["remedy"] for line in logged)
