import http.client
import json
import re
import socket

import numpy as np
import pytest

from ecu.recording.recorder import read_recording
from ecu.watch.history import COLUMNS
from ecu.watch.watcher import Watcher
from ecu.watch.web import Shared, new_handler, page


@pytest.fixture
def watched(loop, tmp_path, serve_here):
    one = loop()
    one.publish(80, frames=1, vehicle_speed=20.0, mu_b=[0.41, np.nan, 0.43, 0.44])
    shared = Shared(Watcher(None), tmp_path / "kept")
    shared.turn()
    return one, shared, serve_here(new_handler(shared)).server_port


def ask(port, method, path, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request(method, path, headers=headers)
    return connection.getresponse()


def news(answer):
    line = answer.readline()
    assert answer.readline() == b"\n"
    return json.loads(line.removeprefix(b"data: "))


def test_the_page_asks_for_nothing_elsewhere(watched):
    _, _, port = watched
    text = ask(port, "GET", "/").read().decode()
    assert text.encode() == page()
    assert not re.search(r"(src|href)=\"(?!data:)|https?://|@import|url\(", text)
    about = json.loads(re.search(r"const ABOUT = (.*);\n", text).group(1))
    assert tuple(about["columns"]) == COLUMNS


def test_a_word_of_faults_keeps_every_bit(watched):
    one, shared, port = watched
    words = {"active_faults": 0x8001_0001, "active_faults_2": 0x4000_0011}
    one.publish(4, **words)
    shared.turn()
    row = dict(zip(COLUMNS, news(ask(port, "GET", "/stream"))["rows"][-1], strict=True))
    assert {name: row[name] for name in words} == words


def test_every_viewer_gets_all_rows_and_then_the_new_ones(watched):
    one, shared, port = watched
    viewers = [ask(port, "GET", "/stream") for _ in range(3)]
    for viewer in viewers:
        status = news(viewer)
        assert len(status["rows"]) == 20
        assert status["daemon"] == "suv on socketcan can0, process 4711"
        row = dict(zip(COLUMNS, status["rows"][-1], strict=True))
        assert (row["vehicle_speed"], row["mu_b_fl"], row["mu_b_fr"]) == (20.0, 0.41, None)
        assert row["clock"] == pytest.approx(1_800_000_000.79)
    one.find("accel_x", value=-3.0, innovation=0.5, sigma=0.1, ratio=2.7, judged_s=0.05, unused_s=0.0)
    one.publish(8, vehicle_speed=19.0)
    shared.turn()
    for viewer in viewers:
        status = news(viewer)
        assert [row[COLUMNS.index("vehicle_speed")] for row in status["rows"]] == [19.0, 19.0]
        assert status["inputs"] == [["accel_x", "m/s^2", -3.0, 0.5, 0.1, 2.7, 0.05, False, 0.0]]
        assert (status["cycles"], sum(status["lateness"])) == (88, 88)
        viewer.close()


def test_the_end_of_the_daemon_is_reported(watched):
    one, shared, port = watched
    viewer = ask(port, "GET", "/stream")
    news(viewer)
    one.close(by="SIGTERM", cycles=80)
    shared.turn()
    assert "stopped by SIGTERM after 80 cycles; waiting" in news(viewer)["trouble"]
    viewer.close()


def test_only_the_page_itself_keeps_a_recording(watched, tmp_path):
    _, _, port = watched
    assert ask(port, "POST", "/keep").status == 403
    assert ask(port, "POST", "/keep", Host="evil.example", **{"X-Brake-Ecu": "keep"}).status == 403
    assert not (tmp_path / "kept").exists()
    answer = ask(port, "POST", "/keep", **{"X-Brake-Ecu": "keep"})
    assert answer.read().decode().startswith("1 s kept in ")
    assert len(read_recording(tmp_path / "kept").cycles) == 80


def test_what_a_page_elsewhere_sends_is_no_second_request(watched, tmp_path):
    """A browser lets any page post text to 127.0.0.1: it must not be read as a request of our own."""
    inner = b"POST /keep HTTP/1.1\r\nHost: localhost\r\nX-Brake-Ecu: keep\r\n\r\n"
    outer = b"POST /keep HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n" % len(inner)
    with socket.create_connection(("127.0.0.1", watched[2]), timeout=60) as client:
        client.sendall(outer + inner)
        said = b"".join(iter(lambda: _received(client), b""))
    assert said.count(b"HTTP/1.1") == 1
    assert said.startswith(b"HTTP/1.1 403")
    assert not (tmp_path / "kept").exists()


def _received(client):
    try:
        return client.recv(4096)
    except ConnectionResetError:  # closed before all was read
        return b""


@pytest.mark.parametrize(
    ("path", "status"), [("/", 200), ("/?x=1", 200), ("/../etc/passwd", 404), ("/keep", 404)]
)
def test_addresses(watched, path, status):
    assert ask(watched[2], "GET", path).status == status
