"""Layouts of other programs name topics and fields that are there: in MCAP results, and live."""

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import pytest

from brakelab.results.files import ROW_SCHEMA
from ecu.contract.signals import topic_of
from ecu.watch.foxglove_server import EVENTS, schemas
from layouts import FOXGLOVE, PLOTJUGGLER, foxglove_text, plotjuggler_text

LIVE = {(topic, name) for topic, schema in schemas().items() for name in schema["properties"]}
RESULTS = {topic_of(field.name) for field in ROW_SCHEMA}


def values(node: Any, key: str) -> list[str]:
    if isinstance(node, list):
        return [found for one in node for found in values(one, key)]
    if not isinstance(node, dict):
        return []
    own = [node[key]] if key in node else []
    return own + [found for one in node.values() for found in values(one, key)]


@pytest.mark.parametrize(
    ("path", "text"), [(FOXGLOVE, foxglove_text), (PLOTJUGGLER, plotjuggler_text)], ids=["json", "xml"]
)
def test_it_is_that_of_the_table_of_plots(path: Path, text: Any) -> None:
    assert path.read_text("utf-8") == text(), "run python tools/write_reference.py"


def test_foxglove_finds_every_field_in_a_result_and_live() -> None:
    layout = json.loads(FOXGLOVE.read_text("utf-8"))
    named = {tuple(value.split(".")) for value in values(layout["configById"], "value")}
    assert len(named) > 30
    assert named <= RESULTS & LIVE
    assert values(layout["configById"], "topicToRender") == [EVENTS]


def test_foxglove_shows_each_of_its_panels_once() -> None:
    layout = json.loads(FOXGLOVE.read_text("utf-8"))
    shown = re.findall(r'"(\w+!\w+)"', json.dumps(layout["layout"]))
    assert sorted(shown) == sorted(layout["configById"])


def test_plotjuggler_finds_every_curve_in_a_result() -> None:
    root = Xml.parse(PLOTJUGGLER).getroot()
    named = [curve.attrib["name"] for curve in root.iter("curve")]
    assert len(named) > 25
    assert {*named} <= {"/".join(place) for place in RESULTS}
    for splitter in root.iter("DockSplitter"):
        assert int(splitter.attrib["count"]) == len(splitter) == splitter.attrib["sizes"].count(";") + 1
