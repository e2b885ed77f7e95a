"""What the daemon says to the service manager that started it."""

import socket
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from ecu import service


def test_the_service_manager_hears_that_it_is_ready(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # an address has at most 107 letters
    monkeypatch.setenv("NOTIFY_SOCKET", "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind("notify")
        manager.setblocking(False)
        service._notify("READY=1")
        assert manager.recv(64) == b"READY=1"


@pytest.mark.parametrize(("address", "said"), [("gone", ["not_notified"]), (None, [])])
def test_a_service_manager_that_is_gone_is_one_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: str | None, said: list[str]
) -> None:
    if address is None:
        monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    else:
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / address))
    with capture_logs() as log:
        service._notify("READY=1")
    assert [line["event"] for line in log] == said
