"""What physics says against the inputs of a drive, for which nothing is learned."""

from collections.abc import Sequence
from typing import Final

from brakelab.replay.quality import Findings

HELD: Final = (
    "friction stays as it was before this drive, and nothing is stored, until the map is mended "
    "(docs/signal-maps.md); --force learns nevertheless"
)


def contradiction_lines(findings: Sequence[Findings]) -> list[str]:
    """Return a line for each sign, scale and signal of a drive that physics contradicts, with the remedy."""
    return [f"{found.path}: {line}" for found in findings for line in found.physics.contradictions]
