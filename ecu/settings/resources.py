"""The files that are shipped with the program: databases, vehicles, signal maps, scenarios."""

from pathlib import Path
from typing import Final

from ecu.errors import UserError, closest

_PACKAGE = Path(__file__).parents[1]


def resource(name: str) -> Path:
    """Path of a shipped file or folder, e.g. `dbc/brake_ecu.dbc`, `config/suv.toml`: of the checkout, or of
    the installed package."""
    installed = _PACKAGE / "data"
    return (installed if installed.is_dir() else _PACKAGE.parent) / name


SCENARIOS: Final = ("config/scenarios", "config/scenarios/faults")


def named(name: str, *folders: str) -> Path:
    """Path of the file `name`; where no such file exists a bare name means a shipped one in `folders`.

    `named("suv", "config")` is the shipped `config/suv.toml`. Raises UserError for a bare name that is
    neither; any other path is returned as it is.
    """
    path = Path(name)
    if path.is_file() or path.suffix or len(path.parts) != 1:
        return path
    shipped = shipped_in(*folders)
    if name in shipped:
        return shipped[name]
    names = ", ".join(shipped)
    raise UserError(name, "", f"no such file, and none that is shipped ({names}){closest(name, shipped)}")


def regular(path: Path, what: str) -> Path:
    """Return `path`, a file that can be read to its end. Raises UserError: it is none; give `what`."""
    if not path.exists():
        raise UserError(str(path), "", f"no such file; give {what}")
    if not path.is_file():
        kind = "a folder" if path.is_dir() else "no regular file"
        raise UserError(str(path), "", f"is {kind}; give {what}")
    return path


def command_name(path: Path) -> str:
    """Return what names a file on the command line: a shipped one's name, else its path."""
    return path.stem if path in shipped_in("config", "config/maps", *SCENARIOS).values() else str(path)


def shipped_in(*folders: str) -> dict[str, Path]:
    """Return the shipped files of `folders` by the names that `named` takes."""
    return {file.stem: file for folder in folders for file in sorted(resource(folder).glob("*.toml"))}
