"""Names that cannot be those of files are refused before anything runs."""

import pytest
from test_messages import example

from romdam.config import parse_config
from romdam.core.errors import ConfigError

WRONG = [
    "a" * 240, "é" * 60, "a/b", "..", ".", ".hidden", "-x", "a\\b", "a:b", "x\x07", "x\x00", " x", "x ", "",
    "e\u0301", "\u200b", "*", "\ud800", "x.",
]  # fmt: skip
RIGHT = ["J1", "left bank", "é", "Block (2)", "a.b", "💧", "x" * 100]


def renamed(kind, name):
    raw = example()
    if kind == "record":
        raw["records"][0]["name"] = name
    elif kind == "node":
        raw["outputs"]["nodes"] = {name: {"block": "left", "at": [5, 0, 50]}}
    elif kind == "joint":
        raw["joints"] = {name: raw["joints"]["contraction"]}
    else:
        raw["materials"][name] = raw["materials"]["concrete"]
    return raw


@pytest.mark.parametrize("name", WRONG, ids=ascii)
@pytest.mark.parametrize("kind", ["record", "node", "joint", "material"])
def test_a_name_that_names_no_file_is_refused(kind, name):
    with pytest.raises(ConfigError) as caught:
        parse_config(renamed(kind, name), "dam.yaml")
    message = str(caught.value)
    assert message.startswith("dam.yaml: ") and "\n" not in message and message.isprintable()


@pytest.mark.parametrize("name", RIGHT)
def test_other_names_are_taken(name):
    for kind in ("node", "joint", "material"):
        parse_config(renamed(kind, name), "dam.yaml")


@pytest.mark.parametrize(
    "name", ["summary", "Report", "verification", "model-1", "stress-x", "con", "NUL", "com1.a"]
)
def test_a_record_is_not_named_as_what_is_written_beside_it(name):
    with pytest.raises(ConfigError, match=r"records\[0\].name: the name .* choose another"):
        parse_config(renamed("record", name), "dam.yaml")
