"""Contents and damage of a log: counters for the metadata, one line for each kind of damage."""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from brakelab.logs.log_quality import Damage, LogQuality, SignalQuality
from brakelab.logs.physics.judge import Judged
from ecu.bus.freshness import RATE_TOLERANCE
from ecu.bus.receive import Reception
from ecu.bus.receive_plan import ReceivePlan
from ecu.contract.faults import FAULTS, WORDS, fault_mask
from ecu.contract.records import EXTENDED_ID, RecordArray
from ecu.contract.signals import DEGRADED, INPUT_SIGNALS, N_INPUTS, OUTPUT

MESSAGE_KINDS: Final = (
    "received",
    "accepted",
    "checksum_errors",
    "sequence_errors",
    "repeated",
    "length_errors",
    "lost",
)
"""Counters of a message that results keep, as in `ecu.bus.receive.MESSAGE_COUNTERS`."""

SHOWN: Final = 20  # names in a line
ABSOLUTE_NS: Final = 10**18
"""Unix time (September 2001) before which a log has no date of its own."""


@dataclass
class Findings:
    """Contents of one log; filled while it is read."""

    path: Path
    start_ns: int = 0
    """Of its first row, on the log's own clock."""
    shift_s: float = 0.0
    """Of its rows within a drive of several logs."""
    rows: int = 0
    interfaces: list[str] = field(default_factory=list)
    log: LogQuality = field(default_factory=LogQuality)
    signals: SignalQuality = field(default_factory=SignalQuality)
    reception: Reception | None = None
    bus: str = ""
    """The interface that the map names, empty: all."""
    other_interfaces: int = 0
    """Frames of interfaces that the map does not name."""
    freshness: RecordArray | None = None
    """Freshness of each input, with counts of its samples, shape (N_INPUTS,)."""
    seen: RecordArray | None = None
    """Statistics of its samples, shape (N_INPUTS,)."""
    mapped: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(N_INPUTS, np.bool_))
    """Where the log can hold an input, shape (N_INPUTS,)."""
    physics: Judged = field(default_factory=lambda: Judged([], [], []))
    """Findings of the physics check about the inputs."""
    dropped: int = 0
    """Frames that the kernel dropped in a recorded run."""
    calibrated: str = ""
    """The line about calibrations of a recorded run that were left out."""
    late: str = ""
    """The line about hydraulics of a recorded run that are not CONFIG's."""
    seconds: float = 0.0
    """That the replay took."""
    faulty_rows: int = 0
    """In which the mode was degraded or failed."""
    fault_rows: Counter[int] = field(default_factory=Counter)
    """Of these, by the fault's bit."""

    @property
    def began_ns(self) -> int | None:
        """Unix time of the first row, None: the log has no date."""
        began = self.start_ns + (self.signals.zero_ns or 0)
        return began if began >= ABSOLUTE_NS else None


def note_faults(findings: Findings, values: NDArray[np.float64]) -> None:
    """Count the faults in rows of results, shape (n, N_ROW)."""
    faulty = values[:, OUTPUT["mode"]] >= DEGRADED
    masks = fault_mask({name: values[faulty, OUTPUT[name]] for name in WORDS})
    findings.faulty_rows += len(masks)
    for fault in FAULTS:
        findings.fault_rows[fault.bit] += int(np.count_nonzero(masks & fault.bit))


def identifier(message: Any) -> str:
    """Return a message's identifier as candump writes it."""
    number = int(message["id"])
    return f"{number - EXTENDED_ID:08X}" if number & EXTENDED_ID else f"{number:03X}"


def damage_lines(findings: Findings) -> list[str]:
    """Return one line for each kind of damage in the file itself: missing parts, stamps that do not fit."""
    name, log, signals = str(findings.path), findings.log, findings.signals
    lines = []
    for found in (log, signals):
        if found.damaged:
            first = found.first_damaged
            what = "lines" if first.removeprefix("line ").isdecimal() else "pieces"
            lines.append(f"{name}: {first}: {found.damaged} damaged {what} skipped, this is the first")
        if found.cut:
            lines.append(f"{name}: {found.cut}")
        if found.backwards:
            lines.append(f"{name}: stored from its end, and read from there")
        if found.clock_set:
            often = f"{found.clock_set} times, this is the first" if found.clock_set > 1 else "once"
            split = "; where the car stood so long, split the log" if ", on by" in found.first_set else ""
            lines.append(
                f"{name}: {found.first_set}: the clock was set {often}; time goes on as before it{split}"
            )
    for twice, what in ((signals.rows_twice, "rows"), (log.frames_twice, "frames")):
        if twice:
            lines.append(f"{name}: {twice} {what} stand twice; the second of each was left out")
    if log.stamps_backwards:
        lines.append(
            f"{name}: time steps back at {log.stamps_backwards} frames; they count in the order of the log"
        )
    if log.gaps:
        first = f"the longest of {log.gaps} gaps" if log.gaps > 1 else "the only gap"
        lines.append(f"{name}: {log.longest_gap}: no frame for {log.longest_gap_s:.1f} s before, {first}")
    if signals.columns_twice:
        these = ", ".join(signals.columns_twice[:SHOWN])
        second = f"{signals.columns_twice[0]}#2"
        lines.append(f'{name}: columns that stand twice: {these}; the first is read, "{second}" the second')
    if signals.unknown_columns:
        unknown = signals.unknown_columns
        more = f", … ({len(unknown)} in all)" if len(unknown) > SHOWN else ""
        lines.append(f"{name}: columns not used: {', '.join(unknown[:SHOWN])}{more}")
    return lines


def quality_lines(findings: Findings, plan: ReceivePlan) -> list[str]:
    """Return one line for each kind of damage in the log, nothing for a clean one."""
    name, lines = str(findings.path), damage_lines(findings)
    if findings.reception is None:
        return lines
    counters = findings.reception.messages
    kinds = {
        "checksum_errors": "CRC errors",
        "sequence_errors": "counter errors",
        "repeated": "repeated counters",
        "length_errors": "wrong lengths",
        "lost": "gaps in counters",
    }
    for kind, text in kinds.items():
        total = int(counters[kind].sum())
        if total:
            worst = plan.messages[int(counters[kind].argmax())]
            received = int(counters["received"].sum())
            share = f"{100 * total / received:.1f} % of {received} frames"
            lines.append(f"{name}: {total} {text} ({share}), most in {worst['name']} ({identifier(worst)})")
    silent = [
        f"{message['name']} ({identifier(message)})"
        for message, counter in zip(plan.messages, counters, strict=True)
        if not counter["received"] and not message["foreign"]
    ]
    if silent:
        where = f" on {findings.bus}" if findings.bus else ""
        has = f"; the log has {', '.join(findings.interfaces)}" if findings.interfaces else ""
        lines.append(f"{name}: never received{where}: {', '.join(silent)}{has}")
    return lines


def quality_counts(findings: Findings, plan: ReceivePlan) -> dict[str, Any]:
    """Return the counters of quality for the metadata of results."""
    counts: dict[str, Any] = {
        "rows": findings.rows,
        **vars(findings.log),
        **({} if findings.reception else {key: getattr(findings.signals, key) for key in vars(Damage())}),
        "samples": findings.signals.samples,
        "dropped": findings.dropped,
        "seconds": round(findings.seconds, 3),
        "inputs": _input_counts(findings),
    }
    if findings.reception is not None:
        messages = findings.reception.messages
        counts |= {kind: int(messages[kind].sum()) for kind in MESSAGE_KINDS}
        counts["messages"] = [
            {
                "name": str(message["name"]),
                "id": identifier(message),
                "expected_hz": 1e9 / float(message["period_ns"]) if message["period_ns"] else None,
                **{kind: int(counter[kind]) for kind in MESSAGE_KINDS},
            }
            for message, counter in zip(plan.messages, messages, strict=True)
            if not message["foreign"]
        ]
    return counts


def _input_counts(findings: Findings) -> list[dict[str, Any]]:
    """Return the counts of each input that the log can hold."""
    if findings.freshness is None or findings.seen is None:
        return []
    inputs = []
    for place in np.flatnonzero(findings.mapped):
        signal, known, seen = INPUT_SIGNALS[place], findings.freshness[place], findings.seen[place]
        intervals = (known["longest_ns"] / RATE_TOLERANCE, known["shortest_ns"] * RATE_TOLERANCE)
        promised = known["shortest_ns"] > 0.0
        inputs.append(
            {
                "name": signal.name,
                "unit": signal.unit,
                "samples": int(known["taken"]) + int(known["outside"]) + int(known["invalid"]),
                "expected_hz": [float(1e9 / interval) for interval in intervals] if promised else [],
                "timeout_s": round(1e-9 * int(known["timeout_ns"]), 6),
                "greatest_gap_s": round(1e-9 * int(seen["gap_ns"]), 6),
                "invalid": int(known["invalid"]),
                "outside": int(known["outside"]),
                "clipped": int(seen["clipped"]),
                "jumps": int(seen["jumps"]),
                "least": float(seen["least"]) if seen["values"] else None,
                "greatest": float(seen["greatest"]) if seen["values"] else None,
            }
        )
    return inputs
