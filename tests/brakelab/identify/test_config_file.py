"""CONFIG files that take the rest from another one, which may itself be such a one."""

from itertools import permutations
from pathlib import Path

import pytest

from brakelab.identify.config_file import car_toml, write_car
from ecu.settings.config import load_config

CONFIG = Path(__file__).parents[3] / "config"
FITTED = {"front": {"disc_heating": ("3e-4", "fitted")}, "rear": {"disc_cooling": ("2e-3", "fitted")}}
OF_PROGRAM = {
    "vehicle": {"vehicle": {"mass": ("1990", "kg")}, "front": {"mu_nominal": ("0.4", "± 0.02")}},
    "thermal": FITTED,
    "wear": {"front.pad": {"sigma": ("0.2", "relative")}, "rear.pad": {"sigma": ("0.3", "relative")}},
    "dust": {
        "front.dust": {
            "model": ('"law"', "of one brake"),
            "numbers": ("[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10]", ""),
            "low": ("[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]", "from here"),
            "high": ("[1.0, 1.0, 1.0, 1.0, 1.0, 1.0]", "to here"),
            "below": ("-0.3", "95 %"),
            "above": ("0.3", ""),
        }
    },
}
"""What each `identify` writes into a CONFIG."""


@pytest.mark.parametrize("name", ["suv", "suv-blended", "mustang"])
def test_all_but_the_fitted_keys_are_those_of_the_start(tmp_path, name) -> None:
    start = CONFIG / f"{name}.toml"
    out = tmp_path / "car.toml"
    write_car(start, out, "# head", FITTED)
    config, before = load_config(out), load_config(start)
    assert config.front.disc_heating == 3e-4
    assert config.rear.disc_cooling == 2e-3
    front = config.front.model_copy(update={"disc_heating": before.front.disc_heating})
    rear = config.rear.model_copy(update={"disc_cooling": before.rear.disc_cooling})
    assert config.model_copy(update={"front": front, "rear": rear}) == before


@pytest.mark.parametrize("start", ["suv", "suv-blended"])
def test_programs_go_on_with_what_others_wrote_in_any_order(tmp_path, start) -> None:
    results = []
    for order in permutations(OF_PROGRAM):
        config = CONFIG / f"{start}.toml"
        for number, program in enumerate(order):
            out = tmp_path / str(number) / f"{program}.toml"
            write_car(config, out, f"# {program}", OF_PROGRAM[program])
            config = out
        results.append(load_config(config))
    first = results[0]
    assert all(one == first for one in results)
    assert (first.vehicle.mass, first.front.mu_nominal, first.front.disc_heating) == (1990.0, 0.4, 3e-4)
    assert (first.front.pad.sigma, first.rear.pad.sigma, first.front.dust.above) == (0.2, 0.3, 0.3)
    assert first.blending == load_config(CONFIG / f"{start}.toml").blending


@pytest.mark.parametrize("start", ["suv", "suv-blended"])
def test_what_was_identified_of_a_shipped_car_can_be_moved(tmp_path, start) -> None:
    out, moved = tmp_path / "out" / "car.toml", tmp_path / "vehicle" / "etc" / "car.toml"
    write_car(CONFIG / f"{start}.toml", out, "# head", FITTED)
    moved.parent.mkdir(parents=True)
    out.rename(moved)
    assert load_config(moved).front.disc_heating == 3e-4


def test_what_a_person_wrote_stays_with_its_comments(tmp_path) -> None:
    first, second = tmp_path / "a.toml", tmp_path / "sub" / "b.toml"
    first.write_text(
        f'\ufeff# my car\ninclude = "{CONFIG / "suv.toml"}"\nname = "my \\"car\\""\n'
        "[front]  # of the test bench\ndisc_heating = 4e-4  # guessed\n\n[rear]\nmu_nominal = 0.4 # by hand\n"
        "[front.pad]\ncoefficients = [0.2, 0.0, 1e-6, 0.1, 0.0, 0.0, 0.0]\n",
        encoding="utf-8",
    )
    write_car(first, second, "# head", FITTED)
    config, text = load_config(second), second.read_text("utf-8")
    assert config.name == 'my "car"'
    assert config.front.disc_heating == 3e-4
    assert config.front.pad.coefficients[0] == 0.2
    assert text.startswith("# head\n# my car\n")
    assert all(one in text for one in ("# of the test bench", "# by hand", "disc_heating = 3e-4 # fitted"))
    assert "guessed" not in text
    assert car_toml(second, second, "", {}).strip() == text.strip()
