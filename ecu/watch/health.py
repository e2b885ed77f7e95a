"""Whether the loop of a daemon is well: its cycles advance.

`python -m ecu.watch.health` exits with 0 where every daemon of this user is, else with 1 and a line: for the
HEALTHCHECK of a container. `/health` of the metrics answers the same.
"""

import math
from typing import Final

from ecu.errors import UserError
from ecu.recording.ring import RingReader
from ecu.runtime.clock import monotonic_s
from ecu.watch.daemons import running

STALLED_S: Final = 0.5


def ailment(reader: RingReader, age_s: float) -> str:
    """Return why a loop is not well, empty while it is; `age_s`: of its last cycle, inf before the first."""
    if reader.closed:
        return f"the run has ended: {reader.last_words.get('by', 'no reason given')}"
    if math.isinf(age_s):
        return "no cycle yet"
    return f"no cycle for {age_s:.1f} s" if age_s > STALLED_S else ""


def ailments(now_s: float) -> list[str]:
    """Return a line for each daemon that is not well at `now_s` of its own clock, one if none runs."""
    found = running()
    lines = [] if found else ["no daemon runs"]
    for daemon in found:
        try:
            reader = RingReader(daemon.path)
        except UserError as error:  # it ended just now
            lines.append(str(error))
            continue
        last = reader.newest()
        age_s = math.inf if last is None else now_s - 1e-9 * float(last["cycle"]["t_mono_ns"][0])
        if why := ailment(reader, age_s):
            lines.append(f"{daemon.label}: {why}")
    return lines


def main() -> int:
    """Print what is not well."""
    lines = ailments(monotonic_s())
    for line in lines:
        print(line)
    return 1 if lines else 0


if __name__ == "__main__":
    raise SystemExit(main())
