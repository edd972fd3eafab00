"""The schema tells an editor of every key what it is: a sentence, its unit, default and bounds."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import annotated_types
import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from romdam.config.job import Config
from romdam.config.quantities import spelt, unit_of
from romdam.config.schema import schema
from romdam.config.yaml_text import read_yaml

ROOT = Path(__file__).parents[2]
SCHEMA = ROOT / "configs" / "romdam.schema.json"
CONFIGS = sorted((ROOT / "configs").rglob("*.yaml"))
WORDS = {"Gt": "above", "Ge": "at least", "Lt": "below", "Le": "at most"}


def keys() -> Iterator[tuple[str, dict[str, Any], bool]]:
    """Name, node and whether it is required, of every key of every mapping that is a model's."""

    def mappings(node: Any, name: str) -> Iterator[tuple[str, dict[str, Any]]]:
        if isinstance(node, dict) and "properties" in node and "description" in node:
            yield name, node
        else:
            for one in node.get("anyOf", ()) if isinstance(node, dict) else ():
                yield from mappings(one, name)

    whole = schema()
    for name, definition in {"Config": whole, **whole["$defs"]}.items():
        for _, mapping in mappings(definition, name):
            for key, node in mapping["properties"].items():
                yield f"{name}.{key}", node, key in mapping.get("required", ())


KEYS = list(keys())


def models(annotation: Any, found: set[type[BaseModel]]) -> set[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel) and annotation not in found:
        found.add(annotation)
        for field in annotation.model_fields.values():
            models(field.annotation, found)
            for mark in field.metadata:
                models(getattr(mark, "annotation", None), found)
    for part in getattr(annotation, "__args__", ()):
        models(part, found)
    return found


def test_every_key_has_a_sentence():
    assert len(KEYS) > 350
    wrong = []
    for name, node, _ in KEYS:
        sentence = re.sub(r"( \[[^\]]*\])+$", "", node.get("description", "").partition("\n")[0])
        if not re.fullmatch(r"([A-Z|].* .*\.|mu = .*\.)", sentence):
            wrong.append(f"{name}: {sentence!r}")
    assert not wrong, "write a text below the key in romdam/config/sections/"


def test_every_key_has_a_default_or_is_required():
    assert not [name for name, node, required in KEYS if ("default" in node) == required]


@pytest.mark.parametrize("model", sorted(models(Config, set()), key=lambda one: one.__name__))
def test_text_has_the_unit_the_bounds_and_the_default_of_the_model(model):
    told = {name.partition(".")[2]: node for name, node, _ in KEYS if name.startswith(f"{model.__name__}.")}
    for name, field in model.model_fields.items():
        text = told[name]["description"]
        for unit in units(field.metadata):
            assert not unit or f"[{spelt(unit)}]" in text.partition("\n")[0], f"{name}: {text}"
        for word, value in bounds(field.metadata):
            assert (word == "above" and "at least" in text.lower()) or f"{word} {value:g}" in text.lower(), (
                text
            )
        if isinstance(field.default, bool | int | float | str) and field.default != "":
            shown = str(field.default).lower() if isinstance(field.default, bool) else field.default
            shown = f"{shown:g}" if isinstance(shown, float) else shown
            assert f"efault {shown}" in text, f"{name}: {text}"


def units(metadata: list[Any]) -> list[str]:
    return [unit for one in metadata if (unit := unit_of(getattr(one, "func", None))) is not None]


def bounds(metadata: list[Any]) -> list[tuple[str, float]]:
    inner = [part for one in metadata for part in (one.metadata if isinstance(one, FieldInfo) else [one])]
    kinds = (annotated_types.Gt, annotated_types.Ge, annotated_types.Lt, annotated_types.Le)
    return [
        (WORDS[type(one).__name__], getattr(one, type(one).__name__.lower()))
        for one in inner
        if isinstance(one, kinds)
    ]


FRAGMENT = re.compile(
    r"(Of|By|From|Without|Across|Along|Up|Through|Below|Beside|Between|To|On|At|That|So|The same"
    r"|What|Where|Whether|How)\b"
)


def test_a_key_is_told_by_itself_with_a_noun_first():
    """Editors and the reference show a key's text without its neighbours: "Of the samples." tells nothing."""
    fragments = [
        f"{key}: {node['description']}" for key, node, _ in keys() if FRAGMENT.match(node["description"])
    ]
    assert not fragments, fragments


def test_the_schema_beside_the_examples_is_that_of_the_code():
    assert json.loads(SCHEMA.read_text()) == schema(), "romdam schema --out configs/romdam.schema.json"


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_the_first_line_of_every_example_leads_an_editor_to_the_schema(path):
    first = path.read_text().partition("\n")[0]
    found = re.fullmatch(r"# yaml-language-server: \$schema=(\S+)", first)
    assert found and (path.parent / found[1]).resolve() == SCHEMA
    assert isinstance(read_yaml(path), dict)
