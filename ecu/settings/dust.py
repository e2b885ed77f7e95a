"""Emission model of an axle's brake in CONFIG: `[front.dust]`, `[rear.dust]` by `identify dust`."""

import zlib
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ecu.contract.dust import FEATURES, MODELS, MOST_NUMBERS, NONE, NUMBERS
from ecu.settings.toml_file import Section

Feature = Annotated[float, Field(ge=-1e6, le=1e6)]


class Dust(Section):
    """Emission factor of one brake, log10 of its particles in an application, by the application's means."""

    model: Literal["network", "table", "law"]
    """Kind of the model that `identify dust` found."""
    numbers: list[Annotated[float, Field(ge=-1e4, le=1e4)]] = Field(max_length=MOST_NUMBERS)
    """Of the model, in the order that its kernel takes them."""
    low: list[Feature] = Field(min_length=len(FEATURES), max_length=len(FEATURES))
    """Of each feature, the least that it was trained on: beyond it no particles are counted."""
    high: list[Feature] = Field(min_length=len(FEATURES), max_length=len(FEATURES))
    """Of each feature, the greatest."""
    factor: Annotated[float, Field(gt=0.1, lt=10.0)] = 1.0
    """Mean of the particles over ten to the emission factor: a logarithm's mean is that of its median."""
    below: Annotated[float, Field(le=0.0, gt=-5.0)]
    """From the emission factor to the lower end of its 95 % interval."""
    above: Annotated[float, Field(ge=0.0, lt=5.0)]
    """From the emission factor to the upper end."""

    @model_validator(mode="after")
    def _whole(self) -> "Dust":
        expected = NUMBERS[MODELS.index(self.model)]
        if len(self.numbers) != expected:
            raise ValueError(f"a {self.model} has {expected} finite numbers (found {len(self.numbers)})")
        if any(low > high for low, high in zip(self.low, self.high, strict=True)):
            raise ValueError("low must not exceed high")
        return self


def set_dust(row: Any, corner: int, dust: Dust | None) -> None:
    """Write the emission model of a corner into `row`, one `PARAMS`."""
    if dust is None:
        row["dust_model"][corner] = NONE
        return
    row["dust_model"][corner] = MODELS.index(dust.model)
    row["dust_numbers"][corner, : len(dust.numbers)] = dust.numbers
    row["dust_low"][corner], row["dust_high"][corner] = dust.low, dust.high
    row["dust_factor"][corner] = dust.factor
    row["dust_below"][corner], row["dust_above"][corner] = dust.below, dust.above


def set_dust_version(row: Any) -> None:
    """Write a number that identifies these emission models into `row`, once all corners are set."""
    names = ("dust_model", "dust_numbers", "dust_factor", "dust_low", "dust_high")
    row["dust_version"] = zlib.crc32(b"".join(row[name].tobytes() for name in names))
