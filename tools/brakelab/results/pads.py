"""Pads at the end of a drive, as the metadata of its result hold them: `pads`, JSON, an object a corner.

What the ECU learned for the life of the pads is not in the rows of a drive: thickness, distance and the
remaining distance follow from it as `brake-ecu wear` has them.
"""

import json
import math
from typing import Any, NamedTuple

from ecu.contract.records import RecordArray
from ecu.pads import appraise
from ecu.pads import pads as linings_of
from ecu.settings.config import Config

KEY = "pads"


class PadState(NamedTuple):
    """One corner's pads at the end of a drive; thickness in mm, distances in km, NaN: not known."""

    corner: str
    thickness: float
    sigma: float
    mass: float
    """Worn off both pads since they were fitted, g."""
    driven: float
    remaining: float
    remaining_low: float
    """Ends of the 95 % band."""
    remaining_high: float
    scale: float
    """Wear by measured thicknesses over wear by the law."""
    measurements: int
    told: bool
    """These pads were registered as new."""
    thickness_new: float
    thickness_worn: float
    configured: bool
    """CONFIG names these linings; else size and law are those of the thesis's brake A."""
    emission_model: bool


def pads_of(params: RecordArray, learned: RecordArray, config: Config) -> list[PadState]:
    """Return the pads of the four corners by `learned` (`LEARNED`, shape (1,))."""
    axles = (config.front, config.front, config.rear, config.rear)
    states = []
    for found, lining, axle in zip(appraise(params, learned, config), linings_of(config), axles, strict=True):
        known = found._asdict()
        del known["wear"]  # the rows have it
        states.append(
            PadState(
                **known,
                thickness_new=lining.thickness_new,
                thickness_worn=lining.thickness_worn,
                configured="pad" in axle.model_fields_set,
                emission_model=axle.dust is not None,
            )
        )
    return states


def packed(pads: list[PadState]) -> list[dict[str, Any]]:
    """Return pads for JSON: NaN becomes null."""
    return [
        {name: None if isinstance(v, float) and math.isnan(v) else v for name, v in pad._asdict().items()}
        for pad in pads
    ]


def unpacked(text: str) -> list[PadState]:
    """Return the pads of `packed`, as JSON text; none of an empty text.

    Raises:
        ValueError: it is none.
        TypeError: a field is missing, or one too many.
    """
    return filled(json.loads(text)) if text else []


def filled(pads: list[dict[str, Any]]) -> list[PadState]:
    """Return the pads of `packed`. Raises TypeError: a field is missing, or one too many."""
    known: list[dict[str, Any]] = [
        {name: math.nan if value is None else value for name, value in pad.items()} for pad in pads
    ]
    return [PadState(**pad) for pad in known]
