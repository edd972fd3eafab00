"""What a configuration states: every key that is not at its default, with its value, unit and meaning."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, get_args

from pydantic import BaseModel, BeforeValidator

from romdam.config.quantities import unit_of
from romdam.config.texts import meaning


class StatedKey(NamedTuple):
    """A key, its value [SI], the SI unit of its numbers as files state units ("" for none), and its text."""

    path: str
    value: object
    units: str
    text: str


def stated_keys(model: BaseModel, path: str = "") -> Iterator[StatedKey]:
    """Every key of a model, and of the models in it, whose value is not its default.

    Parameters
    ----------
    path : of the model, in front of its keys
    """
    for name, field in type(model).model_fields.items():
        value, key = getattr(model, name), f"{path}.{name}" if path else name
        if value == field.get_default(call_default_factory=True):
            continue
        if isinstance(value, BaseModel):
            yield from stated_keys(value, key)
        elif isinstance(value, Mapping) and any(isinstance(one, BaseModel) for one in value.values()):
            for inner_name, inner in value.items():
                yield from stated_keys(inner, f"{key}.{inner_name}")
        elif isinstance(value, tuple) and any(isinstance(one, BaseModel) for one in value):
            if all(_is_text(one) for one in value):  # such as faces: a block and the name of its face
                words = tuple(" ".join(str(word) for word in _not_defaults(one).values()) for one in value)
                yield StatedKey(key, words, "", meaning(type(model), name))
                continue
            for k, inner in enumerate(value):
                yield from stated_keys(inner, f"{key}[{k}]")
        else:
            units = _units(field.annotation) or _units(*field.metadata)
            yield StatedKey(key, value, _as_in_files(units), meaning(type(model), name))


def _not_defaults(model: BaseModel) -> dict[str, object]:
    """Values that are not their defaults."""
    fields = type(model).model_fields.items()
    defaults = {name: field.get_default(call_default_factory=True) for name, field in fields}
    return {name: getattr(model, name) for name in defaults if getattr(model, name) != defaults[name]}


def _is_text(model: BaseModel) -> bool:
    return all(isinstance(value, str) for value in _not_defaults(model).values())


def _units(*annotations: Any) -> str:
    """The unit of the first quantity in annotations, in pint's spelling; empty where there is none."""
    for annotation in annotations:
        if isinstance(annotation, BeforeValidator):
            unit = unit_of(annotation.func) or ""
        else:
            unit = _units(*get_args(annotation))
        if unit:
            return unit
    return ""


def _as_in_files(units: str) -> str:
    """A unit of pint as files state it: kg/m^3 is kg m-3."""
    above, _, below = units.replace("delta_degC", "K").replace("*", " ").partition("/")
    words = [word for word in above.split() if word != "1"]
    for word in below.split():
        name, _, power = word.partition("^")
        words.append(f"{name}-{power or 1}")
    return " ".join(words)
