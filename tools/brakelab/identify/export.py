"""`brake-ecu lab export`: an identified law for other programs, as C or as a table of friction.

C has the law's kernel itself (`c_source.py`), its numbers and two functions more:

    double NAME_start(void);            the memory at the start of an application
    double NAME(double *memory, ...);   mu_b, and the memory `dt` later; inputs of `plant/friction`

A CONFIG gives particles and wear of an axle's brakes instead. The table (CSV) has friction at the first
contact and after a second under the same conditions, for programs that know no memory.
"""

import re
import sys
import tomllib
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any, Final

from brakelab.c_source import Source, array, number
from brakelab.plant.description import PlantFileError, read_file
from brakelab.plant.friction.law import START, Law, RigBrake
from brakelab.plant.friction.laws import friction, law_row
from brakelab.plant.friction.own import NUMBERS, Own, plain_step
from brakelab.plant.linings import Linings
from brakelab.results.outputs import check_outputs, config_files, write_text
from ecu.algorithm.monitoring.emission_factor import emission_factor, inside
from ecu.contract.dust import FEATURES, NONE
from ecu.errors import UserError
from ecu.output import give, say, wrote
from ecu.settings.config import load_config, new_params

TEMPERATURES: Final = (20.0, *(50.0 * step for step in range(1, 13)))  # degC
PRESSURES: Final = (2.0, 5.0, 10.0, 20.0, 30.0, 40.0, 60.0, 80.0, 100.0, 120.0)  # bar
SPEEDS: Final = (0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0)  # m/s, of the disc under the pad
HELD_S: Final = 1.0
STEP_S: Final = 1e-3
COLUMNS: Final = "disc_temperature,calliper_pressure,sliding_speed,mu_b_first,mu_b_held"
UNITS: Final = "degC,bar,m/s,-,-"


def export(source: Path, out: Path, brake: str | None, law: str, axle: str) -> None:
    """Write a law of a lining file, or what CONFIG knows of an axle's brakes.

    Raises:
        UserError: `source` is neither, has no such brake or law, or `out` ends in something else.
    """
    if out.suffix not in (".c", ".csv"):
        raise UserError("--out", str(out), "ends in neither .c nor .csv")
    try:
        linings = "lining" in tomllib.loads(source.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise UserError(str(source), "", f"cannot be read as TOML ({error})") from None
    check_outputs(out, (out,), [source] if linings else config_files(source))
    name = re.sub(r"\W", "_", out.stem)
    name = f"law_{name}" if name[:1].isdigit() else name
    if linings:
        found, on = _chosen(source, brake, law)
        text = _table(found, on) if out.suffix == ".csv" else law_text(found, on, name, f"{law} of {source}")
    elif out.suffix == ".csv":
        raise UserError("--out", str(out), "a CONFIG has no friction law; let it end in .c")
    elif axle not in ("front", "rear"):
        raise UserError("--axle", axle, "choose front or rear")
    else:
        text = _car_text(source, axle, name)
    write_text(out, text)
    say(f"{out}: {'C99, needs -lm' if out.suffix == '.c' else 'no memory: first contact, and held for 1 s'}")
    give(lines=text.count("\n"))
    wrote(out)


def _chosen(path: Path, brake: str | None, law: str) -> tuple[Law, RigBrake]:
    try:
        linings = read_file(path, Linings).lining
    except PlantFileError as error:
        raise UserError(str(path), error.place, error.remedy) from None
    if brake is None and len(linings) == 1:
        brake = next(iter(linings))
    if brake not in linings:
        raise UserError("--brake", brake or "", f"choose one of {', '.join(linings)}")
    lining = linings[brake]
    if law not in lining.friction:
        raise UserError("--law", law, f"no such law; choose one of {', '.join(lining.friction)}")
    return lining.friction[law], lining.brake


def law_text(law: Law, brake: RigBrake, name: str, of: str) -> str:
    """Return a law as C: its kernel, its numbers, `name`_start and `name`."""
    source = Source()
    if isinstance(law, Own):
        kernel, numbers = plain_step(law.code), law.row(brake)[NUMBERS:]
    else:
        kernel, numbers = _kernel_of(law), law.row(brake)
    called = source.add(kernel)
    return f"""\
/* Friction law {of}, written by `brake-ecu lab export`.
 *
 * double {name}_start(void): memory at the start of a brake application.
 * double {name}(...): mu_b; memory is advanced by dt.
 *   pressure [Pa] above the push-out pressure, speed [m/s] of the disc under the pad,
 *   slowing [rad/s^2] of the rig's disc by this brake torque ({brake.gain(law.rig_mass):.6g} mu_b pressure),
 *   temperature [degC] of the disc, dt [s]; 0 keeps the memory.
 */
{source.text}
{array(f"{name}_numbers", numbers)}
double {name}_start(void) {{
    return {number(law.row(brake)[START])};
}}

double {name}(double *memory, double pressure, double speed, double slowing, double temperature, double dt) {{
    double next, mu;
    {called}({name}_numbers, *memory, pressure, speed, slowing, temperature, dt, &next, &mu);
    *memory = next;
    return mu;
}}
"""


def _kernel_of(law: Law) -> Callable[..., Any]:
    kernel: Callable[..., Any] = sys.modules[type(law).__module__].__dict__["step"]
    return kernel


def _table(law: Law, brake: RigBrake) -> str:
    number, row = law_row(law, brake)
    gain, lines = brake.gain(law.rig_mass), [COLUMNS, UNITS]
    for heat, bar, speed in product(TEMPERATURES, PRESSURES, SPEEDS):
        memory, first = friction(number, row, row[START], 1e5 * bar, speed, 0.0, heat, 0.0)
        mu = first
        for _ in range(round(HELD_S / STEP_S)):
            memory, mu = friction(number, row, memory, 1e5 * bar, speed, gain * mu * 1e5 * bar, heat, STEP_S)
        lines.append(f"{heat:g},{bar:g},{speed:g},{first:.5f},{mu:.5f}")
    return "\n".join([*lines, ""])


def _car_text(config: Path, axle: str, name: str) -> str:
    """Return wear and, with an emission model, particles of a brake of an axle as C."""
    corner = 0 if axle == "front" else 2
    row, source = new_params(load_config(config))[0], Source()
    law = row["wear_law"][:, corner]
    parts = [array(f"{name}_wear_law", law), _WEAR.format(name=name, count=len(law))]
    model = int(row["dust_model"][corner])
    if model != NONE:
        factor, known = source.add(emission_factor), source.add(inside)
        for each in ("numbers", "low", "high"):
            parts.append(array(f"{name}_{each}", row[f"dust_{each}"][corner]))
        by = f"{number(row['dust_factor'][corner])} * pow(10.0, {factor}({model}, {name}_numbers, features))"
        parts.append(_PARTICLES.format(name=name, inside=known, by=by, features=", ".join(FEATURES)))
    head = f"/* One {axle} brake of {config}, written by `brake-ecu lab export`. */\n"
    return "\n".join([head, source.text, *parts])


_WEAR: Final = """\
/* g of both pads; integrals: wear_energy to wear_power2_t of RESULT.brakes.parquet, in their order. */
double {name}_wear(const double *integrals) {{
    double grams = 0.0;
    for (int k = 0; k < {count}; k++) grams += {name}_wear_law[k] * integrals[k];
    return grams;
}}
"""
_PARTICLES: Final = """\
/* Particles of one application; features: {features};
 * m/s, N m, degC, s, bar above push-out. NAN outside what the model was trained on. */
double {name}_particles(const double *features) {{
    return {inside}({name}_low, {name}_high, features) ? {by} : NAN;
}}
"""
