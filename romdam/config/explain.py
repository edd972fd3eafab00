"""pydantic's validation errors -> one line per mistake: key, value, limit, remedy."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from romdam.config.quantities import spelt, tangent, unit_of
from romdam.core.errors import quote

Location = tuple[int | str, ...]

_MOST = 20  # mistakes that are told at once
_MOST_MEANT = 1e4  # a number beyond is no percentage, angle or time in ms
_LONGEST = 60  # characters of a key in a message

_KEY = re.compile(r"([A-Za-z_]\w*(?:\.[^\s.:\[\]=]+|\[\d+\])*)(?=:|$| =| must| is| has)")  # begins a message
_OTHERWISE = {  # what keys are called elsewhere
    "density": "rho", "poisson": "nu", "poissons_ratio": "nu", "young": "E", "youngs_modulus": "E",
    "modulus": "E", "dynamic_modulus": "E_dynamic", "mu": "friction", "kn": "normal_stiffness",
    "ks": "shear_stiffness", "step": "dt", "time_step": "finest_step", "reservoir": "water",
    "ground_motion": "records", "dam": "gravity_dam",
}  # fmt: skip
_LIMITS = {  # words, and the bound in the context
    "greater_than": ("must be greater than", "gt"),
    "greater_than_equal": ("must be at least", "ge"),
    "less_than": ("must be less than", "lt"),
    "less_than_equal": ("must be at most", "le"),
}
_KINDS = {  # in the words of a configuration, not of Python
    "path_type": "must be the path of a file",
    "string_type": "must be text",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "tuple_type": "must be a list such as [a, b]",
    "dict_type": "must be a mapping such as {name: value}",
    "model_type": "must be a mapping such as {key: value}",
    "union_tag_not_found": "must be a name, or a mapping that says which, such as {step: detrend}",
}
SHAPES = ("number", "mapping", "list", "word")  # names of a union's branches in pydantic's locations
_REMEDIED = {*_LIMITS, "too_short", "int_parsing", "int_from_float", "tuple_type"}
_REMEDIES = {
    "nu": "concrete has about 0.18, rock 0.2 to 0.3; at 0.5 a solid is incompressible",
    "rho": "concrete has about 2400 kg/m3; a block without mass has `mass: false`, one without weight "
    "`weight: false`",
    "E": "concrete has about 30 GPa",
    "E_dynamic": "concrete has about 35 GPa; leave it out where the record meets E",
    "finest_step": "a step of 1 to 5 ms suits most dams",
    "friction": "concrete joints have about 0.6",
    "ratio": "structural damping is commonly 0.02 to 0.1 (2 % to 10 %)",
    "tolerance": "leave the key out to use the default",
    "normal_stiffness": "`rigid` makes the joint exactly unilateral; leave out a joint that never touches",
    "element_size": "give an edge length above 0, for example 2.5 m",
    "modes": 'give a number of modes per block such as 60, or "all"',
    "records": "name at least one ground motion",
    "gravity": "for example [0, 0, -9.81]",
}
_MISSING = {
    "end": ": beyond which face the channel goes on, for example `end: upstream`, or `closed` within banks",
    "E": ", for example `E: 30 GPa`",
    "nu": ", for example `nu: 0.18`",
    "rho": ", for example `rho: 2400 kg/m3`",
    "dt": ", for example `dt: 0.01 s`",
    "normal_stiffness": ", for example `normal_stiffness: 16 GPa/m` or `rigid`",
    "between": ", for example `between: [left, right]`",
    "records": ", for example `records: [{file: record.txt, unit: g, dt: 0.01 s, components: {y: 1}}]`",
    "model": ", for example `model: {order: reduced, modes: 60}`",
    "water.model": ", for example `model: incompressible`",
    "transient": ", for example `transient: {finest_step: 2.5 ms}`",
    "materials": ", for example `materials: {concrete: {E: 30 GPa, nu: 0.18, rho: 2400 kg/m3}}`",
}


def explain(
    error: ValidationError, source: str, root: type[BaseModel], line: Callable[[Location], int] | None = None
) -> str:
    """Describe every mistake on a line of its own, each naming the file and the key.

    Parameters
    ----------
    line : number of the line of a key in the file, where there is a file
    """
    every: list[dict[str, Any]] = [dict(item) for item in error.errors()]
    every.sort(key=lambda item: item["type"] != "extra_forbidden")  # a misspelt key is the cause of others
    items = [item for item in every if not _follows_from_another(item, every)]
    lines = []
    for item in items[:_MOST]:
        path, owner = _walk(item["loc"], root)
        if path and path[-1] == 0 and _is_of_both(item, every):
            path = path[:-1]
        path, text = _explain_one(item, path, owner)
        at = f":{line(path)}" if line else ""
        lines.append(f"{source}{at}: {text}")
    if len(items) > _MOST:
        lines.append(f"{source}: and {len(items) - _MOST} further mistakes; mend these first")
    return "\n".join(dict.fromkeys(lines))


def key_at(message: str) -> tuple[Location, str]:
    """The key that a message begins with, as a location and as it is written; both empty where none does."""
    match = _KEY.match(message)
    if match is None:
        return (), ""
    words = re.findall(r"[^.\[\]]+", match[1])
    return tuple(int(word) if word.isdigit() else word for word in words), match[1]


def _follows_from_another(item: Mapping[str, Any], items: list[dict[str, Any]]) -> bool:
    """Tell whether the real mistake is told elsewhere.

    A sequence is called too short when an entry is wrong; one number for both directions fails twice; a key
    is missing that is there with a slip of the pen.
    """
    *parent, last = item["loc"] or ("",)
    if item["type"] == "too_short":
        return any(
            len(o["loc"]) > len(item["loc"]) and o["loc"][: len(item["loc"])] == item["loc"] for o in items
        )
    if item["type"] == "missing":
        siblings = [
            o["loc"][-1] for o in items if o["type"] == "extra_forbidden" and [*o["loc"][:-1]] == parent
        ]
        return any(_nearest(str(name), [str(last)]) for name in siblings)
    return last == 1 and any(o["loc"] == (*parent, 0) and o["input"] == item["input"] for o in items)


def _is_of_both(item: Mapping[str, Any], items: list[dict[str, Any]]) -> bool:
    """Tell whether one number for both directions is wrong, whose two copies then are."""
    second = (*item["loc"][:-1], 1)
    return any(o["loc"] == second and o["input"] == item["input"] for o in items)


def _nearest(name: str, known: list[str]) -> str:
    """The known key that a wrong one most likely stands for; empty where none is near."""
    same = [key for key in known if key.lower() == name.lower() or key == _OTHERWISE.get(name.lower())]
    return next(iter([*same, *difflib.get_close_matches(name[:_LONGEST], known, n=1)]), "")


def _explain_one(
    item: Mapping[str, Any], path: Location, owner: type[BaseModel] | None
) -> tuple[Location, str]:
    """The mistake as key, what is wrong, the value, and the remedy; and its location."""
    key, kind, context, value = "", item["type"], item.get("ctx", {}), item["input"]
    for part in path:
        if isinstance(part, int):
            key += f"[{part}]"
        elif part != "[key]":  # on one line, and not all of a long one
            key += f".{part if part.isprintable() and 0 < len(part) <= _LONGEST else quote(part)}"
    key = key.removeprefix(".")
    name = str(next((word for word in reversed(path) if isinstance(word, str)), ""))
    if kind == "extra_forbidden":
        known = sorted(owner.model_fields) if owner is not None else []
        remedy = f"; known here: {', '.join(known)}" if known else ""
        if close := _nearest(name, known):
            remedy = f"; did you mean {close!r}?"
        return path, f"{key} is not a known key{remedy}"
    example = _MISSING.get(key, _MISSING.get(name, ""))
    if kind == "missing":
        return path, f"{key} is missing and has no default; add it{example}"
    if value is None and path:
        return path, f"{key} is empty; fill it{example or ', or leave it out'}"
    unit = ""
    if kind in _LIMITS:
        words, bound = _LIMITS[kind]
        if context[bound] and owner is not None and name in owner.model_fields:
            unit = spelt(_unit(owner.model_fields[name]) or "")
        message = f"{words} {context[bound]:g} {unit}".rstrip()
    elif kind == "too_short":
        message = f"must have at least {context['min_length']} entry"
    elif kind == "too_long":
        message = f"must have at most {context['max_length']} entries"
    elif kind == "union_tag_invalid":
        message = f"no such {context['discriminator'].strip(chr(39))}; known are {context['expected_tags']}"
    elif kind == "tuple_type" and isinstance(value, dict):
        message = "must be a list: begin each of its entries with `- `"
    elif kind in _KINDS:
        message = _KINDS[kind]
    else:
        message = str(item["msg"]).removeprefix("Value error, ").replace("Input should be", "must be")
        message = message[:1].lower() + message[1:]
    # the value, unless the message quotes it or it is a whole section of the file
    quoted = isinstance(value, str) and quote(value) in item["msg"]
    got = f", got {quote(value)}"
    if not isinstance(value, dict | BaseModel) and not quoted and not item["msg"].endswith(got):
        message += got
    inner, written = key_at(message)
    if inner and isinstance(value, Mapping) and inner[0] in value:  # a message of a whole section names a key
        path, key, message = (*path, *inner), f"{key}.{written}".removeprefix("."), message[len(written) :]
        return path, f"{key}{message}"
    remedy = f"; {_REMEDIES[name]}" if kind in _REMEDIED and name in _REMEDIES else ""
    remedy += _meant(kind, name, value, context, unit)
    joint = " " if message.startswith("must ") else ": "
    return path, f"{key}{joint}{message}{remedy}".removeprefix(": ")


def _meant(kind: str, name: str, value: object, context: Mapping[str, Any], unit: str) -> str:
    """What a bare number beyond its bound, or a list that is too long, was probably meant to be."""
    if (
        kind == "too_long"
        and isinstance(value, list)
        and all(isinstance(entry, int | float) for entry in value)
    ):
        return "; is a comma a decimal one? Write a point, 9.81"
    if (
        kind not in ("less_than", "less_than_equal")
        or not isinstance(value, int | float)
        or value > _MOST_MEANT
    ):
        return ""
    if unit == "s" and value >= 1.0:
        return f"; a number without a unit is in s: is `{value:g} ms` meant?"
    if name in ("friction", "friction_static", "mu_s", "mu_d") and (said := tangent(float(value))):
        return f"; {said}"
    if float(value) <= 100.0 and context.get("lt", context.get("le")) <= 1.0 and name != "nu":
        return f"; is `{value:g} %` meant?"
    return ""


def _unit(annotation: Any) -> str | None:
    """The SI unit of the number that a field or an annotation takes; None where it takes none."""
    inner = [*getattr(annotation, "metadata", ()), *get_args(getattr(annotation, "annotation", annotation))]
    if get_origin(annotation) is Annotated:
        inner = [*annotation.__metadata__, annotation.__origin__]
    for part in inner:
        unit = unit_of(getattr(part, "func", None)) if hasattr(part, "func") else _unit(part)
        if unit is not None:
            return unit
    return None


def _walk(loc: Location, root: type[BaseModel]) -> tuple[Location, type[BaseModel] | None]:
    """Follow pydantic's location through the models.

    Returns
    -------
    the location without the parts that name a branch of a union, and the model that owns its last key
    """
    types, path, owner = [root], [], None
    for key in loc:
        step, model = _step(types, key)
        if step is None:  # an unknown key at the end of a location, or the name of a union's branch
            names = {getattr(t, "__name__", "") for t in types}
            if not isinstance(key, str) or key != loc[-1] or not any(_is_model(t) for t in types):
                continue
            if key in names or key in SHAPES or key.startswith(("function-", "literal[", "tuple[")):
                continue
        path.append(key)
        owner = model or next((t for t in types if _is_model(t)), None)
        types = step or []
    return tuple(path), owner


def _step(types: list[Any], key: int | str) -> tuple[list[Any] | None, type[BaseModel] | None]:
    """The types below `key`, and the model that has it as a key; None where `key` leads nowhere."""
    for kind in types:
        if _is_model(kind) and key in kind.model_fields:
            return _leaves(kind.model_fields[key].annotation), kind
        if get_origin(kind) is dict and isinstance(key, str):
            return _leaves(get_args(kind)[1]), None
        if get_origin(kind) is tuple and isinstance(key, int):
            return _leaves(get_args(kind)[0]), None
    return None, None


def _leaves(annotation: Any) -> list[Any]:
    """The alternatives of an annotation, without Annotated and Union around them."""
    origin = get_origin(annotation)
    if origin is Annotated:
        return _leaves(get_args(annotation)[0])
    if origin is Union or type(annotation).__name__ == "UnionType":
        return [leaf for choice in get_args(annotation) for leaf in _leaves(choice)]
    return [annotation]


def _is_model(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel)
