"""What a command prints, by one policy: its result on standard output, words about it on standard error.

`--quiet` leaves the words out, `--verbose` adds details, `--json` prints what the command gave (`give`,
`wrote`) as one object at the end and turns its lines into words. Commands just print: `asked` does the rest.
"""

import json
import math
import os
import shlex
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import asdict, dataclass, field, is_dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any, Final

from ecu.errors import UserError

LOG_FORMATS: Final = ("console", "json")
LOG_FORMAT, LOG_LEVEL = "BRAKE_ECU_LOG_FORMAT", "BRAKE_ECU_LOG_LEVEL"
"""Environment variables by which the daemon's log is chosen for all its processes (`log_as`)."""


class Level(IntEnum):
    """How much a command says."""

    QUIET = 0
    NORMAL = 1
    VERBOSE = 2


@dataclass
class Policy:
    """What was asked of one command line, and what it gave."""

    level: Level = Level.NORMAL
    json: bool = False
    given: dict[str, Any] = field(default_factory=dict)
    errors: Any = None
    """Standard error while `asked` has replaced it."""


_policies: list[Policy] = [Policy()]
"""Of the whole process: threads print by it, too. The last one is that of the command line that runs."""


@contextmanager
def new_policy() -> Iterator[Policy]:
    """Begin a command line, with the policy that is yielded."""
    _policies.append(Policy())
    try:
        yield policy()
    finally:
        _policies.pop()


def policy() -> Policy:
    """Return the policy of this command line."""
    return _policies[-1]


@contextmanager
def asked() -> Iterator[None]:
    """Lead what is printed in this block to where the policy says."""
    here = policy()
    here.errors = sys.stderr
    with ExitStack() as stack:
        if here.level == Level.QUIET:
            nowhere = stack.enter_context(open(os.devnull, "w", encoding="utf-8"))
            stack.enter_context(redirect_stderr(nowhere))
        if here.json:
            stack.enter_context(redirect_stdout(sys.stderr))
        try:
            yield
        finally:
            here.errors = None


def say(line: str) -> None:
    """Say a line of words."""
    print(line, file=sys.stderr, flush=True)


def detail(line: str) -> None:
    """Say a line to who asked for details."""
    if policy().level == Level.VERBOSE:
        say(line)


def fault(line: str) -> None:
    """Print an error, whatever the policy."""
    print(line, file=policy().errors or sys.stderr, flush=True)


def give(**fields: Any) -> None:
    """Give figures of the result by name, for `--json`."""
    if policy().json:
        policy().given.update(fields)


def give_table(table: Any) -> None:
    """Give a table (a NamedTuple) of the result, for `--json`."""
    if policy().json:
        policy().given.setdefault("tables", []).append(table)


def wrote(*paths: Path, next: str = "") -> None:
    """Say which files a command wrote, and the command that goes on with them."""
    say(f"written: {', '.join(map(str, paths))}{f'; next: {next}' if next else ''}")
    give(written=list(paths), **({"next": next} if next else {}))


def argument(path: Path | str) -> str:
    """Return a path as a shell takes it: quoted where it has to be, and no option."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)


def print_given() -> None:
    """Print what was given as one JSON object; what is not a number or not finite is null."""
    print(json.dumps(_plain(policy().given), indent=1, ensure_ascii=False), flush=True)


def _plain(value: Any) -> Any:
    match value:
        case None | bool() | str() | int():
            return value
        case float():
            return float(value) if math.isfinite(value) else None
        case dict():
            return {str(key): _plain(one) for key, one in value.items()}
        case tuple() if hasattr(value, "_asdict"):
            return _plain(value._asdict())
        case list() | tuple() | set() | frozenset():
            return [_plain(one) for one in value]
        case _ if hasattr(value, "tolist"):  # numpy
            return _plain(value.tolist())
        case _ if is_dataclass(value) and not isinstance(value, type):
            return _plain(asdict(value))
        case _:
            return str(value)


def log_as(form: str | None, level: Level) -> None:
    """Choose format (None: by where it goes) and level of the log of this process and those it starts.

    Raises UserError for an unknown format.
    """
    form = form or os.environ.get(LOG_FORMAT) or None
    if form is not None:
        if form not in LOG_FORMATS:
            raise UserError("--log-format", form, f"not known; take {' or '.join(LOG_FORMATS)}")
        os.environ[LOG_FORMAT] = form
    if level != Level.NORMAL:
        os.environ[LOG_LEVEL] = level.name.lower()
    policy().level = Level.NORMAL  # the log alone says it
