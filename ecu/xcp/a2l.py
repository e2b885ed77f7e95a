"""The A2L file (ASAM MCD-2 MC 1.7.1) of the slave: every variable at its address, the event, the transports.

What it says of XCP (IF_DATA) is described in the file itself (A2ML), as far as it is used.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from ecu import __version__
from ecu.errors import UserError
from ecu.output import give, policy
from ecu.runtime.xcp import LOOPBACK, Transport, parse_transport
from ecu.settings.config import load_config
from ecu.xcp.a2l_if_data import A2ML, MEMORY_SEGMENT, if_data
from ecu.xcp.memory import EPK
from ecu.xcp.parameters import NO_WORD, to_record
from ecu.xcp.variables import RECORDS, Record, Variable

TYPES: Final = {"f8": "FLOAT64_IEEE", "i8": "A_INT64", "u4": "ULONG", "u1": "UBYTE"}
USUAL: Final = (Transport("udp", LOOPBACK, 5555), Transport("tcp", LOOPBACK, 5555))
MEANINGS: Final = {
    "outputs": "Outputs of a cycle, as in results",
    "inputs": "Inputs of a cycle, as received",
    "estimate": "Estimate of a cycle: car, tyres, brakes",
    "parameters": "Configuration of the run",
}


def a2l(config: Path | None, transports: Sequence[str] | None, out: Path | None) -> None:
    """Write the file, or print it.

    Raises:
        UserError: a wrong configuration or transport, or a file by another name.
    """
    if out is not None and out.suffix.lower() != ".a2l":
        raise UserError("--out", str(out), "masters know the file by its name; let it end in .a2l")
    given = None if config is None else load_config(config).model_dump()
    places = [parse_transport(one) for one in transports] if transports else USUAL
    text = a2l_text(places, given)
    if out is not None:
        out.write_text(text, encoding="utf-8")
    elif not policy().json:
        print(text, end="")
    give(epk=EPK, addresses={f"{record.name}.{one.name}": record.base + one.offset for record, one in _all()})


def _all() -> Iterator[tuple[Record, Variable]]:
    return ((record, one) for record in RECORDS for one in record.variables)


def a2l_text(transports: Sequence[Transport], configuration: Mapping[str, Any] | None) -> str:
    """Return the file. Of a `configuration` (`Config.model_dump`) it names what is given, else every key."""
    chosen = _chosen(configuration)
    name = _text(str(configuration["name"])) if configuration else '""'
    lines = [
        "ASAP2_VERSION 1 71",
        f"/begin PROJECT brake_ecu {name}",
        f'/begin HEADER "Written by brake-ecu a2l" VERSION "{__version__}" /end HEADER',
        '/begin MODULE brake_ecu "Brake ECU"',
        A2ML,
        f'/begin MOD_PAR "" EPK "{EPK}"\n{MEMORY_SEGMENT}\n/end MOD_PAR',
        '/begin MOD_COMMON "" BYTE_ORDER MSB_LAST /end MOD_COMMON',
        if_data(transports),
        *_conversions(chosen),
        *(_characteristic(*one) if one[0].name == "parameters" else _measurement(*one) for one in chosen),
        *(
            f"/begin RECORD_LAYOUT {kind} FNC_VALUES 1 {kind} ROW_DIR DIRECT /end RECORD_LAYOUT"
            for kind in ("FLOAT64_IEEE", "UBYTE")
        ),
        *(_group(record.name, [one.name for of, one in chosen if of is record]) for record in RECORDS),
        "/end MODULE",
        "/end PROJECT",
    ]
    return "\n".join(lines) + "\n"


def _chosen(configuration: Mapping[str, Any] | None) -> list[tuple[Record, Variable]]:
    if configuration is None:
        return list(_all())
    values = to_record(configuration)[0]
    return [
        (record, one)
        for record, one in _all()
        if record.name != "parameters" or _is_given(values[one.name], one)
    ]


def _is_given(value: Any, one: Variable) -> bool:
    return bool(value != NO_WORD) if one.texts else not bool(np.isnan(value).all())


def _conversions(chosen: Sequence[tuple[Record, Variable]]) -> Iterator[str]:
    units = dict.fromkeys(_unit(one) for _, one in chosen if not one.texts)
    for unit in units:
        yield (f'/begin COMPU_METHOD {_conversion_of(unit)} "" IDENTICAL "%.9" "{unit}" /end COMPU_METHOD')
    for tables in dict.fromkeys(one.texts for _, one in chosen if one.texts):
        name = _table_of(tables)
        rows = " ".join(f"{value} {_text(text)}" for value, text in enumerate(tables))
        yield f'/begin COMPU_METHOD {name} "" TAB_VERB "%.0" "" COMPU_TAB_REF {name}.VTAB /end COMPU_METHOD'
        yield f'/begin COMPU_VTAB {name}.VTAB "" TAB_VERB {len(tables)} {rows} /end COMPU_VTAB'


def _unit(one: Variable) -> str:
    return "" if one.unit == "-" else one.unit


def _conversion_of(unit: str) -> str:
    """Return an identifier for a unit: of its letters and digits, others by their numbers."""
    return "CM." + "".join(c if c.isascii() and c.isalnum() else f"_{ord(c):X}_" for c in unit or "one")


def _table_of(texts: Sequence[str]) -> str:
    return "CM." + "_".join(text.replace("-", "_") for text in texts)


def _measurement(record: Record, one: Variable) -> str:
    return (
        f"/begin MEASUREMENT {record.name}.{one.name} {_text(one.meaning)} {TYPES[one.kind.str[1:]]}"
        f" {_conversion_of(_unit(one))} 0 0 {_number(one.low)} {_number(one.high)}"
        f" ECU_ADDRESS 0x{record.base + one.offset:X} /end MEASUREMENT"
    )


def _characteristic(record: Record, one: Variable) -> str:
    kind, dimension = ("VALUE", "") if one.length == 1 else ("VAL_BLK", f" MATRIX_DIM {one.length}")
    conversion = _table_of(one.texts) if one.texts else _conversion_of(_unit(one))
    access = "" if one.writable else " READ_ONLY"
    return (
        f"/begin CHARACTERISTIC {record.name}.{one.name} {_text(one.meaning)} {kind}"
        f" 0x{record.base + one.offset:X} {TYPES[one.kind.str[1:]]} 0 {conversion}"
        f" {_number(one.low)} {_number(one.high)}{dimension}{access} /end CHARACTERISTIC"
    )


def _group(name: str, members: Sequence[str]) -> str:
    kind = "REF_CHARACTERISTIC" if name == "parameters" else "REF_MEASUREMENT"
    listed = "\n".join(f"{name}.{member}" for member in members)
    return (
        f"/begin GROUP {name} {_text(MEANINGS[name])} ROOT\n/begin {kind}\n{listed}\n/end {kind}\n/end GROUP"
    )


def _text(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _number(value: float) -> str:
    return f"{value:.17g}"
