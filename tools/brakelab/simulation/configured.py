"""What is driven: shipped scenarios and configurations, and configurations with other keys."""

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel

from ecu.contract.params import OBSERVERS
from ecu.errors import UserError
from ecu.settings.config import Config, load_config
from ecu.settings.resources import resource

if TYPE_CHECKING:
    from brakelab.simulation.scenario import Scenario

Model = TypeVar("Model", bound=BaseModel)


@cache
def shipped(name: str) -> "Scenario":
    """Return a scenario of config/scenarios."""
    from brakelab.simulation.scenario import load_scenario  # a replay needs no scenario

    return load_scenario(resource(f"config/scenarios/{name}.toml"))


@cache
def configured(name: str = "suv") -> Config:
    """Return a configuration of config/."""
    return load_config(resource(f"config/{name}.toml"))


def with_keys(model: Model, keys: Mapping[str, Any]) -> Model:
    """Return `model` with other values of `keys`, as front.mu_nominal, which nothing checks."""
    update: dict[str, Any] = {}
    for key, value in keys.items():
        name, _, rest = key.partition(".")
        update[name] = with_keys(update.get(name, getattr(model, name)), {rest: value}) if rest else value
    return model.model_copy(update=update)


def with_observer(config: Config, kind: str | None = None, **keys: float) -> Config:
    """Return `config` with these keys of [observer]; `kind` None: its own.

    Raises UserError for an unknown `kind`.
    """
    if kind is not None and kind not in OBSERVERS:
        raise UserError("--observer", kind, f"not known; take {', '.join(OBSERVERS)}")
    update = keys | ({} if kind is None else {"kind": kind})
    return with_keys(config, {f"observer.{key}": value for key, value in update.items()})
