"""Playback of a recorded drive onto a bus (`brake-ecu play`), every frame on the schedule of its stamps.

A second process reads the log ahead (`brakelab/read_ahead.py`), this one only waits and sends. It sleeps
until shortly before a frame is due, then polls the clock.
"""

import signal
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Final

from brakelab.replay.quality import Findings, damage_lines
from brakelab.replay.source import announced, check_map, load_source
from brakelab.rig.play.play_log import timed_frames
from brakelab.rig.play.read_ahead import ReadAhead
from brakelab.simulation.priority import PRIORITY, ask_for_priority
from ecu.bus.channel import open_channel
from ecu.bus.protocol import Channel
from ecu.contract.records import FRAME_FD, RecordArray
from ecu.errors import UserError
from ecu.output import give, say
from ecu.runtime.clock import Histogram, TimeSource, system_time
from ecu.settings.resources import regular

SPEEDS: Final = (0.1, 20.0)
LEAD_NS: Final = 10_000_000
"""From being ready to the first frame, which is then on time too."""

LEAST_MARGIN_NS, MOST_MARGIN_NS = 20_000, 250_000
SLACK_NS: Final = 10_000
FORGETTING: Final = 256  # wake-ups
# Linux throttles a real-time process that has used more than 95 % of a second, for 50 ms.
AWAKE_NS, NAP_NS = 500_000, 40_000

INTERRUPTED: Final = 130
SHARES: Final = (("p50", 0.5), ("p99", 0.99))


class Waker:
    """Wait for instants: asleep until a margin before, then polling the clock.

    The margin is the worst recent wake-up latency.
    """

    def __init__(self, source: TimeSource) -> None:
        self._source = source
        self._margin_ns = MOST_MARGIN_NS
        self._rested_ns = source.monotonic_ns()

    def wait(self, due_ns: int) -> int:
        """Wait until `due_ns` on the monotonic clock; return that clock."""
        monotonic_ns, sleep_until = self._source.monotonic_ns, self._source.sleep_until
        now = monotonic_ns()
        awake, left = now - self._rested_ns, due_ns - now
        if left > self._margin_ns:
            early = due_ns - self._margin_ns
            while now < early:
                sleep_until(early)
                now = monotonic_ns()
            learned = max(now - early + SLACK_NS, self._margin_ns - self._margin_ns // FORGETTING)
            self._margin_ns = min(max(learned, LEAST_MARGIN_NS), MOST_MARGIN_NS)
            self._rested_ns = now
        elif awake > AWAKE_NS or (awake > AWAKE_NS // 2 and left > 2 * NAP_NS):
            sleep_until(now + NAP_NS)
            self._rested_ns = now = monotonic_ns()
        while now < due_ns:
            now = monotonic_ns()
        return now


@dataclass
class Sent:
    """Frames that were sent."""

    offered: int = 0
    taken: int = 0
    """By the bus."""
    late: Histogram = field(default_factory=Histogram)
    """From when a frame was due until the bus had it."""


def play(log: Path, interface: str, channel: str, map: Path | None, speed: float) -> int:
    """Send `log` to a bus, `speed` times as fast as recorded; return 0, or 130 after SIGINT or SIGTERM.

    Raises:
        UserError: an argument, the map or the log is invalid, or the bus cannot be opened.
    """
    least, most = SPEEDS
    if not least <= speed <= most:
        raise UserError("--speed", f"{speed:g}", f"give a factor from {least:g} to {most:g}; 1 is real time")
    regular(log, "an existing log")
    if map and (line := check_map(map, announced(load_source(map)), log)):
        say(line)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)  # a shell's background jobs ignore SIGINT
    sent, code = Sent(), 0
    with ReadAhead(partial(timed_frames, log, map, channel, speed), Findings(log)) as ahead:
        blocks = iter(ahead)
        first = next(blocks)
        fd = bool((first["flags"] & FRAME_FD).any())
        bus = open_channel(interface, channel, receive_ids=(), fd=fd)
        try:
            _warn_of_no_priority(ask_for_priority())
            say(f"playing {log} onto {interface} {channel}; Ctrl-C ends it")
            send_on_schedule(chain([first], blocks), bus, system_time(), sent)
        except KeyboardInterrupt:
            code = INTERRUPTED
        finally:
            bus.close()
    print(_summary(ahead.findings, sent, code))
    give(
        log=log,
        sent=sent.taken,
        refused=sent.offered - sent.taken,
        late_us={name: 1e-3 * sent.late.quantile(share) for name, share in SHARES} if sent.taken else None,
    )
    for line in damage_lines(ahead.findings):
        say(line)
    return code


def _warn_of_no_priority(reason: str) -> None:
    if reason:
        say(
            f"SCHED_FIFO: {reason}: frames may leave late; grant CAP_SYS_NICE, or `rtprio {PRIORITY}` in "
            "/etc/security/limits.conf"
        )


def _summary(findings: Findings, sent: Sent, code: int) -> str:
    parts = [f"{sent.taken} frames sent"]
    if sent.taken < sent.offered:
        parts.append(f"{sent.offered - sent.taken} refused by the bus")
    if findings.other_interfaces:
        parts.append(f"{findings.other_interfaces} of other interfaces left out")
    late = sent.late
    if late.moments.count:
        shares = {"p50": late.quantile(0.5), "p99": late.quantile(0.99), "worst": late.moments.maximum}
        parts.append(f"late by {', '.join(f'{1e-3 * ns:.0f} µs ({name})' for name, ns in shares.items())}")
    return f"{findings.path}: {'interrupted: ' if code else ''}{', '.join(parts)}"


def send_on_schedule(blocks: Iterable[RecordArray], bus: Channel, source: TimeSource, sent: Sent) -> None:
    """Send every frame when due, `stamp_ns` after the first; `sent` is updated continuously.

    Frames due together are sent in one call.
    """
    start_ns, waker = None, Waker(source)
    for frames in blocks:
        if start_ns is None:
            start_ns = source.monotonic_ns() + LEAD_NS
        due: list[int] = (frames["stamp_ns"] + start_ns).tolist()
        first = 0
        while first < len(due):
            now = waker.wait(due[first])
            end = first + 1
            while end < len(due) and due[end] <= now:
                end += 1
            sent.offered += end - first
            sent.taken += bus.send(frames[first:end], end - first)
            now = source.monotonic_ns()
            for due_ns in due[first:end]:
                sent.late.add(now - due_ns)
            first = end
