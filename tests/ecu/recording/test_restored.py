"""What a daemon starts with: learned values, and discs that have cooled since they were stored."""

import time
from contextlib import closing
from pathlib import Path

import pytest

from ecu.algorithm.step import new_state
from ecu.recording.restored import restored
from ecu.recording.store import open_store, save
from ecu.settings.config import load_config, new_params, store_key

CONFIG = load_config(Path(__file__).parents[3] / "config" / "suv.toml")
PARAMS = new_params(CONFIG)


@pytest.fixture
def folder(tmp_path) -> Path:
    learned = new_state(PARAMS)["learned"].copy()
    learned["disc_excess"], learned["brakings"] = 300.0, 5
    with closing(open_store(tmp_path)) as store:
        save(store, store_key(CONFIG), learned)
    return tmp_path


@pytest.mark.parametrize(
    ("rest", "low", "high"),
    [(None, 300.0, 300.0), (-60.0, 300.0, 300.0), (600.0, 150.0, 220.0), (10 * 3600.0, 0.0, 0.1)],
    ids=["nobody knows", "clock set back", "ten minutes", "a night"],
)
def test_the_discs_have_cooled_by_the_rest_that_a_clock_tells(folder, rest, low, high) -> None:
    found = restored(folder, CONFIG, PARAMS, None if rest is None else time.time() + rest)
    assert found is not None
    revision, learned = found
    assert (revision, learned["brakings"][0]) == (1, 5)
    assert low - 0.5 <= learned["disc_excess"].min() <= learned["disc_excess"].max() <= high


def test_an_empty_store_gives_nothing(tmp_path) -> None:
    assert restored(tmp_path, CONFIG, PARAMS, time.time()) is None
