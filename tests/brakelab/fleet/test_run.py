"""The order of drives, what is carried from one to the next, and what a lost worker costs."""

import io
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from brakelab.fleet.cluster import Workers
from brakelab.fleet.job import Job, Outcome, metadata_of
from brakelab.fleet.manifest import VehicleDrive
from brakelab.fleet.output import brakes_file, keep, others
from brakelab.fleet.run import TRIES, Chain, Planned, run_fleet
from brakelab.replay.source import load_source
from brakelab.results.files import brakes_table
from brakelab.results.outputs import unfinished
from ecu.errors import RunFault, UserError
from ecu.settings.config import load_config
from ecu.settings.resources import resource

SUV, SEDAN = (load_config(resource(f"config/{name}.toml")) for name in ("suv", "sedan"))
SOURCE = load_source(None)
Task = Callable[[Job], Outcome]


class Died(Exception):
    """What a task raises whose worker is gone."""


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with ThreadPoolExecutor(2) as two:
        yield Workers(two, lambda: 2, Died)


def noting(harm: Callable[[Job], None] = lambda job: None) -> Task:
    """A task that appends the drive's name to what was learned; `bad` drives fail."""
    brakes = brakes_table([])

    def task(job: Job) -> Outcome:
        harm(job)
        summary = {"vehicle": job.vehicle, "drive": job.drive, "fault": "", "notes": "", "logs": ""}
        if job.drive.startswith("bad"):
            return Outcome(summary | {"fault": "damaged"}, b"", job.learned)
        outcome = Outcome(summary, b"", job.learned + job.drive.encode() + b" ")
        file = io.BytesIO()
        pq.write_table(brakes.replace_schema_metadata(metadata_of(job, outcome)), file)
        return outcome._replace(file=file.getvalue())

    return task


def fleet(**vehicles: str) -> list[Chain]:
    """Chains by vehicle, of drives named in a text; `!` marks another car's brakes."""
    chains = []
    for vehicle, names in vehicles.items():
        chain = Chain()
        for name in names.split():
            config = SEDAN if name.endswith("!") else SUV
            drive = VehicleDrive(vehicle, name, (f"/d/{name}",), Path("suv.toml"), None)
            chain.add(Planned(drive, config, SOURCE, 100, name, ""))
        chains.append(chain)
    return chains


def run(workers: Workers, chains: list[Chain], out: Path, task: Task) -> dict[str, dict[str, Any]]:
    """Summaries by drive, with `new`."""
    done = {}
    for planned, summary, new in run_fleet(workers, chains, out, task=task):
        done[f"{planned.drive.vehicle}/{planned.drive.name}"] = summary | {"new": new}
    return done


def learned(chain: Chain) -> list[str]:
    return [text.decode() for text in chain.learned.values()]


def test_what_was_learned_goes_along_in_order(workers: Workers, tmp_path: Path) -> None:
    chains = fleet(a="1 2 3 4 5 6", b="1", c="1 bad2 3", d="1 x! 2 y!")
    done = run(workers, chains, tmp_path, noting())
    assert len(done) == 14
    assert learned(chains[0]) == ["1 2 3 4 5 6 "]
    assert learned(chains[1]) == ["1 "]
    assert learned(chains[2]) == ["1 3 "]
    assert learned(chains[3]) == ["1 2 ", "x! y! "]
    assert [name for name, summary in done.items() if summary["fault"]] == ["c/bad2"]


def test_a_second_run_does_what_is_missing(workers: Workers, tmp_path: Path) -> None:
    run(workers, fleet(a="1 2 3", b="1 bad2 3"), tmp_path, noting())
    (tmp_path / "brakes/vehicle=a/2.parquet").unlink()
    chains = fleet(a="1 2 3", b="1 bad2 3 4")
    done = run(workers, chains, tmp_path, noting())
    assert {name for name, summary in done.items() if summary["new"]} == {"a/2", "b/bad2", "b/4"}
    assert learned(chains[0]) == ["1 2 3 "]
    assert learned(chains[1]) == ["1 3 4 "]


def test_a_log_that_changed_is_done_again(workers: Workers, tmp_path: Path) -> None:
    run(workers, fleet(a="1 2 3"), tmp_path, noting())
    chains = fleet(a="1 2 3")
    chains[0].drives[1] = chains[0].drives[1]._replace(mark="another")
    done = run(workers, chains, tmp_path, noting())
    # It taught what it taught before, so the drive after it stands.
    assert {name for name, summary in done.items() if summary["new"]} == {"a/2"}


def test_what_follows_from_another_input_is_done_again(workers: Workers, tmp_path: Path) -> None:
    run(workers, fleet(a="1 2 3 4", b="1 2"), tmp_path, noting())
    chains = fleet(a="1 bad2 3 4", b="1 2")
    done = run(workers, chains, tmp_path, noting())
    assert {name for name, summary in done.items() if summary["new"]} == {"a/bad2", "a/3", "a/4"}
    assert learned(chains[0]) == ["1 3 4 "]


def test_a_killed_worker_costs_its_drive_a_second_try(workers: Workers, tmp_path: Path) -> None:
    def die_once(job: Job) -> None:
        here = tmp_path / "died"
        if job.drive == "2" and not here.exists():
            here.touch()
            raise Died

    chains = fleet(a="1 2 3", b="1 3 4 5")
    done = run(workers, chains, tmp_path / "out", noting(die_once))
    assert learned(chains[0]) == ["1 2 3 "]
    assert learned(chains[1]) == ["1 3 4 5 "]
    assert done["a/2"]["tries"] == 2
    assert not any(summary["fault"] for summary in done.values())


def test_a_drive_that_kills_its_workers_fails_alone(workers: Workers, tmp_path: Path) -> None:
    def die(job: Job) -> None:
        if job.drive == "2":
            raise Died

    chains = fleet(a="1 2 3")
    done = run(workers, chains, tmp_path, noting(die))
    assert done["a/2"]["fault"] == f"/d/2: killed {TRIES} workers; is it too large?"
    assert learned(chains[0]) == ["1 3 "]


def test_a_task_that_raises_fails_alone(workers: Workers, tmp_path: Path) -> None:
    def fail(job: Job) -> None:
        if job.drive == "2":
            raise ValueError("of nothing")

    chains = fleet(a="1 2 3")
    done = run(workers, chains, tmp_path, noting(fail))
    assert done["a/2"]["fault"] == "/d/2: ValueError: of nothing"
    assert learned(chains[0]) == ["1 3 "]


def test_no_more_drives_are_handed_over_than_there_is_room_for(workers: Workers, tmp_path: Path) -> None:
    class Counting(ThreadPoolExecutor):
        most = here = 0

        def submit(self, *call: Any) -> Future[Any]:
            Counting.here += 1
            Counting.most = max(Counting.most, Counting.here)
            future = workers.executor.submit(*call)
            future.add_done_callback(lambda _: setattr(Counting, "here", Counting.here - 1))
            return future

    crew = Workers(Counting(), lambda: 3, Died)
    done = run(crew, fleet(**{f"v{k}": "1 2" for k in range(8)}), tmp_path, noting())
    assert len(done) == 16
    assert 1 < Counting.most <= 3


def test_a_scheduler_that_is_lost_is_one_line(tmp_path: Path) -> None:
    class Lost(ThreadPoolExecutor):
        def submit(self, *call: Any) -> Future[Any]:
            future: Future[Any] = Future()
            future.cancel()
            future.set_running_or_notify_cancel()
            return future

    with pytest.raises(RunFault, match="the Dask scheduler was lost"):
        run(Workers(Lost(), lambda: 1, Died), fleet(a="1"), tmp_path, noting())


def test_a_drive_s_file_is_whole_or_not_there(tmp_path: Path) -> None:
    """What a killed run left unfinished is nobody's drive."""
    outcome = Outcome({"vehicle": "a", "drive": "one", "fault": ""}, b"all of it", b"")
    path = brakes_file(tmp_path, "a", "one")
    keep(tmp_path, outcome)
    assert path.read_bytes() == b"all of it"
    unfinished(path).write_bytes(b"half")
    assert list(others(tmp_path, set())) == [path]
    (tmp_path / "full").write_text("no folder")
    with pytest.raises(UserError, match="cannot be written"):
        keep(tmp_path / "full", outcome)
