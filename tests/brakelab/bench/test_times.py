"""The benches of times, in short: is the work the same on both sides, are the rows complete?"""

import json
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest

from brakelab.bench import command, times
from brakelab.bench.braking import MESSAGES_IN, simulated_stop
from brakelab.bench.codec import codec_rows, plan_of_the_bench, protected_frames
from brakelab.bench.cycle import bursts, cycle_rows, our_side, python_side, run_cycles, thrice
from brakelab.bench.filters import FilterpyFilters, NumpyFilters, constants, filter_cycles, new_observer
from brakelab.bench.plant import cars, plant_rows
from brakelab.bench.socket_pair import put
from brakelab.bench.step import filter_table, step_rows
from brakelab.studies import output
from brakelab.studies.measure import Figure, Row
from brakelab.studies.study import Asked, Entered
from ecu import cli
from ecu.bus.receive import new_reception, receive
from ecu.bus.receive_plan import contract_receive_plan
from ecu.contract.records import FRAME, INPUTS, STAGES, new_record
from ecu.contract.signals import INPUT
from ecu.errors import UserError
from ecu.settings.resources import resource

pytestmark = pytest.mark.study

FIGURE = Figure(2.0, 1.0, 4.0)


def assert_sane(rows: list[Row], names: set[str]) -> None:
    assert {row.what for row in rows} == names
    for row in rows:
        figures = [row.ours] if row.peer is None else [row.ours, row.peer]
        assert all(0.0 < figure.low <= figure.median <= figure.high for figure in figures), row
        assert row.unit == "µs"
        assert row.note


@pytest.mark.parametrize("kind", [NumpyFilters, FilterpyFilters])
def test_all_filters_find_the_same_friction(kind: Any) -> None:
    if kind is FilterpyFilters:
        pytest.importorskip("filterpy")
    params, _, _, table = filter_table(cycles=200)
    observer = new_observer(params, table)
    peer = kind(constants(params), table[0])
    begin = observer["mu"][0].copy()
    filter_cycles(params, observer, table)
    for row in table:
        peer.cycle(row)
    found = peer.x[:, 2] if kind is NumpyFilters else [float(wheel.x[2, 0]) for wheel, *_ in peer.wheels]
    assert np.abs(observer["mu"][0] - begin).max() > 0.02  # they had something to find
    np.testing.assert_allclose(found, observer["mu"][0], rtol=1e-6)


def test_plant_rows() -> None:
    rows = plant_rows(rounds=2, steps=40)
    fleet = [what for what in (row.what for row in rows) if what.startswith("16 cars, 14 degrees, ")]
    assert 1 <= len(set(fleet)) <= 2
    assert_sane(rows, {"14 degrees of freedom", "7 degrees of freedom", *fleet})
    params, states, commands = cars("suv14", 3)
    assert (len(params), len(states), len(commands)) == (3, 3, 3)
    assert len(set(params["mass"])) == 3


def test_step_rows() -> None:
    rows = step_rows(rounds=2, cycles=20)
    whole, filters = "whole step", "four filters"
    callers = ("compiled loop", "called from Python")
    assert_sane(rows, {f"{what}, {caller}" for what in (whole, filters) for caller in callers})
    assert {"numpy" in row.note for row in rows} == {True, False}


def test_step_without_filterpy_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "filterpy.kalman", None)
    rows = step_rows(rounds=1, cycles=5)
    assert [row.note for row in rows if row.peer is None] == [
        "filterpy not installed: in the repository pip install '.[dev]', four filters only"
    ] * 2 + ["filterpy not installed: in the repository pip install '.[dev]'"] * 2


def test_all_frames_of_the_codec_bench_are_accepted_and_read_as_cantools_reads_them() -> None:
    frames = protected_frames(simulated_stop(), cycles=4)
    plan = plan_of_the_bench()
    reception, inputs = new_reception(plan), new_record(INPUTS)
    inputs["t_ns"] = frames["stamp_ns"][-1]
    receive(plan, reception, frames, 0, len(frames), inputs[0])
    assert int(reception.totals["rejected"][0]) == 0
    assert int(reception.messages["accepted"].sum()) == 4 * MESSAGES_IN
    database: Any = cantools.database.load_file(resource("dbc/brake_ecu.dbc"))
    for frame in frames[-MESSAGES_IN:]:
        data = frame["data"][: frame["length"]].tobytes()
        for name, value in database.decode_message(int(frame["can_id"]), data, decode_choices=False).items():
            if name in INPUT:
                assert inputs["value"][0, INPUT[name]] == pytest.approx(value, abs=1e-9), name


def test_codec_rows() -> None:
    rows = codec_rows(rounds=2, cycles=3)
    assert [row.what.split(",")[0] for row in rows] == ["decode", "decode", "encode", "encode"]
    assert_sane(rows, {row.what for row in rows})


def test_all_39_frames_of_a_cycle_are_accepted() -> None:
    [burst] = bursts(simulated_stop(), 1)
    plan = thrice(contract_receive_plan(resource("dbc/brake_ecu.dbc")))
    reception, inputs, frames = new_reception(plan), new_record(INPUTS), new_record(FRAME, len(burst))
    for frame, packet in zip(frames, burst, strict=True):
        frame["can_id"], frame["length"] = int.from_bytes(packet[:4], "little"), packet[4]
        frame["data"][:8] = list(packet[8:])
    receive(plan, reception, frames, 0, len(frames), inputs[0])
    assert int(reception.messages["accepted"].sum()) == 39
    assert reception.messages["accepted"].max() == 1


def test_a_cycle_takes_39_frames_and_sends_6(tmp_path: Path) -> None:
    stop = simulated_stop()
    for side in (our_side(stop, tmp_path), python_side(stop)):
        try:
            burst, *others = bursts(stop, 3)
            assert len(burst) == 39
            put(side.vehicle, burst)
            assert len(side.cycle()) == len(STAGES)  # it checks that all 39 arrived
            ids = [int.from_bytes(side.vehicle.recv(72)[:4], "little") for _ in range(6)]
            assert sorted(ids) == [80, 81, 82, 83, 513, 784]
            with pytest.raises(BlockingIOError):
                side.vehicle.recv(72)
            assert run_cycles(side, others).shape == (2, len(STAGES) + 1)
        finally:
            side.close()


def test_cycle_rows() -> None:
    rows = cycle_rows(rounds=2, cycles=15)
    names = {f"{stage} {label}" for stage in (*STAGES, "whole cycle") for label in ("p50", "p99", "max")}
    assert_sane(rows, names)


@pytest.fixture
def one_bench(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The command with one instant bench, in a checkout whose documentation is empty."""
    rows = [Row("a", FIGURE, Figure(6.0, 6.0, 6.0), "µs", "peer"), Row("b", FIGURE, None, "µs", "none")]
    monkeypatch.setattr(times, "BENCHES", {"step": times.Bench(lambda: rows, "step", "Below.")})
    (tmp_path / "docs" / "results").mkdir(parents=True)
    monkeypatch.setattr(output, "resource", lambda name: tmp_path / name)
    return tmp_path / "docs" / "results" / "benchmarks.md"


def test_json_holds_machine_figures_and_ratio(one_bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["bench", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert "Python" in printed["machine"]
    assert printed["step"][0]["ours"] == {"median": 2.0, "low": 1.0, "high": 4.0}
    assert [row["ratio"] for row in printed["step"]] == [3.0, None]
    assert not one_bench.exists()


def test_the_documentation_is_renewed_where_that_is_asked(
    one_bench: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for arguments in ([], ["step"], ["--json"]):
        assert cli.main(["bench", *arguments]) == 0
        assert not one_bench.exists()
    assert cli.main(["bench", "--write"]) == 0
    assert "| a | 2 (1–4) | 6 (6–6) | 3 | µs | peer |" in one_bench.read_text(encoding="utf-8")
    assert "| b | 2 (1–4) | – | – | µs | none |" in one_bench.read_text(encoding="utf-8")
    assert "Below." in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "asked", "remedy"),
    [
        ("step", Asked(), "no page of its own"),
        ("stops", Asked(draw="nominal"), "leave out --draw"),
        ("entries", Asked(entered=Entered(drive="mustang:a.log")), "leave out --observer, --drive"),
        ("friction", Asked(), "run it in a checkout"),
    ],
)
def test_what_has_no_page_is_refused_before_it_runs(
    name: str, asked: Asked, remedy: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(command, "resource", lambda name: tmp_path / name)
    with pytest.raises(UserError, match=remedy):
        command.bench(name, asked, write=True)


def test_unknown_bench_names_those_there_are() -> None:
    with pytest.raises(
        UserError, match="steps: no such bench; choose one of step, codec, plant, cycle, lateness"
    ):
        command.bench("steps")


def test_replay_tables() -> None:
    replay = pytest.importorskip("brakelab.bench.replay")
    reading, whole = replay.replay_tables(rounds=1, scenario="stop-2", part_s=1.0)
    formats = ("candump", "ASC", "BLF", "TRC", "MDF4")
    assert [row[0] for row in reading.rows] == [
        *(f"{name}: frames" for name in formats),
        "candump: signals",
        "MDF4: signals",
    ]
    assert [row[0] for row in whole.rows] == [*formats, replay.LONGEST_THREAD, "step alone"]
    assert all(name in whole.below for name in formats)
