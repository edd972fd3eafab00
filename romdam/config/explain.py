"""pydantic's validation errors -> one line per mistake: key, value, limit, remedy."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from romdam.core.errors import quote

Location = tuple[int | str, ...]

_MOST = 20  # mistakes that are told at once
_LONGEST = 60  # characters of a key in a message

_LIMITS = {
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
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
_REMEDIED = {*_LIMITS, "too_short", "int_parsing", "int_from_float"}
_REMEDIES = {
    "nu": "concrete has about 0.18, rock 0.2 to 0.3; at 0.5 a solid is incompressible",
    "rho": "concrete has about 2400 kg/m3; a block without mass has `mass: false`, one without weight "
    "`weight: false`",
    "E": "concrete has about 30 GPa",
    "finest_step": "a step of 1 to 5 ms suits most dams",
    "friction": "concrete joints have about 0.6",
    "ratio": "structural damping is commonly 0.02 to 0.1 (2 % to 10 %)",
    "tolerance": "leave the key out to use the default",
    "normal_stiffness": "`rigid` makes the joint exactly unilateral; leave out a joint that never touches",
    "element_size": "give an edge length above 0, for example 2.5 m",
    "modes": 'give a number of modes per block such as 60, or "all"',
    "records": "name at least one ground motion",
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
    items: list[dict[str, Any]] = [dict(item) for item in error.errors()]
    shown_items, lines = items[:_MOST], []
    for item in (item for item in shown_items if not _follows_from_another(item, shown_items)):
        path, owner = _walk(item["loc"], root)
        at = f":{line(path)}" if line else ""
        lines.append(f"{source}{at}: {_explain_one(item, path, owner)}")
    if len(items) > _MOST:
        lines.append(f"{source}: and {len(items) - _MOST} further mistakes; mend these first")
    return "\n".join(dict.fromkeys(lines))


def _follows_from_another(item: Mapping[str, Any], items: list[dict[str, Any]]) -> bool:
    """Tell whether the real mistake is told elsewhere.

    A sequence is called too short when an entry is wrong; one number for both directions fails twice.
    """
    *parent, last = item["loc"] or ("",)
    if item["type"] == "too_short":
        return any(
            len(o["loc"]) > len(item["loc"]) and o["loc"][: len(item["loc"])] == item["loc"] for o in items
        )
    first = (*parent, 0)
    return last == 1 and any(o["loc"] == first and o["input"] == item["input"] for o in items)


def _explain_one(item: Mapping[str, Any], path: Location, owner: type[BaseModel] | None) -> str:
    """The mistake as key, what is wrong, the value, and the remedy."""
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
        if close := difflib.get_close_matches(name[:_LONGEST], known, n=1):
            remedy = f"; did you mean {close[0]!r}?"
        return f"{key} is not a known key{remedy}"
    if kind == "missing":
        return f"{key} is missing and has no default; add it{_MISSING.get(key, _MISSING.get(name, ''))}"
    if kind in _LIMITS:
        message = _LIMITS[kind].format(**context)
    elif kind == "too_short":
        message = f"must have at least {context['min_length']} entry"
    elif kind == "union_tag_invalid":
        message = f"no such {context['discriminator'].strip(chr(39))}; known are {context['expected_tags']}"
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
    remedy = f"; {_REMEDIES[name]}" if kind in _REMEDIED and name in _REMEDIES else ""
    joint = " " if message.startswith("must ") else ": "
    return f"{key}{joint}{message}{remedy}".removeprefix(": ")


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
