"""The pictures of docs/architecture.md are those of the code."""

import pytest

import draw_architecture as draw


def test_they_are_drawn_from_the_code_as_it_is() -> None:
    page = draw.PAGE.read_text("utf-8")
    assert draw.drawn_anew(page) == page, "run python tools/draw_architecture.py"


@pytest.mark.parametrize("package", draw.packages())
def test_no_package_has_a_circle(package: str) -> None:
    graph = draw.imports(package)
    assert len(graph) > 5
    assert [name for name in graph if name in draw.reached(graph, name)] == []


@pytest.mark.parametrize(
    ("arrows", "left"),
    [
        ("ab bc ac", "ab bc"),
        ("ab ac bd cd ad", "ab ac bd cd"),
        ("ab ba bc ac", "ab ba bc ac"),  # a circle: neither says what the other does
        ("ab bc cb", "ab bc cb"),
        ("ab cd", "ab cd"),
    ],
)
def test_arrows_that_others_imply_are_left_out(arrows: str, left: str) -> None:
    graph: dict[str, set[str]] = {name: set() for name in "abcd"}
    for start, end in arrows.split():
        graph[start].add(end)
    found = {start + end for start, ends in draw.without_implied(graph).items() for end in ends}
    assert found == set(left.split())
