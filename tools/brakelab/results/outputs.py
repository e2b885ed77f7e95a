"""Output files of a command: none may be a folder, an input or somebody else's; TOML has its ending.

A command may renew what it wrote. What stands beside its first output is its own only if that one is there.
"""

import os
from collections.abc import Sequence
from pathlib import Path

from ecu.errors import UserError
from ecu.settings.config import config_files as config_files


def check_outputs(
    out: Path, written: Sequence[Path], read: Sequence[Path], toml: bool = False, option: str = "--out"
) -> None:
    """Refuse an output by which a file of `written` would be a folder or replace one that is not its own.

    Not its own are those of `read`, and whatever stands in the place of a neighbour while `written[0]` is not
    there yet. `option`: by which it was given. `toml`: `out` must end in .toml. Raises UserError. Links are
    followed; files that do not exist yet are compared by their path.
    """
    if toml and out.suffix != ".toml":
        raise UserError(option, str(out), "is written as TOML; let the name end in .toml")
    for path in written:
        if path.is_dir():
            what = "is a folder" if path == out else f"writes {path}, which is a folder"
            raise UserError(option, str(out), f"{what}; give the name of a file, or remove the folder")
        for source in read:
            if _same(path, source):
                remedy = f"would overwrite {source}, which this command reads; choose another name"
                raise UserError(option, str(out), remedy)
    if not written[0].exists() and (strange := [path for path in written if path.exists()]):
        remedy = f"would overwrite {strange[0]}, which was not written with it; choose another name"
        raise UserError(option, str(out), remedy)


def write_text(out: Path, text: str, option: str = "--out") -> None:
    """Write the text of an output, and its folder. Raises UserError if it cannot be written."""
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        remedy = f"cannot be written ({error.strerror}); choose another {option}"
        raise UserError(str(out), "", remedy) from None


def _same(one: Path, other: Path) -> bool:
    if one.exists() and other.exists():
        return one.samefile(other)
    return os.path.realpath(one) == os.path.realpath(other)
