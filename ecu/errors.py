"""Errors that a user can mend: one line with file, place and remedy."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches


class UserError(Exception):
    """Bad arguments, configuration or input. The command prints its one line and exits with 2.

    Example: `config/suv.toml: vehicle.mass: missing; give the mass in kg`.
    """

    def __init__(self, where: str, place: str, remedy: str) -> None:
        self.where, self.place, self.remedy = where, place, remedy
        super().__init__(": ".join(part for part in (where, place, remedy) if part))

    def __reduce__(self) -> tuple[type["UserError"], tuple[str, str, str]]:
        """Pickle by the constructor's arguments, for use across processes."""
        return type(self), (self.where, self.place, self.remedy)


class Mistakes(UserError):
    """Several mistakes of one file. The command prints a line for each, and exits with 2."""

    def __init__(self, where: str, findings: Sequence[tuple[str, str]]) -> None:
        """Take the place and the remedy of each, the first of which stands for all in `str`."""
        (place, remedy), *others = findings
        self.findings = tuple(findings)
        more = f" (and {len(others)} more mistake{'s' if len(others) > 1 else ''})" if others else ""
        super().__init__(where, place, f"{remedy}{more}")

    def __reduce__(self) -> tuple[type["Mistakes"], tuple[str, Sequence[tuple[str, str]]]]:  # type: ignore[override]
        """Pickle by the constructor's arguments."""
        return type(self), (self.where, self.findings)

    @property
    def lines(self) -> list[str]:
        """One for each mistake."""
        return [str(UserError(self.where, place, remedy)) for place, remedy in self.findings]


class RunFault(Exception):
    """Fault found by the run itself (bus off, no input). The command exits with 1."""


def closest(name: str, names: Iterable[str]) -> str:
    """Return a hint at the name probably meant, or nothing."""
    near = get_close_matches(name, names, 1, 0.5)
    return f"; did you mean {near[0]}?" if near else ""
