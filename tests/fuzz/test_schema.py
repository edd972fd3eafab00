"""The JSON schema: takes what is right, flags what a schema can tell, and explains every key."""

import copy
import json
from pathlib import Path

import numpy as np
import pytest
from config_cases import BASES, HOSTILE, every_key, value_at, write_files
from jsonschema import Draft202012Validator
from test_messages import MISTAKES, with_mistake
from typer.testing import CliRunner

from romdam.cli import app
from romdam.config import parse_config
from romdam.config.schema import schema
from romdam.config.yaml_text import read_yaml
from romdam.core.errors import ConfigError

ROOT = Path(__file__).parents[2]
CONFIGS = sorted(  # `romdam wedges` has a file of its own
    path for path in [*ROOT.glob("configs/**/*.yaml"), *ROOT.glob("tests/**/*.yaml")] if path.stem != "wedges"
)
BEYOND = {  # mistakes that depend on a unit's dimension, on other keys, or on files
    "unknown unit", "is not a quantity", "'3 kg' is not", "needs `shear_stiffness`", "no 'stone'",
    "is for scenes without damping", "exactly one of", "no 'lef' is defined",
}  # fmt: skip


@pytest.fixture(scope="module")
def validator():
    made = schema()
    Draft202012Validator.check_schema(made)
    return Draft202012Validator(made)


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_configuration_of_the_tree_is_right(validator, path):
    assert [error.message for error in validator.iter_errors(read_yaml(path))] == []


@pytest.mark.parametrize("name", BASES)
def test_every_model_is_right(validator, name):
    assert [error.message for error in validator.iter_errors(BASES[name])] == []


@pytest.mark.parametrize(("key", "value", "parts"), MISTAKES)
def test_a_mistake_is_flagged_where_a_schema_can_tell(validator, key, value, parts):
    told = any(word in part for part in parts for word in BEYOND)
    nan = isinstance(value, float) and value != value  # no JSON
    assert validator.is_valid(with_mistake(key, value)) == (told or nan)


def test_nothing_that_romdam_takes_is_flagged(validator, tmp_path, cases):
    """Every key with values of all kinds: a schema that flags what is right is worse than none."""
    write_files(tmp_path)
    rng, taken = np.random.default_rng(1), 0
    lax = ("on", 0, 1, "30", "0400", "1e3")  # truth values and whole numbers, but not as one writes them
    values = [value for value in HOSTILE if value not in lax]
    for base, place in every_key():
        for k in rng.choice(len(values), cases(1, 2), replace=False):
            raw = copy.deepcopy(BASES[base])
            section = value_at(raw, place[:-1])
            if not isinstance(section, dict):
                continue
            section[place[-1]] = copy.deepcopy(values[k])
            try:
                parse_config(copy.deepcopy(raw), str(tmp_path / "job.yaml"))
            except ConfigError:
                continue
            taken += 1
            wrong = [error.message for error in validator.iter_errors(raw)]
            assert not wrong, f"{base} {place} = {values[k]!r}: {wrong}"
    assert taken > 50


@pytest.mark.parametrize("name", BASES)
def test_unknown_keys_are_flagged_everywhere(validator, name):
    """But in a joint that names a law of a user's own, whose keys only its file knows."""
    places = {place[:-1] for base, place in every_key() if base == name}
    for place in places:
        raw = copy.deepcopy(BASES[name])
        section = value_at(raw, place)
        if isinstance(section, dict):
            section["unheard_of"] = 1
            assert not validator.is_valid(raw), place
    assert places


def test_a_joint_with_a_law_of_its_own_has_further_keys(validator):
    raw = copy.deepcopy(BASES["two"])
    raw["joints"]["gap"] |= {"law": "mine.Sticky", "stickiness": 1.0}
    assert validator.is_valid(raw)


def test_every_key_is_explained(validator):
    text = json.dumps(validator.schema["$defs"]["MaterialConfig"]["properties"]["E"])
    assert "Young's modulus. [Pa]" in text and '"exclusiveMinimum": 0.0' in text
    pages = validator.schema["$defs"].values()
    keys = [key for page in pages for key in page.get("properties", {}).values()]
    assert len(keys) > 200
    assert all(len(key["description"]) > 4 for key in keys)


def test_the_command_writes_it(validator, tmp_path):
    run = CliRunner()
    assert json.loads(run.invoke(app, ["schema"]).output) == validator.schema
    assert run.invoke(app, ["schema", "--out", str(tmp_path / "s.json")]).exit_code == 0
    assert json.loads((tmp_path / "s.json").read_text()) == validator.schema
