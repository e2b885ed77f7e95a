"""Configuration with another observer, or another tuning of it."""

from ecu.contract.params import OBSERVERS
from ecu.errors import UserError
from ecu.settings.config import Config


def with_observer(config: Config, kind: str | None = None, **keys: float) -> Config:
    """Return `config` with these keys of [observer]; `kind` None: its own.

    Raises UserError for an unknown `kind`.
    """
    if kind is not None and kind not in OBSERVERS:
        raise UserError("--observer", kind, f"not known; take {', '.join(OBSERVERS)}")
    update = keys | ({} if kind is None else {"kind": kind})
    return config.model_copy(update={"observer": config.observer.model_copy(update=update)})
