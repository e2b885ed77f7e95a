"""Writes the terms that `discovery` finds as a law of one's own: a Python file, see `plant/friction/own.py`.

In alpha the model is linear, so a step is trapezoidal (`linear_step` of `plant/friction/law.py`). Numbers are
in SI units; `identify friction` searches them within half of what was found about it.
"""

from typing import Final

from brakelab.identify.friction.discovery import (
    BY_ALPHA,
    BY_MU,
    LEVEL_TERMS,
    LEVELS,
    NAMES,
    PLAIN,
    RATE_TERMS,
    Found,
    Library,
    library,
    sparse,
)
from brakelab.identify.friction.stops import Stops

CODE: Final = {
    "1": "1.0",
    "T": "kelvin",
    "T²": "kelvin * kelvin",
    "p": "pressure",
    "v": "speed",
    "p v": "pressure * speed",
    "p T": "pressure * kelvin",
    "v T": "speed * kelvin",
    "p v T": "pressure * speed * kelvin",
    "|ω'|": "pressure",  # times mu: on a flywheel
}
"""Of a term without mu or alpha."""
ABOUT: Final = 0.5


def discovered_law(stops: Stops) -> tuple[Found, str]:
    """Return the terms found in `stops`, and the law of them as Python."""
    of = library(stops)
    found = sparse(of)
    return found, law_code(found, of)


def law_code(found: Found, of: Library) -> str:
    """Return the model of `found` as Python."""
    numbers = []
    sums: dict[str, list[str]] = {"kappa": [], "by mu": [], "by alpha": [], "plain": []}
    for place, (term, weight) in enumerate(zip(found.terms, found.coefficients, strict=True)):
        value = float(weight * of.scale[term])
        ends = sorted((value * (1.0 - ABOUT), value * (1.0 + ABOUT)))
        numbers.append(f'    "{NAMES[term]}": ("SI", {ends[0]!r}, {ends[1]!r}),  # found: {value:.4g}')
        sums[_kind(term)].append(f"numbers[{place}] * {_code(term)}")
    kappa, by_mu, by_alpha, plain = ("\n        + ".join(parts) or "0.0" for parts in sums.values())
    return f'''"""Terms found by `identify friction --discover`: mu_b = kappa alpha. Pa, m/s, K, s."""

NUMBERS = {{
{chr(10).join(numbers)}
}}
START = 1.0


def step(numbers, memory, pressure, speed, slowing, temperature, dt):
    kelvin = temperature + 273.15
    kappa = (
        {kappa}
    )
    by_mu = (
        {by_mu}
    )
    by_alpha = (
        {by_alpha}
    )
    plain = (
        {plain}
    )
    half = min(0.5 * dt * (kappa * by_mu + by_alpha), 0.5)
    memory = (memory * (1.0 + half) + dt * plain) / (1.0 - half)
    return memory, kappa * memory
'''


def _kind(term: int) -> str:
    if term < LEVELS:
        return "kappa"
    return {BY_MU: "by mu", BY_ALPHA: "by alpha", PLAIN: "plain"}[RATE_TERMS[term - LEVELS][1]]


def _code(term: int) -> str:
    name = LEVEL_TERMS[term] if term < LEVELS else RATE_TERMS[term - LEVELS][0]
    bare = " ".join(part for part in name.split() if part not in ("μ", "α"))
    return CODE[bare or "1"]
