"""Benchmarks (`brake-ecu bench`), measured on this machine beside alternatives."""

from importlib import import_module

from brakelab.bench.registry import ENTRIES, MODULES, TIMES
from brakelab.bench.times import run_times
from brakelab.studies.measure import NOT_INSTALLED
from brakelab.studies.output import RESULTS, show_measured
from brakelab.studies.study import NOBODY, UNASKED, WIDE, Asked, Study
from ecu.errors import UserError
from ecu.settings.resources import resource


def bench(name: str | None, asked: Asked = UNASKED, write: bool = False) -> int:
    """Run one bench, or without a name all that measure time; print tables, or JSON. Returns 0.

    With `write` the page in docs/results of the checkout is renewed; `play` keeps the tables of other buses.

    Raises:
        UserError: there is no such bench, or `write` where there is no page.
    """
    if name is not None and name not in (*TIMES, *MODULES):
        raise UserError("bench", name, f"no such bench; choose one of {', '.join((*TIMES, *MODULES))}")
    if asked.entered != NOBODY and name != ENTRIES:
        raise UserError("bench", name or "", f"has no --observer, --drive, --export; `bench {ENTRIES}` has")
    if write:
        _check_page(name, asked)
    if asked.entered.export is not None:
        from brakelab.studies.entries.command import export_entries

        return export_entries(asked.entered.export, asked.seeds)
    if name in MODULES:
        study = study_of(name)
        show_measured(f"bench {name}", study, study.run(asked), write)
    else:
        times = Study("Times", "", lambda asked: run_times(name), "benchmarks")
        show_measured("bench", times, times.run(asked), write)
    return 0


def study_of(name: str) -> Study:
    """Return a study of `MODULES`. Raises UserError where a package is missing."""
    try:
        study: Study = import_module(f"brakelab.{MODULES[name]}").STUDY
    except ModuleNotFoundError as error:
        raise UserError("bench", name, NOT_INSTALLED.format(error.name)) from None
    return study


def _check_page(name: str | None, asked: Asked) -> None:
    if name in TIMES:
        raise UserError("--write", name, "has no page of its own; `bench --write` measures all times")
    if asked.draw != WIDE:
        raise UserError("--write", asked.draw, "pages are of the wide draw; leave out --draw")
    if asked.entered != NOBODY:
        raise UserError("--write", ENTRIES, "leave out --observer, --drive and --export: the page is of ours")
    if not resource(RESULTS).is_dir():
        raise UserError("--write", RESULTS, "no such folder; run it in a checkout")
