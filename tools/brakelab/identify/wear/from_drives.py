"""`brake-ecu identify wear --from-logs`: drives to the blocks of a dynamometer, as files."""

import csv
import io
from pathlib import Path
from typing import Final

from brakelab.identify.wear.applications import read_drives, road_blocks
from brakelab.identify.wear.programme import (
    LEGEND,
    Brake,
    block_panels,
    block_table,
    controller_text,
    mass_of,
    programme_text,
    road_energy,
)
from brakelab.results.chart import write_chart
from brakelab.results.files import brakes_path
from brakelab.results.outputs import check_outputs, config_files, write_text
from brakelab.results.text_table import markdown
from ecu.errors import UserError
from ecu.output import argument, give, wrote
from ecu.settings.config import load_config, new_params

COUNT: Final = 300
"""Applications of a block; the thesis has 250 and more."""
AGAIN: Final = "-again"
"""Of the first block, run once more at the end: what it then wears less is running-in, not heat."""


def blocks_from_drives(drives: list[Path], config: Path, axle: str, out: Path) -> None:
    """Write blocks that stand for drives: `out`, the manifest, and beside it programmes, tables and a page.

    Raises:
        UserError: an argument or a drive is invalid.
    """
    if axle not in ("front", "rear"):
        raise UserError("--axle", axle, "choose front or rear")
    if out.suffix != ".csv":
        raise UserError("--out", str(out), "with --from-logs the manifest is written; let it end in .csv")
    params = new_params(load_config(config))[0]
    road, left_out = read_drives(drives, axle)
    blocks = road_blocks(road, COUNT)
    page, picture = out.with_suffix(".md"), out.with_suffix(".svg")
    programmes = [out.with_name(f"{out.stem}-{block.name}.toml") for block in blocks]
    stops = [path.with_name(f"{path.stem}-stops.csv") for path in programmes]
    written = [out, page, picture, *programmes, *stops]
    check_outputs(out, written, [*drives, *map(brakes_path, drives), *config_files(config)])
    wheel = 0 if axle == "front" else 2
    brake = Brake(
        float(params["wheel_radius"][wheel]),
        float(2.0 * params["piston_area"][wheel] * params["effective_radius"][wheel]),
        float(params["push_out_pressure"][wheel]),
    )
    mass = mass_of(road)
    manifest = io.StringIO()
    rows = csv.writer(manifest, lineterminator="\n")
    rows.writerow(["block", "file", "programme", "road_energy", "mass_before", "mass_after"])
    for block, programme, table in zip(blocks, programmes, stops, strict=True):
        write_text(programme, programme_text(block, mass))
        write_text(table, controller_text(block, mass, brake))
    for place, again in [*((place, "") for place in range(len(blocks))), (0, AGAIN)]:
        block, programme = blocks[place], programmes[place]
        run = f"{programme.stem}{again}-run.csv"
        rows.writerow([f"{block.name}{again}", run, programme.name, f"{road_energy(block):.4f}", "", ""])
    write_text(out, manifest.getvalue())
    write_chart(picture, block_panels(blocks), LEGEND)
    found = block_table(blocks, mass, left_out)
    head = f"# Blocks for a dynamometer, from {len(drives)} {'drive' if len(drives) == 1 else 'drives'}\n\n"
    write_text(page, f"{head}![Applications and steps]({picture.name})\n\n{markdown(found).rstrip()}\n")
    names = ", ".join(block.name for block in blocks)
    print(
        f"{out}: {len(blocks)} blocks of {COUNT} applications ({names}) for {len(road.energy)} on the road, "
        "the first once more at the end: it shows the running-in of the pads"
    )
    inertia = mass * brake.radius**2
    print(f"{page}: how they stand for the drives; a flywheel for {mass:.0f} kg, {inertia:.1f} kg m²")
    give(blocks=[block.name for block in blocks], mass=mass, applications=len(road.energy), left_out=left_out)
    first = programmes[0]
    recording = first.with_name(f"{first.stem}-run.csv")
    wrote(*written, next=f"brake-ecu lab run {argument(first)} --out {argument(recording)}")
