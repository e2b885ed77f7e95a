"""`brake-ecu watch` in another process, beside a daemon on a real bus."""

import json
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from brakelab.testing.daemon import wait_for
from draw_watch import Browser, chromium
from ecu.recording.recorder import read_recording

from .conftest import ENVIRONMENT, ROOT

pytestmark = pytest.mark.multicast

GROUP = f"239.77.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"
BUS = ("--config", ROOT / "config" / "suv.toml", "-i", "udp_multicast", "-c", GROUP)


@pytest.fixture
def watch(tmp_path):
    """Start a watcher of the daemons on this test's bus."""
    started = []

    def start(*options):
        command = [sys.executable, "-m", "ecu.cli", "watch", GROUP, *options]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path, env=ENVIRONMENT)
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()


class Lines:
    """Facts that a watcher prints, line by line."""

    def __init__(self, process):
        self.lines, self.process = [], process
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(json.loads(line))

    def wait_for(self, fact, meanwhile=lambda: time.sleep(0.1)):
        """Return the first line not yet asked for that `fact` holds of; lines before it are left out."""
        found = []

        def looked():
            meanwhile()
            while self.lines and not found:
                found.extend(filter(fact, [self.lines.pop(0)]))
            return found

        wait_for(looked)
        return found[0]


def test_it_attaches_tells_the_end_and_attaches_again(daemon, car, watch):
    watcher = watch("--json")
    lines = Lines(watcher)
    assert lines.wait_for(lambda line: line.get("trouble"))["trouble"].startswith("no daemon")
    first = daemon(*BUS)
    first.wait_for("ready")
    reported = lines.wait_for(lambda line: line.get("mode") == "active", lambda: car.drive(20))
    assert reported["daemon"].endswith(f"process {first.process.pid}")
    assert reported["vehicle_speed"] == pytest.approx(20, abs=1.5)
    assert reported["decel_demand_total"] == pytest.approx(3, abs=0.01)
    first.process.kill()
    assert "was killed" in lines.wait_for(lambda line: line.get("trouble"))["trouble"]
    first.end(None)
    second = daemon(*BUS)
    second.wait_for("ready")

    def of_the_second(line):
        return str(line.get("daemon")).endswith(str(second.process.pid))

    assert lines.wait_for(of_the_second, lambda: car.drive(20))["cycles"] > 0
    watcher.send_signal(signal.SIGTERM)
    assert watcher.wait(20) == 0
    assert second.end() == 0


@pytest.mark.skipif(chromium() is None, reason="there is no chromium to open the page with")
@pytest.mark.study
def test_the_page_in_a_browser(daemon, car, watch, tmp_path):
    first = daemon(*BUS)
    first.wait_for("ready")
    car.drive(150)
    watcher = watch("--web", "--port", "0")
    address = watcher.stdout.readline().split()[0]
    browser = Browser(chromium())
    try:
        browser.look(1200, 900)
        browser.open(address)
        wait_for(
            lambda: (
                car.drive(20).size > 0 and browser.evaluate("Number(document.body.dataset.rows ?? 0)") > 30
            )
        )
        before, t = browser.evaluate("[rows.length, rows[rows.length - 1][0]]")
        car.drive(200)
        after, later = browser.evaluate("[rows.length, rows[rows.length - 1][0]]")
        assert (after - before) / (later - t) == pytest.approx(25, abs=1)  # rows a second
        seen = "[document.getElementById('mode'), document.querySelector('.card b')].map(e => e.textContent)"

        def shows_friction() -> bool:
            car.drive(20)  # while the browser answers: on a busy machine a silent car is a lost one
            mode, friction = browser.evaluate(seen)
            return mode == "active" and "± 0." in friction

        wait_for(shows_friction)
        painted = "plot => new Set(plot.canvas.getContext('2d').getImageData(0, 0, 400, 150).data).size > 9"
        assert browser.evaluate(f"PLOTS.every({painted})")
        browser.evaluate("dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft'}))")
        wait_for(lambda: browser.evaluate("id('where').textContent").endswith("s back"))
        browser.evaluate("id('keep').click()")
        wait_for(lambda: "kept in" in browser.evaluate("id('note').textContent"))
        assert len(read_recording(tmp_path / "out/watch").cycles) > 300
        assert first.end() == 0
        wait_for(lambda: "waiting for the next one" in browser.evaluate("id('trouble').textContent"))
    finally:
        browser.close()
