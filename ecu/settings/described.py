"""Descriptions of a file's keys: the text below each of them in its model.

pydantic's `use_attribute_docstrings` reads the source of a model whenever it is imported, at every start. The
texts are wanted where a schema, a page of reference or a file for people is written.
"""

import ast
from functools import cache
from inspect import cleandoc, getsource
from itertools import pairwise
from textwrap import dedent
from typing import Any

from pydantic import BaseModel


def describe_keys(schema: dict[str, Any], model: type[BaseModel]) -> None:
    """Add the descriptions to a model's JSON schema: `json_schema_extra` of its configuration."""
    for name, text in descriptions(model).items():
        schema["properties"][name].setdefault("description", text)


@cache
def descriptions(model: type[BaseModel]) -> dict[str, str]:
    """Return the text below each key of a model and of those that it is derived from, by key."""
    found = dict[str, str]()
    for kind in reversed(model.__mro__):
        if issubclass(kind, BaseModel) and kind is not BaseModel:
            found |= texts_below_keys(kind)
    return found


def texts_below_keys(kind: type) -> dict[str, str]:
    """Return the text below each key of a class, its own alone."""
    (table,) = ast.parse(dedent(getsource(kind))).body
    assert isinstance(table, ast.ClassDef)
    found = dict[str, str]()
    for key, below in pairwise(table.body):
        match key, below:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                found[name] = cleandoc(text)
    return found
