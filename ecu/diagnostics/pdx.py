"""The PDX file (ISO 22901-1, ODX 2.2.0) of `run --diagnostics`, by which any tester knows this ECU.

One base variant: identifiers with their scaling, trouble codes, routines, access. Names are those of the
tables.
"""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as Xml
from zipfile import ZIP_DEFLATED, ZipFile

from ecu import __version__
from ecu.contract.signals import CORNERS
from ecu.diagnostics import services
from ecu.diagnostics.identifiers import (
    MEASURED,
    PAD_THICKNESS,
    TEXTS,
    UNITS,
    Identifier,
    has_corners,
    scaling_of,
)
from ecu.diagnostics.read_faults import BY_MASK
from ecu.diagnostics.server import SELF_TESTS
from ecu.diagnostics.session import DEFAULT, EXTENDED, KEY_BYTES, SEED_BYTES
from ecu.diagnostics.trouble_codes import TROUBLE_CODES
from ecu.errors import UserError
from ecu.output import give

NAME: Final = "brake_ecu"
TYPE: Final = "{http://www.w3.org/2001/XMLSchema-instance}type"
BYTE, CODES, STATUS = "byte", "trouble_code", "status"

Field = tuple[str, str]
"""Name of a value in a message, and identifier of how it is coded."""


def pdx(out: Path) -> None:
    """Write the file. Raises UserError for one by another name."""
    if out.suffix.lower() != ".pdx":
        raise UserError("--out", str(out), "testers know the file by its name; let it end in .pdx")
    document = Xml.tostring(_document(), encoding="UTF-8", xml_declaration=True)
    with ZipFile(out, "w", ZIP_DEFLATED) as file:
        file.writestr(f"{NAME}.odx-d", document)
        file.writestr("index.xml", Xml.tostring(_index(), encoding="UTF-8", xml_declaration=True))
    give(file=str(out))


def _xml(tag: str, *content: Xml.Element | str, **attributes: str) -> Xml.Element:
    """Return an element; attributes with `_` for `-`, `TYPE` as `kind`."""
    names = {TYPE if name == "kind" else name.replace("_", "-"): text for name, text in attributes.items()}
    element = Xml.Element(tag, names)
    for one in content:
        if isinstance(one, str):
            element.text = one
        else:
            element.append(one)
    return element


def _coded(bits: int, kind: str = "A_UINT32") -> Xml.Element:
    return _xml(
        "DIAG-CODED-TYPE",
        _xml("BIT-LENGTH", str(bits)),
        BASE_DATA_TYPE=kind,
        kind="STANDARD-LENGTH-TYPE",
    )


def _property(name: str, coded: Xml.Element, kind: str, method: Xml.Element, unit: str = "") -> Xml.Element:
    return _xml(
        "DATA-OBJECT-PROP",
        _xml("SHORT-NAME", name),
        method,
        coded,
        _xml("PHYSICAL-TYPE", BASE_DATA_TYPE=kind),
        *([_xml("UNIT-REF", ID_REF=f"unit.{unit}")] if unit else []),
        ID=name,
    )


def _identical() -> Xml.Element:
    return _xml("COMPU-METHOD", _xml("CATEGORY", "IDENTICAL"))


def _linear(one: Identifier) -> Xml.Element:
    """Return a property with the scaling of an identifier."""
    scaling = scaling_of(one)
    coefficients = _xml(
        "COMPU-RATIONAL-COEFFS",
        _xml("COMPU-NUMERATOR", _xml("V", repr(scaling.offset)), _xml("V", repr(scaling.scale))),
        _xml("COMPU-DENOMINATOR", _xml("V", "1")),
    )
    scales = _xml("COMPU-SCALES", _xml("COMPU-SCALE", coefficients))
    method = _xml("COMPU-METHOD", _xml("CATEGORY", "LINEAR"), _xml("COMPU-INTERNAL-TO-PHYS", scales))
    coded = _coded(8 * scaling.bytes, "A_INT32" if scaling.signed else "A_UINT32")
    return _property(one.name, coded, "A_FLOAT64", method, _short(UNITS[one.name]))


def _short(text: str) -> str:
    """Return a text as a SHORT-NAME."""
    return "".join(c if c.isalnum() else "_" for c in text.replace("%", "percent")).strip("_")


def _constant(name: str, value: int, size: int) -> Xml.Element:
    return _xml(
        "PARAM",
        _xml("SHORT-NAME", name),
        _xml("CODED-VALUE", str(value)),
        _coded(8 * size),
        kind="CODED-CONST",
    )


def _value(name: str, coding: str) -> Xml.Element:
    return _xml("PARAM", _xml("SHORT-NAME", name), _xml("DOP-REF", ID_REF=coding), kind="VALUE")


def _params(head: Sequence[tuple[str, int, int]], fields: Sequence[Field]) -> Xml.Element:
    return _xml("PARAMS", *(_constant(*one) for one in head), *(_value(*one) for one in fields))


class _Services:
    """Services with their messages, as they are added."""

    def __init__(self) -> None:
        self.services = _xml("DIAG-COMMS")
        self.requests, self.responses = _xml("REQUESTS"), _xml("POS-RESPONSES")

    def add(
        self,
        name: str,
        service: int,
        of: Sequence[tuple[str, int, int]],
        asks: Sequence[Field] = (),
        answers: Sequence[Field] = (),
        *,
        echoes: bool = True,
    ) -> None:
        """Add a service; `of`: constants behind the service, which the response `echoes`."""
        request = [("service", service, 1), *of]
        response = [("service", service + services.POSITIVE, 1), *(of if echoes else ())]
        self.requests.append(
            _xml("REQUEST", _xml("SHORT-NAME", f"{name}_request"), _params(request, asks), ID=f"{name}.rq")
        )
        self.responses.append(
            _xml(
                "POS-RESPONSE",
                _xml("SHORT-NAME", f"{name}_response"),
                _params(response, answers),
                ID=f"{name}.pr",
            )
        )
        self.services.append(
            _xml(
                "DIAG-SERVICE",
                _xml("SHORT-NAME", name),
                _xml("REQUEST-REF", ID_REF=f"{name}.rq"),
                _xml("POS-RESPONSE-REFS", _xml("POS-RESPONSE-REF", ID_REF=f"{name}.pr")),
                _xml("NEG-RESPONSE-REFS", _xml("NEG-RESPONSE-REF", ID_REF="negative")),
                ID=name,
            )
        )


def _values(one: Identifier) -> list[Field]:
    places = CORNERS if has_corners(one) else ("",)
    return [(f"{one.name}_{corner}".rstrip("_"), one.name) for corner in places]


def _all_services() -> _Services:
    added = _Services()
    for kind, name in ((DEFAULT, "default_session"), (EXTENDED, "extended_session")):
        timing = [("p2_ms", "word"), ("p2_star_10_ms", "word")]
        added.add(name, services.SESSION_CONTROL, [("session", kind, 1)], answers=timing)
    added.add("tester_present", services.TESTER_PRESENT, [("function", 0, 1)])
    added.add("give_seed", services.SECURITY_ACCESS, [("level", 1, 1)], answers=[("seed", "seed")])
    added.add("send_key", services.SECURITY_ACCESS, [("level", 2, 1)], [("key", "key")])
    added.add("clear_faults", services.CLEAR, [], [("group", "group")])
    listed = [("available", STATUS), ("faults", "listed")]
    added.add("read_faults", services.READ_FAULTS, [("kind", BY_MASK, 1)], [("mask", STATUS)], listed)
    for one in MEASURED:
        added.add(
            f"read_{one.name}", services.READ_DATA, [("identifier", one.number, 2)], answers=_values(one)
        )
    for number, name in TEXTS.items():
        added.add(f"read_{name}", services.READ_DATA, [("identifier", number, 2)], answers=[(name, "text")])
    written = [("identifier", PAD_THICKNESS.number, 2)]
    added.add("write_pad_thickness", services.WRITE_DATA, written, _values(PAD_THICKNESS))
    for routine, asks, answers in (
        (services.SELF_TEST, [], [(_short(name), BYTE) for name in SELF_TESTS]),
        (services.NEW_PADS, [("corners", BYTE)], []),
        (services.FORGET, [], []),
    ):
        name, of = _short(services.ROUTINES[routine]), [("kind", services.START, 1), ("routine", routine, 2)]
        added.add(f"start_{name}", services.ROUTINE_CONTROL, of, asks, answers)
    return added


def _codings() -> Xml.Element:
    """Return how values are coded."""
    codes = _xml("DTCS")
    for code in TROUBLE_CODES:
        codes.append(
            _xml(
                "DTC",
                _xml("SHORT-NAME", _short(code.text)),
                _xml("TROUBLE-CODE", str(code.number)),
                _xml("DISPLAY-TROUBLE-CODE", code.text),
                _xml("TEXT", code.fault.name),
                ID=f"code.{code.number:06X}",
            )
        )
    trouble = _xml(
        "DTC-DOP",
        _xml("SHORT-NAME", CODES),
        _coded(24),
        _xml("PHYSICAL-TYPE", BASE_DATA_TYPE="A_UINT32"),
        _identical(),
        codes,
        ID=CODES,
    )
    plain = {BYTE: 1, STATUS: 1, "word": 2, "group": 3}
    properties = [_property(name, _coded(8 * size), "A_UINT32", _identical()) for name, size in plain.items()]
    for name, size in (("seed", SEED_BYTES), ("key", KEY_BYTES)):
        coded = _coded(8 * size, "A_BYTEFIELD")
        properties.append(_property(name, coded, "A_BYTEFIELD", _identical()))
    rest = _xml(
        "DIAG-CODED-TYPE",
        _xml("MAX-LENGTH", "255"),
        _xml("MIN-LENGTH", "0"),
        BASE_DATA_TYPE="A_UTF8STRING",
        TERMINATION="END-OF-PDU",
        kind="MIN-MAX-LENGTH-TYPE",
    )
    properties.append(_property("text", rest, "A_UNICODE2STRING", _identical()))
    found = _params([], [("code", CODES), ("status", STATUS)])
    units = {_short(UNITS[one.name]): UNITS[one.name] for one in MEASURED}
    return _xml(
        "DIAG-DATA-DICTIONARY-SPEC",
        _xml("DTC-DOPS", trouble),
        _xml("DATA-OBJECT-PROPS", *properties, *map(_linear, MEASURED)),
        _xml("STRUCTURES", _xml("STRUCTURE", _xml("SHORT-NAME", "fault"), found, ID="fault")),
        _xml(
            "END-OF-PDU-FIELDS",
            _xml(
                "END-OF-PDU-FIELD",
                _xml("SHORT-NAME", "listed"),
                _xml("BASIC-STRUCTURE-REF", ID_REF="fault"),
                ID="listed",
            ),
        ),
        _xml(
            "UNIT-SPEC",
            _xml(
                "UNITS",
                *(
                    _xml("UNIT", _xml("SHORT-NAME", name), _xml("DISPLAY-NAME", text), ID=f"unit.{name}")
                    for name, text in units.items()
                    if name
                ),
            ),
        ),
    )


def _document() -> Xml.Element:
    added = _all_services()
    refused = _params([("negative", services.NEGATIVE, 1)], [("refused", BYTE), ("reason", BYTE)])
    variant = _xml(
        "BASE-VARIANT",
        _xml("SHORT-NAME", NAME),
        _xml("LONG-NAME", f"Brake ECU {__version__}"),
        _codings(),
        added.services,
        added.requests,
        added.responses,
        _xml(
            "NEG-RESPONSES",
            _xml("NEG-RESPONSE", _xml("SHORT-NAME", "negative"), refused, ID="negative"),
        ),
        ID=NAME,
    )
    container = _xml(
        "DIAG-LAYER-CONTAINER",
        _xml("SHORT-NAME", f"{NAME}_layers"),
        _xml("BASE-VARIANTS", variant),
        ID=f"{NAME}.layers",
    )
    return _xml("ODX", container, MODEL_VERSION="2.2.0")


def _index() -> Xml.Element:
    file = _xml(
        "FILE",
        f"{NAME}.odx-d",
        MIME_TYPE="application/x-asam.odx.odx-d",
        CREATION_DATE=datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S"),
    )
    block = _xml(
        "ABLOCK",
        _xml("SHORT-NAME", NAME),
        _xml("CATEGORY", "ODX-DATA"),
        _xml("FILES", file),
        UPD="NEW",
    )
    return _xml("CATALOG", _xml("SHORT-NAME", NAME), _xml("ABLOCKS", block), F_DTD_VERSION="ODX-2.2.0")
