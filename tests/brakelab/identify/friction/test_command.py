"""`brake-ecu lab` and `brake-ecu identify friction` from a recording to a law that the rig runs."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from brakelab.cli import app
from brakelab.identify.friction import choice, command
from brakelab.identify.friction.choice import Job, Judged, choose, hottest, judge, ties
from brakelab.identify.friction.columns import Columns, load_columns
from brakelab.identify.friction.fit import error_of
from brakelab.identify.friction.reader import read_recording
from brakelab.identify.friction.recording import Recording, write_recording
from brakelab.identify.friction.stops import Stops, find_stops
from brakelab.plant.description import read_file
from brakelab.plant.dynamometer import nominal_friction
from brakelab.plant.friction.constant import Constant
from brakelab.plant.friction.law import Law, RigBrake
from brakelab.plant.friction.own import Own
from brakelab.plant.linings import Lining, Linings, rig_with
from ecu.errors import UserError

FEW = ("constant", "ilvo")
"""Laws that are quickly identified."""


def test_ams_of_brake_b_is_written_and_read(tmp_path: Path) -> None:
    out = tmp_path / "ams.csv"
    done = CliRunner().invoke(app, ["lab", "run", "ams", "--brake", "B", "--seed", "3", "--out", str(out)])
    assert done.exit_code == 0, done.output
    read = read_recording(out)
    stops = find_stops(read.recording, read.columns, "ams.csv")
    assert len(stops) == 6
    assert stops.start_temperature == pytest.approx([50, 100, 150, 200, 250, 300], abs=3.0)
    assert load_columns(out.with_suffix(".toml")).rig.inertia == pytest.approx(stops.inertia)


def test_a_law_is_identified_and_runs_on_the_rig(
    tmp_path: Path,
    recording: Recording,
    lining: Lining,
    columns: Columns,
    stops: Stops,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The lining file has the chosen law as SIM; its nominal friction is what the recording shows."""
    few = [c for c in choice.candidates(stops, lining.brake) if c.name in FEW]
    monkeypatch.setattr(choice, "candidates", lambda stops, brake, own: few)
    monkeypatch.setattr(choice, "as_completed", list)
    data, out = tmp_path / "own.parquet", tmp_path / "brake.toml"
    assert columns.rig.inertia is not None
    write_recording(data, recording, lining, columns.rig.inertia)
    command.friction([data], None, None, out)
    page = out.with_suffix(".html").read_text("utf-8")
    assert "Friction law of mine: ilvo" in page
    assert "Do not extrapolate.</b> Seen: 8" in page
    found = read_file(out, Linings).lining["mine"]
    assert found.brake == lining.brake
    assert set(found.friction) == {"SIM", *FEW}
    assert found.friction["SIM"] == found.friction["ilvo"]
    nominal = nominal_friction(rig_with(found, "SIM"))
    near = np.abs(stops.held_pressure - 30e5) < 5e5
    seen = np.interp(100.0, stops.start_temperature[near], stops.mean[near])
    assert nominal == pytest.approx(seen, rel=0.1)


def test_a_law_of_one_s_own_is_identified_with_the_others(
    tmp_path: Path, recording: Recording, lining: Lining, columns: Columns, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is written names the file, from where it lies, and reads as what was fitted."""
    every = choice.candidates
    monkeypatch.setattr(
        choice,
        "candidates",
        lambda stops, brake, own: [c for c in every(stops, brake, own) if c.name in ("constant", "line")],
    )
    monkeypatch.setattr(choice, "as_completed", list)
    (tmp_path / "laws").mkdir()
    own, data, out = tmp_path / "laws" / "line.py", tmp_path / "own.parquet", tmp_path / "brake.toml"
    own.write_text(
        'NUMBERS = {"mu": ("–", 0.1, 0.8), "heat": ("1/K", -2e-3, 2e-3)}\n\n\n'
        "def step(numbers, memory, pressure, speed, slowing, temperature, dt):\n"
        "    return memory, numbers[0] * (1.0 + numbers[1] * (temperature - 100.0))\n"
    )
    assert columns.rig.inertia is not None
    write_recording(data, recording, lining, columns.rig.inertia)
    command.friction([data], None, None, out, own=(str(own),))
    assert 'code = "laws/line.py"' in out.read_text()
    found = read_file(out, Linings).lining["mine"].friction["line"]
    assert isinstance(found, Own)
    stops = find_stops(recording, columns, "x")
    heat = stops.temperature[stops.block_first[:, None] + np.arange(stops.per_block)].mean(axis=1)
    slope, level = np.polyfit(heat - 100.0, stops.mu, 1)
    assert found.numbers["mu"] == pytest.approx(level, rel=1e-3)
    assert found.numbers["heat"] * found.numbers["mu"] == pytest.approx(slope, rel=1e-2)


@pytest.mark.study
def test_found_terms_are_written_and_judged_as_a_law(
    tmp_path: Path, recording: Recording, lining: Lining, columns: Columns, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a drawn pad they explain more than a constant does; what is held out is not searched."""
    every, searched = choice.candidates, command.discovered_law
    few = ("constant", "terms")
    monkeypatch.setattr(
        choice, "candidates", lambda stops, brake, own: [c for c in every(stops, brake, own) if c.name in few]
    )
    monkeypatch.setattr(choice, "as_completed", list)
    counts: list[int] = []
    monkeypatch.setattr(command, "discovered_law", lambda stops: counts.append(len(stops)) or searched(stops))
    data, out, terms = tmp_path / "own.parquet", tmp_path / "brake.toml", tmp_path / "laws" / "terms.py"
    assert columns.rig.inertia is not None
    write_recording(data, recording, lining, columns.rig.inertia)
    command.friction([data], None, None, out, discover=terms)
    assert counts == [19]  # of 24, without the hottest fifth
    found = read_file(out, Linings).lining["mine"].friction["terms"]
    assert isinstance(found, Own)
    assert found.code == str(terms)
    stops = find_stops(recording, columns, "x")
    constant = read_file(out, Linings).lining["mine"].friction["constant"]
    errors = [error_of(law, lining.brake, stops, closed=True) for law in (found, constant)]
    assert errors[0] < 0.7 * errors[1]


def test_a_law_of_one_s_own_must_have_a_name_of_its_own(tmp_path: Path) -> None:
    own, data = tmp_path / "ilvo.py", tmp_path / "cpc.csv"
    own.write_text(
        'NUMBERS = {"mu": ("–", 0.1, 0.8)}\n\n\ndef step(numbers, memory, *u):\n    return memory, 0.4\n'
    )
    command.run("cpc", "A", 0, data)
    with pytest.raises(UserError, match="ilvo: two laws of this name"):
        command.friction([data], None, None, tmp_path / "out.toml", own=(str(own),))


def test_a_recording_counts_once_and_does_not_judge_its_own_law(tmp_path: Path) -> None:
    """Whatever it is called by, and in a folder, too."""
    data, out = tmp_path / "rig" / "ams.csv", tmp_path / "out.toml"
    command.run("ams", "A", 0, data)
    with pytest.raises(UserError, match=r"ams\.csv: is given twice; a recording counts once"):
        command.look([data, data.parent / "." / ".." / "rig" / "ams.csv"], None)
    with pytest.raises(UserError, match=r"--held-out: .*cannot be judged by it; give another programme"):
        command.friction([data.parent], None, data, out)


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda f: command.run("cpc", "D", 0, f), "--brake: D: no such brake; choose one of A, B, C"),
        (
            lambda f: command.run("cpd", "A", 0, f),
            "cpd: no such file, and none that is shipped (ak-master, ams, cpc, j2707, pressure-gradient)",
        ),
        (lambda f: command.run("ams", "A", 0, f, "R9"), "--law: R9: no such law; choose one of SIM, R1"),
        (lambda f: command.run("ams", "A", 0, f.with_suffix(".xls")), "ends in .csv or .parquet"),
        (lambda f: command.friction([f], None, None, f.with_name("law.toml")), "6 stops; needs 10"),
        (
            lambda f: command.friction(
                [f], None, None, f.with_name("law.toml"), discover=f.with_name("law.txt")
            ),
            "is written as Python; let the name end in .py",
        ),
    ],
)
def test_one_line_says_what_to_do(tmp_path: Path, call, line: str) -> None:
    out = tmp_path / "data.csv"
    command.run("ams", "A", 0, out)
    with pytest.raises(UserError) as error:
        call(out)
    assert line in str(error.value)


@pytest.mark.parametrize(("kelvin", "refused"), [(0.0, ""), (273.15, "stop00.csv and 23 more")])
def test_a_file_may_hold_a_single_hot_stop(
    tmp_path: Path, recording: Recording, lining: Lining, columns: Columns, kelvin: float, refused: str
) -> None:
    ends = [0, *np.flatnonzero(np.diff(recording.time) > 1.0) + 1, len(recording.time)]
    paths = [tmp_path / f"stop{number:02d}.csv" for number in range(len(ends) - 1)]
    for path, begin, end in zip(paths, ends[:-1], ends[1:], strict=True):
        stop = Recording(*(values[begin:end] for values in recording))
        hot = 100.0 * (stop.temperature[0] > 190.0) + kelvin
        write_recording(path, stop._replace(temperature=stop.temperature + hot), lining, columns.rig.inertia)
    if not refused:
        command.look(paths, None)
        return
    with pytest.raises(UserError, match=f'{refused}.*reads like K: give the unit "K"'):
        command.look(paths, None)


def test_recordings_of_two_brakes_are_not_one(tmp_path: Path) -> None:
    for brake in "AB":
        command.run("ams", brake, 0, tmp_path / f"{brake}.csv")
    with pytest.raises(UserError, match="identify one brake at a time"):
        command.look([tmp_path / "A.csv", tmp_path / "B.csv"], None)


def judged(name: str, overall: float, criterion: float) -> Judged:
    law = Constant(law="constant", rig_mass=1.0, mu=0.4)
    return Judged(name, law, False, 1, 1.0, 1.0, overall, "stays" in name, criterion, (), (), "4 of 4", "")


@pytest.mark.parametrize(
    ("laws", "expected"),
    [
        ([("a", 4.0, -10.0), ("b", 6.0, -90.0)], "a"),
        ([("a", 4.00, -10.0), ("b", 4.15, -90.0)], "b"),
        ([("a", 4.00, -10.0), ("b", 4.25, -90.0)], "a"),
        ([("a", 4.00, -90.0), ("stays", 4.95, -10.0)], "stays"),
        ([("a", 4.00, -90.0), ("stays", 5.05, -10.0)], "a"),
        ([("a", 4.00, -90.0), ("stays", 4.30, -10.0), ("stays too", 4.90, -20.0)], "stays"),
        ([("a", 4.00, -90.0), ("stays", 4.30, -10.0), ("stays too", 4.45, -20.0)], "stays too"),
    ],
    ids=[
        "least error",
        "a tie goes to the criterion",
        "more than 5 % is no tie",
        "what stays beyond the data comes first",
        "unless it is worse by a quarter",
        "of two that stay the better",
        "of two that stay and tie the one of less criterion",
    ],
)
def test_the_choice(laws: list[tuple[str, float, float]], expected: str) -> None:
    assert choose(tuple(judged(*law) for law in laws), 60).name == expected


def test_laws_that_miss_the_same_stops_alike_are_a_tie() -> None:
    """Stops differ by far more than the laws do; in each one law is surely worse, another is not."""
    random = np.random.default_rng(3)
    hard = random.lognormal(-6.0, 1.0, 40)
    near, far = (hard * (1.0 + of + 0.2 * random.standard_normal(40)) for of in (0.02, 0.5))
    laws = [
        judged(name, 4.0, -10.0)._replace(misses=tuple(m))
        for name, m in zip("abc", (hard, near, far), strict=True)
    ]
    assert [one.name for one in ties(laws, laws[0])] == ["b"]
    assert ties([one._replace(misses=one.misses[:3]) for one in laws], laws[0]) == []


def test_a_law_of_more_numbers_than_stops_is_not_chosen() -> None:
    laws = judged("a", 3.0, -10.0), judged("stays", 2.8, -20.0)._replace(free=93)
    assert [choose(laws, stops).name for stops in (60, 315)] == ["a", "stays"]


def test_a_law_is_judged_as_it_is_used(
    stops: Stops, columns: Columns, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ostermeyer's is fitted from the friction that each stop began with, which a car does not measure."""

    def error(law: Law, brake: RigBrake, judged: Stops, closed: bool) -> float:
        assert closed
        return 3.0 if len(judged) == len(stops) else 4.0

    monkeypatch.setattr(choice, "error_of", error)
    found = judge(Job("ostermeyer", columns.brake, stops, None, ()))
    assert found.starts_at_measured
    assert found.overall == pytest.approx(np.sqrt(0.8 * 3.0**2 + 0.2 * 4.0**2))


def test_a_programme_that_is_given_decides_alone(stops: Stops, columns: Columns) -> None:
    seen, unseen = hottest(stops)
    found = judge(Job("constant", columns.brake, seen, unseen, ()))
    assert found.overall == found.held_out == error_of(found.law, columns.brake, unseen, closed=True)


def test_held_out_are_the_hottest(stops: Stops) -> None:
    seen, unseen = hottest(stops)
    assert len(seen) == 19
    assert len(unseen) == 5
    assert seen.start_temperature.max() <= unseen.start_temperature.min()


def test_a_wrong_ending_is_refused_before_the_programme_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "new_bench", lambda *_, **__: pytest.fail("the rig was started"))
    with pytest.raises(UserError, match=r"ends in \.csv or \.parquet"):
        command.run("ams", "A", 0, tmp_path / "data.xls")


PROGRAMMES = {
    "a table": (b"speed,level\n80,30\n", "not valid TOML"),
    "a recording": (b"PAR1\xff\xfe\x00", "is no text; give a programme"),
    "sections without a speed": (b'title = "x"\n[gate]\n[[section]]\nname = "1"\n', "section|gate"),
}


@pytest.mark.parametrize(("text", "said"), PROGRAMMES.values(), ids=PROGRAMMES)
def test_a_programme_that_is_none_is_refused_in_one_line(tmp_path: Path, text: bytes, said: str) -> None:
    (tmp_path / "p.toml").write_bytes(text)
    with pytest.raises(UserError, match=said) as caught:
        command.run(str(tmp_path / "p.toml"), "A", 0, tmp_path / "out.csv")
    assert "\n" not in str(caught.value)
