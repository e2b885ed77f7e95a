"""The page in a real browser: every plot drawn, scrolled to or not; nothing on the console, no request."""

import json
import os
import re
import subprocess
from pathlib import Path

import pytest

from brakelab.report.command import report
from draw_watch import chromium

from .conftest import write_drive

CHROMIUM = chromium()
pytestmark = [
    pytest.mark.study,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here (apt-get install chromium)"),
]

OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-dev-shm-usage",
    "--disable-background-networking", "--disable-component-update", "--enable-logging=stderr",
    "--virtual-time-budget=10000",
)  # fmt: skip

# Leaves what it saw in the title, which --dump-dom shows.
PROBE = """<script>
setTimeout(() => {
  const canvases = [], look = (node) => {
    if (node.tagName === "CANVAS") canvases.push(node);
    for (const child of [...node.children, ...(node.shadowRoot ? node.shadowRoot.children : [])]) look(child);
  };
  const inked = (canvas) => canvas.width > 0 &&
    canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.some((byte) => byte > 0);
  const drawn = [...document.querySelectorAll(".plots figure")].filter((figure) => {
    canvases.length = 0;
    look(figure);
    return canvases.some(inked);
  });
  const legends = [], find = (node) => {
    if (node.className?.includes?.("bk-Legend")) legends.push(node);
    for (const child of [...node.children, ...(node.shadowRoot ? node.shadowRoot.children : [])]) find(child);
  };
  document.querySelectorAll(".plots figure").forEach(find);
  const cut = legends.filter((legend) => {
    const box = legend.getBoundingClientRect();
    return box.left < 0 || box.right > innerWidth;
  });
  document.querySelectorAll("button[data-from]")[1].click();
  const range = [...Bokeh.documents[0].all_models].find((model) => model.name === "drive-time");
  const colours = [...Bokeh.documents[0].all_models].flatMap((model) => model.axis_label_text_color ?? []);
  document.title = JSON.stringify({
    figures: document.querySelectorAll(".plots figure").length, drawn: drawn.length,
    loaded: performance.getEntriesByType("resource").map((entry) => entry.name),
    window: [range.start, range.end], ink: [...new Set(colours)].map((colour) => colour.value ?? colour),
    legends: legends.length, cut: cut.length, overflow: document.documentElement.scrollWidth - innerWidth,
  });
}, 6000);
</script></body>"""


@pytest.fixture(scope="module")
def probed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("probed")
    drive_files, page = write_drive(folder), folder / "report.html"
    report(drive_files["result"], drive_files["truth"], page, drive_files["timing"])
    page.write_text(page.read_text("utf-8").replace("</body>", PROBE), "utf-8")
    return page


@pytest.mark.parametrize(
    ("scheme", "ink", "width"), [(1, "#1b1f24", 1400), (0, "#e8ebef", 400)], ids=["light", "dark and narrow"]
)
def test_every_plot_is_drawn(probed: Path, tmp_path: Path, scheme: int, ink: str, width: int) -> None:
    own = (
        f"--window-size={width},900",
        f"--user-data-dir={tmp_path / 'profile'}",
        f"--blink-settings=preferredColorScheme={scheme}",
    )
    command = [str(CHROMIUM), *OPTIONS, *own, "--dump-dom", probed.as_uri()]
    short = {**os.environ, "TMPDIR": "/tmp"}  # where it makes a socket, whose name has at most 107 letters
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False, env=short)
    title = re.search(r"<title>(.*?)</title>", done.stdout)
    assert title, done.stderr[-2000:]
    seen = json.loads(title[1])
    assert seen["figures"] == seen["drawn"] == 36
    assert (seen["legends"] > 30, seen["cut"]) == (True, 0)
    assert seen["loaded"] == []
    assert seen["window"] == pytest.approx([21.5, 27.13], abs=0.05)
    assert seen["ink"] == [ink]
    assert seen["overflow"] <= 0
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert [line for line in console if "document idle" not in line and "log level" not in line] == []
