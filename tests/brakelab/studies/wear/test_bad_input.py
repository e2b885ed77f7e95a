"""Wrong blocks and trips: each is refused, with one line that names the file and what to do."""

import re

import pytest

from brakelab.studies.lab.bad_input import Answer
from brakelab.studies.wear.bad_input import BLOCKS, TRIPS, answers
from ecu.settings.resources import resource

pytestmark = pytest.mark.study


@pytest.fixture(scope="module")
def found() -> list[Answer]:
    return answers()


def test_every_wrong_input_is_refused_with_a_line_that_names_its_file(found: list[Answer]):
    assert [each.what for each in found] == [*BLOCKS, *TRIPS]
    for each in found:
        assert each.is_refused, each.what
        assert re.match(r"^(manifest|town-calm|trip-1)\.csv: .{10,}$", each.line), each
        assert "\n" not in each.line


def test_the_page_has_the_lines_that_are_printed(found: list[Answer]):
    page = (resource("docs/results") / "blocks.md").read_text("utf-8")
    for each in found:
        assert f"| {each.what} | {each.line} | refused |" in page
