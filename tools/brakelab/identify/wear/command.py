"""Identification of wear (`brake-ecu identify wear`): wear law from dynamometer blocks, as a CONFIG."""

from pathlib import Path
from typing import Final

import numpy as np

from brakelab.identify.config_file import Section, write_car
from brakelab.identify.measurement_files import measured_files
from brakelab.identify.wear.curves import SHARE
from brakelab.identify.wear.fit import QUASI_STATIC, TERMS, UNITS, Fit, fit_law, leave_one_out
from brakelab.identify.wear.fusion import fuse
from brakelab.identify.wear.page import tables, write_page
from brakelab.identify.wear.reader import Heat, read_blocks
from brakelab.results.outputs import check_outputs, config_files
from ecu.errors import UserError
from ecu.output import give, wrote
from ecu.settings.config import Axle, load_config

COOLING_SPEED: Final = 15.0  # m/s, speed of cooling between stops, assumed
ROAD: Final = 0.10  # relative: difference of the road from a laboratory (section 7.6)


def law_section(fit: Fit, error: float) -> Section:
    """Return the keys of a pad: its law and the law's `error`, relative."""
    numbers = ", ".join(f"{value:.6g}" for value in fit.coefficients)
    return {
        "law": ('"extended"', "from dynamometer blocks, disc in degC"),
        "coefficients": (f"[{numbers}]", "g/MJ, g/MJ/K, g/MJ/K^2, g/MW, g/MW/K, g s/MJ^2, …/K"),
        "sigma": (f"{min(max(error, 0.02), 0.9):.4f}", "relative, blocks left out and the way to the road"),
    }


def identify_wear(manifest: Path, config: Path, axle: str, out: Path) -> int:
    """Identify the wear law of an axle's linings; write `out` and `out`.md, return 0.

    Raises:
        UserError: an argument or a file is invalid.
    """
    if axle not in ("front", "rear"):
        raise UserError("--axle", axle, "choose front or rear")
    vehicle = load_config(config)
    written = out, page, _ = out, out.with_suffix(".md"), out.with_suffix(".svg")
    check_outputs(out, written, [*measured_files(manifest), *config_files(config)], toml=True)
    brake: Axle = getattr(vehicle, axle)
    cooling = brake.disc_cooling + COOLING_SPEED * brake.disc_cooling_by_speed
    blocks = read_blocks(manifest, brake.pad, Heat(brake.disc_heating, cooling))
    fused = fuse(np.array([b.wear for b in blocks]), np.array([b.mass for b in blocks]))
    regressors = np.array([block.regressors for block in blocks])
    variance = np.diag(fused.covariance)
    try:
        fit = fit_law(regressors, fused.mass, variance)
        static = fit_law(regressors, fused.mass, variance, QUASI_STATIC)
    except UserError as error:
        raise UserError(str(manifest), f"{error.where}: {error.place}", error.remedy) from None
    sigma = float(np.hypot(leave_one_out(fit, fused.mass), ROAD))
    head = "# Wear law by `brake-ecu identify wear`."
    write_car(config, out, head, {f"{axle}.pad": law_section(fit, sigma)})
    write_page(page, blocks, fused, fit, static, SHARE[axle] * vehicle.vehicle.mass)
    named = zip(TERMS, fit.coefficients, UNITS, strict=True)
    kept = ", ".join(f"{name} = {value:.4g} {unit}" for name, value, unit in named if value)
    give(coefficients=dict(zip(TERMS, fit.coefficients, strict=True)), r2=fit.r2)
    give(left_out=leave_one_out(fit, fused.mass), tables=tables(blocks, fused, fit, static))
    print(f"{out}: {kept}")
    print(
        f"{page}: {len(blocks)} blocks, R² {fit.r2:.4f} (quasi-static {static.r2:.4f}), blocks left out "
        f"{100 * leave_one_out(fit, fused.mass):.1f} % RMS, rank {fit.rank} of 7"
    )
    wrote(*written, next=f"brake-ecu replay LOG --config {out} --out drive.parquet")
    return 0
