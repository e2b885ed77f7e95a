"""The memory that a master reads: the records of one cycle at their addresses, and nothing else.

An image is one cycle as bytes: the records of `RECORDS` one after the other, little-endian. An address
belongs to a record; an access within it may touch fields alone: what lies between them has no address.
"""

import json
import zlib
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ecu import __version__
from ecu.contract.records import RecordArray
from ecu.recording.ring import Batch
from ecu.xcp.variables import RECORDS

Image = NDArray[np.uint8]

BEGINS: Final = dict(
    zip(
        (record.name for record in RECORDS),
        np.cumsum([0, *(record.dtype.itemsize for record in RECORDS)]).tolist(),
        strict=False,
    )
)
"""Place of each record in an image."""
IMAGE_BYTES: Final = sum(record.dtype.itemsize for record in RECORDS)


def _layout() -> str:
    """Return what an address file has to agree on, as a number in hexadecimal."""
    rows = [
        [record.base, variable.name, variable.offset, variable.kind.str, variable.length]
        for record in RECORDS
        for variable in record.variables
    ]
    return f"{zlib.crc32(json.dumps(rows).encode()):08X}"


EPK: Final = f"brake-ecu {__version__} {_layout()}"
"""Names version and addresses; an A2L file with another one is not of this program."""


def _readable() -> NDArray[np.bool_]:
    found = np.zeros(IMAGE_BYTES, bool)
    for record in RECORDS:
        for one in record.variables:
            begin = BEGINS[record.name] + one.offset
            found[begin : begin + one.length * one.kind.itemsize] = True
    return found


_READABLE: Final = _readable()


def base_of(name: str) -> int:
    """Return the address of a record."""
    return next(record.base for record in RECORDS if record.name == name)


def place_of(address: int, length: int) -> int | None:
    """Return where `length` bytes from `address` on are in an image, None: some have no address."""
    for record in RECORDS:
        if record.base <= address and address + length <= record.base + record.dtype.itemsize:
            begin = BEGINS[record.name] + address - record.base
            return begin if _READABLE[begin : begin + length].all() else None
    return None


def images(batch: Batch, parameters: RecordArray) -> Image:
    """Return the images of the cycles of a batch, shape (n, `IMAGE_BYTES`).

    `parameters`: PARAMETERS, shape (n,).
    """
    parts = {
        "outputs": batch.records["outputs"],
        "inputs": batch.beside["inputs"],
        "estimate": batch.beside["estimate"],
        "parameters": parameters,
    }
    found = np.empty((len(batch.records), IMAGE_BYTES), np.uint8)
    for record in RECORDS:
        begin, size = BEGINS[record.name], record.dtype.itemsize
        part = np.ascontiguousarray(parts[record.name])
        found[:, begin : begin + size] = part.view(np.uint8).reshape(-1, size)
    return found
