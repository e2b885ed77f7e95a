"""Work on the first one's learned values reaches the standby's loop, once, and only at rest."""

from types import SimpleNamespace

import pytest
import structlog

from ecu.algorithm.step import new_state
from ecu.contract.records import OUTPUTS, new_record
from ecu.contract.work import Kind, Work
from ecu.recording.calibration import ask, in_force
from ecu.recording.ring import RingReader
from ecu.runtime import asking
from ecu.runtime.calibration import consider
from ecu.runtime.clock import monotonic_s
from ecu.runtime.follow_first import LOOK_FOR_FIRST_S, Follower
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

from ..watch.conftest import START_NS, loop, rings

__all__ = ["loop", "rings"]

CONFIG = load_config(resource("config/suv.toml"))
PARAMS = new_params(CONFIG)
NEW_PADS = Work(Kind.NEW_PADS, {"fl": 0.0, "fr": 0.0})


class Unit:
    """A daemon at rest whose loop looks whenever `turn` is called."""

    def __init__(self, loop):
        self.loop, state = loop, new_state(PARAMS)
        state["estimate"]["started"], state["demand"]["standing_s"] = 1, 9.0
        self.ecu = SimpleNamespace(
            params=PARAMS.copy(), state=state, estimate=state["estimate"], outputs=new_record(OUTPUTS)
        )
        loop.publish(1)

    def turn(self, *_):
        consider(self.loop.ring, self.ecu, self.loop.number, round(1e9 * monotonic_s()))
        self.loop.publish(1)
        self.loop.ring.header["followed"] = self.loop.number - 1

    def work(self, work, tables=None):
        """Do it as a tester at this one asks for it."""
        ask(self.loop.ring, self.ecu.params, tables or {}, round(1e9 * (monotonic_s() + 1)), work)
        self.turn()

    @property
    def new_pads(self):
        """Whether the pads of each corner were registered as new."""
        return self.ecu.state["learned"]["wear"]["told"].tolist()[0]


@pytest.fixture
def pair(loop, monkeypatch):
    """A first one and its standby, a second younger, and what follows the one for the other."""
    monkeypatch.setattr(asking, "ANSWERS_IN_S", 0.05)
    about = {"configuration": CONFIG.model_dump(), "store_key": "suv/1"}
    first = Unit(loop(1, **about))
    standby = loop(2, **{**about, "start_ns": START_NS + 1_000_000_000})
    standby.cycle["speaks"] = 0
    standby = Unit(standby)
    follower = Follower(RingReader(standby.loop.ring.path, asks=True), sleep=standby.turn)
    return SimpleNamespace(first=first, standby=standby, follower=follower)


def test_what_is_done_to_the_first_one_is_done_to_its_standby_once(pair):
    pair.first.loop.publish(100)
    pair.follower.look()
    pair.first.work(NEW_PADS)
    pair.follower.look()
    assert pair.standby.new_pads == pair.first.new_pads == [1, 1, 0, 0]
    assert in_force(pair.standby.loop.ring).work == NEW_PADS
    pair.follower.look()
    assert in_force(pair.standby.loop.ring).number == 1
    pair.first.work(Work(Kind.MEASURED_PADS, {"rl": 1.5}))
    pair.follower.look()
    assert pair.standby.ecu.state["learned"]["wear"]["measurements"][0].tolist() == [0, 0, 1, 0]


def test_work_before_the_standby_s_start_is_in_what_it_learned(pair):
    pair.first.work(NEW_PADS)
    pair.first.loop.publish(200)
    pair.follower.look()
    assert in_force(pair.standby.loop.ring) is None
    pair.first.work(Work(Kind.NEW_PADS, {"rl": 0.0}))
    pair.follower.look()
    assert pair.standby.new_pads == [0, 0, 1, 0]


def test_a_calibration_is_the_first_one_s_own(pair):
    pair.first.loop.publish(100)
    pair.first.work(None, {"control": CONFIG.control.model_dump()})
    pair.follower.look()
    assert in_force(pair.standby.loop.ring) is None


def test_a_standby_that_moves_does_it_when_it_stands_again_however_late(pair):
    pair.first.loop.publish(100)
    pair.first.work(NEW_PADS)
    pair.standby.ecu.estimate["speed"] = 5.0
    with structlog.testing.capture_logs() as lines:
        pair.follower.look()
        pair.first.loop.publish(3000)  # out of the ring
        pair.follower.look()
    assert [line["event"] for line in lines] == ["work_waits"]
    assert pair.standby.new_pads == [0, 0, 0, 0]
    pair.standby.ecu.estimate["speed"] = 0.0
    pair.follower.look()
    assert pair.standby.new_pads == [1, 1, 0, 0]


def test_what_came_too_soon_after_another_is_a_line(pair):
    pair.first.loop.publish(100)
    pair.follower.look()
    for work in (NEW_PADS, Work(Kind.FORGET)):
        pair.first.work(work)
    with structlog.testing.capture_logs() as lines:
        pair.follower.look()
    assert [(line["event"], line["changes"]) for line in lines] == [("work_missed", 1)]


@pytest.mark.parametrize("why", ["speaks itself", "first is silent", "another car", "none"])
def test_whom_it_does_not_follow(why, pair):
    if why == "speaks itself":
        pair.standby.loop.cycle["speaks"] = 1
        pair.standby.loop.publish(1)
    elif why == "first is silent":
        pair.first.loop.cycle["speaks"] = 0
        pair.first.loop.publish(1)
    elif why == "another car":
        pair.follower.own.description["store_key"] = "lcv/1"
    else:
        pair.first.loop.ring.path.unlink()
    pair.first.loop.publish(100)
    pair.first.work(NEW_PADS)
    assert pair.follower.look() == LOOK_FOR_FIRST_S
    assert in_force(pair.standby.loop.ring) is None
