"""What physics says against the inputs of a drive, for which nothing is learned."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from brakelab.replay.quality import Findings
from ecu.contract.records import RecordArray

HELD: Final = (
    "friction stays as it was before this drive, and nothing is stored, until the map is mended "
    "(docs/signal-maps.md); --force learns nevertheless"
)


def contradiction_lines(findings: Sequence[Findings]) -> list[str]:
    """Return a line for each sign, scale and signal of a drive that physics contradicts, with the remedy."""
    return [f"{found.path}: {line}" for found in findings for line in found.physics.contradictions]


def runs(logs: Sequence[Path], params: RecordArray, learns: bool) -> Iterator[list[Findings]]:
    """Yield findings to be filled by a run; where physics then contradicts the drive, those of a second one.

    That begins anew, with the friction of before; there is none where the first `learns` nevertheless.
    """
    findings = [Findings(path) for path in logs]
    yield findings
    if contradiction_lines(findings) and not learns:
        params["fixed"] = 1
        yield [Findings(path) for path in logs]
