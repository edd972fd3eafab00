"""Values for named places of the joints and the damping: what a suite may vary without a new reduction."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from romdam.config.base import Model
from romdam.config.explain import explain
from romdam.config.sections.job import Config, DampingConfig, RayleighConfig
from romdam.config.sections.joint_laws import annotation
from romdam.config.sections.joints import JointConfig
from romdam.contact.laws import LAWS
from romdam.contact.laws.catalogue import law_order
from romdam.contact.laws.law import Law, Parameter
from romdam.core.errors import ConfigError, listed, quote

Section = TypeVar("Section", bound=Model)

_UDUNITS = {"": "1", "m/s": "m s-1", "N/m": "N m-1", "N/m^3": "N m-3", "N*s/m^3": "N s m-3", "1/s": "s-1"}
_GAP = Parameter("gap", "m", least=-math.inf)
_DAMPING = {"rayleigh.ratio": "1", "rayleigh.alpha": "s-1", "rayleigh.beta": "s", "modal": "1"}


def _places(laws: Iterable[type[Law]]) -> dict[str, Parameter]:
    """Keys that laws add to a joint, dotted within, and what may stand there."""
    keys = {}
    for law in laws:
        for parameter in law.parameters:
            if parameter.unit != "axes":
                keys[f"{law.section}.{parameter.name}".removeprefix(".")] = parameter
            if parameter.per_gap:
                keys[f"{parameter.name}.per_gap"] = replace(parameter, unit=parameter.per_gap, rigid=False)
    return keys


_JOINT = {**_places(LAWS), "gap": _GAP}


@dataclass(frozen=True)
class VariedKey:
    """A number in a configuration that a suite may vary.

    Attributes
    ----------
    path : as written, such as joints.J3.friction
    joints : names of the joints it stands in; empty for damping
    keys : of the joint or of `damping`
    units : of the SI value, UDUNITS
    parameter : what may stand there, of a joint
    """

    path: str
    joints: tuple[str, ...]
    keys: tuple[str, ...]
    units: str
    parameter: Parameter | None = None


@dataclass(frozen=True)
class Varied:
    """The joints and the damping of one sample."""

    joints: dict[str, JointConfig]
    damping: DampingConfig


def find_varied_key(config: Config, path: str, name: str, source: str) -> VariedKey:
    """Find what a path names.

    Parameters
    ----------
    name, source : of the parameter and of the configuration's file, for messages

    Raises
    ------
    ConfigError
        for what changes the reduced basis, unknown joints and unknown keys.
    """
    where = f"{source}: suite.parameters.{name}.path"
    root, _, rest = path.partition(".")
    if root == "damping" and rest in _DAMPING:
        return VariedKey(path, (), tuple(rest.split(".")), _DAMPING[rest])
    joint, _, field = rest.partition(".")
    every = config.every_joint
    users = {user.law for properties in every.values() for user in properties.law}
    known = {**_JOINT, **_places(sorted(users, key=law_order))}
    if root == "joints" and field in known:
        named = tuple(every) if joint == "*" else (joint,)
        if not set(named) <= set(every):
            raise ConfigError(f"{where}: no joint {quote(joint)} is defined; defined are {listed(every)}")
        unit = known[field].unit
        return VariedKey(path, named, tuple(field.split(".")), _UDUNITS.get(unit, unit), known[field])
    if root in ("joints", "damping"):
        keys = [f"joints.<name>.{key}" for key in known] if root == "joints" else [*_DAMPING]
        raise ConfigError(f"{where}: {quote(path)} cannot be varied; in {root} can {', '.join(keys)}")
    raise ConfigError(
        f"{where}: {quote(path)} is not of the joints or the damping: it would change the reduced basis "
        "or the loads, which all runs of a suite share; vary joints.<name>.<key> or damping.<key>, and run "
        "one suite for each value of the rest"
    )


def si_value(key: VariedKey, value: float | str, name: str, source: str) -> float:
    """A value of a place in SI; infinite for a rigid normal stiffness.

    Raises
    ------
    ConfigError
        for a value that its key would not take.
    """
    if value == "rigid" and key.parameter is not None and key.parameter.rigid:
        return float("inf")
    try:
        converted = _adapter(key).validate_python(value)
    except ValidationError as error:
        message = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise ConfigError(
            f"{source}: suite.parameters.{name}: {key.path}: {message}, got {quote(value)}"
        ) from None
    return float(converted[0] if isinstance(converted, tuple) else converted)


@cache
def _adapter(key: VariedKey) -> TypeAdapter[Any]:
    """Reader of what the key takes."""
    if key.parameter is not None:
        return TypeAdapter(annotation(key.parameter))
    owner = RayleighConfig if key.keys[0] == "rayleigh" else DampingConfig
    field = owner.model_fields[key.keys[-1]]
    kind: Any = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
    return TypeAdapter(kind)


def vary(config: Config, places: Mapping[str, VariedKey], values: Mapping[str, float], source: str) -> Varied:
    """The joints and damping of a configuration with values put in their places.

    Parameters
    ----------
    places, values : by the parameter's name; SI

    Raises
    ------
    ConfigError
        for values that do not fit together.
    """
    raw = {name: joint.model_dump(mode="json") for name, joint in config.every_joint.items()}
    for name, joint in config.every_joint.items():
        raw[name]["law"] = joint.law  # with their files, which are no part of what a configuration says
    damping = config.damping.model_dump(mode="json", exclude_none=True)
    for name, parameter in places.items():
        value = "rigid" if values[name] == float("inf") else float(values[name])
        for section in [raw[joint] for joint in parameter.joints] if parameter.joints else [damping]:
            target = section
            *sections, last = parameter.keys
            for key in sections:
                inner = target.get(key)
                target[key] = dict(inner) if isinstance(inner, dict) else {}
                target = target[key]
            target[last] = value
    stated = ", ".join(f"{name} = {value:g}" for name, value in values.items())
    joints = {
        name: _checked(JointConfig, properties, f"{source}: sample {stated}: joints.{name}")
        for name, properties in raw.items()
    }
    return Varied(joints, _checked(DampingConfig, damping, f"{source}: sample {stated}: damping"))


def _checked(model: type[Section], raw: object, source: str) -> Section:
    """The section that a mapping makes, or its mistakes as a ConfigError."""
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        raise ConfigError(explain(error, source, model)) from None
