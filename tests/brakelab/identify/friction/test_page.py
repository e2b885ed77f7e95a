"""The page of an identified law: its charts hold what they say, and it is one file of its own."""

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from brakelab.identify.friction.choice import Identified, Judged
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.page import write_report
from brakelab.identify.friction.stops import Stops
from brakelab.plant.friction.constant import Constant
from brakelab.results.text_table import Table


def test_the_page_of_a_constant(tmp_path: Path, columns: Columns, stops: Stops) -> None:
    law = Constant(law="constant", rig_mass=1.0, mu=float(stops.mu.mean()))
    judged = Judged(
        "constant", law, False, 1, 5.0, 6.0, 5.2, True, 0.0, (), ("<mu>",), "4 of 4", "knows no fade"
    )
    span = (1.0, 9.0)
    identified = Identified((judged,), judged, len(stops), span, (1e6, 7e6), (80.0, 250.0))
    path = tmp_path / "brake.html"
    write_report(path, columns, stops, identified, [Table("All & every", ("a",), [("1 < 2",)], "")])
    page = path.read_text("utf-8")
    assert "Seen: 80 to 250 °C, 10 to 70 bar, sliding at 1.0 to 9.0 m/s. Beyond: knows no fade." in page
    assert "Not identified by the data: &lt;mu&gt;." in page
    assert "1 &lt; 2" in page
    assert not re.search(r"<script|src=|href=|url\(", page)
    charts = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert [chart.count("<rect x=") for chart in charts] == [2, 4, 1, 3]
    titles = [int(number) for number in re.findall(r"stop (\d+): ", charts[1])]
    off = [np.mean((law.mu - stops.mu[stops.block_stop == k - 1]) ** 2) for k in titles]
    assert off == sorted(off)
    every = [np.mean((law.mu - stops.mu[stops.block_stop == k]) ** 2) for k in range(len(stops))]
    assert (off[0], off[-1]) == (min(every), max(every))
    for each in charts:
        ElementTree.fromstring(each)
    assert page.count('<div class="scroll" tabindex="0"><svg') == 4  # legible on a phone
    assert '<meta name="viewport" content="width=device-width' in page
    assert "prefers-color-scheme:dark" in page
    level = float(re.search(r"κ of \(3\.12\): (0\.\d+) ± 0\.\d+ at 100 °C", page).group(1))
    assert level == pytest.approx(stops.mu[np.unique(stops.block_stop, return_index=True)[1]].mean(), rel=0.1)
    assert charts[0].count("h0") == 3 * len(stops)
    write_report(path, columns, stops, identified, [], stops)
    charts = re.findall(r"<svg.*?</svg>", path.read_text("utf-8"), re.DOTALL)
    assert [chart.count("<rect x=") for chart in charts] == [2, 4, 4, 1, 3]
    assert re.findall(r"stop (\d+): ", charts[2]) == [str(number) for number in titles]
