"""A friction observer as it enters the benchmark, and how `--observer` names it."""

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

from brakelab.studies.entries.inputs import Inputs
from ecu.errors import UserError
from ecu.settings.config import Config

OPTION = "--observer"


class Observer(Protocol):
    """What an entry has.

    It may also have, as attributes or properties, what it knows beyond friction, which is read where the next
    braking is predicted: `mass` [kg], `overrun` [m/s^2] and `pressure_zero` [bar], the last of shape (4,).
    `wheel_transducers = True`: it hears the forces of measuring wheels, and its line says so.
    """

    def reset(self, config: Config) -> None:
        """Forget everything: another car, configured so."""

    def step(self, inputs: Inputs) -> tuple[Any, Any]:
        """Return friction and its standard deviation, four values each; sigma NaN: not stated."""


class EntryError(Exception):
    """An entry that failed; the text is its line in the table."""


def _module(name: str) -> ModuleType:
    if not name.endswith(".py"):
        here = str(Path.cwd())
        if here not in sys.path:
            sys.path.insert(0, here)
        return importlib.import_module(name)
    path = Path(name).resolve()
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if not path.is_file() or spec is None or spec.loader is None:
        raise UserError(OPTION, name, "no such file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def load_class(name: str) -> type[Observer]:
    """Return the class named `module:Class`, from the working directory or installed, or `file.py:Class`.

    Raises:
        UserError: there is no such module, file or class, it cannot be imported, or lacks `reset` or `step`.
    """
    module, _, wanted = name.rpartition(":")
    if not module or not wanted.isidentifier():
        raise UserError(OPTION, name, "give module:Class or path/file.py:Class")
    try:
        loaded = _module(module)
    except UserError:
        raise
    except (Exception, SystemExit) as error:  # what a stranger's module does while it is imported is its own
        raise UserError(OPTION, name, f"cannot be imported ({type(error).__name__}: {error})") from None
    found = getattr(loaded, wanted, None)
    if not isinstance(found, type):
        classes = [key for key, value in vars(loaded).items() if isinstance(value, type)]
        raise UserError(OPTION, name, f"no class {wanted} there; it has {', '.join(classes) or 'none'}")
    for method in ("reset", "step"):
        if not callable(getattr(found, method, None)):
            raise UserError(OPTION, name, f"has no method {method}; see docs/benchmark.md")
    return found
