"""Work on a running loop, asked for by a tester: handed over, recorded and stored before it is confirmed."""

from types import SimpleNamespace

import pytest
import structlog

from ecu.algorithm.step import new_state
from ecu.contract.faults import NOT_KEPT
from ecu.contract.records import OUTPUTS, new_record
from ecu.contract.work import Kind, Work
from ecu.diagnostics.session import Refused
from ecu.diagnostics.workshop import Workshop
from ecu.recording.calibration import ask, in_force
from ecu.recording.ring import RingReader
from ecu.runtime import asking
from ecu.runtime.asking import Busy
from ecu.runtime.calibration import consider
from ecu.runtime.clock import monotonic_s
from ecu.settings.config import config_of, load_config, new_params
from ecu.settings.resources import resource

CONFIG = load_config(resource("config/suv.toml"))


class Serviced:
    """A run at rest that looks for work whenever the tester's server waits."""

    def __init__(self, run, kept=True):
        self.run, self.follows, params = run, True, new_params(CONFIG)
        state = new_state(params)
        state["estimate"]["started"], state["demand"]["standing_s"] = 1, 9.0
        self.ecu = SimpleNamespace(
            params=params, state=state, estimate=state["estimate"], outputs=new_record(OUTPUTS)
        )
        run.publish(1, active_faults=0, active_faults_2=0)
        run.ring.header["followed"] = 0
        self.workshop = Workshop(RingReader(run.ring.path, asks=True), kept=kept, sleep=self.look)

    def look(self, _):
        consider(self.run.ring, self.ecu, self.run.number, round(1e9 * monotonic_s()))
        self.run.publish(1)
        if self.follows:
            self.run.ring.header["followed"] = self.run.number - 1

    def ask(self, kind, **values):
        """Return the code of refusal and its reason in the log, None: it was done."""
        with structlog.testing.capture_logs() as lines:
            try:
                self.workshop.do(kind, values)
            except Refused as refused:
                return refused.code, lines[-1]["reason"]
        return None


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    monkeypatch.setattr(asking, "ANSWERS_IN_S", 0.05)


@pytest.fixture
def serviced(loop):
    return Serviced(loop(configuration=CONFIG.model_dump()))


def test_new_pads_reach_the_loop_and_leave_its_parameters(serviced):
    before = serviced.ecu.params.tobytes()
    assert serviced.ask(Kind.NEW_PADS, fl=0.0, fr=0.0) is None
    assert serviced.ecu.state["learned"]["wear"]["told"].tolist() == [[1, 1, 0, 0]]
    assert serviced.ecu.params.tobytes() == before
    assert in_force(serviced.run.ring).work == Work(Kind.NEW_PADS, {"fl": 0.0, "fr": 0.0})
    assert serviced.ask(Kind.FORGET) is None
    assert in_force(serviced.run.ring).number == 2


def test_a_calibration_in_force_stays_in_force(serviced):
    control = {**CONFIG.control.model_dump(), "max_pressure_rate": 2000.0}
    params = new_params(config_of({**CONFIG.model_dump(), "control": control}, ""))
    ask(serviced.run.ring, params, {"control": control}, round(1e9 * (monotonic_s() + 1)))
    serviced.ecu.params["transmit"] = 0
    serviced.look(0)
    assert serviced.ecu.params["max_pressure_rate"] == 2e8
    assert serviced.ask(Kind.NEW_PADS, fl=0.0) is None
    assert serviced.ecu.params["max_pressure_rate"] == 2e8
    assert in_force(serviced.run.ring).tables == {"control": control}


def test_thicknesses_become_wear(serviced):
    new = CONFIG.front.pad.thickness_new
    assert serviced.ask(Kind.MEASURED_PADS, fl=new - 1.5) is None
    assert in_force(serviced.run.ring).work.wear == {"fl": pytest.approx(1.5)}
    assert serviced.ecu.state["wear"]["wear"][0, 0] == pytest.approx(1.5, abs=0.2)


@pytest.mark.requirement("REQ-WORK-1")
@pytest.mark.parametrize("kind", list(Kind))
def test_nothing_reaches_the_loop_while_the_car_moves(kind, serviced):
    serviced.ecu.estimate["speed"] = 1.0
    before = serviced.ecu.state.tobytes()
    code, reason = serviced.ask(kind, fl=10.0)
    assert code == 0x22
    assert reason.startswith("the car does not stand with released brakes")
    assert serviced.ecu.state.tobytes() == before
    assert in_force(serviced.run.ring) is None


@pytest.mark.parametrize(("thickness", "says"), [(14.0, "thicker than the 12 mm"), (0.01, "in mm, without")])
def test_thicknesses_that_cannot_be(thickness, says, serviced):
    code, reason = serviced.ask(Kind.MEASURED_PADS, rl=10.0, fl=thickness)
    assert code == 0x31
    assert says in reason
    assert in_force(serviced.run.ring) is None


def test_without_a_state_folder_nothing_is_done(serviced):
    assert Serviced(serviced.run, kept=False).ask(Kind.FORGET) == (
        0x22,
        "nothing would be kept; start with --state",
    )
    assert in_force(serviced.run.ring) is None


@pytest.mark.parametrize("what", ["disk full", "no recorder"])
def test_what_is_done_and_not_stored_is_no_success(what, serviced):
    if what == "disk full":
        serviced.run.publish(1, active_faults=NOT_KEPT)
    serviced.follows = what == "disk full"
    code, reason = serviced.ask(Kind.NEW_PADS, fl=0.0)
    assert (code, reason.partition(",")[0]) == (0x72, "done")


def test_while_another_asks_it_is_busy(serviced, monkeypatch):
    def busy(*_):
        raise Busy("another process asks")

    monkeypatch.setattr("ecu.diagnostics.workshop.worked", busy)
    assert serviced.ask(Kind.FORGET) == (0x21, "another process asks")
