"""`modelDescription.xml` of an FMU: FMI 3.0.2, chapters 2.4 and 4.4; FMI 2.0.3, chapters 2.2 and 4.3."""

import xml.etree.ElementTree as ET
from typing import Final, Literal

from brakelab.fmu.unit import BASE, Unit, Variable
from ecu import __version__
from ecu.contract.signals import CYCLE_NS

Version = Literal[2, 3]
"""Of FMI."""
STEP: Final = f"{1e-9 * CYCLE_NS:g}"
CATEGORIES: Final = {
    "logStatusWarning": "What is unusual",
    "logStatusDiscard": "Steps that are not done",
    "logStatusError": "Errors, which end a run",
}
_CAPABILITIES: Final[dict[Version, dict[str, str]]] = {
    2: {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true"},
    3: {"canGetAndSetFMUState": "true", "canSerializeFMUState": "true", "fixedInternalStepSize": STEP},
}


def model_description(unit: Unit, token: str, version: Version) -> bytes:
    """Return the file; `token` identifies the library that belongs to it.

    A path in the description may hold what XML cannot: that becomes a question mark.
    """
    root = ET.Element(
        "fmiModelDescription",
        {"fmiVersion": f"{version}.0", "modelName": unit.name},
        **{"guid" if version == 2 else "instantiationToken": token},
        description="".join(one if one.isprintable() else "?" for one in unit.description),
        version=__version__,
        license="Apache-2.0",
        generationTool=f"brake-ecu {__version__}",
        variableNamingConvention="structured",
    )
    ET.SubElement(
        root,
        "CoSimulation",
        _CAPABILITIES[version],
        modelIdentifier=unit.name,
        canHandleVariableCommunicationStepSize="false",
    )
    units = ET.SubElement(root, "UnitDefinitions")
    for name in dict.fromkeys(one.unit for one in unit.variables if _has_unit(one)):
        exponents = {key: f"{value:g}" for key, value in BASE[name].items()}
        ET.SubElement(ET.SubElement(units, "Unit", name=name), "BaseUnit", exponents)
    categories = ET.SubElement(root, "LogCategories")
    for name, description in CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=description)
    ET.SubElement(root, "DefaultExperiment", startTime="0", stepSize=STEP)
    variables = ET.SubElement(root, "ModelVariables")
    for place, one in enumerate(unit.variables):
        kind, common, own = _variable(place, one)
        if version == 2:
            kind = {"Float64": "Real"}.get(kind, kind)
            ET.SubElement(ET.SubElement(variables, "ScalarVariable", common), kind, own)
        else:
            ET.SubElement(variables, kind, common | own)
    _add_structure(root, unit, version)
    ET.indent(root)
    return ET.tostring(root, "utf-8", xml_declaration=True) + b"\n"


def _has_unit(one: Variable) -> bool:
    return one.unit not in ("", "-")


def _variable(reference: int, one: Variable) -> tuple[str, dict[str, str], dict[str, str]]:
    """Return the type of a variable, attributes that any has, and those of its type."""
    common = {"name": one.name, "valueReference": str(reference)}
    if one.description:
        common["description"] = one.description
    if one.kind == "PARAMETER":
        return "Boolean", {**common, "causality": "parameter", "variability": "fixed"}, {"start": "true"}
    unit = {"unit": one.unit} if _has_unit(one) else {}
    match one.kind:
        case "TIME":
            return "Float64", {**common, "causality": "independent", "variability": "continuous"}, unit
        case "INPUT":
            return "Float64", {**common, "causality": "input"}, {**unit, "start": "NaN"}
        case "OUTPUT":
            return "Float64", {**common, "causality": "output"}, unit


def _add_structure(root: ET.Element, unit: Unit, version: Version) -> None:
    """Add which variables are outputs: by value reference, in FMI 2 by place from 1 on."""
    structure = ET.SubElement(root, "ModelStructure")
    for element in ("Output", "InitialUnknown"):
        parent = ET.SubElement(structure, f"{element}s") if version == 2 else structure
        for place, one in enumerate(unit.variables):
            if one.kind == "OUTPUT" and version == 2:
                ET.SubElement(parent, "Unknown", index=str(place + 1))
            elif one.kind == "OUTPUT":
                ET.SubElement(parent, element, valueReference=str(place))
