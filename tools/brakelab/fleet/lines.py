"""Fleet page, few vehicles: each quantity over the drives, a line per vehicle."""

from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from bokeh.models import SingleIntervalTicker

from brakelab.fleet.statistics import Quantity, Summary, values_of
from brakelab.report.look import INK, STAGE_COLOURS, new_figure

FEW: Final = 8
"""Vehicles up to which each has its line."""
_COLOURS: Final = (*STAGE_COLOURS, INK)
_DASHES: Final = ("solid", "dashed")


def lines_of_vehicles(done: Sequence[Summary], quantity: Quantity) -> Any:
    """Return the figure over the number of a vehicle's drive, in the order of `done`."""
    values = values_of(done, quantity.name) * quantity.scale
    owners = [row["vehicle"] for row in done]
    plot = new_figure("Drive of the vehicle", quantity.title)
    for place, vehicle in enumerate(dict.fromkeys(owners)):
        mine = values[[owner == vehicle for owner in owners]]
        known = np.isfinite(mine)
        if not known.any():
            continue
        number = 1 + np.flatnonzero(known)
        colour, dash = _COLOURS[place % len(_COLOURS)], _DASHES[place // len(_COLOURS)]
        plot.line(number, mine[known], line_color=colour, line_dash=dash, legend_label=vehicle)
        plot.scatter(number, mine[known], size=5, line_color=colour, fill_color=colour, legend_label=vehicle)
    longest = max(Counter(owners).values(), default=1)
    plot.xaxis.ticker = SingleIntervalTicker(interval=max(1, -(-longest // 15)), num_minor_ticks=0)
    return plot
