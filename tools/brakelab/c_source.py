"""C99 text of kernels, and of all that they call: assignments, branches, loops over `range`, arithmetic.

A kernel that returns several values becomes a function that writes them through pointers; records of numbers
become `const double *`. Numbers of the module are written out, so the text needs nothing but <math.h>.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple, get_args

import numpy as np

from ecu.errors import UserError

INT, DOUBLE, POINTER = "int", "double", "const double *"
HEAD: Final = """\
#include <math.h>

static inline double minimum(double a, double b) { return b < a ? b : a; }
static inline double maximum(double a, double b) { return b > a ? b : a; }
"""
OPERATORS: Final[dict[type[ast.AST], str]] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
    ast.Eq: "==", ast.NotEq: "!=", ast.And: "&&", ast.Or: "||",
}  # fmt: skip
MATH: Final = (
    *("exp", "log", "log10", "log1p", "expm1", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2"),
    *("sinh", "cosh", "tanh", "hypot", "pow", "fabs", "copysign", "fmod"),
)


class _Text(NamedTuple):
    code: str
    kind: str


class _Function(NamedTuple):
    name: str
    outputs: tuple[str, ...]  # kinds


def number(value: float) -> str:
    """Return a number as C reads it back to the bit."""
    if np.isnan(value):
        return "NAN"
    return repr(float(value)) if np.isfinite(value) else "INFINITY" if value > 0.0 else "-INFINITY"


def array(name: str, values: Sequence[float]) -> str:
    """Return numbers as a constant of C."""
    rows = textwrap.fill(", ".join(map(number, values)), 100, initial_indent="    ", subsequent_indent="    ")
    return f"static const double {name}[] = {{\n{rows}\n}};\n"


class Source:
    """Functions of C in the order in which they need each other."""

    def __init__(self) -> None:
        self._functions: dict[Callable[..., Any], _Function] = {}
        self._texts: list[str] = []

    @property
    def text(self) -> str:
        """Return all functions added so far, and those that they call."""
        return "\n".join([HEAD, *self._texts])

    def add(self, function: Callable[..., Any]) -> str:
        """Add a kernel or a plain function; return its name in C.

        Raises:
            UserError: it is written in more of Python than the module's docstring names.
        """
        return self._known(function).name

    def _known(self, function: Callable[..., Any]) -> _Function:
        plain = inspect.unwrap(getattr(function, "py_func", function))
        if plain not in self._functions:
            translated = _Translation(self, plain)
            self._functions[plain] = translated.known
            self._texts.append(translated.text)
        return self._functions[plain]


class _Translation:
    def __init__(self, source: Source, function: Callable[..., Any]) -> None:
        self._source, self._function = source, function
        tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        self._globals = {**function.__globals__, **inspect.getclosurevars(function).nonlocals}
        hints = function.__annotations__
        given = [argument.arg for argument in tree.args.args]
        self._kinds = {
            name: _kind(hints.get(name, Any if place == 0 and not hints else float))
            for place, name in enumerate(given)
        }
        outputs = _outputs(hints.get("return"), tree)
        module = function.__module__.rpartition(".")[2]
        self.known = _Function(f"{module}_{tree.name}", outputs)
        inputs = [f"{kind} {name}".replace("* ", "*") for name, kind in self._kinds.items()]
        if len(outputs) > 1:
            inputs += [f"{kind} *out_{place}" for place, kind in enumerate(outputs)]
        self._constants: list[str] = []
        before: dict[str, str] = {}
        while before != self._kinds:  # a later line may make a whole number a double
            before = dict(self._kinds)
            body = self._block(tree.body, 1)
        made = [f"    {kind} {name} = 0;" for name, kind in list(self._kinds.items())[len(given) :]]
        result = outputs[0] if len(outputs) == 1 else "void"
        lines = [f"static {result} {self.known.name}({', '.join(inputs)}) {{", *made, *body, "}", ""]
        self.text = "\n".join([*dict.fromkeys(self._constants), *lines])

    def _refuse(self, node: ast.AST) -> UserError:
        path = inspect.getsourcefile(self._function) or self._function.__module__
        line = self._function.__code__.co_firstlineno + getattr(node, "lineno", 1) - 1
        return UserError(
            path, f"line {line}", f"{ast.unparse(node)}: has no form in C; write it in arithmetic"
        )

    def _block(self, nodes: Sequence[ast.stmt], depth: int) -> list[str]:
        return [4 * depth * " " + line for node in nodes for line in self._statement(node)]

    def _statement(self, node: ast.stmt) -> list[str]:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return []
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            return self._assign(node.target, node.value)
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            return self._assign(node.targets[0], node.value)
        if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            read = ast.Name(node.target.id, ast.Load())
            whole = ast.copy_location(ast.BinOp(read, node.op, node.value), node)
            return self._assign(node.target, whole)
        if isinstance(node, ast.Return) and node.value is not None:
            return self._return(node.value)
        if isinstance(node, ast.If):
            lines = [f"if ({self._text(node.test).code}) {{", *self._block(node.body, 1)]
            other = ["} else {", *self._block(node.orelse, 1)] if node.orelse else []
            return [*lines, *other, "}"]
        if isinstance(node, ast.While) and not node.orelse:
            return [f"while ({self._text(node.test).code}) {{", *self._block(node.body, 1), "}"]
        if isinstance(node, ast.For) and isinstance(node.target, ast.Name) and not node.orelse:
            return self._loop(node, node.target.id)
        if isinstance(node, ast.Break | ast.Continue):
            return [f"{ast.unparse(node)};"]
        raise self._refuse(node)

    def _loop(self, node: ast.For, name: str) -> list[str]:
        called = node.iter
        if not (
            isinstance(called, ast.Call) and ast.unparse(called.func) == "range" and len(called.args) < 3
        ):
            raise self._refuse(node.iter)
        ends = [self._text(end).code for end in called.args]
        begin = ends[0] if len(ends) == 2 else "0"
        self._kinds.setdefault(name, INT)
        head = f"for ({name} = {begin}; {name} < {ends[-1]}; {name}++) {{"
        return [head, *self._block(node.body, 1), "}"]

    def _assign(self, target: ast.expr, value: ast.expr) -> list[str]:
        if isinstance(target, ast.Name):
            text = self._text(value)
            self._note(target.id, text.kind)
            return [f"{target.id} = {text.code};"]
        if not (isinstance(target, ast.Tuple) and all(isinstance(each, ast.Name) for each in target.elts)):
            raise self._refuse(target)
        names = [each.id for each in target.elts if isinstance(each, ast.Name)]
        if isinstance(value, ast.Call):
            known, given = self._called(value)
            if len(known.outputs) != len(names):
                raise self._refuse(value)
            for name, kind in zip(names, known.outputs, strict=True):
                self._note(name, kind)
            return [f"{known.name}({', '.join([*given, *(f'&{name}' for name in names)])});"]
        texts = self._several(value, len(names))
        lines = [f"{text.kind} {name}_next = {text.code};" for name, text in zip(names, texts, strict=True)]
        for name, text in zip(names, texts, strict=True):
            self._note(name, text.kind)
        return [
            "{",
            *(f"    {line}" for line in lines),
            *(f"    {name} = {name}_next;" for name in names),
            "}",
        ]

    def _several(self, value: ast.expr, count: int) -> list[_Text]:
        found = value.elts if isinstance(value, ast.Tuple) else None
        if isinstance(value, ast.Name) and self._kinds.get(value.id) == POINTER:
            return [_Text(f"{value.id}[{place}]", DOUBLE) for place in range(count)]
        if found is None and isinstance(value, ast.Name) and isinstance(self._globals.get(value.id), tuple):
            found = [ast.Constant(each) for each in self._globals[value.id]]
        if found is None or len(found) != count:
            raise self._refuse(value)
        return [self._text(each) for each in found]

    def _note(self, name: str, kind: str) -> None:
        self._kinds[name] = _wider(kind, self._kinds.get(name, kind))

    def _return(self, value: ast.expr) -> list[str]:
        outputs = self.known.outputs
        if len(outputs) == 1:
            return [f"return {self._text(value).code};"]
        places = [f"out_{place}" for place in range(len(outputs))]
        if isinstance(value, ast.Call):
            known, given = self._called(value)
            return [f"{known.name}({', '.join([*given, *places])});", "return;"]
        texts = self._several(value, len(outputs))
        lines = [f"*{place} = {text.code};" for place, text in zip(places, texts, strict=True)]
        return [*lines, "return;"]

    def _called(self, node: ast.Call) -> tuple[_Function, list[str]]:
        function = self._value(node.func)
        if node.keywords or not callable(function) or inspect.isbuiltin(function):
            raise self._refuse(node)
        known = self._source._known(function)
        return known, [self._text(each).code for each in node.args]

    def _value(self, node: ast.expr) -> Any:
        """Return what a name, or an attribute of a module, stands for; None for a local."""
        if isinstance(node, ast.Name) and node.id not in self._kinds:
            return self._globals.get(node.id)
        if isinstance(node, ast.Attribute) and inspect.ismodule(module := self._value(node.value)):
            return getattr(module, node.attr, None)
        return None

    def _text(self, node: ast.expr) -> _Text:
        if isinstance(node, ast.Name) and node.id in self._kinds:
            return _Text(node.id, self._kinds[node.id])
        value = node.value if isinstance(node, ast.Constant) else self._value(node)
        if isinstance(value, bool | int):
            return _Text(str(int(value)), INT)
        if isinstance(value, float):
            return _Text(number(value), DOUBLE)
        if isinstance(node, ast.BinOp):
            return self._arithmetic(node)
        if isinstance(node, ast.UnaryOp):
            inner = self._text(node.operand)
            if isinstance(node.op, ast.Not):
                return _Text(f"!{inner.code}", INT)
            return _Text(f"(-{inner.code})" if isinstance(node.op, ast.USub) else inner.code, inner.kind)
        if isinstance(node, ast.BoolOp):
            parts = [self._text(each).code for each in node.values]
            return _Text(f"({f' {OPERATORS[type(node.op)]} '.join(parts)})", INT)
        if isinstance(node, ast.Compare):
            return self._comparison(node)
        if isinstance(node, ast.IfExp):
            test, yes, no = (self._text(each) for each in (node.test, node.body, node.orelse))
            return _Text(f"({test.code} ? {yes.code} : {no.code})", _wider(yes.kind, no.kind))
        if isinstance(node, ast.Subscript):
            return self._element(node)
        if isinstance(node, ast.Call):
            return self._call(node)
        raise self._refuse(node)

    def _arithmetic(self, node: ast.BinOp) -> _Text:
        left, right = self._text(node.left), self._text(node.right)
        if isinstance(node.op, ast.Div):
            return _Text(f"({'(double)' * (left.kind == INT)}{left.code} / {right.code})", DOUBLE)
        if isinstance(node.op, ast.Pow):
            return _Text(f"pow({left.code}, {right.code})", DOUBLE)
        if type(node.op) not in OPERATORS:
            raise self._refuse(node)
        code = f"({left.code} {OPERATORS[type(node.op)]} {right.code})"
        return _Text(code, _wider(left.kind, right.kind))

    def _comparison(self, node: ast.Compare) -> _Text:
        parts, left = [], self._text(node.left).code
        for operator, right in zip(node.ops, node.comparators, strict=True):
            if isinstance(operator, ast.In) and isinstance(right, ast.Tuple):
                one_of = " || ".join(f"{left} == {self._text(each).code}" for each in right.elts)
                return _Text(f"({one_of})", INT)
            if type(operator) not in OPERATORS:
                raise self._refuse(node)
            code = self._text(right).code
            parts.append(f"{left} {OPERATORS[type(operator)]} {code}")
            left = code
        return _Text(f"({' && '.join(parts)})", INT)

    def _element(self, node: ast.Subscript) -> _Text:
        place = self._text(node.slice)
        if isinstance(node.value, ast.Name) and self._kinds.get(node.value.id) == POINTER:
            return _Text(f"{node.value.id}[{place.code}]", DOUBLE)
        values = self._value(node.value)
        if place.kind != INT or not isinstance(values, tuple | np.ndarray):
            raise self._refuse(node)
        name = f"{self.known.name}_{ast.unparse(node.value).replace('.', '_')}"
        self._constants.append(array(name, [float(each) for each in values]))
        return _Text(f"{name}[{place.code}]", DOUBLE)

    def _call(self, node: ast.Call) -> _Text:
        name = ast.unparse(node.func)
        given = [self._text(each) for each in node.args]
        codes = ", ".join(each.code for each in given)
        if name in ("min", "max") and len(given) == 2:
            code = f"{name}imum({codes})"
            whole = all(each.kind == INT for each in given)
            return _Text(f"(int){code}", INT) if whole else _Text(code, DOUBLE)
        if name == "abs":
            return _Text(f"fabs({codes})", DOUBLE)
        if name in ("int", "float", "bool", "math.floor", "math.ceil") and len(given) == 1:
            whole = name != "float"
            inner = f"{name[5:]}({codes})" if name.startswith("math.") else f"({codes})"
            return _Text(f"({INT if whole else DOUBLE}){inner}", INT if whole else DOUBLE)
        if name in ("math.isnan", "math.isfinite", "math.isinf"):
            return _Text(f"{name[5:]}({codes})", INT)
        if name.startswith("math.") and name[5:] in MATH:
            return _Text(f"{name[5:]}({codes})", DOUBLE)
        known, texts = self._called(node)
        if len(known.outputs) != 1:
            raise self._refuse(node)
        return _Text(f"{known.name}({', '.join(texts)})", known.outputs[0])


def _wider(one: str, other: str) -> str:
    return INT if one == other == INT else DOUBLE


def _kind(hint: Any) -> str:
    return {float: DOUBLE, int: INT, bool: INT}.get(hint, POINTER)


def _outputs(hint: Any, tree: ast.FunctionDef) -> tuple[str, ...]:
    if hint is not None:
        return tuple(map(_kind, get_args(hint))) or (_kind(hint),)
    returned = [node.value for node in ast.walk(tree) if isinstance(node, ast.Return)]
    counts = {len(value.elts) if isinstance(value, ast.Tuple) else 1 for value in returned}
    return (DOUBLE,) * max(counts, default=1)
