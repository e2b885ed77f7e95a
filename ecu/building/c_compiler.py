"""The C compiler, for what is linked into shared libraries."""

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from ecu.errors import UserError


def compiler() -> str | None:
    """Return the C compiler, None without one."""
    return shutil.which(os.environ.get("CC", "cc"))


def compile_shared(sources: Sequence[Path], options: Sequence[str], file: Path) -> None:
    """Compile C texts and object files into a shared library that shows what it says it shows.

    Raises:
        UserError: there is no compiler, or it refuses them.
    """
    shared = ("-O2", "-shared", "-fPIC", "-fvisibility=hidden", "-s", "-Wl,--no-undefined")
    command = [
        compiler() or os.environ.get("CC", "cc"),
        *map(str, sources),
        *shared,
        *options,
        "-o",
        str(file),
    ]
    try:
        subprocess.run(command, check=True, capture_output=True, text=True)
    except (OSError, subprocess.CalledProcessError) as error:
        lines = (getattr(error, "stderr", "") or str(error)).splitlines()
        words = next((line for line in lines if "error:" in line), lines[-1])[:300]
        raise UserError(command[0], "", f"{words}; install a C compiler, or set CC to one") from None
