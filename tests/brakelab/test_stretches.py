import numpy as np
import pytest

from brakelab.stretches import stretches


@pytest.mark.parametrize(
    ("rows", "found"),
    [
        ("", []),
        ("...", []),
        ("###", [[0, 3]]),
        (".##.", [[1, 3]]),
        ("#..##.#", [[0, 1], [3, 5], [6, 7]]),
    ],
)
def test_each_stretch_has_its_first_row_and_the_one_after_its_last(rows: str, found: list[list[int]]) -> None:
    holds = np.array([row == "#" for row in rows], np.bool_)
    assert stretches(holds).tolist() == found
    assert stretches(holds).shape == (len(found), 2)
