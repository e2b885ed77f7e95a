"""Command line `brake-ecu`: parses arguments, reports errors that the user can mend in one line.

Every command imports its modules when called. Other distributions add commands by the entry point
group `brake_ecu.commands`, as the laboratory does (`tools/pyproject.toml`); the daemon starts without them.
Exit code 0 on success, 1 when the run found a fault, 2 for bad arguments, configuration or input.
"""

import os
import signal
import sys

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # Ctrl-C shows no traceback of imports
    signal.signal(signal.SIGINT, lambda *_: os._exit(128 + signal.SIGINT))

from ecu.imports import without_modules
from ecu.recording.sink import free_output
from ecu.runtime.start import is_run, raise_priority

if is_run(sys.argv[1:]):  # under load, importing the command line alone would take a second
    raise_priority()
    free_output()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy's: 40 MB of locked memory a thread

import atexit
import errno
import gc
import traceback
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated

import typer

from ecu import __version__, streams
from ecu.arguments import (
    CHANNEL_OPTION,
    CONFIG_OPTION,
    INTERFACE_OPTION,
    Channel,
    Commands,
    Config,
    Interface,
    Map,
    PlainHelp,
    State,
    TopLevel,
    flag,
    option,
)
from ecu.commands.config import app as config_app
from ecu.commands.diagnostics import app as diagnostics_app
from ecu.commands.watch import app as watch_app
from ecu.commands.xcp import app as xcp_app
from ecu.completion import known
from ecu.errors import Mistakes, RunFault, UserError
from ecu.output import LOG_FORMATS, Level, fault, give, log_as, new_policy, policy, print_given

LABORATORY = ("bokeh", "jinja2", "pyarrow", "pymoo", "scipy", "tomlkit")
"""Packages of the extra `lab`, by the names that are imported, beside those of `compiler`."""
COMPILER = ("numba",)
OF_REPOSITORY = "from the repository: pip install '.[lab]' ./tools"
"""No package index has this project: a package of its name there would be somebody else's."""
FLEET = ("distributed", "fsspec")
"""Packages of the extra `fleet`."""
LEARN = ("sklearn",)
"""Packages of the extra `learn`."""

INTERRUPTED, UNREAD = 128 + signal.SIGINT, 128 + signal.SIGPIPE
"""Exit codes of a command that Ctrl-C ended and of one whose output nobody reads, as a shell gives them."""
COMPLETE = "_BRAKE_ECU_COMPLETE"
"""Set by the shell that asks for completion."""

app = Commands(
    cls=TopLevel,
    help="Real-time brake ECU: estimates brake lining friction and corrects pressure demands by it.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

atexit.register(gc.freeze)  # what is left goes with the process: looking through it takes 0.07 s

app.add_typer(config_app, name="config")
app.add_typer(watch_app)
app.add_typer(diagnostics_app)
app.add_typer(xcp_app)


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"brake-ecu {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit."),
    ] = False,
) -> None:
    pass


@app.command(cls=PlainHelp)
def run(
    config: Config,
    interface: Interface,
    channel: Channel,
    map: Map = None,
    record: Annotated[
        Path | None, option("DIR", "Record frames, cycles and outputs into a new folder of DIR")
    ] = None,
    record_limit: Annotated[
        float | None, option("GB", "Remove the oldest recordings in DIR beyond this size", min=0.01)
    ] = None,
    state: State = None,
    standby: Annotated[
        bool, flag("--standby", "Stay silent beside a running daemon; take over when it falls silent")
    ] = False,
    armed: Annotated[
        bool, flag("--armed", "Flag the demands valid, as `transmit = true` in CONFIG does")
    ] = False,
    silent: Annotated[
        bool, flag("--silent", "Receive and estimate only: send nothing, whatever CONFIG says")
    ] = False,
    metrics_port: Annotated[
        int | None, option("N", "Serve metrics for Prometheus and /health at this port", min=1, max=65535)
    ] = None,
    metrics_address: Annotated[str, option("IP", "Address to serve metrics on")] = "127.0.0.1",
    diagnostics: Annotated[
        str | None,
        option(
            "REQUEST:RESPONSE", "Answer a tester (UDS) on these identifiers of the bus, such as 0x7E0:0x7E8"
        ),
    ] = None,
    diagnostics_key: Annotated[
        Path | None, option("FILE", "Secret of the tester's access; without it none gets it")
    ] = None,
    xcp: Annotated[
        str | None,
        option(
            "TRANSPORT",
            "Answer a master of XCP: udp:[ADDRESS:]PORT, tcp:[ADDRESS:]PORT or can:REQUEST:RESPONSE",
            autocompletion=known("udp:127.0.0.1:5555", "tcp:127.0.0.1:5555"),
        ),
    ] = None,
    xcp_key: Annotated[
        Path | None, option("FILE", "Secret of a master that calibrates; without it none does")
    ] = None,
    xcp_save: Annotated[Path | None, option("FILE", "CONFIG file to write when a master stores")] = None,
    cpu: Annotated[
        int | None, option("N", "CPU of its loop; default: the last one that no other daemon has", min=0)
    ] = None,
    priority: Annotated[int, option("P", "Priority of its loop (SCHED_FIFO)", min=1, max=99)] = 50,
    log_format: Annotated[
        str | None,
        option(
            "FORMAT",
            "console or json; default: console on a terminal, json elsewhere",
            autocompletion=known(*LOG_FORMATS),
        ),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Log warnings and errors only")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Log what is read and compiled, too")
    ] = False,
) -> int:
    """Run the daemon on a CAN bus. Its demands are flagged invalid unless it is armed."""
    with without_modules("rich", "scipy"):  # of structlog's tracebacks, and BLAS that the cycle never calls
        from ecu.jit import library_of

        if library_of("ecu.algorithm.step") is None:
            import numba.np.arraymath  # noqa: F401

        from ecu.runtime import prepare, service
        from ecu.runtime.xcp import Calibrating
    metrics = f"{metrics_address}:{metrics_port}" if metrics_port else None
    level = Level.QUIET if quiet else Level.VERBOSE if verbose else policy().level
    log_as(log_format, level)
    return service.run(
        prepare.RunOptions(
            config,
            interface,
            channel,
            map,
            record,
            record_limit,
            state,
            standby,
            armed,
            silent,
            metrics,
            diagnostics,
            diagnostics_key,
            xcp,
            Calibrating(xcp_key, xcp_save),
            cpu,
            priority,
        )
    )


@app.command()
def wear(
    config: Config,
    state: Annotated[Path, option("DIR", "Folder of learned values, as for `run` and `replay`")],
    new_pads: Annotated[str | None, option("WHERE", "Register new pads: front, rear, all, a corner")] = None,
    measured: Annotated[
        str | None, option("fl=9.8,…", "Register measured linings in mm, without backplate")
    ] = None,
) -> None:
    """Show how thick the brake pads are and how far they last. Register new and measured ones."""
    from ecu import pads
    from ecu.compiling import report_compiling

    with report_compiling():
        pads.wear_command(config, state, new_pads, measured)


@app.command()
def doctor(
    config: Annotated[Path | None, CONFIG_OPTION] = None,
    map: Map = None,
    interface: Annotated[str | None, INTERFACE_OPTION] = None,
    channel: Annotated[str | None, CHANNEL_OPTION] = None,
) -> int:
    """Check that this machine can run the ECU. With a bus, check its frames, rates and E2E too."""
    from ecu import doctor

    return doctor.doctor(config, map, interface, channel)


def _describe(error: Exception) -> tuple[str, int]:
    """Return the one-line message for the user, and the exit code."""
    match error:
        case UserError():
            return str(error), 2
        case RunFault():
            return str(error), 1
        case typer.TyperException():
            context = getattr(error, "ctx", None)
            command = context.command_path if context else "brake-ecu"
            said = error.format_message().rstrip(".")
            lacking = said.startswith("No such command") and not _add_commands()
            hint = f"; the laboratory's commands need {OF_REPOSITORY}" if lacking else ""
            return f"{said}; see {command} --help{hint}", error.exit_code
        case ModuleNotFoundError(name=str(name)) if name.partition(".")[0] in LABORATORY:
            return f"{name} is missing: this command needs the laboratory, {OF_REPOSITORY}", 2
        case ModuleNotFoundError(name=str(name)) if name.partition(".")[0] in (*FLEET, "dask"):
            return f"{name} is missing: fleets need it, pip install distributed fsspec", 2
        case ModuleNotFoundError(name=str(name)) if name.partition(".")[0] in LEARN:
            return (
                f"{name} is missing: emission models need scikit-learn, pip install scikit-learn",
                2,
            )
        case OSError(filename=str(filename), strerror=str(reason)):
            return f"{filename}: {reason.lower()}", 2
        case OSError(errno=errno.ENOSPC):
            return "no space left on the disk; free some, or write elsewhere", 2
        case _:
            return (
                f"unexpected {type(error).__name__}: {error} (a fault of the program, please report it;"
                " BRAKE_ECU_DEBUG=1 shows where)",
                1,
            )


@cache
def _add_commands() -> int:
    """Add the commands of other distributions, once; return the number of these distributions."""
    others = entry_points(group="brake_ecu.commands")
    for point in others:
        app.add_typer(point.load())
    return len(others)


def main(arguments: list[str] | None = None) -> int:
    """Run one command line and return its exit code."""
    streams.prepare()
    try:
        code = _answered(arguments or sys.argv[1:] or ["--help"])
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        streams.empty()
        return UNREAD


def _answered(arguments: list[str]) -> int:
    """Run one command line, print the error that it ends with, and return its exit code.

    Raises:
        BrokenPipeError: nobody reads what it prints.
    """
    had_reader = not streams.is_nowhere()
    with new_policy() as asked:
        try:
            code = _run(arguments)
        except (KeyboardInterrupt, typer.Abort):
            return INTERRUPTED
        except Exception as error:
            gone = had_reader and streams.is_nowhere()
            if isinstance(error, BrokenPipeError) and (gone or streams.are_unread()):
                raise
            if COMPLETE in os.environ:
                return 1  # nothing to complete after a mistake
            if os.environ.get("BRAKE_ECU_DEBUG") == "1":
                traceback.print_exc()
            line, code = _describe(error)
            line = " ".join(line.split())
            give(error=line)
            if isinstance(error, Mistakes):
                give(mistakes=error.lines)
            for each in error.lines if isinstance(error, Mistakes) else [line]:
                fault(f"brake-ecu: {each}")
        if asked.json and asked.given:
            print_given()
        return code


def _run(arguments: list[str]) -> int:
    name = "" if COMPLETE in os.environ else next((one for one in arguments if one[:1] != "-"), "")
    if (program := app.only(name)) is app:
        _add_commands()
        program = app.only(name)
    if not is_run(arguments):
        gc.set_threshold(100_000)  # what is imported stays: looking through it again and again takes time
    try:
        return program(arguments, prog_name="brake-ecu", standalone_mode=False) or 0
    except SystemExit as ended:  # typer's and rich's answer to a broken pipe
        raise ended.__context__ or ended from None


if getattr(signal.getsignal(signal.SIGINT), "__module__", "") == __name__:
    signal.signal(signal.SIGINT, signal.default_int_handler)

if __name__ == "__main__":
    raise SystemExit(main())
