"""The bench of the friction laws: its figures are those that an audit of the thesis found reachable."""

import pytest

from brakelab.bench import command
from brakelab.plant.description import load_plant
from brakelab.plant.linings import Linings
from brakelab.studies import output
from brakelab.studies.physics.friction import (
    BRAKES,
    RUNS,
    TABLE_3_4,
    free_inertia,
    friction_tables,
    rms_row,
    run_means,
)
from ecu import cli
from ecu.settings.resources import resource


@pytest.fixture(scope="module")
def linings() -> Linings:
    return load_plant(resource("config/plant/suv.toml")).linings


@pytest.mark.parametrize(
    ("title", "by_brake", "together"),
    [
        ("R1, replayed", (1.1, 2.6, 1.9), 1.96),
        ("R2, replayed", (1.1, 2.7, 2.0), 2.03),
        ("as printed, sign of b mended, replayed", (10.7, 16.0, 10.4), 12.6),
        ("Ostermeyer, inertia of R1, replayed", (3.7, 1.7, 4.8), 3.65),
        ("R1, closed loop", (7.6, 9.1, 19.0), 13.0),
        ("R2, closed loop", (4.1, 4.8, 15.3), 9.6),
        ("SIM, closed loop", (0.04, 0.06, 0.10), 0.07),
    ],
)
def test_errors_against_table_3_4(
    linings: Linings, title: str, by_brake: tuple[float, ...], together: float
) -> None:
    run = next(run for run in RUNS if run.title == title)
    *each, everything = rms_row(run_means(linings, run), run.beside)
    assert each == pytest.approx(by_brake, abs=0.07)
    assert everything == pytest.approx(together, abs=0.05)


def test_ostermeyer_with_free_inertia(linings: Linings) -> None:
    _, errors = free_inertia(linings)
    assert errors == pytest.approx([1.4, 2.0, 3.7, 2.6], abs=0.1)


def test_every_column_of_table_3_4_is_complete() -> None:
    assert {len(column[brake]) for column in TABLE_3_4.values() for brake in BRAKES} == {6}


@pytest.mark.study
def test_the_bench_writes_its_page(monkeypatch: pytest.MonkeyPatch) -> None:
    written = []
    monkeypatch.setattr(output, "write_page", lambda name, *rest: written.append((name, len(rest[2]))))
    assert command.bench("friction", write=True) == 0
    assert written == [("friction.md", len(friction_tables()))]


def test_the_bench_prints_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["bench", "friction", "--json"]) == 0
    assert '"Nominal friction"' in capsys.readouterr().out
