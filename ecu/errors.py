"""Errors that a user can mend: one line with file, place and remedy."""

from collections.abc import Iterable
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


class RunFault(Exception):
    """Fault found by the run itself (bus off, no input). The command exits with 1."""


def closest(name: str, names: Iterable[str]) -> str:
    """Return a hint at the name probably meant, or nothing."""
    near = get_close_matches(name, names, 1, 0.5)
    return f"; did you mean {near[0]}?" if near else ""
