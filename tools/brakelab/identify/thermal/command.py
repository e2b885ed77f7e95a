"""Identification of the disc temperature model (`brake-ecu identify thermal`) from measured temperatures."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from brakelab.identify.config_file import Section, write_car
from brakelab.identify.thermal.check import check_drive, check_fit
from brakelab.identify.thermal.fit import Disc, Fit, fit_axle, fit_nothing
from brakelab.identify.thermal.page import Judged, unidentified, write_page
from brakelab.identify.thermal.reader import ThermalLog, read_drives
from brakelab.identify.thermal.result import errors_of, judge, section_of, start_of
from brakelab.results.outputs import check_outputs, config_files
from brakelab.simulation.configured import with_keys
from ecu.errors import UserError
from ecu.output import argument, give, wrote
from ecu.settings.config import Axle, Config, load_config

AXLES: Final = {"front": (0, 1), "rear": (2, 3)}


def judge_axle(name: str, drives: Sequence[ThermalLog], discs: list[Disc], axle: Axle) -> Judged:
    """Return the fit of one axle beside the configuration's own. Raises `UserError`: see `check_fit`."""
    start = start_of(axle)
    fit = fit_axle(discs, axle.disc_heating, start)
    drive_of = {id(drive.series): drive for drive in drives}
    check_fit(str(drive_of[id(discs[0].series)].path), discs, fit, axle.disc_heating, start)
    before = fit_nothing(discs, axle.disc_heating, start, fit)
    errors = errors_of(fit, axle)
    predictions = [
        judge(disc, drive_of[id(disc.series)].friction_error[:, disc.corner], fit, number, errors, before)
        for number, disc in enumerate(discs)
    ]
    return Judged(name, axle, discs, fit, before, errors, predictions)


def _mean(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _about(axle: Judged) -> str:
    names = ", ".join(dict.fromkeys(disc.series.name for disc in axle.discs))
    before, after = (_mean([getattr(one, when) for one in axle.predictions]) for when in ("before", "after"))
    return f"{names}; RMSE {before:.1f} to {after:.1f} K"


def with_fits(config: Config, fits: dict[str, Fit]) -> Config:
    """Return the configuration that the written file is, for programs that go on with it."""
    keys: dict[str, float] = {}
    for name, fit in fits.items():
        axle: Axle = getattr(config, name)
        section = section_of(fit, axle, errors_of(fit, axle), "")
        keys |= {f"{name}.{key}": float(value) for key, (value, _) in section.items()}
    return with_keys(config, keys)


def identify_thermal(logs: Sequence[Path], config: Path, map: Path | None, out: Path) -> None:
    """Identify the disc temperature model of a car; write `out`, `out`.md and `out`.svg.

    Raises:
        UserError: an argument or a log is invalid, or the logs identify nothing.
    """
    vehicle = load_config(config)
    written = out, page, _ = out, out.with_suffix(".md"), out.with_suffix(".svg")
    check_outputs(out, written, [*logs, *config_files(config), *([map] if map else [])], toml=True)
    drives = read_drives(logs, vehicle, map)
    measured = [check_drive(drive) for drive in drives]
    axles: list[Judged] = []
    for name, corners in AXLES.items():
        discs = [
            Disc(drive.series, corner)
            for drive, found in zip(drives, measured, strict=True)
            for corner in corners
            if corner in found
        ]
        if discs:
            print(f"{name}: fitting {len(discs)} discs …", flush=True)
            axles.append(judge_axle(name, drives, discs, getattr(vehicle, name)))
    if not any(axle.fit.identified[:5].any() for axle in axles):
        raise UserError(str(logs[0]), "disc_temperature_measured_*", "; ".join(unidentified(axles[0])[:1]))
    sections: dict[str, Section] = {
        axle.name: section_of(axle.fit, axle.brake, axle.errors, _about(axle)) for axle in axles
    }
    head = "# Disc temperature by `brake-ecu identify thermal`."
    write_car(config, out, head, sections)
    load_config(out)
    write_page(page, axles)
    for drive in drives:
        if not drive.rain_known:
            print(f"{drive.path}: no rain signal; taken as dry")
    for axle in axles:
        for line in unidentified(axle):
            print(line)
    give(axles=sections)
    for axle in axles:
        fit, inside = axle.fit, 100.0 * float(np.mean([one.inside for one in axle.predictions]))
        print(
            f"{axle.name}: ξ {fit.heating:.3g} K/J, δ {fit.cooling.still:.3g} + {fit.cooling.by_speed:.3g} v "
            f"1/s; {_about(axle)}, inside 2σ {inside:.0f} %"
        )
    wrote(*written, next=f"brake-ecu replay LOG --config {argument(out)} --out drive.parquet")
