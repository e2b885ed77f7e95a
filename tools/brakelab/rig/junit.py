"""Verdicts of a rig run as JUnit XML: a suite per scenario, a case per verdict."""

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

from brakelab.rig.verdicts import Verdict


def junit_text(judged: Mapping[str, Sequence[Verdict]]) -> str:
    """Return the verdicts of each scenario as XML."""
    root = ElementTree.Element("testsuites", name="brake-ecu rig")
    for scenario, verdicts in judged.items():
        failed = sum(not one.passed for one in verdicts)
        counts = {"tests": len(verdicts), "failures": failed, "errors": 0}
        suite = ElementTree.SubElement(root, "testsuite", name=scenario)
        suite.attrib |= {name: str(count) for name, count in counts.items()}
        for one in verdicts:
            case = ElementTree.SubElement(suite, "testcase", classname=scenario, name=one.expected)
            if not one.passed:
                ElementTree.SubElement(case, "failure", message=f"found: {one.found}").text = one.line
    ElementTree.indent(root)
    return ElementTree.tostring(root, "unicode", xml_declaration=True) + "\n"
