"""Pictures of the packages and their imports (Mermaid) in docs/architecture.md, drawn from the code.

    python tools/draw_architecture.py

A picture shows what is directly in a package, each folder as one box; a package of three packages or more has
a picture of its own. An arrow is an import. Arrows that a chain of others implies are left out, except within
a circle.
"""

import ast
from pathlib import Path

CHECKOUT = Path(__file__).parent.parent
PAGE = CHECKOUT / "docs" / "architecture.md"
BEGIN, END = "<!-- drawn by tools/draw_architecture.py -->\n", "<!-- end of the drawing -->"
SOURCES = {"ecu": CHECKOUT / "ecu", "brakelab": CHECKOUT / "tools" / "brakelab"}

Graph = dict[str, set[str]]


def folder_of(package: str) -> Path:
    """Return the folder of a package."""
    return SOURCES[package.partition(".")[0]].joinpath(*package.split(".")[1:])


def packages() -> list[str]:
    """Return the packages that have a picture: the sources, and those of three packages or more."""
    found = []
    for source, top in SOURCES.items():
        for folder in (top, *sorted(path.parent for path in top.rglob("*/__init__.py"))):
            if folder == top or len(list(folder.glob("*/__init__.py"))) >= 3:
                found.append(".".join((source, *folder.relative_to(top).parts)))
    return found


def imports(package: str) -> Graph:
    """Return what is in a package, each with what it imports of it; another source is one box."""
    graph: Graph = {}
    depth = package.count(".") + 2
    for path in sorted(folder_of(package).rglob("*.py")):
        parts = [package, *path.relative_to(folder_of(package)).with_suffix("").parts]
        here = ".".join(parts[:2])
        if parts[1:] == ["__init__"]:
            continue
        wanted = graph.setdefault(here, set())
        for node in ast.walk(ast.parse(path.read_bytes())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.module:
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            for name in names:
                top = name.partition(".")[0]
                wanted.add(".".join(name.split(".")[:depth]) if name.startswith(f"{package}.") else top)
        wanted.discard(here)
    known = graph.keys() | (SOURCES.keys() - {package} if package in SOURCES else set())
    return {name: found & known for name, found in graph.items()}


def reached(graph: Graph, start: str) -> set[str]:
    """Return all that a package imports, directly or not."""
    seen: set[str] = set()
    ahead = list(graph.get(start, ()))
    while ahead:
        if (name := ahead.pop()) not in seen:
            seen.add(name)
            ahead += graph.get(name, ())
    return seen


def without_implied(graph: Graph) -> Graph:
    """Return the graph without the arrows that others imply."""
    reach = {name: reached(graph, name) for name in graph}
    circles = {name: {other for other in reach[name] if name in reach.get(other, ())} for name in graph}

    def implied(name: str, to: str) -> bool:
        by = graph[name] - circles[name] - circles.get(to, set()) - {to}
        return to not in circles[name] and any(to in reach.get(other, ()) for other in by)

    return {name: {to for to in found if not implied(name, to)} for name, found in graph.items()}


def drawn(package: str) -> str:
    """Return the picture of a package as Mermaid text."""
    graph = without_implied(imports(package))
    names = sorted(graph.keys() | {to for found in graph.values() for to in found})
    boxes = [f'    {name.replace(".", "_")}["{name.removeprefix(f"{package}.")}"]' for name in names]
    arrows = [
        f"    {name.replace('.', '_')} --> {to.replace('.', '_')}"
        for name, found in sorted(graph.items())
        for to in sorted(found)
    ]
    return "\n".join([f"`{package}`", "", "```mermaid", "flowchart TD", *boxes, *arrows, "```", ""])


def drawn_anew(page: str) -> str:
    """Return the page with its pictures drawn from the code as it is."""
    before, _, rest = page.partition(BEGIN)
    return before + BEGIN + "\n".join(map(drawn, packages())) + END + rest.partition(END)[2]


if __name__ == "__main__":
    PAGE.write_text(drawn_anew(PAGE.read_text("utf-8")), "utf-8")
