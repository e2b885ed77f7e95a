"""`brake-ecu lab` and `brake-ecu identify friction`."""

from pathlib import Path
from typing import Final, NamedTuple

from rich.console import Console

from brakelab.identify.friction.analysis import history_effect, principal_components
from brakelab.identify.friction.choice import hottest, identify, known_candidates, ties
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.discovered_law import discovered_law
from brakelab.identify.friction.dynamometer import new_bench
from brakelab.identify.friction.fit import fit
from brakelab.identify.friction.heat_capacity import SLOW, UNSHOWN, heat_capacity, undelayed
from brakelab.identify.friction.lining_file import write_lining
from brakelab.identify.friction.page import write_report
from brakelab.identify.friction.recording import check_name, write_recording
from brakelab.identify.friction.sequence import read_sequence, run_sequence
from brakelab.identify.friction.stops import Stops, find_stops, say_dead
from brakelab.identify.friction.tables import (
    component_table,
    heat_line,
    history_line,
    law_tables,
    number_table,
    profile_table,
    residual_table,
)
from brakelab.identify.friction.whole import files_of, inputs_of, read_whole
from brakelab.plant.description import PlantFileError, read_file
from brakelab.plant.linings import Lining, Linings
from brakelab.results.outputs import check_outputs, write_text
from brakelab.results.progress import progress_bar
from brakelab.results.text_table import show
from ecu.errors import UserError
from ecu.output import argument, give, say, wrote
from ecu.settings.resources import named, resource

FEWEST_STOPS: Final = 10
"""Stops that identification needs."""
HELD_OUT: Final = "the fifth of the stops that begins hottest"


def run(
    programme: str, brake: str, seed: int, out: Path, law: str | None = None, linings: Path | None = None
) -> None:
    """Run a programme on the simulated dynamometer and write its recording.

    `programme`: a file, or a name of config/rig; `brake`: A, B or C, of which
    `seed` draws a pad and the sensors, or a lining of the file `linings`; `law`: of the lining, not a pad.

    Raises:
        UserError: a programme, brake or law of that name does not exist, or `out` ends in something else.
    """
    check_name(out)
    path, beside = named(programme, "config/rig"), out.with_suffix(".toml")
    check_outputs(out, (out, beside), [path, *([linings] if linings else [])])
    known = _linings(linings)
    if brake not in known:
        raise UserError("--brake", brake, f"no such brake; choose one of {', '.join(known)}")
    lining = known[brake]
    if linings is not None and law is None:
        raise UserError("--law", "", f"missing; --linings has laws, no pads: {', '.join(lining.friction)}")
    if law is not None and law not in lining.friction:
        raise UserError("--law", law, f"no such law; choose one of {', '.join(lining.friction)}")
    sequence = read_sequence(path)
    bench = new_bench(lining, brake, seed, law=law or "", mass=sequence.mass)
    rig = bench.rig[0]
    inertia = float(rig["mass"] * rig["tyre_radius"] ** 2)
    with progress_bar("lab run", 1.0) as advance:
        recording = run_sequence(bench, sequence, advance)
    write_recording(out, recording, lining, inertia, bench.noise.stated())
    hours, minutes = bench.time / 3600.0, recording.time.size / 200.0 / 60.0
    say(f"{hours:.1f} h on the rig, {minutes:.0f} min recorded")
    give(hours=hours, minutes_recorded=minutes)
    data, lining_file = argument(out), argument(out.with_name(f"{out.stem}-lining.toml"))
    wrote(
        out,
        beside,
        next=f"brake-ecu lab report {data}; brake-ecu identify friction {data} --out {lining_file}",
    )


def look(data: list[Path], columns: Path | None) -> None:
    """Print principal components, the effect of the previous stop and the disc's heat."""
    _refuse_twice(data)
    measured = _read(data, columns)
    stops = measured.stops
    _need(stops, data[0])
    console = Console()
    show(console, component_table(principal_components(stops)))
    give(stops=len(stops))
    console.print(history_line(history_effect(stops)), highlight=False)
    console.print(heat_line(heat_capacity(stops, measured.columns)), highlight=False)


def friction(
    data: list[Path],
    columns: Path | None,
    held_out: Path | None,
    out: Path,
    profile: str | None = None,
    own: tuple[str, ...] = (),
    discover: Path | None = None,
) -> None:
    """Identify all laws, print them, and write them with the chosen one as a lining file.

    A page with the law's fit is written beside it, with the ending .html.

    `data` are recordings of one brake; `columns` describes them all, default: the file beside each;
    `held_out` is a recording that the choice is made by; `own` are laws of one's own; to `discover` a law of
    the terms that these stops show is written, which is then identified like those.

    Raises:
        UserError: a file cannot be read or makes no physical sense, or holds too few stops; one line.
    """
    page = out.with_suffix(".html")
    recordings = [*data, *([held_out] if held_out else [])]
    read = [*inputs_of(recordings, columns), *map(Path, own)]
    check_outputs(out, (out, page), read, toml=True)
    _refuse_twice(data, held_out)
    if discover is not None:
        if discover.suffix != ".py":
            raise UserError("--discover", str(discover), "is written as Python; let the name end in .py")
        check_outputs(discover, (discover,), read, option="--discover")
    measured = _read(data, columns)
    _need(measured.stops, data[0])
    heat = heat_capacity(measured.stops, measured.columns)
    if not heat.known:
        say(f"{data[0]}: {UNSHOWN}; what friction does with temperature cannot be known from it")
    elif heat.lag > SLOW:
        say(f"{data[0]}: the thermocouple lags {heat.lag:.1f} s: what it has not shown is added by the work")
    measured = measured._replace(stops=undelayed(measured.stops, heat, measured.columns))
    if discover is not None:
        seen = measured.stops if held_out is not None else hottest(measured.stops)[0]
        found, code = discovered_law(seen)
        write_text(discover, code, "--discover")
        say(f"{discover}: {', '.join(found.names())}; nRMSE {found.error:.2f} % in the search")
        own = (*own, str(discover))
    own = tuple(str(Path(code).resolve()) if code.endswith(".py") else code for code in own)
    try:
        known = known_candidates(measured.columns, measured.stops, own)
    except ValueError as error:
        raise UserError("--own", "", str(error)) from None
    laws = {candidate.name: candidate for candidate in known}
    if profile is not None and profile not in laws:
        raise UserError("--profile", profile, f"no such law; choose one of {', '.join(laws)}")
    unseen = None
    if held_out is not None:
        unseen = undelayed(_read([held_out], columns).stops, heat, measured.columns)
    described = HELD_OUT if held_out is None else str(held_out)
    identified = identify(measured.columns, measured.stops, unseen, say, own)
    tables = [
        *law_tables(identified, described),
        *([number_table(identified.chosen)] if identified.chosen.numbers else []),
        residual_table(identified.chosen, measured.columns, measured.stops),
    ]
    if profile is not None:
        fitted = fit(laws[profile], measured.columns.brake, measured.stops)
        tables.append(profile_table(fitted, measured.columns.brake, measured.stops, say))
    for table in tables:
        show(Console(), table)
    write_lining(out, measured.columns, measured.heating, identified)
    write_report(page, measured.columns, measured.stops, identified, tables, unseen)
    tied = [judged.name for judged in ties(identified.laws, identified.chosen)]
    give(chosen=identified.chosen.name, ties=tied, stops=identified.stops)
    wrote(out, page)
    if tied:
        say(
            f"{out}: tie: {', '.join(tied)} miss the stops not seen as {identified.chosen.name} does, within "
            "their scatter; another programme as --held-out shows more"
        )
    say(f"{out}: the law chosen under the name SIM; {page}: how well and how far it holds")


def _linings(path: Path | None) -> dict[str, Lining]:
    """Return the linings of a file, or those that are shipped."""
    if path is None:
        return read_file(resource("config/plant/linings.toml"), Linings).lining
    try:
        return read_file(path, Linings).lining
    except PlantFileError as error:
        raise UserError(str(path), error.place, error.remedy) from None


class _Measured(NamedTuple):
    columns: Columns
    stops: Stops
    heating: float  # K/J


def _read(data: list[Path], columns: Path | None) -> _Measured:
    """Return the stops of recordings of one brake, one after the other."""
    whole = read_whole(data, columns)
    time = whole.recording.time
    stops = find_stops(whole.recording._replace(time=time - time[0]), whole.columns, str(data[0]))
    say_dead(stops, str(data[0]))
    return _Measured(whole.columns, stops, whole.heating)


def _refuse_twice(data: list[Path], held_out: Path | None = None) -> None:
    """Refuse a recording that would count twice, or judge the law that is made of it.

    Raises:
        UserError: names the file.
    """
    seen: set[Path] = set()
    for path, _ in files_of(data, None):
        if path.resolve() in seen:
            raise UserError(str(path), "", "is given twice; a recording counts once")
        seen.add(path.resolve())
    for path, _ in files_of([held_out] if held_out else [], None):
        if path.resolve() in seen:
            remedy = (
                f"{path}: a law is made of it and cannot be judged by it; give another programme, or none"
            )
            raise UserError("--held-out", "", remedy)


def _need(stops: Stops, path: Path) -> None:
    if len(stops) < FEWEST_STOPS:
        raise UserError(str(path), "", f"{len(stops)} stops; needs {FEWEST_STOPS}")
