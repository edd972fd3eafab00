"""Keys that the laws of a joint add to it; their parameters say all of it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, Tag, create_model

from romdam.config.base import Model, by_shape
from romdam.config.quantities import in_unit
from romdam.contact.laws import LAWS
from romdam.contact.laws.catalogue import find_law, loaded_law, try_law, user_law
from romdam.contact.laws.law import Law, Parameter
from romdam.core.errors import quote
from romdam.core.system import LawSource

_STIFFNESS = "a stiffness per area such as 16 GPa/m{} {{per_gap: 1 GN/m}}{}"


class LawSection(Model):
    """Parameters of a law, in a mapping."""


def both(value: object) -> object:
    """Read one number as that of both directions."""
    return (value, value) if not isinstance(value, list | tuple) else value


@cache
def _per_gap(unit: str, above: bool) -> type[Model]:
    """A stiffness of each gap, whatever its tributary area; `above` zero or from there on."""
    stiffness: Any = Annotated[in_unit(unit), Field(gt=0.0) if above else Field(ge=0.0)]
    text = "The stiffness of one gap, whatever its area."
    name = "PositivePerGap" if above else "PerGap"
    return create_model(name, __base__=Model, __doc__=text, per_gap=(stiffness, Field(description=text)))


def annotation(parameter: Parameter) -> Any:
    """Type of a parameter in a configuration, with unit and bounds."""
    if parameter.unit == "axes":
        return Annotated[tuple[Literal["j", "k"], ...], Field(min_length=1)]
    if parameter.choices:
        return Literal[parameter.choices]
    least, most = parameter.least, parameter.most
    bounds: Any = Field(gt=least, le=most) if parameter.above else Field(ge=least, le=most)
    number: Any = Annotated[in_unit(parameter.unit), bounds]
    return Annotated[tuple[number, number], BeforeValidator(both)] if parameter.both else number


def _type(parameter: Parameter) -> Any:
    """As `annotation`, with {per_gap: value} and the words "rigid" and "auto" where these are allowed."""
    if not parameter.per_gap:
        return annotation(parameter)
    number, mapping = annotation(parameter), _per_gap(parameter.per_gap, parameter.above)
    numbers: Any = Annotated[number, Tag("number")] | Annotated[mapping, Tag("mapping")]
    words = [word for word, allowed in (("rigid", parameter.rigid), ("auto", parameter.auto)) if allowed]
    if not words:
        return Annotated[numbers, by_shape(_STIFFNESS.format(", or", ""))]
    quoted = " or ".join(f'"{word}"' for word in words)
    return Annotated[
        numbers | Annotated[Literal[*words], Tag("word")],
        by_shape(_STIFFNESS.format(",", f", or {quoted}"), *words),
    ]


def fields(law: type[Law], optional: bool = True) -> dict[str, Any]:
    """The keys that a law adds to a joint, as pydantic's create_model takes them.

    Parameters
    ----------
    optional : whether a joint may leave out what has no default, and then has not got the law
    """
    keys: dict[str, Any] = {}
    for p in law.parameters:
        text = p.meaning or None
        if p.default is not None:
            keys[p.name] = _type(p), Field(p.default, description=text)
        elif law.section or p.required or not optional:
            keys[p.name] = _type(p), Field(description=text)
        else:
            keys[p.name] = _type(p) | None, Field(None, description=text)
    if not law.section:
        return keys
    options: dict[str, Any] = {"__base__": LawSection, "__doc__": law.__doc__, **keys}
    section: Any = create_model(f"{law.__name__}Config", **options)
    if law in LAWS:  # workers of a suite look for the class by its name
        globals()[section.__name__] = section
    return {law.section: (section | None, None)}


class UserLaw(Model):
    """A law of a user's file, with what the joint says of its parameters.

    Attributes
    ----------
    name : module.Class
    sha256 : of the file, and of what the law takes from elsewhere
    file : where it is read; no part of what the configuration says
    values : by key [SI]
    """

    name: str
    """Module and class, as module.Class."""
    sha256: str
    """SHA-256 of the file, and of what the law takes from elsewhere."""
    file: str = Field(exclude=True)
    """File that the law is read from."""
    values: dict[str, Any]
    """Values of the law's own keys."""

    @property
    def source(self) -> LawSource:
        """Source of the class."""
        return LawSource(self.name, self.file, self.sha256)

    @property
    def law(self) -> type[Law]:
        """The class."""
        return find_law(self.source)


def read_user_laws(joint: Mapping[str, Any], folder: Path | None) -> dict[str, Any]:
    """The keys of a joint with those of its user's laws taken out of them and into `law`.

    Parameters
    ----------
    folder : where the files of such laws are; None where they have been loaded before

    Raises
    ------
    ValueError, ConfigError
        for a law that cannot be loaded, and for what it does not take.
    """
    keys = dict(joint)
    entries = keys.pop("law", ())
    asked = [entries] if isinstance(entries, str) or not isinstance(entries, list | tuple) else entries
    names = [entry for entry in asked if isinstance(entry, str)]
    if len(set(names)) < len(names):
        raise ValueError("`law` names a class twice; each is applied once")
    laws = [_user_law(entry, keys, folder) for entry in asked]
    return keys | ({"law": tuple(laws)} if laws else {})


def _user_law(asked: Any, keys: dict[str, Any], folder: Path | None) -> UserLaw:
    """One law, its values taken from the joint's keys, or from where they were before."""
    if isinstance(asked, UserLaw):
        source, before = asked.source, asked.values
    elif isinstance(asked, dict) and {"name", "sha256", "values"} <= set(asked):
        source, before = loaded_law(str(asked["name"]), str(asked["sha256"])), dict(asked["values"])
    else:
        source, before = user_law(*_file_of(asked, folder)), {}
    law = find_law(source)
    values = before | {key: keys.pop(key) for key in law.key_names() if key in keys}
    checked = _model(source).model_validate(values).model_dump(mode="json")
    try_law(law, checked, f"{source.file}: {law.__name__}")
    return UserLaw(name=source.name, sha256=source.sha256, file=source.file, values=checked)


@cache
def _model(source: LawSource) -> type[Model]:
    law = find_law(source)
    return create_model(law.__name__, __base__=Model, **fields(law, optional=False))


def _file_of(asked: Any, folder: Path | None) -> tuple[str, Path]:
    """Name and file of a law as YAML names it: module.Class, the module's file beside the configuration."""
    module, _, name = asked.rpartition(".") if isinstance(asked, str) else ("", "", "")
    if (
        folder is None
        or not name.isidentifier()
        or not all(word.isidentifier() for word in module.split("."))
    ):
        raise ValueError(
            f"`law` must be module.Class, a class in module.py beside this file, got {quote(asked)}"
        )
    return asked, folder.joinpath(*module.split(".")).with_suffix(".py")


if TYPE_CHECKING:
    JointLaws = Model
else:
    JointLaws = create_model(
        "JointLaws", __base__=Model, **{key: kind for law in LAWS for key, kind in fields(law).items()}
    )
