"""Whether daemons are well, by their rings."""

import pytest

from ecu.watch import health
from ecu.watch.health import STALLED_S, ailments, main

from .conftest import MONO_NS

NOW_S = 1e-9 * MONO_NS


def test_a_daemon_is_well_while_its_cycles_advance(loop):
    one = loop()
    assert ailments(NOW_S) == ["suv on socketcan can0, process 4711: no cycle yet"]
    one.publish(1)
    assert ailments(NOW_S + STALLED_S) == []
    assert ailments(NOW_S + 0.6) == ["suv on socketcan can0, process 4711: no cycle for 0.6 s"]
    one.publish(3000)  # round the ring
    assert ailments(NOW_S + 30.0) == []
    one.close(by="SIGTERM")
    assert ailments(NOW_S + 30.0) == ["no daemon runs"]


def test_of_several_each_counts(loop):
    first, second = loop(1), loop(2, channel="can1")
    first.publish(100)
    second.publish(1)
    assert ailments(NOW_S + 1.0) == ["suv on socketcan can1, process 2: no cycle for 1.0 s"]


@pytest.mark.parametrize(("late_s", "code", "said"), [(0.1, 0, ""), (2.0, 1, "no cycle for 2.0 s\n")])
def test_the_command_says_so_by_its_exit_code(loop, monkeypatch, capsys, late_s, code, said):
    one = loop()
    one.publish(1)
    monkeypatch.setattr(health, "monotonic_s", lambda: NOW_S + late_s)
    assert main() == code
    assert capsys.readouterr().out.endswith(said)


def test_without_a_daemon_nothing_is_well(rings, capsys):
    assert (main(), capsys.readouterr().out) == (1, "no daemon runs\n")
