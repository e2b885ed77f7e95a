"""`modelDescription.xml` of an FMU (FMI 3.0.2, chapters 2.4 and 4.4)."""

import xml.etree.ElementTree as ET
from typing import Final

from brakelab.fmu.unit import BASE, Unit, Variable
from ecu import __version__
from ecu.contract.signals import CYCLE_NS

STEP: Final = f"{1e-9 * CYCLE_NS:g}"
CATEGORIES: Final = {
    "logStatusWarning": "What is unusual",
    "logStatusDiscard": "Steps that are not done",
    "logStatusError": "Errors, which end a run",
}


def model_description(unit: Unit, token: str) -> bytes:
    """Return the file; `token` identifies the library that belongs to it."""
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=unit.name,
        instantiationToken=token,
        description=unit.description,
        version=__version__,
        license="Apache-2.0",
        generationTool=f"brake-ecu {__version__}",
        variableNamingConvention="structured",
    )
    ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=unit.name,
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        canHandleVariableCommunicationStepSize="false",
        fixedInternalStepSize=STEP,
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
    for reference, one in enumerate(unit.variables):
        ET.SubElement(variables, *_variable(reference, one))
    structure = ET.SubElement(root, "ModelStructure")
    for element in ("Output", "InitialUnknown"):
        for reference, one in enumerate(unit.variables):
            if one.kind == "OUTPUT":
                ET.SubElement(structure, element, valueReference=str(reference))
    ET.indent(root)
    return ET.tostring(root, "utf-8", xml_declaration=True) + b"\n"


def _has_unit(one: Variable) -> bool:
    return one.unit not in ("", "-")


def _variable(reference: int, one: Variable) -> tuple[str, dict[str, str]]:
    given = {"name": one.name, "valueReference": str(reference)}
    if one.description:
        given["description"] = one.description
    if one.kind == "PARAMETER":
        return "Boolean", {**given, "causality": "parameter", "variability": "fixed", "start": "true"}
    if _has_unit(one):
        given["unit"] = one.unit
    match one.kind:
        case "TIME":
            given |= {"causality": "independent", "variability": "continuous"}
        case "INPUT":
            given |= {"causality": "input", "start": "NaN"}
        case "OUTPUT":
            given |= {"causality": "output"}
    return "Float64", given
