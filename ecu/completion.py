"""Completion of values in the shell. Where nothing fits, the shell completes names of files.

Bash, zsh and fish ask by running `brake-ecu` with `_BRAKE_ECU_COMPLETE` in its environment: what is imported
here, and by the modules of options, must be fast.
"""

from collections.abc import Callable, Iterable
from pathlib import Path

from ecu.settings.resources import shipped_in

Completer = Callable[[str], list[str]]


def known(*names: str) -> Completer:
    """Return the completion of values that are all known."""
    return lambda incomplete: fitting(names, incomplete)


def shipped(*folders: str) -> Completer:
    """Return the completion of a shipped file's name, and of TOML files beside it."""

    def complete(incomplete: str) -> list[str]:
        here = [] if Path(incomplete).is_absolute() else Path().glob(f"{incomplete}*.toml")
        return fitting([*shipped_in(*folders), *sorted(map(str, here))], incomplete)

    return complete


def fitting(names: Iterable[str], incomplete: str) -> list[str]:
    """Return the names that begin like that."""
    return [name for name in names if name.startswith(incomplete)]
