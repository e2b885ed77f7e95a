"""Report pages taken apart: what each section says, and what each of its plots draws."""

import base64
import gzip
import json
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from urllib.parse import unquote

import numpy as np

DOCUMENT = re.compile(r"const docs_json = '(.*?)';\n", re.DOTALL)
DRAWN = ("d", "points", "href")
"""Attributes that hold a curve, or a file to be saved."""


class _Sections(HTMLParser):
    """Heading, text and curves, and plots of each section; the first is what stands before all."""

    def __init__(self) -> None:
        super().__init__()
        self.headings: list[str] = [""]
        self.texts: list[list[str]] = [[]]
        self.plots: list[list[str]] = [[]]
        self._within: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._within.append(tag)
        given = dict(attrs)
        if tag == "section":
            self.headings.append(given.get("aria-label") or "")
            self.texts.append([])
            self.plots.append([])
        self.texts[-1] += [unquote(given[name] or "") for name in DRAWN if name in given]
        if "data-root-id" in given:
            self.plots[-1].append(given["data-root-id"] or "")

    def handle_endtag(self, tag: str) -> None:
        while self._within and self._within.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if not {"script", "style"} & {*self._within}:
            self.texts[-1] += data.split()
        if "h2" in self._within and not self.headings[-1]:
            self.headings[-1] = " ".join(data.split())


def _content(model: object) -> Iterator[str]:
    """Yield names, labels, numbers and arrays of a plot in its order."""
    if isinstance(model, dict) and model.get("type") == "ndarray":
        kind = np.dtype(model["dtype"]).newbyteorder("<" if model["order"] == "little" else ">")
        data = gzip.decompress(base64.b64decode(model["array"]["data"]))
        yield from map(repr, np.frombuffer(data, kind).tolist())
    elif isinstance(model, dict):
        for key, value in model.items():
            if key != "id":
                yield from _content(value)
    elif isinstance(model, list):
        for value in model:
            yield from _content(value)
    else:
        yield str(model)


def parts_of(page: str) -> dict[str, str]:
    """Return what every section says, and what every plot in it draws."""
    sections = _Sections()
    sections.feed(page)
    found = DOCUMENT.search(page)
    assert found, "no plots"
    [document] = json.loads(re.sub(r"\\(.)", r"\1", found[1])).values()
    drawn = {root["id"]: root for root in document["roots"]}
    parts = {}
    rows = list(zip(sections.headings, sections.texts, sections.plots, strict=True))
    for heading, texts, plots in rows[1:]:
        parts[heading] = " ".join(texts)
        for number, plot in enumerate(plots, 1):
            parts[f"{heading}, plot {number}"] = " ".join(_content(drawn[plot]))
    return parts
