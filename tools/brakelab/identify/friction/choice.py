"""`brake-ecu identify friction`: all laws on one recording, and the choice among them.

Choice. Every law is identified twice: on all stops, and without those held out. Held out is the programme
that was given for it, else the fifth of the stops that begin hottest: a law that only copies what it saw
shows itself there. It is judged as it is used: in closed loop, for with the measured pressure a law that
loses the brake costs nothing, and from its own memory at the start of every stop, which no car measures.
Without a programme that was given, the other four fifths count as well as the hottest: a law that is right
when hot alone is wrong in most stops. Least error wins; of laws within 5 % of it, the least information
criterion (Schwarz's, with stops as observations, since the residuals of one stop hang together). But what is
held out lies 25 K beyond the rest, and a car brakes 100 K hotter than a programme: a law that goes on beyond
the data must be better by a quarter than every one that stays what it is at their edge. A law of more numbers
than there are stops is not chosen: the samples of one stop hang together, so nothing shows that many.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from typing import Final, NamedTuple

import numpy as np

from brakelab.identify.friction.candidate import Candidate
from brakelab.identify.friction.candidates import candidates
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.fit import Fitted, error_of, fit, nrmse, refit, replayed
from brakelab.identify.friction.stops import Stops, some
from brakelab.plant.friction.law import Law, RigBrake
from brakelab.results.processes import new_pool

HELD_OUT: Final = 0.2
TIE: Final = 1.05
STAYS: Final = 1.25  # of the least error, up to which a law that is bounded comes first
PROCESSES: Final = 2
FEWEST_STOPS: Final = 5  # that show a scatter
SURELY: Final = 2.0  # standard deviations, of two laws that differ


class Judged(NamedTuple):
    """A law that was identified."""

    name: str
    law: Law
    starts_at_measured: bool
    free: int
    error: float  # nRMSE [%] on what it was identified with
    held_out: float  # nRMSE [%] on what it had not seen, as it is used
    overall: float  # nRMSE [%] by which the law is chosen
    bounded: bool  # beyond the data stays what it is at their edge
    criterion: float  # less is better
    numbers: tuple[tuple[str, str, float, float], ...]  # name, unit, value, half of the interval of 95 %
    unidentified: tuple[str, ...]
    starts: str  # that agreed, of those tried
    extrapolates: str
    misses: tuple[float, ...] = ()
    """Mean square of each stop that it had not seen, as it is used."""


class Identified(NamedTuple):
    """All laws, in the order of `candidates`, and which was chosen."""

    laws: tuple[Judged, ...]
    chosen: Judged
    stops: int
    speed: tuple[float, float]  # m/s, sliding, least and greatest seen
    pressure: tuple[float, float]  # Pa
    temperature: tuple[float, float]  # degC


class Job(NamedTuple):
    """What is identified and judged; without `unseen` by the hottest of `stops`."""

    name: str
    brake: RigBrake
    stops: Stops
    unseen: Stops | None
    own: tuple[str, ...]


def hottest(stops: Stops) -> tuple[Stops, Stops]:
    """Return the stops without the fifth that begins hottest, and that fifth."""
    order = np.argsort(stops.start_temperature, kind="stable")
    cut = round((1.0 - HELD_OUT) * len(stops))
    return some(stops, np.sort(order[:cut])), some(stops, np.sort(order[cut:]))


def known_candidates(columns: Columns, stops: Stops, own: Sequence[str] = ()) -> list[Candidate]:
    """Return the laws that recordings can show: of summaries none that starts at a friction of its stop.

    Raises:
        ValueError: as `candidates`.
    """
    laws = candidates(stops, columns.brake, own)
    return [law for law in laws if not (columns.columns.speed_end and law.starts_at_measured)]


def identify(
    columns: Columns,
    stops: Stops,
    unseen: Stops | None,
    progress: Callable[[str], None],
    own: tuple[str, ...] = (),
) -> Identified:
    """Return all laws identified on `stops` and judged on `unseen`, by default the hottest of `stops`.

    `progress` receives a line for each law; `own`: files and entry points of own laws. Two processes.
    """
    names = [candidate.name for candidate in known_candidates(columns, stops, own)]
    jobs = [Job(name, columns.brake, stops, unseen, own) for name in names]
    done: dict[str, Judged] = {}
    with new_pool(PROCESSES) as pool:
        running = [pool.submit(judge, job) for job in reversed(jobs)]  # the slowest first
        for future in as_completed(running):
            judged = future.result()
            done[judged.name] = judged
            progress(
                f"{len(done)} of {len(jobs)}: {judged.name}, nRMSE {judged.error:.2f} %, "
                f"unseen {judged.held_out:.2f} %, {judged.starts} starts agree"
            )
    laws = tuple(done[name] for name in names)
    return Identified(
        laws,
        choose(laws, len(stops)),
        len(stops),
        _span(stops.speed),
        _span(stops.held_pressure),
        _span(stops.temperature),
    )


def judge(job: Job) -> Judged:
    """Return one law identified and judged."""
    candidate = next(c for c in candidates(job.stops, job.brake, job.own) if c.name == job.name)
    fitted = fit(candidate, job.brake, job.stops)
    if job.unseen is None:
        seen, unseen = hottest(job.stops)
        law = refit(fitted, job.brake, seen)
    else:
        law, unseen = fitted.law, job.unseen
    overall = held_out = error_of(law, job.brake, unseen, closed=True)
    off = replayed(law, job.brake, unseen, starts_at_measured=False, closed=True) - unseen.mu
    samples = np.bincount(unseen.block_stop, minlength=len(unseen))
    misses = np.bincount(unseen.block_stop, off**2, len(unseen)) / np.maximum(samples, 1)
    if job.unseen is None:
        every = error_of(fitted.law, job.brake, job.stops, closed=True)
        overall = float(np.sqrt((1.0 - HELD_OUT) * every**2 + HELD_OUT * held_out**2))
    return Judged(
        candidate.name,
        fitted.law,
        candidate.starts_at_measured,
        candidate.size,
        nrmse(fitted.residuals, job.stops),
        held_out,
        overall,
        candidate.bounded,
        criterion(fitted, job.stops),
        tuple(
            (free.name, free.unit, value, float(half))
            for free, value, half in zip(candidate.free, fitted.values, fitted.half, strict=True)
        ),
        tuple(fitted.unidentified()),
        f"{fitted.agreed} of {fitted.tried}",
        candidate.extrapolates,
        tuple(misses.tolist()),
    )


def criterion(fitted: Fitted, stops: Stops) -> float:
    """Return n ln(mean square) + k ln n, n the number of stops."""
    count = len(stops)
    mean_square = max(float(np.mean(fitted.residuals**2)), 1e-300)
    return count * float(np.log(mean_square)) + fitted.candidate.size * float(np.log(count))


def choose(laws: tuple[Judged, ...], stops: int) -> Judged:
    """Return the law of least error, identified on `stops`; see above for ties."""
    laws = tuple(judged for judged in laws if judged.free <= stops) or laws
    least = min(judged.overall for judged in laws)
    staying = [judged for judged in laws if judged.bounded and judged.overall <= STAYS * least]
    among = staying or laws
    best = min(judged.overall for judged in among)
    return min((one for one in among if one.overall <= TIE * best), key=lambda one: one.criterion)


def ties(laws: Sequence[Judged], chosen: Judged) -> list[Judged]:
    """Return the laws that miss the stops not seen as the chosen one does, within their scatter.

    Pairs, stop by stop: a stop that is hard to tell is hard for all.
    """
    found = []
    for judged in laws:
        if judged.name == chosen.name or len(judged.misses) < FEWEST_STOPS:
            continue
        more = np.array(judged.misses) - np.array(chosen.misses)
        if abs(more.mean()) < SURELY * more.std(ddof=1) / np.sqrt(len(more)):
            found.append(judged)
    return found


def _span(values: np.ndarray) -> tuple[float, float]:
    low, high = np.percentile(values, [0.5, 99.5])
    return float(low), float(high)
