"""Fleet replay (`brake-ecu fleet`): recorded drives of many vehicles, learned values carried along."""

from collections import Counter
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

import pyarrow.parquet as pq

from brakelab.fleet.cluster import connect
from brakelab.fleet.files import state_of
from brakelab.fleet.manifest import VehicleDrive, find_drives
from brakelab.fleet.output import brakes_file, others
from brakelab.fleet.page import write_page
from brakelab.fleet.run import Chain, Planned, run_fleet
from brakelab.fleet.statistics import notes
from brakelab.fleet.summary import summary_table, when
from brakelab.fleet.wear import pads_table
from brakelab.replay.source import announced, load_source
from brakelab.results.outputs import check_outputs
from brakelab.results.progress import progress_bar
from brakelab.simulation.configured import with_observer
from ecu.errors import UserError
from ecu.output import fault, give, say, wrote
from ecu.settings.config import load_config

GOES_ON: Final = "interrupted: the same command goes on with the rest"
SHOWN: Final = 20
"""Failures that are printed; all of them are in the report."""


def fleet(
    given: Sequence[str],
    config: Path | None,
    map: Path | None,
    observer: str | None,
    scheduler: str | None,
    workers: int | None,
    out: Path,
    rows: bool = False,
) -> int:
    """Replay the drives selected by `given` into `out`; return 0, or 1 if drives failed.

    Results of an earlier run in `out` are reused. After Ctrl-C completed drives stay, with their tables and
    page; returns 130.

    Raises:
        UserError: an argument, a manifest, a configuration or a map is invalid.
        RunFault: the scheduler was lost.
    """
    drives = find_drives(given, config, map, out)
    tables = [out / name for name in ("drives.parquet", "pads.parquet", "report.html")]
    names = {table.name for table in tables}
    logs = (Path(log) for drive in drives for log in drive.logs)
    check_outputs(out, tables, [log for log in logs if log.name in names])
    chains = plan(drives, observer)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError("--out", str(out), f"{error.strerror}; give a folder that can be written") from None
    out = out.resolve()
    total = sum(chain.left for chain in chains)
    done: list[dict[str, Any]] = []
    replayed, interrupted = 0, False
    with progress_bar("fleet", total) as advance, connect(scheduler, workers) as crew:
        try:
            for planned, summary, new in run_fleet(crew, chains, out, rows):
                done.append(summary)
                replayed += new and not summary["fault"]
                advance(planned.size)
        except KeyboardInterrupt:
            interrupted = True
    if not done:
        say(GOES_ON)
        return 130
    place = {(p.drive.vehicle, p.drive.name): k for k, p in enumerate(p for c in chains for p in c.drives)}
    done.sort(key=lambda summary: place[summary["vehicle"], summary["drive"]])
    pq.write_table(summary_table(done), tables[0], compression="zstd")
    pq.write_table(pads_table(done), tables[1], compression="zstd")
    write_page(done, tables[2])
    _tell(done, replayed, sum(len(chain.drives) for chain in chains), out)
    wrote(*tables)
    if interrupted:
        say(GOES_ON)
        return 130
    return 1 if any(summary["fault"] for summary in done) else 0


def plan(drives: Sequence[VehicleDrive], observer: str | None) -> list[Chain]:
    """Return the drives vehicle by vehicle, with their configurations, maps and the state of their logs."""
    config_of = cache(lambda path: with_observer(load_config(path), observer))
    source_of = cache(lambda path: announced(load_source(path)))
    chains: dict[str, Chain] = {}
    for drive in drives:
        size, marks, fault = 0, "", ""
        try:
            for log in drive.logs:
                more, mark = state_of(log)
                size, marks = size + more, marks + mark
        except UserError as error:
            fault = str(error)
        planned = Planned(drive, config_of(drive.config), source_of(drive.map), size, marks, fault)
        chains.setdefault(drive.vehicle, Chain()).add(planned)
    return list(chains.values())


def _tell(done: Sequence[dict[str, Any]], replayed: int, total: int, out: Path) -> None:
    faults = [summary for summary in done if summary["fault"]]
    for summary in faults[:SHOWN]:
        fault(f"failed: {summary['fault']}")
    if len(faults) > SHOWN:
        fault(f"failed: {len(faults) - SHOWN} more, see {out / 'report.html'}")
    again = [summary for summary in done if summary["tries"] > 1]
    for summary in again[:SHOWN]:
        names = f"{summary['vehicle']}/{summary['drive']}"
        say(f"tried again: {names}: its worker died, {summary['tries']} tries")
    for line in disorder(done):
        say(line)
    known = {brakes_file(out, summary["vehicle"], summary["drive"]) for summary in done}
    left = Counter(path.parent.name for path in others(out, known)) if len(done) == total else Counter()
    if left:
        say(
            f"{out / 'brakes'}: {left.total()} files are of drives not named now; they stay, remove them or"
            " name another --out"
        )
    noted = len(notes([summary for summary in done if not summary["fault"]]))
    hours = sum(summary.get("duration") or 0.0 for summary in done) / 3600.0
    kilometres = sum(summary.get("distance") or 0.0 for summary in done) / 1000.0
    vehicles = len({summary["vehicle"] for summary in done})
    print(
        f"{out}: {len(done) - len(faults)} of {total} drives of {vehicles} vehicle"
        f"{'s' * (vehicles != 1)}, {hours:.1f} h, {kilometres:.0f} km; {replayed} replayed now, "
        f"{len(faults)} failed, {noted} with notes on the log"
    )
    give(drives=total, done=len(done) - len(faults), replayed=replayed, with_notes=noted)
    give(vehicles=vehicles, hours=hours, kilometres=kilometres, failed=[one["fault"] for one in faults])


def disorder(done: Sequence[dict[str, Any]]) -> list[str]:
    """Return a line for each vehicle with a log that starts before its predecessor."""
    latest: dict[str, dict[str, Any]] = {}
    lines: dict[str, str] = {}
    for summary in done:
        start = summary.get("start_time")
        if start is None:
            continue
        before = latest.setdefault(summary["vehicle"], summary)
        if start < before["start_time"]:
            lines.setdefault(
                summary["vehicle"],
                f"vehicle {summary['vehicle']}: {summary['drive']} ({when(start)}) comes after"
                f" {before['drive']} ({when(before['start_time'])}); give their order in a manifest",
            )
        latest[summary["vehicle"]] = summary
    return list(lines.values())
