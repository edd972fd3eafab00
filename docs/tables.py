"""Tables of the manual that come from the code: configuration keys and result variables, as Markdown."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, BeforeValidator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from romdam.config.sections.job import Config
from romdam.contact.laws import LAWS
from romdam.results.case import Variable
from romdam.results.suite.rows import ROWS
from romdam.results.variables import COORDINATES, VARIABLES

_SPELT = {"delta_degC": "K", "N*s/m^3": "N s/m3"}  # pint's way -> ours; else without its ^
_BOUNDS = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below"}


def write(folder: Path) -> None:
    """Write every table into a folder, where it is not as it should be."""
    folder.mkdir(exist_ok=True)
    made = {
        "configuration.md": configuration(),
        "coordinates.md": variables(COORDINATES),
        "variables.md": variables(VARIABLES),
        "rows.md": variables(ROWS),
    }
    for name, text in made.items():
        path = folder / name
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


def variables(registry: Mapping[str, Variable]) -> str:
    """A row for every variable of a registry."""
    rows = ["| variable | dimensions | unit | meaning |", "|---|---|---|---|"]
    for name, one in registry.items():
        dims = ", ".join(one.dims) or "(one number)"
        rows.append(f"| `{name}` | {dims} | {one.units or 'text'} | {_cell(one.long_name)} |")
    return "\n".join(rows) + "\n"


def configuration() -> str:
    """A section for every model of the configuration, in the order in which `Config` meets them."""
    sections, headings = [], set[str]()
    for model, paths in models().items():
        heading = f"`{paths[0]}`" if paths[0] else "Top level"
        if heading in headings:  # one of several that may stand there
            heading = f"{heading}: {_mark(model)}"
        headings.add(heading)
        at = "the whole file" if paths == [""] else ", ".join(f"`{path}`" for path in paths)
        doc = " ".join(_own_doc(model).split())
        rows = ["| key | type and unit | default | limits and meaning |", "|---|---|---|---|"]
        rows += [_row(model, name, field) for name, field in model.model_fields.items()]
        sections.append("\n".join([f"## {heading}", "", f"Stands at {at}. {doc}", "", *rows, ""]))
    return "\n".join(sections)


def _mark(model: type[BaseModel]) -> str:
    """What tells a model from others at its place: the step that it is, or its first key."""
    name, field = next(iter(model.model_fields.items()))
    return str(field.default) if name == "step" else name


def unexplained() -> set[str]:
    """Keys of which neither a text of their own nor their model's docstring says anything."""
    return {
        f"{paths[0]}.{name}".removeprefix(".")
        for model, paths in models().items()
        for name, field in model.model_fields.items()
        if name != "step"
        and name not in meanings(model)
        and re.search(rf"`{name}\b", _own_doc(model)) is None
        and not any(_inner(field.annotation))
    }


def models() -> dict[type[BaseModel], list[str]]:
    """Every model that a configuration can hold -> the keys at which it stands."""
    paths: dict[type[BaseModel], list[str]] = {}

    def visit(model: type[BaseModel], path: str) -> None:
        known = model in paths
        paths.setdefault(model, []).append(path)
        if known:
            return
        for name, field in model.model_fields.items():
            key = f"{path}.{name}" if path else name
            for inner, many in _inner(field.annotation):
                visit(inner, key + many)

    visit(Config, "")
    return paths


def _inner(annotation: Any, many: str = "") -> Iterator[tuple[type[BaseModel], str]]:
    """Models within an annotation, with what stands between them and the key."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, many
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is dict:
        yield from _inner(arguments[1], many + ".<name>")
    elif origin is tuple:
        yield from _inner(arguments[0], many + "[]")
    elif origin in (Union, UnionType):
        for one in arguments:
            yield from _inner(one, many)
    elif origin is Annotated:
        yield from _inner(arguments[0], many)


def _row(model: type[BaseModel], name: str, field: FieldInfo) -> str:
    default = field.default
    if field.default_factory is not None:
        shown = "empty"
    elif default is PydanticUndefined:
        shown = "**required**"
    elif isinstance(default, BaseModel):
        shown = "its defaults"
    else:
        shown = "none" if default in (None, (), "") else f"`{_plain(default)}`"
    limits = _limits([*field.metadata, *_nested(field.annotation)])
    told = "; ".join(text for text in (", ".join(limits), _meaning(model, name, field)) if text)
    return f"| `{name}` | {_cell(_type(_declared(model, name)))} | {shown} | {_cell(told)} |"


def _meaning(model: type[BaseModel], name: str, field: FieldInfo) -> str:
    """The text of the key, or what the model says of itself that alone can stand there."""
    texts, inner = meanings(model), _lone(field.annotation)
    if name in texts or inner is None:
        return texts.get(name, "")
    return _first_line(inner)


def _first_line(one: type) -> str:
    return " ".join((one.__doc__ or "").partition("\n\n")[0].split())


def _lone(annotation: Any) -> type[BaseModel] | None:
    """The model of an annotation that allows nothing else, or a list or mapping of it."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    kinds = [one for one in get_args(annotation) if one not in (type(None), Ellipsis)]
    if get_origin(annotation) is dict:
        return _lone(kinds[1])
    lone = len(kinds) == 1 or get_origin(annotation) is Annotated
    return _lone(kinds[0]) if lone and kinds else None


def _plain(value: object) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(_plain(one) for one in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def _nested(annotation: Any) -> list[Any]:
    """What bounds a number that may also be left out."""
    kinds = [one for one in get_args(annotation) if one is not type(None)]
    if get_origin(annotation) not in (Union, UnionType) or len(kinds) != 1:
        return []
    marks = get_args(kinds[0])[1:] if get_origin(kinds[0]) is Annotated else ()
    return [inner for one in marks for inner in (one.metadata if isinstance(one, FieldInfo) else [one])]


def _limits(metadata: list[Any]) -> list[str]:
    return [
        f"{word} {getattr(one, bound):g}"
        for one in metadata
        for bound, word in _BOUNDS.items()
        if isinstance(getattr(one, bound, None), int | float)
    ]


def meanings(model: type[BaseModel]) -> dict[str, str]:
    """The text that stands below a key in its model, for those that have one; those it inherits too."""
    texts = {key: _first_line(law) for law in LAWS if not law.section for key in law.key_names()}
    texts = {key: text for key, text in texts.items() if key in model.model_fields}
    for one in reversed(model.__mro__):
        if not issubclass(one, BaseModel) or one is BaseModel:
            continue
        try:
            source = inspect.getsource(one)
        except (OSError, TypeError):  # made by pydantic, written nowhere
            continue
        body = ast.parse(textwrap.dedent(source)).body[0].body  # type: ignore[attr-defined]
        for key, text in pairwise(body):
            if isinstance(key, ast.AnnAssign) and isinstance(key.target, ast.Name) and _is_text(text):
                texts[key.target.id] = " ".join(text.value.value.split())
    return texts


def _is_text(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _own_doc(model: type[BaseModel]) -> str:
    """The docstring, with those it inherits from other models."""
    docs = [one.__doc__ or "" for one in model.__mro__ if issubclass(one, BaseModel) and one is not BaseModel]
    return " ".join(inspect.cleandoc(doc) for doc in docs if doc and "part of a configuration" not in doc)


def _declared(model: type[BaseModel], name: str) -> Any:
    """The annotation as it is written, which has the unit."""
    return get_type_hints(model, include_extras=True)[name]


def _unit_of(annotation: Any) -> str | None:
    """Unit of a quantity: its validator, made by `romdam.config.quantities`, holds it."""
    for mark in get_args(annotation)[1:]:
        if isinstance(mark, BeforeValidator) and inspect.isfunction(mark.func):
            unit = inspect.getclosurevars(mark.func).nonlocals.get("unit")
            if isinstance(unit, str):
                return _SPELT.get(unit, unit.replace("^", ""))
    return None


def _type(declared: Any) -> str:
    """Type and unit in words."""
    origin, arguments = get_origin(declared), get_args(declared)
    if origin is Annotated:
        unit = _unit_of(declared)
        if unit is not None:
            return f"number [{unit}]" if unit else "number"
        return _type(arguments[0])
    if origin is Literal:
        return ", ".join(f"`{one}`" for one in arguments)
    if origin is dict:
        return f"name: {_type(arguments[1])}"
    if origin is tuple:
        inner = [_type(one) for one in arguments if one is not Ellipsis]
        return f"list of {inner[0]}" if Ellipsis in arguments else f"[{', '.join(inner)}]"
    if origin in (Union, UnionType):
        return " or ".join(_type(one) for one in arguments if one is not type(None))
    if isinstance(declared, type) and issubclass(declared, BaseModel):
        return "mapping"
    return {int: "whole number", str: "text", bool: "true or false", Path: "path", float: "number"}.get(
        declared, getattr(declared, "__name__", str(declared))
    )


def _cell(text: str) -> str:
    return " ".join(text.replace("|", r"\|").split())
