"""The base of every configuration model: frozen, unknown keys are errors, one branch per union."""

from __future__ import annotations

from types import UnionType
from typing import ClassVar, get_args

from pydantic import BaseModel, ConfigDict, Discriminator


class Model(BaseModel):
    """A frozen part of a configuration.

    Attributes
    ----------
    short_form : JSON schema of what may stand in place of the mapping, where anything may
    """

    short_form: ClassVar[dict[str, object] | None] = None

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def shape(value: object) -> str:
    """Tell the branches of a union apart by how a value is written: mapping, list, number (or text)."""
    if isinstance(value, dict | BaseModel):
        return "mapping"
    return "list" if isinstance(value, list | tuple) else "number"


def by_key(expected: str, branches: type[BaseModel] | UnionType, *words: str) -> Discriminator:
    """Choose a union's branch by the first key of its mapping, so that a mistake has one message.

    Each branch has the name of its model as its tag.

    Parameters
    ----------
    expected : what may stand there, for the message when no branch fits, or several do
    branches : models, of each of which the first key says that it is meant
    words : texts that are values of their own
    """
    models = get_args(branches)
    first = {next(iter(model.model_fields)): model.__name__ for model in models}

    def choose(value: object) -> str | None:
        if isinstance(value, BaseModel):
            return type(value).__name__
        if isinstance(value, dict):
            meant = [name for key, name in first.items() if key in value]
            return meant[0] if len(meant) == 1 else None
        return "word" if isinstance(value, str) and value in words else None

    return Discriminator(choose, custom_error_type="shape", custom_error_message=f"expected {expected}")


def by_shape(expected: str, *words: str) -> Discriminator:
    """Choose a union's branch by `shape`, or "word" for given words, so that a mistake has one message.

    Parameters
    ----------
    expected : what may stand there, for the message when no branch fits
    words : texts that are values of their own, such as "rigid"
    """

    def choose(value: object) -> str:
        return "word" if isinstance(value, str) and value in words else shape(value)

    return Discriminator(choose, custom_error_type="shape", custom_error_message=f"expected {expected}")
