"""Numbers identified beside those of Tables C.1 to C.3."""

from typing import Final

from brakelab.identify.friction.choice import Judged
from brakelab.plant.disc import DISC_SHARE
from brakelab.results.text_table import Table
from brakelab.studies.lab.run import Lab
from brakelab.studies.physics.heat import BRAKES

TABLE_C_1: Final = (2.111e-4, 2.668e-4, 1.700e-4)
"""xi [K/J]; the print's unit is 1/(m N) K, which is the same."""
TABLE_C_2: Final = {
    "kappa_0": (0.2687, 0.1127, 0.1854),
    "kappa_1": (0.3075e-3, 0.6395e-3, 0.4405e-3),
    "a": (None, None, None),
    "b": (0.02302, 0.01640, 0.02034),
    "c": (1.226e-10, 1.380e-10, 0.9605e-10),
}
TABLE_C_3: Final = {
    "p_1": (1.123e-5, 2.918e-4, 2.161e-5),
    "p_2": (3.604e6, 6.679e5, 1.528e6),
    "p_3": (3.599e3, 7.008e2, 1.478e3),
}


def number_tables(lab: Lab) -> list[Table]:
    """Return the identified numbers beside Tables C.1, C.2 and C.3."""
    return [_heating(lab), _ilvo(lab), _ostermeyer(lab)]


def _law(lab: Lab, brake: str, name: str) -> Judged:
    return next(law for law in lab.brakes[brake].identified.laws if law.name == name)


def _heating(lab: Lab) -> Table:
    rows = []
    for brake, printed in zip(BRAKES, TABLE_C_1, strict=True):
        heat = lab.brakes[brake].heat
        xi = DISC_SHARE / heat.at_100
        rows.append((brake, f"{printed:.4g}", f"{xi:.4g} ± {xi * heat.half / heat.at_100:.1g}"))
    below = (
        "K/J, at 100 °C. The rig's discs have the thesis's numbers there, so this is a check of the "
        "identification. Cooling is not found: between stops nothing is recorded, within them the air takes "
        "little."
    )
    return Table("Table C.1: ξ", ("brake", "thesis", "found"), rows, below)


def _ilvo(lab: Lab) -> Table:
    rows = []
    for place, (name, printed) in enumerate(TABLE_C_2.items()):
        cells = []
        for column, brake in enumerate(BRAKES):
            _, _, value, half = _law(lab, brake, "ilvo").numbers[place]
            thesis = printed[column]
            cells += ["–" if thesis is None else f"{thesis:.4g}", f"{value:.3g} ± {half:.1g}"]
        rows.append((name, *cells))
    columns = ("number", *(f"{b}{what}" for b in BRAKES for what in (", thesis", "")))
    below = (
        "ILVO on CPC of our pads, form R1 of friction.md, units there. The thesis's are of its "
        "brakes: the same signs and orders of size, no more is to be expected. Its a (10⁻⁹, without a "
        "mantissa) has no value to compare."
    )
    return Table("Table C.2: ILVO", columns, rows, below)


def _ostermeyer(lab: Lab) -> Table:
    found = {}
    for brake in BRAKES:
        p_1, p_2, ratio = (value for _, _, value, _ in _law(lab, brake, "ostermeyer").numbers)
        found[brake] = {"p_1": p_1, "p_2": p_2, "p_3": ratio * p_2}
    rows = []
    for name, printed in TABLE_C_3.items():
        cells = zip(printed, BRAKES, strict=True)
        rows.append((name, *(text for p, b in cells for text in (f"{p:.3g}", f"{found[b][name]:.3g}"))))
    rates = zip(TABLE_C_3["p_1"], TABLE_C_3["p_2"], BRAKES, strict=True)
    rows.append(
        (
            "p_1 p_2 [1/s]",
            *(t for p, q, b in rates for t in (f"{p * q:.2g}", f"{found[b]['p_1'] * found[b]['p_2']:.2g}")),
        )
    )
    slopes = zip(TABLE_C_3["p_2"], TABLE_C_3["p_3"], BRAKES, strict=True)
    rows.append(
        (
            "p_3 / p_2 [1/K]",
            *(t for q, r, b in slopes for t in (f"{r / q:.2g}", f"{found[b]['p_3'] / found[b]['p_2']:.2g}")),
        )
    )
    unsure = {b: ", ".join(_law(lab, b, "ostermeyer").unidentified) or "none" for b in BRAKES}
    below = (
        "SI units, temperature in K. Settled, within 1 / (p_1 p_2), the law is p_3 T / (p_2 + power of the "
        "normal force): p_1 is gone, and p_2 shows only where that power comes near it, so stops show p_3 / "
        f"p_2. Not identified: {'; '.join(f'{b} {names}' for b, names in unsure.items())}."
    )
    columns = ("number", *(f"{b}{what}" for b in BRAKES for what in (", thesis", "")))
    return Table("Table C.3: Ostermeyer", columns, rows, below)
