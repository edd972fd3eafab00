"""Tables of the manual that come from the code: configuration keys and result variables, as Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, BeforeValidator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from romdam.config.quantities import spelt, unit_of
from romdam.config.sections.job import Config
from romdam.config.texts import meaning, meanings, own_doc
from romdam.results.case import Variable
from romdam.results.suite.rows import ROWS
from romdam.results.variables import COORDINATES, VARIABLES

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
        doc = " ".join(own_doc(model).split())
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
        and re.search(rf"`{name}\b", own_doc(model)) is None
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
    told = "; ".join(text for text in (", ".join(limits), meaning(model, name)) if text)
    return f"| `{name}` | {_cell(_type(_declared(model, name)))} | {shown} | {_cell(told)} |"


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


def _declared(model: type[BaseModel], name: str) -> Any:
    """The annotation as it is written, which has the unit."""
    return get_type_hints(model, include_extras=True)[name]


def _unit_of(annotation: Any) -> str | None:
    """Unit of a quantity: its validator, made by `romdam.config.quantities`, holds it."""
    for mark in get_args(annotation)[1:]:
        unit = unit_of(mark.func) if isinstance(mark, BeforeValidator) else None
        if unit is not None:
            return spelt(unit)
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
