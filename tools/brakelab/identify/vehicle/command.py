"""`brake-ecu identify vehicle`: a car's parameters from its drives, as a CONFIG; page and map beside it."""

from collections.abc import Sequence
from pathlib import Path

from brakelab.identify.vehicle.config_file import map_toml, offsets, unit_scales, write_vehicle
from brakelab.identify.vehicle.cross_check import cross_check, keep_start
from brakelab.identify.vehicle.page import write_page
from brakelab.identify.vehicle.parameters import parameters_of
from brakelab.identify.vehicle.reader import read_drives
from brakelab.identify.vehicle.solve import identify
from brakelab.results.outputs import check_outputs, config_files
from ecu.errors import UserError
from ecu.output import argument, give, say, wrote
from ecu.settings.config import load_config, new_params


def identify_vehicle(drives: Sequence[Path], config: Path, map: Path | None, closed: bool, out: Path) -> None:
    """Identify the car of `drives`; write `out`, a page and, with a `map`, that without zeros.

    Raises:
        UserError: an argument or a file is not right, or the drives identify nothing.
    """
    start = load_config(config)
    page, own_map = out.with_suffix(".md"), out.with_name(f"{out.stem}-map.toml")
    written = [out, page, page.with_suffix(".svg"), *([own_map] if map else [])]
    check_outputs(out, written, [*drives, *config_files(config), *([map] if map else [])], toml=True)
    params = new_params(start)
    found = identify(read_drives(drives, params, map), params, closed)
    names = [drive.name for drive in drives]
    check = cross_check(found.residuals, found.known, found.fit.theta)
    parameters = keep_start(parameters_of(found, start), check)
    parameters = write_vehicle(config, out, parameters, start, names, check.line)
    try:
        load_config(out)
    except UserError as error:
        say(f"{error}")
    write_page(page, found, parameters, params[0], names, check.line)
    zeros = offsets(found.zeros)
    if map and zeros:
        own_map.write_text(map_toml(map, own_map, zeros, unit_scales(map, drives[0])), encoding="utf-8")
    give(parameters=parameters, zeros=zeros, cross_check=check)
    for one in parameters:
        unit = "" if one.unit == "-" else f" {one.unit}"
        if one.remedy:
            print(f"{one.key}: not identified; {one.remedy} would identify it")
        else:
            value = f"{one.value:.5g} ± {one.sigma:.2g}{unit}{one.doubt}"
            print(f"{one.key} = {value} ({one.source}; was {one.start:.5g})")
    print(check.line)
    for name, zero in zeros.items():
        print(
            f"{name}: reads {zero:+.4g} at 0"
            + ("" if map else f"; a map would take it off: offset = {-zero:.4g}")
        )
    with_map = f" --map {argument(own_map if zeros else map)}" if map else ""
    replay = f"brake-ecu replay {argument(drives[0])} --config {argument(out)}{with_map} --out drive.parquet"
    wrote(*(written if map and zeros else written[:3]), next=replay)
