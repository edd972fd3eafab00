"""Texts of the keys of a configuration, from its models, for the manual and the schema."""

from __future__ import annotations

import ast
import inspect
import textwrap
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel

from romdam.contact.laws import LAWS

_OF_THE_MODEL = {"step"}  # keys whose value says which model it is, and so what the model says of itself


def meaning(model: type[BaseModel], name: str) -> str:
    """The text of the key, or what the model says of itself that alone can stand there."""
    field = model.model_fields[name]
    texts, inner = meanings(model), _lone(field.annotation)
    if name in texts or inner is None:
        text = texts.get(name, field.description or "")
        return text or (_first_line(model) if name in _OF_THE_MODEL else "")
    return _first_line(inner)


def meanings(model: type[BaseModel]) -> dict[str, str]:
    """The text that stands below a key in its model, for those that have one; those it inherits too."""
    texts = {key: _first_line(law) for law in LAWS if not law.section for key in law.key_names()}
    texts = {key: text for key, text in texts.items() if key in model.model_fields}
    for ancestor in reversed(model.__mro__):
        if issubclass(ancestor, BaseModel) and ancestor is not BaseModel:
            texts |= _texts_in_source(ancestor)
    return texts


@cache
def _texts_in_source(model: type[BaseModel]) -> dict[str, str]:
    """The text below each key that a model itself declares, read from its source."""
    try:
        source = inspect.getsource(model)
    except (OSError, TypeError):  # made by pydantic, written nowhere
        return {}
    body = ast.parse(textwrap.dedent(source)).body[0].body  # type: ignore[attr-defined]
    texts = {}
    for key, below in pairwise(body):
        constant = below.value if isinstance(below, ast.Expr) else None
        text = constant.value if isinstance(constant, ast.Constant) else None
        if isinstance(key, ast.AnnAssign) and isinstance(key.target, ast.Name) and isinstance(text, str):
            texts[key.target.id] = " ".join(text.split())
    return texts


def model_docstring(model: type[BaseModel]) -> str:
    """The docstring, with those it inherits from other models."""
    docs = [
        ancestor.__doc__ or ""
        for ancestor in model.__mro__
        if issubclass(ancestor, BaseModel) and ancestor is not BaseModel
    ]
    return " ".join(inspect.cleandoc(doc) for doc in docs if doc and "part of a configuration" not in doc)


def _first_line(described: type) -> str:
    return " ".join((described.__doc__ or "").partition("\n\n")[0].split())


def _lone(annotation: Any) -> type[BaseModel] | None:
    """The model of an annotation that allows nothing else, or a list or mapping of it."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    kinds = [kind for kind in get_args(annotation) if kind not in (type(None), Ellipsis)]
    if get_origin(annotation) is dict:
        return _lone(kinds[1])
    lone = len(kinds) == 1 or get_origin(annotation) is Annotated
    return _lone(kinds[0]) if lone and kinds else None
