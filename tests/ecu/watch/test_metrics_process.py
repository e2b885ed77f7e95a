import http.client
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from ecu.watch.metrics_process import NO_RING, Shared, new_handler, open_server
from ecu.watch.serve import Handler

ROOT = Path(__file__).parents[3]


def ask(port, path, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    return answer.status, answer.headers["Content-Type"], answer.read().decode()


@pytest.fixture
def served(rings, serve_here):
    shared = Shared(rings / "brake-ecu.1.4711.ring")
    return shared, serve_here(new_handler(shared)).server_port


def test_health_follows_the_loop(served, loop):
    shared, port = served
    shared.turn()
    assert ask(port, "/health")[::2] == (503, f"{NO_RING}\n")
    one = loop()
    shared.turn()
    assert ask(port, "/health")[::2] == (503, "no cycle yet\n")
    one.cycle["t_mono_ns"] = 40_000_000_000
    one.publish_frames(one.frames[:0])
    shared.tally._now_s = lambda: 40.2
    assert ask(port, "/health")[::2] == (200, "ok\n")
    shared.tally._now_s = lambda: 40.6
    assert ask(port, "/health")[::2] == (503, "no cycle for 0.6 s\n")
    one.close(by="SIGTERM")
    assert ask(port, "/health")[::2] == (503, "the run has ended: SIGTERM\n")


def test_metrics_in_the_form_that_is_asked_for(served, loop):
    shared, port = served
    assert ask(port, "/metrics")[0] == 200  # there is no loop yet
    one = loop()
    one.publish(5)
    shared.turn()
    status, kind, text = ask(port, "/metrics")
    assert (status, kind.partition(";")[0]) == (200, "application/openmetrics-text")
    assert "brake_ecu_cycles_total 5.0\n" in text
    assert text.endswith("# EOF\n")
    assert ask(port, "/metrics", Accept="text/plain")[1].startswith("text/plain")
    assert ask(port, "/")[::2] == (404, "/metrics or /health\n")


@pytest.mark.parametrize("path", ["/metrics", "/health"])
def test_a_page_whose_name_was_bent_to_this_machine_reads_nothing(served, path):
    assert ask(served[1], path, Host="evil.example:9476")[::2] == (403, "ask for 127.0.0.1 or localhost\n")


def test_a_port_that_is_taken_is_tried_again(monkeypatch, capsys):
    blocking = socket.create_server(("127.0.0.1", 0))
    port = blocking.getsockname()[1]
    monkeypatch.setattr("ecu.watch.metrics_process.time.sleep", lambda s: blocking.close())
    server = open_server(f"127.0.0.1:{port}", Handler, lambda: True)
    assert server.server_port == port
    server.server_close()
    assert open_server("127.0.0.1:1", Handler, lambda: False) is None


def test_it_ends_with_its_parent(tmp_path):
    """The process has another parent than its arguments name."""
    command = [sys.executable, "-m", "ecu.watch.metrics_process", "--ring", str(tmp_path / "no.ring")]
    command += ["--metrics", "127.0.0.1:1", "--parent", str(os.getpid() + 1)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    assert subprocess.run(command, env=environment, timeout=60).returncode == 0
