"""Values for named numbers of a configuration: what a suite may vary without a new reduction."""

from __future__ import annotations

import difflib
import fnmatch
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any, TypeVar, get_args

from pydantic import BeforeValidator, TypeAdapter, ValidationError

from romdam.config.base import Model
from romdam.config.effects import EFFECTS
from romdam.config.explain import explain
from romdam.config.job import OF_SAMPLE, Config
from romdam.config.quantities import unit_of
from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.config.sections.joint_laws import annotation
from romdam.config.sections.joints import JointProperties
from romdam.contact.laws import LAWS
from romdam.contact.laws.catalogue import law_order
from romdam.contact.laws.law import Law, Parameter
from romdam.core.errors import ConfigError, Faults, listed, quote

Section = TypeVar("Section", bound=Model)

_UDUNITS = {
    "": "1", "m/s": "m s-1", "N/m": "N m-1", "N/m^3": "N m-3", "N*s/m^3": "N s m-3", "1/s": "s-1",
    "kg/m^3": "kg m-3", "delta_degC": "K", "m^2": "m2",
}  # fmt: skip
_GAP = Parameter("gap", "m", least=-math.inf)
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


Location = tuple[str | int, ...]  # keys that lead to a number; ints count entries of a list


@dataclass(frozen=True)
class VariedKey:
    """A number in a configuration that a suite may vary.

    Attributes
    ----------
    path : as written, such as joints.J3.friction; several with commas between
    locations : keys of a `Config` that lead to each number; where a joint of a dam or a cut is named, it
        stands in `joints`
    joints : names of the joints it stands in; empty for others
    keys : of the joint or of `damping`; the last one elsewhere
    units : of the SI value, UDUNITS
    parameter : what may stand there, of a joint
    owner : section that it stands in; None of a joint
    """

    path: str
    locations: tuple[Location, ...]
    joints: tuple[str, ...]
    keys: tuple[str, ...]
    units: str
    parameter: Parameter | None = None
    owner: type[Model] | None = None

    @property
    def structure(self) -> tuple[str, ...]:
        """Where it stands in materials, water, loads or attachments; empty for joints and damping."""
        return () if self.joints or self.locations[0][0] == "damping" else tuple(map(_dotted, self.locations))

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
    config : the configuration with its values
    structure : place in the configuration -> its value, of materials, levels and temperatures
    """

    config: Config
    structure: dict[str, float]


def _dotted(location: Location) -> str:
    return ".".join(map(str, location))


def _structure_places(config: Config) -> dict[Location, float]:
    """Every number of the materials, the water, the loads and what is attached that a suite may vary; SI."""
    places: dict[Location, float] = {
        ("materials", name, key): float(getattr(material, key))
        for name, material in config.materials.items()
        for key in ("E", "E_dynamic", "rho")
        if getattr(material, key) is not None
    }
    places |= {
        ("materials", name, "damping", key): float(getattr(material.damping, key))
        for name, material in config.materials.items()
        for key in ("ratio", "alpha", "beta")
        if getattr(material.damping, key, None) is not None
    }
    if config.water is not None:
        places["water", "level"] = config.water.level
    for section in ("hydrostatic", "joint_water"):
        for k, load in enumerate(getattr(config.loads, section)):
            places["loads", section, k, "level"] = load.level
    for k, temperature in enumerate(config.loads.temperature):
        if temperature.change is not None:
            places["loads", "temperature", k, "change"] = temperature.change
    for effect in EFFECTS.values():
        for name, entry in getattr(config, effect.key).items() if effect.varies else ():
            given = {key: getattr(entry, key) for key in effect.varies}
            places |= {(effect.key, name, key): x for key, x in given.items() if x is not None}
    return places


def varied_paths(config: Config) -> tuple[str, ...]:
    """Every path of a configuration that a suite may vary, those of keys that are at their defaults too."""
    joints = (f"{place}.{key}" for place, names in config.joint_places.items()
              for key in _keys_of_all(config, names))  # fmt: skip
    damping = (f"damping.{key}" for key in _DAMPING)
    return (*joints, *damping, *map(_dotted, _structure_places(config)))


def joints_at(config: Config, path: str) -> tuple[str, ...]:
    """The joints in which a path names a key, in the order of the configuration; empty where it names none.

    Parameters
    ----------
    path : of a joint's key, with * and ? for parts of names, or of what a dam or a cut makes its joints of
    """
    places = config.joint_places
    names = {name for place in _sections_at(config, path) for name in places[place]}
    return tuple(name for name in config.every_joint if name in names)


def _sections_at(config: Config, path: str) -> list[str]:
    """The sections of joints' keys in which a path names one; empty where it names none."""
    section, _ = _section(config, path)
    places = config.joint_places
    if section is None:
        return []
    return [section] if section in places else [p for p in places if fnmatch.fnmatchcase(p, section)]


def _location_of(section: str) -> Location:
    """The keys that lead to a section of joints' keys, whose names may have points."""
    root, _, rest = section.partition(".")
    if root == "joints":
        return root, rest
    return (root, *((rest.removesuffix(".joints"), "joints") if root == "cut" else rest.split(".")))


def _section(config: Config, path: str) -> tuple[str | None, str]:
    """A path as the section of a joint's keys, None where it ends in none of them, and the key."""
    # shear_key.depth before a key `depth`
    fields = sorted({key for joint in config.every_joint for key in _joint_keys(config, joint)} | {*_JOINT},
                    key=lambda key: (-len(key), key))  # fmt: skip
    field = next((key for key in fields if path.endswith(f".{key}")), "")
    return (path.removesuffix(f".{field}") if field else None), field


def _joint_keys(config: Config, joint: str) -> dict[str, Parameter]:
    """Every key of a joint that can be varied, those of its user's laws too."""
    users = {user.law for user in config.every_joint[joint].law}
    return {**_JOINT, **_places(sorted(users, key=law_order))}


def _keys_of_all(config: Config, joints: Iterable[str]) -> list[str]:
    """The keys that each of some joints has."""
    first, *others = (_joint_keys(config, joint) for joint in joints)
    return [key for key in first if all(key in keys for keys in others)]


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
        for what changes the reduced basis, unknown joints and keys, several paths of different keys, and a
        key that is another number in each of several joints' laws.
    """
    where = f"{source}: suite.parameters.{name}.path"
    paths = (paths,) if isinstance(paths, str) else paths
    fields, joints, locations = list[str](), list[str](), list[Location]()
    known = {_dotted(place): place for place in _structure_places(config)}
    places = [known[text] for text in known if any(fnmatch.fnmatchcase(text, path) for path in paths)]
    if places and all(fnmatch.filter(known, path) for path in paths):
        return _structure_key(config, paths, places, where)
    for path in paths:
        root, _, rest = path.partition(".")
        if root == "damping" and rest in _DAMPING and len(paths) == 1:
            keys = tuple(rest.split("."))
            return VariedKey(path, ((root, *keys),), (), keys, _DAMPING[rest])
        section, field = _section(config, path)
        sections = _sections_at(config, path)
        if not sections:
            raise ConfigError(f"{where}: {_why_not(config, path, section)}")
        fields.append(field)
        joints += joints_at(config, path)
        locations += [(*_location_of(each), *field.split(".")) for each in sections]
    if len(set(fields)) > 1:
        raise ConfigError(
            f"{where}: the paths of a list have one key, got {listed(set(fields))}; make a "
            "parameter of each key"
        )
    ordered = tuple(joint for joint in config.every_joint if joint in joints)
    parameter = _one_parameter(config, ordered, fields[0], where)
    units = _UDUNITS.get(parameter.unit, parameter.unit)
    at = tuple(dict.fromkeys(locations))
    return VariedKey(", ".join(paths), at, ordered, tuple(fields[0].split(".")), units, parameter)


def _one_parameter(config: Config, joints: Sequence[str], key: str, where: str) -> Parameter:
    """What may stand at a key of some joints, which is the same for all."""
    parameters = {joint: _joint_keys(config, joint).get(key) for joint in joints}
    if without := [joint for joint, parameter in parameters.items() if parameter is None]:
        raise ConfigError(
            f"{where}: {key!r} belongs to a law that {listed(without)} of the joints does not have; name the "
            "joints that have it"
        )
    (first, parameter), *others = ((joint, p) for joint, p in parameters.items() if p is not None)
    for joint, other in others:
        if replace(other, meaning="", default=None) != replace(parameter, meaning="", default=None):
            raise ConfigError(
                f"{where}: {key!r} is of different laws in joints {first} and {joint}, with other units or "
                "limits; make a parameter of each"
            )
    return parameter


def _structure_key(config: Config, paths: Sequence[str], places: Sequence[Location], where: str) -> VariedKey:
    """A number of the materials, or levels of the water, which vary together where they are one."""
    (key, *others) = dict.fromkeys(str(place[-1]) for place in places)
    if others:
        raise ConfigError(
            f"{where}: the paths of a list have one key, got {listed([key, *others])}; make a parameter of "
            "each key"
        )
    if key == "level":
        values = _structure_places(config)
        levels = {values[place] for place in places}
        left = [p for p, value in values.items() if p[-1] == key and value in levels and p not in places]
        if left:
            raise ConfigError(
                f"{where}: {_dotted(left[0])} is at the same {values[left[0]]:g} m and would not follow; "
                "name it too, as path: [" + ", ".join(map(_dotted, [*places, *left])) + "]"
            )
        water = config.water
        if ("water", "level") in places and water is not None and (water.mesh is not None or water.has_waves):
            what = "the mesh of the reservoir ends at it" if water.mesh else "its waves are reduced for it"
            raise ConfigError(
                f"{where}: water.level cannot be varied, as {what}; take water.model: incompressible or "
                "westergaard without a mesh, or run one suite for each level"
            )
    owner = _section_of(config, places[0])
    return VariedKey(", ".join(paths), tuple(places), (), (key,), _units(owner, key), owner=owner)


def _section_of(config: Config, location: Location) -> type[Model]:
    """The section that a number stands in."""
    section: Any = config
    for key in location[:-1]:
        section = getattr(section, str(key)) if isinstance(section, Model) else section[key]
    assert isinstance(section, Model)
    return type(section)


def _units(owner: type[Model], key: str) -> str:
    """Units of a number of a section, UDUNITS."""
    unit = _unit_within(_kind(owner, key))
    assert unit is not None
    return _UDUNITS.get(unit, unit)


def _unit_within(kind: Any) -> str | None:
    """The unit that a type converts to; of a union that of its first quantity."""
    marks = getattr(kind, "__metadata__", ())
    units = (unit_of(mark.func) for mark in marks if isinstance(mark, BeforeValidator))
    inner = (_unit_within(one) for one in get_args(kind) if one not in marks)
    return next((unit for unit in (*units, *inner) if unit is not None), None)


def _kind(owner: type[Model], key: str) -> Any:
    """The type of a key of a section."""
    field = owner.model_fields[key]
    return Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation


def refuse_unvaried(config: Config, source: str) -> None:
    """Refuse parameters of a suite whose path cannot be varied, or whose key does not take a value.

    Raises
    ------
    ConfigError
        as `find_varied_key` and `si_value` do.
    """
    faults = Faults()
    for name, parameter in ({} if config.suite is None else config.suite.parameters).items():
        with faults.gathered():
            key = find_varied_key(config, parameter.paths, name, source)
            every = (
                *(parameter.values or ()),
                parameter.low,
                parameter.high,
                parameter.mean,
                parameter.median,
            )
            for value in every:
                if value is not None:
                    si_value(key, value, name, source)
    faults.raise_together()


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
        known_keys = dict.fromkeys(key for joint in config.every_joint for key in _joint_keys(config, joint))
        keys = [f"joints.<name>.{key}" for key in known_keys or _JOINT] if root == "joints" else [*_DAMPING]
        near = difflib.get_close_matches(path.split(".")[-1], [key.split(".")[-1] for key in keys], n=1)
        meant = f"; did you mean {near[0]!r}?" if near else ""
        return f"{quote(path)} cannot be varied; in {root} can {', '.join(keys)}{meant}"
    return (
        f"{quote(path)} is not of the joints or the damping: it would change the reduced basis "
        "or the loads, which all runs of a suite share; vary joints.<name>.<key>, damping.<key>, "
        "materials.<name>.E, .E_dynamic, .rho or .damping.ratio, anchors.<name>.pretension, "
        "masses.<name>.mass, water.level, loads.hydrostatic.<number>.level, "
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
    of_damping = RayleighConfig if key.keys[0] == "rayleigh" else DampingConfig
    return TypeAdapter(_kind(key.owner or of_damping, key.keys[-1]))


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
    changes = dict[Location, float | str]()
    for name, key in places.items():
        value = "rigid" if values[name] == float("inf") else float(values[name])
        changes |= dict.fromkeys(key.locations, value)
    # joints that a dam or a cut makes and that are named stand beside the section that makes them
    named = {str(at[1]) for at in changes if at[0] == "joints"} - {*config.joints}
    if named:
        every = config.every_joint
        config = config.model_copy(update={"joints": config.joints | {name: every[name] for name in named}})
    stated = ", ".join(f"{name} = {value:g}" for name, value in values.items())
    structure = {place: float(values[name]) for name, key in places.items() for place in key.structure}
    return Varied(replace_values(config, changes, f"{source}: sample {stated}"), structure)


def replace_values(
    model: Section, changes: Mapping[Location, object], source: str, at: Location = ()
) -> Section:
    """A frozen model with values at the ends of paths; every model on the way is validated, the whole last.

    What is not on the way stays the object that it is. A section that is not there is begun.

    Parameters
    ----------
    changes : path -> value, all at once
    source : of the model, for messages
    at : path of this model in the whole

    Raises
    ------
    ConfigError
        for values that do not fit together.
    """
    by_key = dict[str | int, dict[Location, object]]()
    for (key, *rest), value in changes.items():
        location = (
            (*_to_user_law(model, str(key)), *rest) if isinstance(model, JointProperties) else (key, *rest)
        )
        by_key.setdefault(location[0], {})[location[1:]] = value
    values = {name: getattr(model, name) for name in model.model_fields_set}
    plain = {name for name, value in values.items() if name not in by_key and not _holds_models(value)}
    raw: dict[str, object] = values | model.model_dump(mode="json", include=plain)
    for key, inner in by_key.items():
        raw[str(key)] = _replaced(getattr(model, str(key)), inner, source, (*at, key))
    try:
        return type(model).model_validate(raw, context={"si": True, OF_SAMPLE: True})
    except ValidationError as error:
        where = f"{source}: {_dotted(at)}" if at else source
        raise ConfigError(explain(error, where, type(model))) from None


def _replaced(value: object, changes: Mapping[Location, object], source: str, at: Location) -> object:
    """What stands at a key, with values at the ends of paths from there."""
    if () in changes:
        return changes[()]
    if isinstance(value, Model):
        return replace_values(value, changes, source, at)
    entries: dict[str | int, object] = {}
    if isinstance(value, Mapping):
        entries = dict(value)
    elif isinstance(value, tuple):
        entries = dict(enumerate(value))
    for key in dict.fromkeys(location[0] for location in changes):
        inner = {location[1:]: each for location, each in changes.items() if location[0] == key}
        entries[key] = _replaced(entries.get(key), inner, source, (*at, key))
    return tuple(entries.values()) if isinstance(value, tuple) else entries


def _holds_models(value: object) -> bool:
    if isinstance(value, Mapping):
        return any(_holds_models(each) for each in value.values())
    return isinstance(value, Model) or (isinstance(value, tuple) and any(map(_holds_models, value)))


def _to_user_law(joint: JointProperties, key: str) -> Location:
    """The path to a key of a joint: one of a user's law stands in `law`."""
    number = next((k for k, user in enumerate(joint.law) if key in user.values), None)
    return (key,) if number is None else ("law", number, "values", key)
