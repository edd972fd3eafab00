"""YAML text -> plain mappings, lists, text and numbers; what nobody would expect is refused, not guessed.

Scalars are those of YAML 1.2: `no`, `12:30` and `2001-01-01` are text, `0400` is no octal number and `1e3` is
a number. There are no tags, no key twice, no key but text, and no control characters.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path, PurePath
from typing import Any, TypeVar

import yaml

from romdam.core.errors import ConfigError, quote
from romdam.core.files import check_file

MOST_BYTES = 1e6
MOST_VALUES = 100_000  # anchors counted wherever they are used: a few of them can stand for billions
MOST_LEVELS = 50
_LONGEST = 200  # characters of the YAML library's own words in a message
_CLOSING = {"[": "]", "{": "}", '"': '"', "'": "'"}

_TAG = "tag:yaml.org,2002:"
_SCALARS = {  # tag -> what has it, and the characters that it can begin with; the first that fits counts
    "bool": (r"true|True|TRUE|false|False|FALSE", "tTfF"),
    "null": (r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    "int": (r"[-+]?(?:0|[1-9][0-9_]*)", "-+0123456789"),
    "float": (
        r"[-+]?(?:\.[0-9]+|(?:0|[1-9][0-9_]*)(?:\.[0-9_]*)?)(?:[eE][-+]?[0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        "-+0123456789.",
    ),
    "merge": (r"<<", "<"),
}
_TAGS = {_TAG + name for name in (*_SCALARS, "str", "map", "seq")}
_OF_TEXT = {_TAG + "str", _TAG + "merge"}

Value = TypeVar("Value")


class _Loader(yaml.SafeLoader):
    """The safe loader with other scalars, which does not go on beyond the most values."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012
    composed = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        self.composed += 1
        if self.composed > MOST_VALUES:
            problem = f"more than {MOST_VALUES} values; is this the file that was meant?"
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=mark)
        return super().compose_node(parent, index)


for _name, (_pattern, _first) in _SCALARS.items():
    _Loader.add_implicit_resolver(_TAG + _name, re.compile(f"^(?:{_pattern})$"), list(_first))


class _Dumper(yaml.SafeDumper):
    """Puts text in quotes that the loader would take for something else."""

    yaml_implicit_resolvers = _Loader.yaml_implicit_resolvers


def read_yaml(path: Path) -> object:
    """Read a YAML file.

    Raises
    ------
    ConfigError
        for what is no file, too large, not UTF-8, or not the YAML described above.
    """
    check_file(path, MOST_BYTES, ConfigError)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        line = 1 + error.object.count(b"\n", 0, error.start)
        raise ConfigError(
            f"{path}:{line}: is not text in UTF-8 (byte {error.start}: {error.reason}); save it as UTF-8"
        ) from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error})") from None
    return parse_yaml(text, str(path))


def parse_yaml(text: str, source: str) -> object:
    """Parse YAML text; `source` names it in errors.

    Raises
    ------
    ConfigError
        naming the line.
    """
    loader = _foreign(lambda: _Loader(text), source, text)
    node = _foreign(loader.get_single_node, source, text)
    if node is None:
        return None
    values, levels = _measure(node, {}, source)
    for number, limit, what in ((values, MOST_VALUES, "values"), (levels, MOST_LEVELS, "levels")):
        if number > limit:
            raise ConfigError(
                f"{source}: holds {number:.3g} {what}, at most {limit} are read; is this the file that was "
                "meant? An anchor (&name) counts wherever it is used (*name)"
            )
    return _foreign(lambda: loader.construct_document(node), source, text)


def plain(value: Any, source: str, levels: int = MOST_LEVELS) -> object:
    """Turn what Python has into what YAML has: mappings, lists, text and numbers.

    Tuples and arrays become lists, NumPy's numbers Python's, paths text.

    Parameters
    ----------
    source : names it in errors
    levels : that may be nested

    Raises
    ------
    ConfigError
        for what is too deep, and for keys that are no text.
    """
    if levels == 0:
        raise ConfigError(f"{source}: nested deeper than {MOST_LEVELS} levels; is this the mapping?")
    if isinstance(value, Mapping):
        wrong = next((key for key in value if not isinstance(key, str)), None)
        if wrong is not None:
            raise ConfigError(f"{source}: a key must be text, got {quote(wrong)}; put it in quotes")
        return {key: plain(member, source, levels - 1) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [plain(member, source, levels - 1) for member in value]
    if isinstance(value, PurePath):
        return str(value)
    numbers = getattr(value, "tolist", None)  # of NumPy, which is not imported for a configuration
    return numbers() if callable(numbers) else value


def write_yaml(value: object) -> str:
    """Write plain values as YAML text that `parse_yaml` reads as the same ones."""
    return yaml.dump(value, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=110)


def line_of(path: Path, key: Sequence[int | str], missing: int = 1) -> int:
    """Line, from 1, of a key of a file that has been read; of what it would stand in where it is missing.

    A key of an anchor's section has its line there, whether the section is used as a whole (`*name`) or its
    keys are taken into another one (`<<: *name`).

    Parameters
    ----------
    missing : what a key has of whose sections not even the first is in the file
    """
    node, line = _composed(path.read_text(encoding="utf-8-sig")), missing
    for word in key:
        below = _entries(node)
        if word not in below:
            break
        name, node = below[word]
        line = name.start_mark.line + 1
    return line


@lru_cache(maxsize=1)  # a job's messages ask for line after line
def _composed(text: str) -> yaml.Node | None:
    return _Loader(text).get_single_node()


def _entries(node: yaml.Node | None) -> dict[int | str, tuple[yaml.Node, yaml.Node]]:
    """What stands in a node: key, or number in a list -> the node that names it and its value."""
    if isinstance(node, yaml.SequenceNode):
        return {k: (value, value) for k, value in enumerate(node.value)}
    if not isinstance(node, yaml.MappingNode):
        return {}
    merged: dict[int | str, tuple[yaml.Node, yaml.Node]] = {}
    for name, value in node.value:
        if name.tag == _TAG + "merge":
            sections = value.value if isinstance(value, yaml.SequenceNode) else [value]
            for section in reversed(sections):  # the first that has a key counts
                merged |= _entries(section)
    return merged | {name.value: (name, value) for name, value in node.value if name.tag != _TAG + "merge"}


def _foreign(call: Callable[[], Value], source: str, text: str) -> Value:
    """Return what the YAML library does, its errors as one line."""
    try:
        return call()
    except yaml.MarkedYAMLError as error:
        raise _syntax_error(error, text, source) from None
    except RecursionError:
        raise ConfigError(f"{source}: nested deeper than {MOST_LEVELS} levels; is this the file?") from None
    except Exception as error:  # the parser's own, for text that it did not expect
        raise ConfigError(f"{source}: not valid YAML: {' '.join(str(error).split())[:200]}") from None


def _wrong(mark: yaml.Mark | None, problem: str, source: str) -> ConfigError:
    """The error of a mistake at a mark of the text."""
    position = f":{mark.line + 1}" if mark else ""
    column = f" at column {mark.column + 1}" if mark else ""
    return ConfigError(f"{source}{position}: not valid YAML{column}: {problem}")


def _syntax_error(error: yaml.MarkedYAMLError, text: str, source: str) -> ConfigError:
    """The error of the YAML library at the line that is to be mended, with what was probably meant there."""
    mark, problem = error.problem_mark or error.context_mark, (error.problem or "")[:_LONGEST]
    if mark is None:
        return _wrong(None, problem, source)
    rows = text.splitlines()
    here = rows[mark.line] if mark.line < len(rows) else ""
    before = next((k for k in range(mark.line - 1, -1, -1) if rows[k].strip()), mark.line)
    context = error.context_mark
    if "\t" in here[: len(here) - len(here.lstrip())]:
        problem = "the line is indented with a tab; use blanks"
    elif context is not None and "flow" in (error.context or ""):
        mark, sign = context, rows[context.line][context.column]
        problem = f"the {sign} has no {_CLOSING.get(sign, sign)}; close it, and put , between its entries"
    elif "could not find expected ':'" in problem:
        at = before if context is None else context.line
        row, mark = rows[at].strip(), context or mark
        key = re.match(r"([\w-]+)\s*[:=]\s*(.*)", row)
        problem = f"{quote(row)} is no key with a value; write `key: value`, with a blank after the colon"
        if key is not None:
            problem = f"{quote(row)} is no key with a value; write `{key[1]}: {key[2]}`"
    elif "escape" in problem:
        problem += "; put a path with \\ in single quotes, or write / instead"
    elif "block" in problem or "mapping values are not allowed" in problem:
        problem = (
            f"{quote(here.strip())} does not go on from line {before + 1}; begin the keys of one section in "
            "the same column, those below a key further right, and put text with `: ` in quotes"
        )
    return _wrong(mark, problem, source)


def _measure(node: yaml.Node, known: dict[int, tuple[int, int]], source: str) -> tuple[int, int]:
    """Count the values and levels that a node stands for, its anchors written out.

    Tags, characters that nobody sees, and keys that are no text or given twice are refused.
    """
    if id(node) in known:
        return known[id(node)]
    known[id(node)] = (1, MOST_LEVELS + 1)  # what holds itself has no end
    if node.tag not in _TAGS:
        tag = quote(node.tag.replace(_TAG, "!!"))
        raise _wrong(node.start_mark, f"the tag {tag} means nothing here; leave it out", source)
    if isinstance(node, yaml.ScalarNode):
        for character in node.value:
            if character not in "\n\t" and unicodedata.category(character) in ("Cc", "Cs"):
                problem = f"the control character {character!r} in a text; remove it"
                raise _wrong(node.start_mark, problem, source)
        known[id(node)] = (1, 1)
        return 1, 1
    keys = set[str]()
    for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():
        if key.tag not in _OF_TEXT or not isinstance(key, yaml.ScalarNode):
            got = quote(key.value) if isinstance(key, yaml.ScalarNode) else "a list or mapping"
            raise _wrong(key.start_mark, f"a key must be text, got {got}; put it in quotes", source)
        if key.value in keys:
            raise _wrong(key.start_mark, f"key {quote(key.value)} is given twice; remove one", source)
        keys.add(key.value)
    values, levels = 1, 0
    for entry in node.value:
        for member in entry if isinstance(entry, tuple) else (entry,):
            count, depth = _measure(member, known, source)
            values, levels = values + count, max(levels, depth)
    known[id(node)] = (values, 1 + levels)
    return known[id(node)]
