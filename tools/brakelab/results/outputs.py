"""Output files of a command: none may be a folder, or one of its inputs."""

import os
from collections.abc import Sequence
from pathlib import Path

from ecu.errors import UserError


def check_outputs(out: Path, written: Sequence[Path], read: Sequence[Path]) -> None:
    """Refuse an `--out` by which a file of `written` would be a folder or replace one of `read`.

    Raises UserError. Links are followed; files that do not exist yet are compared by their path.
    """
    for path in written:
        if path.is_dir():
            what = "is a folder" if path == out else f"writes {path}, which is a folder"
            raise UserError("--out", str(out), f"{what}; give the name of a file, or remove the folder")
        for source in read:
            if _same(path, source):
                remedy = f"would overwrite {source}, which this command reads; choose another name"
                raise UserError("--out", str(out), remedy)


def _same(one: Path, other: Path) -> bool:
    if one.exists() and other.exists():
        return one.samefile(other)
    return os.path.realpath(one) == os.path.realpath(other)
