"""What a replay says of the frames that it looked for."""

from pathlib import Path

import pytest

from brakelab.replay.quality import Findings, quality_lines
from brakelab.replay.source import load_source
from ecu.bus.receive import new_reception
from ecu.settings.resources import resource


@pytest.mark.parametrize(
    ("bus", "interfaces", "begins", "ends"),
    [
        (
            "can0",
            ["can1", "can2"],
            "a.log: never received on can0: BrakeSnData_3 (077), ",
            "; the log has can1, can2",
        ),
        ("", ["can0"], "a.log: never received: BrakeSnData_3 (077), ", "; the log has can0"),
    ],
)
def test_messages_that_never_came_are_reported_with_the_buses_of_the_log(
    bus: str, interfaces: list[str], begins: str, ends: str
) -> None:
    plan = load_source(resource("config/maps/mustang.toml")).plan
    found = Findings(Path("a.log"), interfaces=interfaces, bus=bus, reception=new_reception(plan))
    (line,) = quality_lines(found, plan)
    assert line.startswith(begins)
    assert line.endswith(ends)
