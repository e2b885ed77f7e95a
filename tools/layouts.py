"""Layouts of Foxglove and PlotJuggler for MCAP results, and for Foxglove live: the same plots in both.

`python tools/write_reference.py` writes them to `tools/deploy`.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as Xml

from ecu.contract.signals import CORNERS, topic_of

DEPLOY: Final = Path(__file__).parent / "deploy"
FOXGLOVE: Final = DEPLOY / "foxglove-brake-ecu.json"
PLOTJUGGLER: Final = DEPLOY / "plotjuggler-brake-ecu.xml"
COLOURS: Final = ("#0072b2", "#d55e00", "#56b4e9", "#e69f00")
"""Front left, front right, rear left, rear right: Okabe and Ito (2008)."""


def _wheels(name: str) -> list[str]:
    return [f"{name}_{corner}" for corner in CORNERS]


PLOTS: Final = {
    "Speed [m/s]": ["vehicle_speed"],
    "Deceleration demanded, specific force [m/s²]": ["decel_demand_total", "accel_x_road", "grip_limit"],
    "Pressure [bar]": _wheels("calliper_pressure"),
    "Pressure demanded [bar]": _wheels("pressure_demand"),
    "Friction of the linings": _wheels("mu_b"),
    "Its standard deviation": _wheels("sigma_mu_b"),
    "Disc temperature [°C]": _wheels("disc_temperature"),
    "Wear of the pads [mm]": _wheels("pad_wear"),
}
"""Columns of each."""
STATES: Final = ["mode", *_wheels("mode"), "active_faults", "active_faults_2"]


def _label(column: str) -> str:
    topic, name = topic_of(column)
    return name if topic == "/ecu" else f"{name} {topic[-2:]}"


def _paths(columns: list[str]) -> list[dict[str, Any]]:
    found = []
    for column, colour in zip(columns, COLOURS, strict=False):
        topic, name = topic_of(column)
        found.append(
            {
                "value": f"{topic}.{name}",
                "label": _label(column),
                "enabled": True,
                "timestampMethod": "receiveTime",
                "color": colour,
            }
        )
    return found


def _halves(panels: list[str], direction: str = "row") -> Any:
    """Return panels as a tree of halves, side by side and below each other in turn."""
    if len(panels) == 1:
        return panels[0]
    middle, other = len(panels) // 2, {"row": "column", "column": "row"}[direction]
    first, second = _halves(panels[:middle], other), _halves(panels[middle:], other)
    return {"direction": direction, "first": first, "second": second}


def foxglove_text() -> str:
    """Return the layout of Foxglove: the plots, the modes and the log of the daemon."""
    panels: dict[str, Mapping[str, Any]] = {
        f"Plot!plot{place}": {
            "foxglovePanelTitle": title,
            "paths": _paths(columns),
            "showXAxisLabels": True,
            "showYAxisLabels": True,
            "showLegend": True,
            "legendDisplay": "floating",
            "isSynced": True,
            "xAxisVal": "timestamp",
        }
        for place, (title, columns) in enumerate(PLOTS.items())
    }
    states = [
        {"value": ".".join(topic_of(one)), "label": _label(one), "timestampMethod": "receiveTime"}
        for one in STATES
    ]
    below = {
        "StateTransitions!states": {"foxglovePanelTitle": "Modes, faults", "paths": states, "isSynced": True},
        "RosOut!events": {"foxglovePanelTitle": "Log", "topicToRender": "/events", "minLogLevel": 1},
    }
    layout = {
        "direction": "column",
        "splitPercentage": 75,
        "first": _halves([*panels]),
        "second": _halves([*below]),
    }
    content = {"configById": panels | below, "globalVariables": {}, "userNodes": {}, "layout": layout}
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def plotjuggler_text() -> str:
    """Return the layout of PlotJuggler: the plots in two columns."""
    root = Xml.Element("root")
    window = Xml.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    tab = Xml.SubElement(window, "Tab", {"tab_name": "Brakes", "containers": "1"})
    columns = _splitter(Xml.SubElement(tab, "Container"), "|", 2)
    middle = len(PLOTS) // 2
    for half in ([*PLOTS.items()][:middle], [*PLOTS.items()][middle:]):
        rows = _splitter(columns, "-", len(half))
        for title, names in half:
            area = Xml.SubElement(rows, "DockArea", {"name": title})
            plot = Xml.SubElement(area, "plot", {"mode": "TimeSeries", "style": "Lines"})
            for column, colour in zip(names, COLOURS, strict=False):
                Xml.SubElement(plot, "curve", {"name": "/".join(topic_of(column)), "color": colour})
    Xml.SubElement(window, "currentTabIndex", {"index": "0"})
    Xml.SubElement(root, "use_relative_time_offset", {"enabled": "1"})
    Xml.indent(root, " ")
    return Xml.tostring(root, "unicode", xml_declaration=True) + "\n"


def _splitter(within: Xml.Element, orientation: str, count: int) -> Xml.Element:
    sizes = ";".join([f"{1.0 / count:g}"] * count)
    return Xml.SubElement(
        within, "DockSplitter", {"orientation": orientation, "count": str(count), "sizes": sizes}
    )
