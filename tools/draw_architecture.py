"""Pictures of the packages and their imports (Mermaid) in docs/architecture.md, drawn from the code.

    python tools/draw_architecture.py

An arrow is an import. Arrows that a chain of others implies are left out, except within a circle of packages.
A package of three packages or more is drawn module by module.
"""

import ast
from pathlib import Path

CHECKOUT = Path(__file__).parent.parent
PAGE = CHECKOUT / "docs" / "architecture.md"
BEGIN, END = "<!-- drawn by tools/draw_architecture.py -->\n", "<!-- end of the drawing -->"
SOURCES = {"ecu": CHECKOUT / "ecu", "brakelab": CHECKOUT / "tools" / "brakelab"}

Graph = dict[str, set[str]]


def package_of(module: str) -> str:
    """Return the box of a module: its package, or itself in a package of packages."""
    top, *rest = module.split(".")
    folder = SOURCES[top]
    for depth, name in enumerate(rest):
        if not (folder / name).is_dir():
            return module if len(list(folder.glob("*/__init__.py"))) >= 3 else ".".join([top, *rest[:depth]])
        folder = folder / name
    return module


def imports(source: str) -> Graph:
    """Return the packages of a source, each with those that it imports; the other source is one package."""
    graph: Graph = {}
    for path in sorted(SOURCES[source].rglob("*.py")):
        parts = path.relative_to(SOURCES[source].parent).with_suffix("").parts
        here = package_of(".".join(parts).removesuffix(".__init__"))
        if here == source:
            continue
        wanted = graph.setdefault(here, set())
        for node in ast.walk(ast.parse(path.read_bytes())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.module in SOURCES:
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module]
            for name in names:
                top = name.partition(".")[0]
                if top in SOURCES and name != top:
                    wanted.add(package_of(name) if top == source else top)
        wanted.discard(here)
    known = graph.keys() | SOURCES.keys() - {source}
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


def drawn(source: str) -> str:
    """Return the picture of a source as Mermaid text."""
    graph = without_implied(imports(source))
    names = sorted(graph.keys() | {to for found in graph.values() for to in found})
    boxes = [f'    {name.replace(".", "_")}["{name.removeprefix(f"{source}.")}"]' for name in names]
    arrows = [
        f"    {name.replace('.', '_')} --> {to.replace('.', '_')}"
        for name, found in sorted(graph.items())
        for to in sorted(found)
    ]
    return "\n".join(["```mermaid", "flowchart TD", *boxes, *arrows, "```", ""])


def drawn_anew(page: str) -> str:
    """Return the page with its pictures drawn from the code as it is."""
    before, _, rest = page.partition(BEGIN)
    return before + BEGIN + "\n".join(drawn(source) for source in SOURCES) + END + rest.partition(END)[2]


if __name__ == "__main__":
    PAGE.write_text(drawn_anew(PAGE.read_text("utf-8")), "utf-8")
