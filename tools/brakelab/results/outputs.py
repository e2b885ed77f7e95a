"""Output files of a command: none may be a folder, an input or somebody else's; TOML has its ending.

A command may renew what it wrote. What stands beside its first output is its own only if that one is there.
An output is whole, or as it was before: `whole`.
"""

import errno
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from ecu.errors import UserError
from ecu.settings.config import config_files as config_files


def check_outputs(
    out: Path, written: Sequence[Path], read: Sequence[Path], toml: bool = False, option: str = "--out"
) -> None:
    """Refuse an output by which a file of `written` would be a folder, replace one that is not its own, or
    could not be written.

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
        if reason := _closed(path):
            raise cannot_write(path, OSError(reason, ""), option)
        for source in read:
            if _same(path, source):
                remedy = f"would overwrite {source}, which this command reads; choose another name"
                raise UserError(option, str(out), remedy)
    if not written[0].exists() and (strange := [path for path in written if path.exists()]):
        remedy = f"would overwrite {strange[0]}, which was not written with it; choose another name"
        raise UserError(option, str(out), remedy)


def cannot_write(out: Path, error: OSError, option: str = "--out") -> UserError:
    """Return what a user reads where `out`, given by `option`, failed with `error`."""
    reason = os.strerror(error.errno) if error.errno else str(error)  # pyarrow's own text is two lines
    return UserError(str(out), "", f"cannot be written ({reason}); choose another {option}")


def unfinished(out: Path) -> Path:
    """Return where this process writes `out` before it is whole: beside it, with the same ending."""
    return out.with_name(f".{out.stem}.{os.getpid()}{out.suffix}")


@contextmanager
def whole(out: Path, option: str = "--out") -> Iterator[Path]:
    """Yield where to write `out`, which appears at the end of the block or stays as it was; make its folder.

    A device or pipe is written to itself, as is a file whose folder is closed. Raises UserError if it cannot
    be written.
    """
    place = Path(os.path.realpath(out))
    aside = not place.exists() or (place.is_file() and os.access(place.parent, os.W_OK))
    part = unfinished(place) if aside else place
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        yield part
        if part != place:
            part.replace(place)
    except OSError as error:
        raise cannot_write(out, error, option) from None
    finally:
        if part != place:
            with suppress(OSError):
                part.unlink(missing_ok=True)


def write_text(out: Path, text: str, option: str = "--out") -> None:
    """Write the text of an output, and its folder. Raises UserError if it cannot be written."""
    with whole(out, option) as part:
        part.write_text(text, encoding="utf-8")


def _closed(path: Path) -> int:
    """Return the error number for which `path`, or the folder it goes into, cannot be written; 0 for none."""
    there = next(each for each in (path.absolute(), *path.absolute().parents) if each.exists())
    if there != path.absolute() and not there.is_dir():
        return errno.ENOTDIR
    if os.access(there, os.W_OK):
        return 0
    return errno.EROFS if os.statvfs(there).f_flag & os.ST_RDONLY else errno.EACCES


def _same(one: Path, other: Path) -> bool:
    if one.exists() and other.exists():
        return one.samefile(other)
    return os.path.realpath(one) == os.path.realpath(other)
