"""The configuration as a JSON schema, by which editors complete, explain and check YAML.

It knows every key, type, choice and bound that stands by itself; what depends on several keys, on files or on
the dimension of a unit is known to `romdam check` alone.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from romdam.config.base import Model
from romdam.config.job import Config
from romdam.config.quantities import needs_unit, spelt, unit_of
from romdam.config.sections.joint_laws import both
from romdam.config.sections.joints import TOUCHING, unlike_pairs
from romdam.config.sections.motions.correction import CHAINS, bare_step, named_chain
from romdam.config.texts import meaning, model_docstring

_WITH_UNIT = r"^\s*[+−-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*(1/)?[A-Za-zµ°%][A-Za-zµ°%0-9²³⁴⁻¹·⋅^*/ -]*$"
_QUANTITY = r"^\s*[+−-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*((1/)?[A-Za-zµ°%][A-Za-zµ°%0-9²³⁴⁻¹·⋅^*/ -]*)?$"


_UNIT = "unit"  # a word of ours in the schema, which validators pass over
_IN_WORDS = {
    "minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most", "exclusiveMaximum": "below",
}  # fmt: skip
_BOUNDS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


class _Generator(GenerateJsonSchema):
    """With units, texts of the keys, and quantities that are numbers or texts such as "2.5 ms"."""

    def function_before_schema(self, schema: core_schema.BeforeValidatorFunctionSchema) -> JsonSchemaValue:
        generated = super().function_before_schema(schema)
        function = schema["function"]["function"]
        unit = unit_of(function)
        if function is unlike_pairs:  # one name stands for other keys
            either = generated["additionalProperties"]["oneOf"]
            said = {"default": None, "description": "All joints between blocks that touch."}
            return generated | {
                "properties": {TOUCHING: {"anyOf": either} | said},
                "additionalProperties": either[0],
            }
        if unit is None:
            return (
                {"anyOf": [*_SHORT_FORMS[function](generated), generated]}
                if function in _SHORT_FORMS
                else generated
            )
        if needs_unit(function):
            return {"type": "string", "pattern": _WITH_UNIT, _UNIT: spelt(unit)}
        text = {"type": "string", "pattern": _QUANTITY, _UNIT: spelt(unit)}
        return {"anyOf": [generated, text]}

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        generated, model = super().model_schema(schema), schema["cls"]
        if not issubclass(model, Model):
            return generated
        generated["description"] = model_docstring(model)
        for name, key in generated.get("properties", {}).items():
            key.pop("title", None)
            if (empty := model.model_fields[name].default_factory) in (dict, list):
                key["default"] = empty()
            unit = "".join(dict.fromkeys(f" [{unit_word}]" for unit_word in _units(key)))
            key["description"] = f"{meaning(model, name)}{unit}"
        if "law" in generated.get("properties", {}):  # whose keys only the file of a user's law knows
            known = list(generated["properties"])
            generated["properties"]["law"] |= {"type": ["string", "array", "object"]}
            generated.pop("additionalProperties", None)
            generated["anyOf"] = [{"required": ["law"]}, {"propertyNames": {"enum": known}}]
        return {"anyOf": [generated, model.short_form]} if model.short_form else generated


def _units(node: Any) -> Iterator[str]:
    """Units of the quantities of a key."""
    if isinstance(node, dict) and node.get(_UNIT):
        yield node[_UNIT]
    inner = node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    for member in inner:
        yield from _units(member)


def _of_one_direction(pair: JsonSchemaValue) -> list[JsonSchemaValue]:
    return [pair["prefixItems"][0]]


def _names_of_steps(step: JsonSchemaValue) -> list[JsonSchemaValue]:
    """A step by its name, or {name: options}."""
    steps = step["discriminator"]["mapping"]
    options = {name: {"anyOf": [{"$ref": at}, {"type": "null"}]} for name, at in steps.items()}
    named = {"type": "object", "properties": options, "additionalProperties": False, "maxProperties": 1}
    return [{"enum": list(steps)}, named]


def _names_of_chains(_: JsonSchemaValue) -> list[JsonSchemaValue]:
    return [{"enum": [*CHAINS, "none", None]}]


_SHORT_FORMS: dict[Any, Callable[[JsonSchemaValue], list[JsonSchemaValue]]] = {
    both: _of_one_direction,
    bare_step: _names_of_steps,
    named_chain: _names_of_chains,
}


def schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of a configuration file."""
    generated = Config.model_json_schema(schema_generator=_Generator, mode="validation")
    whole = _describe_limits(_bounded(generated))
    return {"$schema": GenerateJsonSchema.schema_dialect, **whole, "title": "romdam configuration"}


def schema_text() -> str:
    """The schema as the text of its file."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


def _describe_limits(node: Any) -> Any:
    """With the bounds and the default of every key below its sentence: editors show the text alone."""
    if isinstance(node, list):
        return [_describe_limits(member) for member in node]
    if not isinstance(node, dict):
        return node
    node = {name: _describe_limits(member) for name, member in node.items()}
    for name, key in node.get("properties", {}).items() if "description" in node else ():
        value = key.get("default")
        default = "required" if name in node.get("required", ()) else ""
        if value not in (None, "", [], {}) and not isinstance(value, dict):
            default = f"default {plain(value)}"
        if remark := ", ".join([*limits(key), *([default] if default else [])]):
            key["description"] += f"\n\n{remark[:1].upper()}{remark[1:]}."
    return node


def limits(key: dict[str, Any]) -> list[str]:
    """Bounds of a key's number in words, also of one that may be left out."""
    branches = [
        key,
        *(branch for branch in key.get("anyOf", ()) if "anyOf" in branch or branch.get("type") != "null"),
    ]
    # each of several has bounds of its own
    if len(branches) > 2 and not any("unit" in branch for branch in branches):
        branches = [key]
    bounds = {
        word: branch[bound] for branch in branches for bound, word in _IN_WORDS.items() if bound in branch
    }
    if bounds.get("above", math.inf) < bounds.get("at least", -math.inf):
        del bounds["above"]
    return [f"{word} {value:g}" for word, value in bounds.items()]


def plain(value: object) -> str:
    """A default as one writes it."""
    if isinstance(value, list):
        return "[" + ", ".join(plain(member) for member in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def _bounded(node: Any) -> Any:
    """With bounds in the words of JSON schema; pydantic leaves them where a number may be text."""
    if isinstance(node, list):
        return [_bounded(member) for member in node]
    if not isinstance(node, dict):
        return node
    return {
        _BOUNDS.get(key, key) if isinstance(value, int | float) else key: _bounded(value)
        for key, value in node.items()
    }
