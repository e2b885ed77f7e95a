"""The drives that entries hear and their truth as files, for work in another language."""

import shutil
from pathlib import Path
from typing import Final

import numpy as np

from brakelab.simulation.simulate import write_columns
from brakelab.studies.entries.drives import NAMES, PERIOD, SETS, WITHHELD, CarTracks, Track
from ecu.contract.signals import CORNERS
from ecu.errors import UserError
from ecu.settings.resources import resource

CONFIG: Final = "config/suv.toml"


def new_folder(folder: Path) -> None:
    """Make the folder with the configuration in it. Raises UserError if it cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(resource(CONFIG), folder / Path(CONFIG).name)
    except OSError as error:
        raise UserError("--export", str(folder), f"cannot be written ({error.strerror})") from None


def export_car(folder: Path, seed: int, car: CarTracks) -> list[Path]:
    """Write inputs and truth of a car's drives into `folder`; return the files of the inputs."""
    named = {track.name: track for track in (car.everyday, *car.stops)}
    named |= {f"recorded-{place}": track for place, track in enumerate(car.recorded)}
    return [_export(folder, f"car-{seed}-{name}", track) for name, track in named.items()]


def _export(folder: Path, name: str, track: Track) -> Path:
    t = np.arange(len(track.values), dtype=np.float64) * PERIOD
    inputs = {signal: track.values[:, place] for place, signal in enumerate(NAMES) if not WITHHELD[place]}
    truth = {f"mu_b_{corner}": track.mu[:, place] for place, corner in enumerate(CORNERS)}
    truth |= {f"calliper_pressure_{corner}": track.pressure[:, i] for i, corner in enumerate(CORNERS)}
    truth["counted"] = track.rows.astype(np.float64)
    about = {"sensors": track.name} if track.name in SETS else {}
    path = folder / f"{name}.inputs.parquet"
    write_columns(path, t, inputs, about)
    write_columns(folder / f"{name}.truth.parquet", t, truth, about)
    return path
