"""Faults by hand: lines typed while the simulated car drives."""

import io
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from brakelab.rig import vehicle_node
from brakelab.rig.by_hand import ROOM, Hand, typed, with_room
from brakelab.rig.vehicle_node import drive_in_real_time, new_node
from brakelab.simulation.vehicle_bus import Vehicle
from ecu import cli
from ecu.errors import UserError

from .test_vehicle_node import FakeBus, FakeClock, column, scenario


def hand_of(vehicle: Vehicle, *lines: str) -> Hand:
    hand = Hand(vehicle, lines)
    hand._reader.join()
    return hand


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("loss message=Imu", "fault: kind: "),
        ("lost Imu", "fault: Imu: is no KEY=VALUE, as in: lost message=Imu duration=2"),
        ("lost message=Imus", "fault: message: no 'Imus' in the database"),
        ("biased signal=accel_x", "fault: the kind 'biased' needs amount"),
        ("biased signal=accel_x amount=much", "fault: amount: "),
        ('biased signal=accel_x amount=1 when="a', "No closing quotation; close it"),
        ("daemon_killed", "fault: daemon_killed: a car cannot do that; kill the daemon"),
    ],
)
def test_a_mistake_is_a_line_and_the_car_goes_on(
    line: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(UserError, match="fault: ") as error:
        typed(line)
    assert says in str(error.value)
    vehicle = with_room(new_node(scenario(0.1), 1).side.vehicle)
    hand_of(vehicle, line, "calliper_dead corner=fl,rr").take(3.0)
    printed = capsys.readouterr()
    assert printed.err == f"{error.value}\n"
    assert printed.out == "3.00 s: calliper_dead corner=fl,rr\n"
    assert vehicle.faults["corner"][0].tolist() == [1, 0, 0, 1]


@pytest.mark.parametrize(
    ("lines", "begin", "end"),
    [
        (["lost message=Imu duration=2"], 3.0, 5.0),
        (["lost message=Imu"], 3.0, np.inf),
        (["stuck signal=accel_x t=1.5 duration=2"], 4.5, 6.5),
        (['lost when="vehicle_speed < 12" duration=2'], np.inf, np.inf),
        (["lost message=Imu", "off"], np.inf, np.inf),
        (["lost duration=1", *["lost message=Imu duration=2"] * ROOM], 3.0, 5.0),
    ],
)
def test_a_fault_begins_when_its_line_comes(lines: list[str], begin: float, end: float) -> None:
    vehicle = with_room(new_node(scenario(0.1), 1).side.vehicle)
    hand_of(vehicle, *lines).take(3.0)
    assert (vehicle.faults["begin"][0], vehicle.faults["end"][0]) == (begin, end)


def test_frames_are_lost_from_the_cycle_in_which_it_is_typed() -> None:
    """The second line comes while the car drives, from the thread that reads."""
    clock, first_read, at_rest = FakeClock(), Event(), Event()
    bus, node = FakeBus(clock), new_node(scenario(1.0), 1)
    node = node._replace(side=node.side._replace(vehicle=with_room(node.side.vehicle)))

    def lines() -> Iterator[str]:
        yield "lost message=Imu t=0.3 duration=0.2"
        first_read.set()
        at_rest.wait()
        yield "lost message=Steering"

    hand = Hand(node.side.vehicle, lines())
    first_read.wait()

    def by_hand(t: float) -> None:
        if len(bus.sent) == 70:
            at_rest.set()
            hand._reader.join()
        hand.take(t)

    truth = drive_in_real_time(node, bus, clock.source(), by_hand=by_hand)
    without = {
        name: [k for k, frames in enumerate(bus.sent) if identifier not in frames["can_id"]]
        for name, identifier in (("Imu", 0x72), ("Steering", 0x78))
    }
    first = without["Imu"][0]
    assert without["Imu"] == [*range(first, first + 20)]
    assert without["Steering"] == [*range(70, 100)]
    assert column(truth.values, "fault_acting")[-1] == 2


@pytest.mark.parametrize("asked", [True, False])
def test_the_command_takes_them_from_standard_input_if_it_is_asked_to(
    asked: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class ReadAtOnce(Hand):
        def __init__(self, vehicle: Vehicle, lines: Iterable[str]) -> None:
            super().__init__(vehicle, lines)
            self._reader.join()

    clock = FakeClock()
    short = tmp_path / "short.toml"
    short.write_text('plant = "suv"\ninitial_speed = 20.0\n[[phase]]\nkind = "coast"\nseconds = 0.1\n')
    monkeypatch.setattr(sys, "stdin", io.StringIO("lost message=Imu\n\noff\n"))
    for name, stand_in in (
        ("Hand", ReadAtOnce),
        ("open_channel", lambda *bus, receive_ids: FakeBus(clock)),
        ("system_time", clock.source),
        ("ask_for_priority", lambda: None),
        ("warm_up", lambda driven: None),
    ):
        monkeypatch.setattr(vehicle_node, name, stand_in)
    monkeypatch.setattr("signal.signal", lambda number, handler: None)
    words = ["vehicle", str(short), "-i", "virtual", "-c", "x", "--alone"]
    assert cli.main([*words, *(["--by-hand"] if asked else [])]) == 0
    taken = ["0.00 s: lost message=Imu", "0.00 s: off"] if asked else []
    assert capsys.readouterr().out.splitlines()[2:] == taken
