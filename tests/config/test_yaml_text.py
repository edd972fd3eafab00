"""YAML as a person means it: scalars that surprise nobody, and one line for what is refused."""

import os
import re
import time

import pytest
import yaml

from romdam.config import load_config, yaml_text
from romdam.config.sections.motions.records import is_manifest
from romdam.config.yaml_text import MOST_BYTES, _measure, parse_yaml, read_yaml
from romdam.core.errors import ConfigError

BOMB = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 10)
)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("1e3", 1000.0),
        ("1_000_000", 1000000),
        ("-2.5e-3", -0.0025),
        (".5", 0.5),
        ("true", True),
        ("~", None),
        ("no", "no"),
        ("on", "on"),
        ("12:30:00", "12:30:00"),
        ("0o17", "0o17"),
        ("0400", "0400"),
        ("0x1F", "0x1F"),
        ("2001-13-45", "2001-13-45"),
        ("2001-01-01", "2001-01-01"),
        ("=", "="),
        ("'1e3'", "1e3"),
    ],
)
def test_scalars(text, meant):
    found = parse_yaml(f"key: {text}", "x")["key"]
    assert found == meant and type(found) is type(meant)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (BOMB, ["holds 4", "values, at most 100000", "anchor"]),
        (BOMB.replace("[", "{<<: [").replace("]", "]}"), ["anchor"]),
        ("a: &a [*a]", ["levels"]),
        ("a: " + "[" * 1200 + "]" * 1200, ["nested deeper than 50"]),
        ("a: " + "[" * 60 + "]" * 60, ["levels, at most 50"]),
        (
            "a: !!python/object/apply:os.getcwd []",
            ["dam.yaml:1: not valid YAML at column 4", "!!python/object/apply", "leave it out"],
        ),
        ("a: !mine 3", ["'!mine'"]),
        ("a: !!timestamp 2001-13-45", ["!!timestamp"]),
        ("a: " + "9" * 5000, ["not valid YAML"]),
        ('a: "\\0"', ["dam.yaml:1: ", "control character '\\x00'"]),
        ('a: "\\ud800"', ["control character"]),
        ('a: "\\UFFFFFFFF"', ["not valid YAML"]),
        ("a: \x01", ["not valid YAML"]),
        ("1: x", ["a key must be text, got '1'; put it in quotes"]),
        ("true: x", ["a key must be text"]),
        ("? [a, b]\n: x", ["a key must be text, got a list or mapping"]),
        ("a: 1\nb: 2\na: 3", ["dam.yaml:3: not valid YAML at column 1", "key 'a' is given twice"]),
        ("a: [1, 2", ["dam.yaml:1: ", "the [ has no ]; close it"]),
        ("a: *nowhere", ["undefined alias"]),
        ("a: 1\n---\nb: 2", ["dam.yaml:2: "]),
        ("\ta: 1", ["dam.yaml:1: ", "indented with a tab; use blanks"]),
    ],
)
def test_what_is_refused_is_one_line(text, parts):
    with pytest.raises(ConfigError) as caught:
        parse_yaml(text, "dam.yaml")
    message = str(caught.value)
    assert re.match(r"dam\.yaml(:\d+)?: ", message) and "\n" not in message and len(message) < 400
    assert all(part in message for part in parts), message


def test_parsing_ends_where_a_file_has_more_values_than_can_be_meant(monkeypatch):
    monkeypatch.setattr(yaml_text, "MOST_VALUES", 1000)
    assert len(parse_yaml(f"[{'1, ' * 998}1]", "x")) == 999
    with pytest.raises(ConfigError, match=r"x:1: not valid YAML at column \d+: more than 1000 values"):
        parse_yaml("[" + "1, " * 1000 + "[" * 10**5, "x")


def test_merged_keys_give_way_to_those_written():
    text = "base: &base {E: 1, nu: 0.2}\nother: {<<: *base, nu: 0.3}\nthird: {<<: [*base], E: 2}\n"
    found = parse_yaml(text, "x")
    assert found["other"] == {"E": 1, "nu": 0.3} and found["third"] == {"E": 2, "nu": 0.2}


def test_fifty_thousand_keys_are_searched_for_twins_at_once():
    mark = yaml.Mark("x", 0, 0, 0, None, None)
    text = [yaml.ScalarNode("tag:yaml.org,2002:str", f"k{i}", mark) for i in range(50_000)]
    node = yaml.MappingNode("tag:yaml.org,2002:map", [(key, text[0]) for key in text], mark)
    start = time.perf_counter()
    assert _measure(node, {}, "x") == (100_001, 2)
    assert time.perf_counter() - start < 30.0, "a count of every key takes minutes"


def test_what_is_no_text_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "wide.yaml").write_bytes("a: 1\n".encode("utf-16"))
    (tmp_path / "long.yaml").write_bytes(b"#" * (int(MOST_BYTES) + 1))
    for path, part in (
        (tmp_path, "is a folder"),
        (tmp_path / "pipe", "is a device, pipe or socket"),
        (tmp_path / "wide.yaml", "not text in UTF-8"),
        (tmp_path / "long.yaml", "at most 1 MB"),
        (tmp_path / "none.yaml", "no such file"),
        (tmp_path / ("x" * 300), "cannot be read"),
    ):
        with pytest.raises(ConfigError, match=part):
            load_config(path)
        assert not is_manifest(path)


def test_a_mark_of_the_byte_order_is_no_part_of_the_first_key(tmp_path):
    (tmp_path / "bom.yaml").write_bytes(b"\xef\xbb\xbfa: 1\r\n")
    assert read_yaml(tmp_path / "bom.yaml") == {"a": 1}
