"""Values for named numbers of a configuration: what a suite may vary without a new reduction."""

from __future__ import annotations

import difflib
import fnmatch
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from romdam.config.base import Model
from romdam.config.explain import explain
from romdam.config.sections.job import Config, DampingConfig, MaterialConfig, RayleighConfig
from romdam.config.sections.joint_laws import annotation
from romdam.config.sections.joints import JointConfig
from romdam.config.sections.loads import TemperatureConfig
from romdam.config.sections.water import WaterConfig
from romdam.contact.laws import LAWS
from romdam.contact.laws.catalogue import law_order
from romdam.contact.laws.law import Law, Parameter
from romdam.core.errors import ConfigError, listed, quote

Section = TypeVar("Section", bound=Model)

_UDUNITS = {"": "1", "m/s": "m s-1", "N/m": "N m-1", "N/m^3": "N m-3", "N*s/m^3": "N s m-3", "1/s": "s-1"}
_GAP = Parameter("gap", "m", least=-math.inf)
_STRUCTURE = {"E": "Pa", "rho": "kg m-3", "level": "m", "change": "K"}
_OWNERS: dict[str, type[Model]] = {"level": WaterConfig, "change": TemperatureConfig}
_DAMPING = {"rayleigh.ratio": "1", "rayleigh.alpha": "s-1", "rayleigh.beta": "s", "modal": "1"}


def _places(laws: Iterable[type[Law]]) -> dict[str, Parameter]:
    """Keys that laws add to a joint, dotted within, and what may stand there."""
    keys = {}
    for law in laws:
        for parameter in law.parameters:
            if parameter.unit != "axes" and not parameter.choices:
                keys[f"{law.section}.{parameter.name}".removeprefix(".")] = parameter
            if parameter.per_gap:
                keys[f"{parameter.name}.per_gap"] = replace(parameter, unit=parameter.per_gap, rigid=False)
    return keys


_FIELD = {
    "field.seed": Parameter("seed", ""),
    "field.coefficient_of_variation": Parameter("coefficient_of_variation", "", above=True),
    "field.length": Parameter("length", "m", above=True),
}
_JOINT = {**_places(LAWS), "gap": _GAP, **_FIELD}


@dataclass(frozen=True)
class VariedKey:
    """A number in a configuration that a suite may vary.

    Attributes
    ----------
    path : as written, such as joints.J3.friction; several with commas between
    joints : names of the joints it stands in; empty for damping
    keys : of the joint or of `damping`
    units : of the SI value, UDUNITS
    parameter : what may stand there, of a joint
    structure : where it stands in materials, water or loads; empty for joints and damping
    """

    path: str
    joints: tuple[str, ...]
    keys: tuple[str, ...]
    units: str
    parameter: Parameter | None = None
    structure: tuple[str, ...] = ()

    @property
    def is_load(self) -> bool:
        """Tell whether it changes a load, a level of water or a temperature."""
        return bool(self.structure) and self.keys[0] in ("level", "change")

    @property
    def is_level(self) -> bool:
        """Tell whether it is a level of water."""
        return bool(self.structure) and self.keys == ("level",)


@dataclass(frozen=True)
class Varied:
    """One sample.

    Attributes
    ----------
    joints, damping : its joints and its damping
    config : the configuration with its materials and levels
    structure : place in the configuration -> its value, of these
    """

    joints: dict[str, JointConfig]
    damping: DampingConfig
    config: Config
    structure: dict[str, float]


def structure_places(config: Config) -> dict[str, float]:
    """Every number of the materials, the water and the loads that a suite may vary, by its path; SI."""
    places = {
        f"materials.{name}.{key}": float(getattr(material, key))
        for name, material in config.materials.items()
        for key in ("E", "rho")
    }
    if config.water is not None:
        places["water.level"] = config.water.level
    for section in ("hydrostatic", "joint_water"):
        for k, load in enumerate(getattr(config.loads, section)):
            places[f"loads.{section}.{k}.level"] = load.level
    for k, temperature in enumerate(config.loads.temperature):
        if temperature.change is not None:
            places[f"loads.temperature.{k}.change"] = temperature.change
    return places


def joints_at(config: Config, path: str) -> tuple[str, ...]:
    """The joints in which a path names a key, in the order of the configuration; empty where it names none.

    Parameters
    ----------
    path : of a joint's key, with * and ? for parts of names, or of what a dam or a cut makes its joints of
    """
    section, _ = _section(config, path)
    if section is None:
        return ()
    places = config.joint_places
    matching = (
        [section] if section in places else [place for place in places if fnmatch.fnmatchcase(place, section)]
    )
    names = {name for place in matching for name in places[place]}
    return tuple(name for name in config.every_joint if name in names)


def _section(config: Config, path: str) -> tuple[str | None, str]:
    """A path as the section of a joint's keys, None where it ends in none of them, and the key."""
    fields = sorted(_joint_keys(config), key=len, reverse=True)  # shear_key.depth before a key `depth`
    field = next((key for key in fields if path.endswith(f".{key}")), "")
    return (path.removesuffix(f".{field}") if field else None), field


def _joint_keys(config: Config) -> dict[str, Parameter]:
    """Every key of a joint that can be varied, those of a user's laws too."""
    users = {user.law for properties in config.every_joint.values() for user in properties.law}
    return {**_JOINT, **_places(sorted(users, key=law_order))}


def find_varied_key(config: Config, paths: str | Sequence[str], name: str, source: str) -> VariedKey:
    """Find what the path of a parameter, or each of several, names.

    Parameters
    ----------
    paths : such as joints.J3.friction, joints.base_*.friction or gravity_dam.joints.base.friction; what they
        name has one value
    name, source : of the parameter and of the configuration's file, for messages

    Raises
    ------
    ConfigError
        for what changes the reduced basis, unknown joints and keys, and several paths of different keys.
    """
    where = f"{source}: suite.parameters.{name}.path"
    paths = (paths,) if isinstance(paths, str) else paths
    fields, joints = list[str](), list[str]()
    known = structure_places(config)
    places = [place for place in known if any(fnmatch.fnmatchcase(place, path) for path in paths)]
    if places and all(fnmatch.filter(places, path) for path in paths):
        return _structure_key(config, paths, places, where)
    for path in paths:
        root, _, rest = path.partition(".")
        if root == "damping" and rest in _DAMPING and len(paths) == 1:
            return VariedKey(path, (), tuple(rest.split(".")), _DAMPING[rest])
        section, field = _section(config, path)
        named = joints_at(config, path)
        if not named:
            raise ConfigError(f"{where}: {_why_not(config, path, section)}")
        fields.append(field)
        joints += named
    if len(set(fields)) > 1:
        raise ConfigError(
            f"{where}: the paths of a list have one key, got {listed(set(fields))}; make a "
            "parameter of each key"
        )
    parameter = _joint_keys(config)[fields[0]]
    units = _UDUNITS.get(parameter.unit, parameter.unit)
    ordered = tuple(joint for joint in config.every_joint if joint in joints)
    return VariedKey(", ".join(paths), ordered, tuple(fields[0].split(".")), units, parameter)


def _structure_key(config: Config, paths: Sequence[str], places: Sequence[str], where: str) -> VariedKey:
    """A number of the materials, or levels of the water, which vary together where they are one."""
    (key, *others) = dict.fromkeys(place.rpartition(".")[2] for place in places)
    if others:
        raise ConfigError(
            f"{where}: the paths of a list have one key, got {listed([key, *others])}; make a parameter of "
            "each key"
        )
    if key == "level":
        values = structure_places(config)
        levels = {values[place] for place in places}
        left = [
            p for p, value in values.items() if p.endswith(".level") and value in levels and p not in places
        ]
        if left:
            raise ConfigError(
                f"{where}: {left[0]} is at the same {values[left[0]]:g} m and would not follow; name it too, "
                "as path: [" + ", ".join([*places, *left]) + "]"
            )
        water = config.water
        if "water.level" in places and water is not None and (water.mesh is not None or water.has_waves):
            what = "the mesh of the reservoir ends at it" if water.mesh else "its waves are reduced for it"
            raise ConfigError(
                f"{where}: water.level cannot be varied, as {what}; take water.model: incompressible or "
                "westergaard without a mesh, or run one suite for each level"
            )
    return VariedKey(", ".join(paths), (), (key,), _STRUCTURE[key], None, tuple(places))


def refuse_unvaried(config: Config, source: str) -> None:
    """Refuse parameters of a suite whose path cannot be varied, or whose key does not take a value.

    Raises
    ------
    ConfigError
        as `find_varied_key` and `si_value` do.
    """
    for name, parameter in ({} if config.suite is None else config.suite.parameters).items():
        key = find_varied_key(config, parameter.paths, name, source)
        every = (*(parameter.values or ()), parameter.low, parameter.high, parameter.mean, parameter.median)
        for value in every:
            if value is not None:
                si_value(key, value, name, source)


def _why_not(config: Config, path: str, section: str | None) -> str:
    """Say what is wrong with a path that names no number which can be varied."""
    root = path.split(".")[0]
    if section is not None and root in ("joints", "gravity_dam", "arch_dam", "cut"):
        every = config.joint_places
        near = difflib.get_close_matches(section, every, n=3)
        meant = f"; did you mean {' or '.join(repr(place) for place in near)}?" if near else ""
        if root == "joints":
            joint, known = section.removeprefix("joints."), config.every_joint
            what = "is like" if "*" in joint or "?" in joint else "is"
            return f"no joint {what} {quote(joint)}; defined are {listed(known)}{meant}"
        return f"no joints are made of {quote(section)}; joints are of {listed(every)}{meant}"
    if root in ("joints", "damping"):
        keys = [f"joints.<name>.{key}" for key in _joint_keys(config)] if root == "joints" else [*_DAMPING]
        near = difflib.get_close_matches(path.split(".")[-1], [key.split(".")[-1] for key in keys], n=1)
        meant = f"; did you mean {near[0]!r}?" if near else ""
        return f"{quote(path)} cannot be varied; in {root} can {', '.join(keys)}{meant}"
    return (
        f"{quote(path)} is not of the joints or the damping: it would change the reduced basis "
        "or the loads, which all runs of a suite share; vary joints.<name>.<key>, damping.<key>, "
        "materials.<name>.E or .rho, water.level, loads.hydrostatic.<number>.level, "
        "loads.joint_water.<number>.level or loads.temperature.<number>.change (of no table), and run one "
        "suite for each value of the rest"
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
    owner: type[Model] = RayleighConfig if key.keys[0] == "rayleigh" else DampingConfig
    if key.structure:
        owner = _OWNERS.get(key.keys[0], MaterialConfig)
    field = owner.model_fields[key.keys[-1]]
    kind: Any = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
    return TypeAdapter(kind)


def vary(config: Config, places: Mapping[str, VariedKey], values: Mapping[str, float], source: str) -> Varied:
    """A configuration with values put in their places.

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
    structure = {
        place: float(values[name]) for name, parameter in places.items() for place in parameter.structure
    }
    for name, parameter in places.items():
        if parameter.structure:
            continue
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
    checked = _checked(DampingConfig, damping, f"{source}: sample {stated}: damping")
    return Varied(joints, checked, _with_structure(config, structure), structure)


def _with_structure(config: Config, structure: Mapping[str, float]) -> Config:
    """The configuration with other materials, levels and temperatures."""
    if not structure:
        return config
    materials, loads, water = dict(config.materials), config.loads, config.water
    for place, value in structure.items():
        section, _, rest = place.partition(".")
        name, _, key = rest.rpartition(".")  # a material's name may have a point
        if section == "materials":
            materials[name] = materials[name].model_copy(update={key: value})
        elif section == "water":
            assert water is not None
            water = water.model_copy(update={"level": value})
        else:
            kind, number = name.split(".")
            entries = list(getattr(loads, kind))
            entries[int(number)] = entries[int(number)].model_copy(update={key: value})
            loads = loads.model_copy(update={kind: tuple(entries)})
    return config.model_copy(update={"materials": materials, "loads": loads, "water": water})


def _checked(model: type[Section], raw: object, source: str) -> Section:
    """The section that a mapping makes, or its mistakes as a ConfigError."""
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        raise ConfigError(explain(error, source, model)) from None
