"""The description has names and units of the contract; FMPy finds nothing wrong with it, and simulates it."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from brakelab.fmu.unit import BASE
from brakelab.simulation.vehicle_bus import TRUTH_COLUMNS, truth_unit
from ecu.bus.units import CONVERSIONS
from ecu.cli import main
from ecu.contract.signals import INPUT_SIGNALS, OUTPUT_SIGNALS, column_names

from .master import Fmu

PAGE = (Path(__file__).parents[3] / "docs/fmu.md").read_text("utf-8")
UNITS = {one.name: one.unit for one in INPUT_SIGNALS} | {
    name: one.unit for one in OUTPUT_SIGNALS for name in column_names(one)
}


@pytest.fixture(params=["suv", "stop", "suv_2", "stop_2"])
def fmu(request: pytest.FixtureRequest) -> Fmu:
    """The ECU, the vehicle, both of FMI 2.0."""
    return request.getfixturevalue(request.param)


def test_every_unit_of_the_contract_is_one_of_si() -> None:
    units = {one.unit for one in (*INPUT_SIGNALS, *OUTPUT_SIGNALS)} | {truth_unit(n) for n in TRUTH_COLUMNS}
    assert units - {"", "-"} <= BASE.keys()


SI = {"rad/s": "rad/s", "m/s": "m/s", "bar": "Pa", "N": "N", "degC": "K", "%": "-"}


@pytest.mark.parametrize(("unit", "base"), SI.items())
def test_factors_are_those_of_signal_maps(unit: str, base: str) -> None:
    """A signal map turns SI into the contract's unit, an importer the contract's unit into SI."""
    factor, offset = CONVERSIONS[unit][base]
    assert BASE[unit].get("factor", 1.0) == pytest.approx(1.0 / factor)
    assert BASE[unit].get("offset", 0.0) == pytest.approx(-offset / factor)


def test_variables_have_the_units_of_the_contract(fmu: Fmu) -> None:
    units = fmu.description.findall("UnitDefinitions/Unit")
    defined = {one.get("name"): one.find("BaseUnit") for one in units}
    found = 0
    for variable in fmu.description.findall("ModelVariables/*"):
        name, kind = variable.get("name", ""), variable.find("*")
        unit = (variable if kind is None else kind).get("unit")
        stem = name.removeprefix("estimate.").removeprefix("truth.")
        expected = "s" if name == "time" else UNITS.get(stem, truth_unit(stem))
        assert (unit or "-") == (expected or "-"), name
        assert unit is None or unit in defined
        found += unit is not None
    assert found > 30
    bar = defined["bar"]
    assert bar is not None
    assert bar.attrib == {"kg": "1", "m": "-1", "s": "-2", "factor": "100000"}


def test_it_is_a_co_simulation_of_ten_milliseconds_with_states(fmu: Fmu) -> None:
    interface, experiment = fmu.description.find("CoSimulation"), fmu.description.find("DefaultExperiment")
    assert interface is not None
    assert experiment is not None
    assert experiment.get("stepSize") == interface.get("fixedInternalStepSize", "0.01") == "0.01"
    assert interface.get("canHandleVariableCommunicationStepSize") == "false"
    state = "FMUstate" if fmu.version == 2 else "FMUState"
    assert interface.get(f"canGetAndSet{state}") == interface.get(f"canSerialize{state}") == "true"
    references = [int(one.get("valueReference", "")) for one in fmu.description.findall("ModelVariables/*")]
    assert references == list(range(len(references)))
    assert len(fmu.references) == len(references), "names are unique"
    places = [fmu.references[name] for name in fmu.outputs]
    for kind in ("Output", "InitialUnknown"):
        path, key, first = (
            (f"{kind}s/Unknown", "index", 1) if fmu.version == 2 else (kind, "valueReference", 0)
        )
        listed = fmu.description.findall(f"ModelStructure/{path}")
        assert [int(one.get(key, "")) - first for one in listed] == places


def test_a_variable_has_the_description_of_its_signal(suv: Fmu) -> None:
    variables: dict[str, ET.Element] = {
        one.get("name", ""): one for one in suv.description.findall("ModelVariables/*")
    }
    assert variables["yaw_rate"].get("description") == "Yaw rate, left positive (-6 to 6; NaN: no sample)"
    assert variables["mu_b_fl"].get("description") == "Estimated friction of pad and disc front left"
    assert variables["accel_x"].get("start") == "NaN"


def packed(fmu: Fmu) -> Path:
    """Return the FMU that was unpacked beside itself."""
    return next(Path(fmu.library._name).parents[3].glob("*.fmu"))


def test_fmpy_finds_nothing_wrong(fmu: Fmu) -> None:
    fmpy = pytest.importorskip("fmpy.validation", reason="FMPy is not installed: pip install fmpy")
    assert fmpy.validate_fmu(str(packed(fmu))) == []


def test_fmpy_simulates_a_stop(stop: Fmu, suv: Fmu) -> None:
    """The vehicle alone brakes by its hydraulics; the ECU alone hears nobody, and says so."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install fmpy")
    names = ["truth.vehicle_speed", "truth.demand_heard"]
    drive = fmpy.simulate_fmu(str(packed(stop)), stop_time=12.0, step_size=0.01, output=names)
    assert drive["truth.vehicle_speed"][0] == pytest.approx(33.333)
    assert drive["truth.vehicle_speed"][-1] < 20.0
    alone = fmpy.simulate_fmu(str(packed(suv)), stop_time=40.0, output_interval=0.01, output=["mode"])
    assert len(alone) == 4001
    assert np.unique(alone["mode"]).tolist() == [0.0, 4.0]


def test_the_script_of_the_page_brakes_as_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("fmpy", reason="FMPy is not installed: pip install fmpy")
    monkeypatch.chdir(tmp_path)
    for line in re.findall(r"^brake-ecu (fmu \w+ .*?) +#", PAGE, re.MULTILINE):
        assert main(line.split()) == 0
    exec(re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)[0], {})
    assert capsys.readouterr().out == "at rest after 339.4 m, 15.25 s\n"
