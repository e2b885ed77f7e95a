"""Logs wherever fsspec reaches: local paths, `s3://…`, `ssh://…`, `memory://…`."""

import hashlib
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from fsspec.core import url_to_fs
from fsspec.implementations.local import LocalFileSystem

from ecu.errors import UserError

CHANGES: Final = ("ETag", "md5Hash", "mtime", "LastModified", "created")
"""Marks of a changed file beside its size, the first that its file system knows."""


def _opened(url: str) -> tuple[Any, str]:
    try:
        system, path = url_to_fs(url)
    except ImportError as error:
        raise UserError(url, "", f"{error}; install it here and on every worker") from None
    except ValueError as error:
        raise UserError(url, "", f"{error}; give a path or an address that fsspec knows") from None
    return system, path


def expand(pattern: str) -> list[str]:
    """Return the files and folders matching `pattern`, in natural order (drive-2 before drive-10)."""
    system, path = _opened(pattern)
    found = system.glob(path) if re.search(r"[*?\[]", path) else [path] if system.exists(path) else []
    return sorted((_name(system, str(one)) for one in found), key=natural)


def natural(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts the numbers in names as numbers."""
    parts = re.findall(r"\d+|\D+", name)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]


def _name(system: Any, path: str) -> str:
    return path if isinstance(system, LocalFileSystem) else str(system.unstrip_protocol(path))


def state_of(url: str) -> tuple[int, str]:
    """Return size in bytes of a file (or of all in a folder), and a mark that changes with its content.

    The mark consists of size and time (or other entries of `CHANGES`), without reading. Raises UserError if
    there is no such file.
    """
    system, path = _opened(url)
    try:
        infos = [system.info(path)]
        if infos[0]["type"] == "directory":
            infos = list(system.find(path, detail=True).values())
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else f"cannot be read ({error})"
        raise UserError(url, "", f"{reason}; correct the path") from None
    size = sum(int(info["size"] or 0) for info in infos)
    marks = [
        (info["name"], info["size"], next((str(info[key]) for key in CHANGES if key in info), ""))
        for info in infos
    ]
    return size, hashlib.sha256(repr(sorted(marks)).encode()).hexdigest()


@contextmanager
def local_copies(urls: Sequence[str]) -> Iterator[list[Path]]:
    """Yield each file (or folder) of `urls` as a local path: itself, or a temporary copy."""
    with TemporaryDirectory(prefix="brake-ecu-fleet-") as folder:
        paths = []
        for number, url in enumerate(urls):
            system, path = _opened(url)
            if isinstance(system, LocalFileSystem):
                paths.append(Path(path))
                continue
            copy = Path(folder, str(number), path.rstrip("/").rpartition("/")[2])
            copy.parent.mkdir()
            try:
                system.get(path, str(copy), recursive=system.isdir(path))
            except OSError as error:
                raise UserError(url, "", f"cannot be copied ({error}); correct the address") from None
            paths.append(copy)
        yield paths
