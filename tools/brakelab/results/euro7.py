"""Limits of Euro 7 for particles up to 10 µm from brakes [mg/km], over the WLTP-Brake cycle, discs included.

Regulation (EU) 2024/1257, Annex I, as a summary has them (S&P Global Mobility, 2026); the regulation's own
text was not at hand. Heavier vans are those of category N1, class III. There is no limit of the number yet.
"""

from typing import Final

ELECTRIC_CAR: Final = 3.0
ELECTRIC_VAN: Final = 5.0
"""Heavier van, battery electric."""
CAR: Final = 7.0
"""Any other car or lighter van."""
VAN: Final = 11.0
"""Any other heavier van."""
WORDS: Final = (
    f"{CAR:g}, battery electric {ELECTRIC_CAR:g}; heavier vans {VAN:g}, battery electric {ELECTRIC_VAN:g}"
)


def above_all(mass: float) -> bool:
    """Return whether no limit allows `mass` [mg/km]: CONFIG states neither category nor drive."""
    return mass > max(ELECTRIC_CAR, ELECTRIC_VAN, CAR, VAN)
