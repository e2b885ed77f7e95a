"""Pictures of docs/watch.md: what `brake-ecu watch` shows of a daemon that brakes a simulated car.

    python tools/draw_watch.py [FOLDER]

Writes watch.png (the page, light), watch-dark.png, watch-narrow.png (400 px) and watch.svg (the terminal)
into FOLDER, default docs/images. Takes a minute and a half; needs Chromium.
"""

import asyncio
import base64
import io
import json
import re
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from tornado.websocket import WebSocketClientConnection, websocket_connect

CHECKOUT: Final = Path(__file__).parent.parent
DRIVE_S: Final = 62.0
PATIENCE_S: Final = 30.0


def chromium() -> str | None:
    """Return the program, None where there is none."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


class Browser:
    """A page in headless Chromium, driven over its DevTools."""

    def __init__(self, program: str) -> None:
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        options = [
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            "--remote-debugging-port=0",
        ]
        self._process = subprocess.Popen(
            [program, *options, f"--user-data-dir={self._folder.name}", "about:blank"],
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            text=True,
        )
        assert self._process.stderr is not None
        found = None
        for line in self._process.stderr:
            if found := re.search(r"ws://(\S+?)/devtools", line):
                break
        assert found is not None, "no DevTools"
        with urllib.request.urlopen(f"http://{found.group(1)}/json/list", timeout=PATIENCE_S) as answer:
            (page,) = [one for one in json.load(answer) if one["type"] == "page"]
        self._runner = asyncio.Runner()
        self._number = 0
        self._socket: WebSocketClientConnection = self._runner.run(
            self._connect(page["webSocketDebuggerUrl"])
        )

    async def _connect(self, address: str) -> WebSocketClientConnection:
        return await websocket_connect(address, max_message_size=1 << 28)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Return the answer to a DevTools command."""
        return self._runner.run(self._call(method, parameters))

    async def _call(self, method: str, parameters: dict[str, Any]) -> dict[str, Any]:
        self._number += 1
        await self._socket.write_message(
            json.dumps({"id": self._number, "method": method, "params": parameters})
        )
        while True:
            read: Any = self._socket.read_message()
            message = json.loads(await asyncio.wait_for(read, PATIENCE_S) or "{}")
            if message.get("id") == self._number:
                return dict(message["result"])

    def look(self, width: int, height: int, dark: bool = False) -> None:
        """Set the size of the window, and what the user prefers."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def open(self, address: str) -> None:
        """Open a page."""
        self.call("Page.navigate", url=address)

    def evaluate(self, script: str) -> Any:
        """Return the value of a script in the page."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        return answer["result"].get("value")

    def wait_for(self, script: str) -> None:
        """Wait until a script gives something true."""
        end = time.monotonic() + PATIENCE_S
        while not self.evaluate(script):
            assert time.monotonic() < end, script
            time.sleep(0.1)

    def shoot(self, path: Path) -> None:
        """Write the window as a picture."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot")["data"]))

    def close(self) -> None:
        """End the browser."""
        self._process.kill()
        self._process.wait()
        self._runner.close()
        self._folder.cleanup()


def draw(folder: Path, address: str, browser: Browser) -> None:
    """Write the pictures of the page at `address`."""
    for name, width, height, dark in (
        ("watch", 1200, 1240, False),
        ("watch-dark", 1200, 1240, True),
        ("watch-narrow", 400, 2100, False),
    ):
        browser.look(width, height, dark)
        browser.open(address)
        browser.wait_for("document.body.dataset.rows > 50")
        time.sleep(0.5)
        browser.shoot(folder / f"{name}.png")


def main() -> int:
    """Drive, watch, draw."""
    from brakelab.rig.live import Processes, choose_bus
    from ecu.settings.resources import resource
    from ecu.watch.picture import picture
    from ecu.watch.watcher import Watcher

    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else CHECKOUT / "docs" / "images"
    program = chromium()
    if program is None:
        print("draw_watch: chromium is missing", file=sys.stderr)
        return 2
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch, (Path(scratch) / "log").open("wb") as log:
        processes = Processes(choose_bus(), resource("config/suv.toml"), Path(scratch), log)
        watching = None
        try:
            processes.start_vehicle(resource("config/scenarios/demo.toml"), 1)
            processes.start_daemon("drive")
            pid = str(processes.daemons[-1].pid)
            command = [sys.executable, "-m", "ecu.cli", "watch", pid, "--web", "--port", "0"]
            watching = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
            assert watching.stdout is not None
            address = watching.stdout.readline().split()[0]
            watcher, browser = Watcher(pid), Browser(program)
            processes.departure()
            end = time.monotonic() + DRIVE_S
            while time.monotonic() < end and processes.driving():
                watcher.turn()
                time.sleep(0.1)
            console = Console(width=110, height=36, record=True, file=io.StringIO())
            console.print(picture(watcher, 110, 36))
            drawn = re.sub(
                r"@font-face {.*?}", "", console.export_svg(title="brake-ecu watch"), flags=re.DOTALL
            )
            (folder / "watch.svg").write_text(re.sub(r"<!--.*?-->", "", drawn), "utf-8")
            draw(folder, address, browser)
            browser.close()
        finally:
            if watching is not None:
                watching.kill()
                watching.wait()
            processes.end()
    print(f"{folder}: watch.png, watch-dark.png, watch-narrow.png, watch.svg")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
