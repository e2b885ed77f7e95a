"""Every package that an installation brings along has a line with its licence."""

import re

import pytest

import write_third_party as third_party


@pytest.mark.parametrize("name", third_party.SETS)
def test_every_pinned_package_is_listed_with_a_licence(name: str) -> None:
    rows = dict(re.findall(r"^\| ([\w.\-]+) \| (.+?) \|", third_party.PAGE.read_text("utf-8"), re.M))
    assert set(third_party.pinned(name)) <= set(rows), "run python tools/write_third_party.py"
    assert not [package for package, licence in rows.items() if licence in ("not stated", "")]


def test_a_licence_is_that_of_the_metadata() -> None:
    assert "LGPL" in third_party.licence("python-can") or "Lesser" in third_party.licence("python-can")
