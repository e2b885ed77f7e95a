import math

import pytest
from rich.console import Console

from ecu.contract.faults import IMU_LOST
from ecu.watch.picture import picture, shown, sparkline
from ecu.watch.watcher import Watcher


@pytest.mark.parametrize(
    ("values", "width", "line"),
    [
        ([], 4, ""),
        ([math.nan] * 4, 2, "  "),
        ([0.0, 1.0, 2.0, 3.5], 4, "▁▃▅█"),
        ([0.0, math.nan, 7.0], 3, "▁ █"),
        ([5.0, 5.0], 2, "▄▄"),  # one that does not move is a line in the middle
        ([0.0, 0.0, 4.0, 4.0], 2, "▁█"),
    ],
)
def test_sparkline(values, width, line):
    assert sparkline(values, width, 1.0) == line


def draw(watcher, width, height, **more):
    console = Console(width=width, height=height, color_system=None)
    with console.capture() as captured:
        console.print(picture(watcher, width, height, **more))
    return captured.get().splitlines()


@pytest.fixture
def watched(loop):
    one = loop()
    one.publish(400, vehicle_speed=20.0, mu_b=0.4, sigma_mu_b=0.02, pad_remaining=93)
    one.publish(400, mode=3, active_faults=IMU_LOST, vehicle_speed=10.0, decel_demand_total=3.0)
    watcher = Watcher(None)
    watcher.turn()
    yield watcher
    assert one


@pytest.mark.parametrize("width", [40, 64, 80, 100, 160])
@pytest.mark.parametrize("height", [24, 50])
def test_it_fits_any_terminal(watched, width, height):
    lines = draw(watched, width, height)
    assert len(lines) <= height
    assert max(map(len, lines)) <= width
    page = "\n".join(lines)
    for part in ("DEGRADED", "10.0 m/s", "IMU lost", "0.400±0.020", "fl", "rr", "q quit  k keep"):
        assert part in page
    assert "8 s can be kept" in page
    assert ("93" in page) == (width >= 64)


@pytest.mark.parametrize("width", [40, 80])
def test_a_long_note_leaves_the_keys_in_sight(watched, width):
    note = "24 s kept in out/watch/2026-11-22T20-07-29Z; next: brake-ecu replay " + "out/" * 20
    for number in range(30):
        watched.history.tell(f"event {number}")
    lines = draw(watched, width, 24, note=note)
    assert len(lines) <= 24
    assert lines[-1].startswith("q quit")
    assert "event 29" in "\n".join(lines)


def test_both_decelerations_have_one_scale(watched):
    """3 m/s² were demanded, none was reached."""
    demanded, measured = (line[-1] for line in draw(watched, 80, 40) if line[:8] in ("demanded", "measured"))
    assert (demanded, measured) == ("█", "▁")


def test_what_is_not_available_is_a_dash(loop):
    one = loop()
    one.publish(4, vehicle_speed=math.nan, accel_x_road=math.nan, mu_b=math.nan, pad_wear=math.nan)
    watcher = Watcher(None)
    watcher.turn()
    assert "nan" not in "\n".join(draw(watcher, 120, 40))


def test_the_inputs_in_a_line(loop):
    one = loop()
    one.find("yaw_rate", value=3.0, ratio=2e3, rejected=1)
    one.find("accel_x", value=-3.0, ratio=0.31)
    one.find("vehicle_speed", value=20.0, ratio=9.0, judged_s=60.0)  # what was said long ago counts no more
    one.publish(4)
    watcher = Watcher(None)
    watcher.turn()
    line = "left out: yaw_rate; test ratio at most 0.31 (accel_x)"
    assert line in "\n".join(draw(watcher, 80, 40))
    assert "accel_x" not in "\n".join(draw(watcher, 80, 24))


def test_it_scrolls_back(watched):
    page = "\n".join(draw(watched, 80, 40, back_s=5.0, paused=True))
    assert "READY  20.0 m/s" in page
    assert "5 s back  paused" in page
    assert "no fault" in page
    assert len(shown(watched.history.rows, 5.0)) == 75


def test_without_a_daemon(rings):
    watcher = Watcher(None)
    watcher.turn()
    assert "no daemon of this user runs" in "\n".join(draw(watcher, 60, 24))
