"""What Foxglove is given of a daemon; with foxglove-sdk itself where it is installed."""

import sys

import pytest

from ecu import cli
from ecu.contract.faults import WHEEL_SPEED_LOST
from ecu.contract.signals import OUTPUT_COLUMNS, topic_of
from ecu.settings.resources import resource
from ecu.watch import foxglove_server
from ecu.watch.foxglove_server import EVENTS, Publisher, schemas
from ecu.watch.watcher import Watcher


@pytest.fixture
def published(loop):
    """A loop, and its publisher with all that it has published: topic, message, time [ns]."""
    one, said = loop(), []
    logs = {
        topic: lambda message, stamp_ns, topic=topic: said.append((topic, message, stamp_ns))
        for topic in schemas()
    }
    publisher = Publisher(Watcher(None, now_s=iter(range(1000)).__next__), logs)
    return one, publisher, said


def test_each_row_is_published_once_with_what_is_available(published):
    one, publisher, said = published
    one.publish(8, vehicle_speed=20.0, mu_b=[0.4, 0.41, float("nan"), 0.43], active_faults=WHEEL_SPEED_LOST)
    publisher.turn()
    ecu = [message for topic, message, _ in said if topic == "/ecu"]
    assert [message["vehicle_speed"] for message in ecu] == [20.0, 20.0]
    assert ecu[0]["faults"] == ["wheel speed lost"]
    assert {topic: message.get("mu_b") for topic, message, _ in said if "corner" in topic} == {
        "/corner/fl": 0.4,
        "/corner/fr": 0.41,
        "/corner/rl": None,
        "/corner/rr": 0.43,
    }
    stamps = [stamp_ns for topic, _, stamp_ns in said if topic == "/ecu"]
    assert stamps[1] - stamps[0] == pytest.approx(40_000_000, abs=1000)
    said.clear()
    publisher.turn()
    assert said == []
    one.publish(4)
    publisher.turn()
    assert [topic for topic, _, _ in said].count("/ecu") == 1


def test_events_are_lines_of_a_log_each_once(published):
    one, publisher, said = published
    one.publish(4)
    one.publish(8, active_faults=WHEEL_SPEED_LOST)
    publisher.turn()
    lines = [message for topic, message, _ in said if topic == "/events"]
    assert any("wheel speed lost" in line["message"] and line["level"] == 3 for line in lines)
    assert [line["message"].startswith("attached to suv") for line in lines].count(True) == 1
    said.clear()
    publisher.turn()
    assert said == []


def test_messages_are_as_their_schemas_in_the_topics_of_an_mcap_file(published):
    one, publisher, said = published
    one.publish(8)
    publisher.turn()
    described = schemas()
    assert all(set(message) <= set(described[topic]["properties"]) for topic, message, _ in said)
    assert described["/corner/fl"]["properties"]["calliper_pressure"]["description"] == "bar"
    own = {("/ecu", name) for name in ("t", "clock", "lateness", "speaks", "faults")}
    places = {
        (topic, name) for topic in described for name in described[topic]["properties"] if topic != EVENTS
    }
    assert places - own <= {topic_of(column) for column in OUTPUT_COLUMNS}


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("--foxglove --web", "give one of them"),
        ("--foxglove --json", "give one of them"),
        ("--port 1", "--port: 1: is for --web or --foxglove"),
        ("--foxglove", "--foxglove: needs foxglove-sdk: "),
    ],
)
def test_wrong_arguments(words, says, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    assert cli.main(["watch", *words.split()]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_foxglove_is_served_on_this_machine_alone_and_a_taken_port_is_named(loop, monkeypatch, capsys):
    foxglove = pytest.importorskip("foxglove")
    one, first = loop(), foxglove.start_server(port=0)
    one.publish(8)
    hosts, start = [], foxglove.start_server

    def started(**options):
        hosts.append(options["host"])
        return start(**options)

    monkeypatch.setattr(foxglove, "start_server", started)
    assert cli.main(["watch", "--foxglove", "--port", str(first.port)]) == 2
    assert f"--port: {first.port}: cannot be served" in capsys.readouterr().err

    def end(watcher, turn):
        turn()
        return 0

    monkeypatch.setattr(foxglove_server, "follow", end)
    assert cli.main(["watch", "--foxglove", "--port", "0"]) == 0
    said = capsys.readouterr().out
    assert "ws://127.0.0.1:" in said
    assert resource(foxglove_server.LAYOUT).is_file()
    assert str(resource(foxglove_server.LAYOUT)) in said
    assert set(hosts) == {"127.0.0.1"}
    first.stop()
