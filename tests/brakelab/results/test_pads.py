"""Pads in a result's metadata: there and back, with what is not known yet."""

import json
import math

import pytest

from brakelab.results.pads import packed, pads_of, unpacked
from ecu.algorithm.step import new_state
from ecu.contract.signals import CORNERS
from ecu.pads import appraise, fit_new, measure
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

SUV = load_config(resource("config/suv.toml"))


def test_a_new_ecu_takes_linings_as_half_worn_and_knows_no_distance():
    params = new_params(SUV)
    pads = pads_of(params, new_state(params)["learned"], SUV)
    assert [pad.corner for pad in pads] == list(CORNERS)
    middle = 0.5 * (SUV.front.pad.thickness_new + SUV.front.pad.thickness_worn)
    assert all(pad.thickness == pytest.approx(middle) and not pad.told for pad in pads)
    assert all(math.isnan(pad.remaining) for pad in pads)
    assert all(pad.configured and not pad.emission_model for pad in pads)


def test_it_is_what_the_command_of_the_pads_says_and_survives_json():
    params = new_params(SUV)
    learned = new_state(params)["learned"].copy()
    wear = learned[0]["wear"]
    fit_new(wear, "front")
    wear["odometer"] = 12e6
    wear["regressors"][0] = 400.0
    measure(wear, SUV.front.pad, 0, 10.0)
    pads = pads_of(params, learned, SUV)
    for pad, said in zip(pads, appraise(params, learned, SUV), strict=True):
        shared = set(pad._fields) & set(said._fields)
        assert len(shared) == 11
        assert all(getattr(pad, name) == getattr(said, name) for name in shared)
    assert pads[0].measurements == 1
    assert pads[0].remaining > 0.0
    assert unpacked(json.dumps(packed(pads))) == pads
    assert unpacked("") == []


def test_a_car_without_a_section_of_pads_says_so():
    car = load_config(resource("config/lcv.toml"))
    params = new_params(car)
    assert not any(pad.configured for pad in pads_of(params, new_state(params)["learned"], car))


@pytest.mark.parametrize("text", ["{", '[{"corner": "fl"}]'])
def test_what_is_not_pads_is_refused(text):
    with pytest.raises((ValueError, TypeError)):
        unpacked(text)
