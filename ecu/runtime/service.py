"""Service `brake-ecu run`: prepare (`ecu/runtime/prepare.py`), cycle until a signal or fault, farewell, exit.

From READY on the loop logs nothing and waits for its deadline alone. However it ends, except by SIGKILL or a
crash of the interpreter, the last frames flag every demand invalid (`send_farewell`). Events reach the log
through the ring and the side process (`ecu/runtime/side_process.py`).
"""

import signal
from contextlib import suppress
from types import FrameType
from typing import Any, Final

from ecu.contract.records import STAGES, e2e_counts
from ecu.errors import RunFault
from ecu.recording.log import configure_logging
from ecu.recording.ring import close_ring, remove_ring
from ecu.runtime.calibration import consider
from ecu.runtime.clock import Grid, system_time
from ecu.runtime.cycle import Progress, cycle_once, send_farewell
from ecu.runtime.prepare import RunOptions, Session, prepare
from ecu.runtime.start import ENDING, IGNORED, left_at_once, signal_name

LOOK_AT_SIDE_CYCLES: Final = 10
SIDE_PATIENCE_S: Final = 30.0  # to write out the ring


def run(options: RunOptions) -> int:
    """Run the ECU on a bus until a signal comes; return the exit code 0.

    Raises:
        UserError: bad arguments or configuration, a bus that cannot be opened, or someone else already sends
            one of our frames.
        RunFault: no frame known to the ECU was received in the run, or the bus was off at its end.
    """
    configure_logging()
    stopping: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        stopping.append(number)

    for number in ENDING:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup
            signal.signal(number, stop)
    for number in IGNORED:
        signal.signal(number, signal.SIG_IGN)
    with left_at_once():
        session = prepare(options)
    progress = Progress(session.ecu, session.channel.status(), session.compiled, waits=session.waits)
    words: dict[str, Any] = {}
    off = False
    try:
        _cycle_until(session, progress, stopping)
        off = session.channel.status().bus_off
        words["by"] = signal_name(stopping[0])
    except BaseException as error:
        words["by"] = f"{type(error).__name__}: {error}"
        if isinstance(error, OSError):  # of the machine, not of an argument: a restart may help
            raise RunFault(f"the loop ended: {error}") from error
        raise
    finally:
        if progress.speaks:
            with suppress(Exception):  # even after an error the rest is still to be done
                send_farewell(session.ecu, session.channel, progress.number)
        _leave(session, {**words, **_summary(progress), "frames": e2e_counts(session.ecu.cycle)})
    where = f"{options.interface} {options.channel}"
    if not progress.number:  # stopped before the first cycle
        return 0
    if off:
        raise RunFault(f"{where}: the bus was off at the end: check wiring, bit rate and ip -details link")
    if not int(session.ecu.reception.messages["received"].sum()):
        raise RunFault(f"{where}: no frame of the database came in: check channel, bit rate and --map")
    return 0


def _cycle_until(session: Session, progress: Progress, stopping: list[int]) -> None:
    grid = Grid(system_time())
    watchdog = session.manager.watchdog_cycles
    while not stopping:
        cycle_once(session.ecu, session.channel, session.ring, grid, progress)
        if progress.number % LOOK_AT_SIDE_CYCLES == 0:
            progress.loop["kept"] = session.side.look(grid.deadline_ns)
            session.ring.header["followed"] = session.side.followed
            consider(session.ring, session.ecu, progress.number, grid.deadline_ns)
        if watchdog and progress.number % watchdog == 0:
            session.manager.tell("WATCHDOG=1")


def _leave(session: Session, words: dict[str, Any]) -> None:
    session.manager.tell("STOPPING=1")
    close_ring(session.ring, words)
    session.channel.close()
    if session.side.await_end(SIDE_PATIENCE_S):
        remove_ring(session.ring.path)


def _summary(progress: Progress) -> dict[str, Any]:
    lateness = progress.timing.lateness
    return {
        "cycles": progress.number,
        "missed": progress.overruns,
        "lateness_us": {
            **{f"p{100 * share:g}": _us(lateness.quantile(share)) for share in (0.5, 0.99, 0.999)},
            "max": _us(lateness.moments.maximum),
            "mean": _us(lateness.moments.mean),
            "deviation": _us(lateness.moments.deviation),
        },
        "stages_us": {
            name: {
                "p50": _us(times.quantile(0.5)),
                "p99": _us(times.quantile(0.99)),
                "max": _us(times.moments.maximum),
            }
            for name, times in zip(STAGES, progress.timing.stages, strict=True)
        },
    }


def _us(duration_ns: float) -> float:
    return round(duration_ns / 1e3, 1)
