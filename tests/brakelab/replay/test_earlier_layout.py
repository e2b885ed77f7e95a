"""State of a recording by a version with two models of the hydraulics, field by field."""

import numpy as np
import pytest

from brakelab.replay.earlier_layout import convert_initial
from ecu.algorithm.estimation.joint.whole_filter import FALL, PRIOR
from ecu.algorithm.step import INITIAL, initial_part, new_state
from ecu.contract.records import RecordArray
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

PRESSURES = np.dtype([("model", "f8", (4,)), ("value", "f8", (4,))])  # of the observer alone


def earlier(without: str = "") -> np.dtype:
    """Layout of the earlier version, or of one that lacks a part."""
    parts = []
    for name in INITIAL.names:
        part = INITIAL[name]
        if name == "joint":
            fields = [(field, part[field]) for field in part.names if field != "follows"]
            part = np.dtype([*fields, ("pressures", PRESSURES)], align=True)
        if name == "hydraulics":
            part = np.dtype([(field, part[field]) for field in part.names if field != "gain_variance"])
        if name == "application":
            part = np.dtype([(field, part[field]) for field in part.names if field != "shown"])
        if name == "demand":
            part = np.dtype(
                [(field, part[field]) for field in part.names if field not in ("automated", "gap_s")]
            )
        if name == "distribution":
            part = np.dtype([(field, part[field]) for field in part.names if field not in ("grip", "rolled")])
        if name == "learned":
            shorter = {"whole": ("f8", (3,)), "whole_covariance": ("f8", (6,))}
            fields = [(field, *shorter.get(field, (part[field],))) for field in part.names]
            part = np.dtype(fields, align=True)
        if name == "whole":
            sizes = {"value": (5,), "covariance": (5, 5), "h": (5,), "ph": (5,)}
            of_filter = part["filter"]
            fewer = np.dtype(
                [(field, of_filter[field].base, sizes.get(field, ())) for field in of_filter.names]
            )
            part = np.dtype([(field, fewer if field == "filter" else part[field]) for field in part.names])
        if name in ("flags", "witness"):
            continue
        parts.append(("friction_torque" if name == "hydraulics" else name, part))
    return np.dtype([part for part in parts if part[0] != without], align=True)


def started() -> RecordArray:
    return initial_part(new_state(new_params(load_config(resource("config/suv.toml")))))


def test_every_state_goes_on_under_its_present_name() -> None:
    old = np.zeros(1, earlier())
    old["friction_torque"]["value"], old["friction_torque"]["agreed_s"] = [1.0, 2.0, 3.0, 4.0], 0.5
    old["joint"]["x"], old["joint"]["zero"]["value"] = np.arange(old["joint"]["x"].shape[1]), 0.7
    old["learned"] = np.frombuffer(bytes(range(1, 256)) * 40, old["learned"].dtype, 1)
    old["learned"]["whole_covariance"] = np.arange(6.0)
    old["whole"]["filter"]["covariance"] = 0.3
    new = convert_initial(old, started())
    assert new.dtype == INITIAL
    assert new["hydraulics"]["value"].tolist() == [[1.0, 2.0, 3.0, 4.0]]
    assert new["hydraulics"]["agreed_s"].tolist() == [[0.5] * 4]
    assert new["joint"]["zero"]["value"].tolist() == [[0.7] * 4]
    np.testing.assert_array_equal(new["joint"]["x"], old["joint"]["x"])
    assert new["learned"]["whole_covariance"].tolist() == [[*range(6), *[0.0] * 15]]
    assert (new["whole"]["filter"]["covariance"][0, :5, :5] == 0.3).all()
    assert new["whole"]["filter"]["covariance"][0, 5].tolist() == [0.0] * 5 + [PRIOR[FALL] ** 2]
    alike = [name for name in old["learned"].dtype.names if not name.startswith("whole")]
    assert all(new["learned"][name].tobytes() == old["learned"][name].tobytes() for name in alike)
    assert (new["distribution"]["rolled"] == 1.0).all()
    assert np.isnan(new["flags"]["last"])
    assert not new["joint"]["follows"].any()
    assert not new["application"]["shown"].any()


@pytest.mark.parametrize("part", ["friction_torque", "joint", "limiter"])
def test_a_state_that_lacks_a_part_is_not_converted(part: str) -> None:
    assert convert_initial(np.zeros(1, earlier(without=part)), started()) is None
