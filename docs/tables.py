"""Tables of the manual that come from the code: configuration keys and result variables, as Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from romdam.config.effects import EFFECTS, EXCLUDED
from romdam.config.schema import limits, plain, schema
from romdam.results.case import Variable
from romdam.results.suite.rows import ROWS
from romdam.results.variables import COORDINATES, VARIABLES

Node = dict[str, Any]

_WORDS = {
    "integer": "whole number", "string": "text", "boolean": "true or false", "number": "number",
    "array": "list", "object": "mapping",
}  # fmt: skip


def write(folder: Path) -> None:
    """Write every table into a folder, where it is not as it should be."""
    folder.mkdir(exist_ok=True)
    made = {
        "configuration.md": configuration(),
        "effects.md": effects(),
        "coordinates.md": variables(COORDINATES),
        "variables.md": variables(VARIABLES),
        "rows.md": variables(ROWS),
    }
    for name, text in made.items():
        path = folder / name
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


def effects() -> str:
    """A row and a column for every physical effect, and the reasons of pairs that cannot be."""
    names, reasons = list(EFFECTS), list(dict.fromkeys(EXCLUDED.values()))
    head = ["effect", "key", *(str(k + 1) for k in range(len(names)))]
    rows = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for k, name in enumerate(names):
        marks = []
        for other in names:
            message = EXCLUDED.get(frozenset({name, other}))
            mark = (
                "" if other == name else "yes" if message is None else chr(ord("a") + reasons.index(message))
            )
            marks.append(mark)
        rows.append(f"| {k + 1} {name} | `{EFFECTS[name].key}` | {' | '.join(marks)} |")
    notes = [f"- {chr(ord('a') + k)}: {_cell(reason)}" for k, reason in enumerate(reasons)]
    return "\n".join([*rows, "", *notes]) + "\n"


def variables(registry: Mapping[str, Variable]) -> str:
    """A row for every variable of a registry."""
    rows = ["| variable | dimensions | unit | meaning |", "|---|---|---|---|"]
    for name, one in registry.items():
        dims = ", ".join(one.dims) or "(one number)"
        rows.append(f"| `{name}` | {dims} | {one.units or 'text'} | {_cell(one.long_name)} |")
    return "\n".join(rows) + "\n"


def configuration() -> str:
    """A section for every mapping of the configuration's schema, in the order in which it is met."""
    sections, headings = [], set[str]()
    for mapping, paths in mappings():
        heading = f"`{paths[0]}`" if paths[0] else "Top level"
        if heading in headings:  # one of several that may stand there
            heading = f"{heading}: {_mark(mapping)}"
        headings.add(heading)
        at = "the whole file" if paths == [""] else ", ".join(f"`{path}`" for path in paths)
        rows = ["| key | type and unit | default | limits and meaning |", "|---|---|---|---|"]
        rows += [_row(mapping, name) for name in mapping["properties"]]
        doc = " ".join(mapping["description"].split())
        sections.append("\n".join([f"## {heading}", "", f"Stands at {at}. {doc}", "", *rows, ""]))
    return "\n".join(sections)


def _mark(mapping: Node) -> str:
    """What tells a mapping from others at its place: the step that it is, or its first key."""
    name, key = next(iter(mapping["properties"].items()))
    return str(key["default"]) if name == "step" else name


def mappings() -> list[tuple[Node, list[str]]]:
    """Every mapping with keys of its own, and where it stands."""
    whole = schema()
    found: dict[int, tuple[Node, list[str]]] = {}

    def visit(node: Any, path: str) -> None:
        if "$ref" in node:
            node = whole["$defs"][node["$ref"].rpartition("/")[2]]
        if "properties" in node and "description" in node:
            known = id(node) in found
            found.setdefault(id(node), (node, []))[1].append(path)
            for name, key in node["properties"].items() if not known else ():
                visit(key, f"{path}.{name}" if path else name)
            return
        for inner, many in _inner(node):
            visit(inner, path + many)

    visit(whole, "")
    return list(found.values())


def _inner(node: Node) -> Iterator[tuple[Node, str]]:
    """Nodes within one that is no mapping with keys, with what stands between them and the key."""
    for one in (*node.get("anyOf", ()), *node.get("oneOf", ())):
        yield one, ""
    for key, many in (("additionalProperties", ".<name>"), ("items", "[]")):
        if isinstance(node.get(key), dict):
            yield node[key], many
    if "prefixItems" in node:
        yield node["prefixItems"][0], "[]"


def _row(mapping: Node, name: str) -> str:
    key = mapping["properties"][name]
    if name in mapping.get("required", ()):
        shown = "**required**"
    elif isinstance(key["default"], dict):
        shown = "its defaults" if key["default"] else "empty"
    else:
        shown = "none" if key["default"] in (None, [], "") else f"`{plain(key['default'])}`"
    meaning = re.sub(r"( \[[^\]]*\])+$", "", key["description"].partition("\n")[0])
    told = "; ".join(text for text in (", ".join(limits(key)), meaning) if text)
    return f"| `{name}` | {_cell(_type(key))} | {shown} | {_cell(told)} |"


def _type(node: Node) -> str:
    """Type and unit in words."""
    if "enum" in node or "const" in node:
        return ", ".join(f"`{one}`" for one in node.get("enum", [node.get("const")]) if one is not None)
    branches = [one for one in (*node.get("anyOf", ()), *node.get("oneOf", ())) if one.get("type") != "null"]
    if "unit" in node:
        return f"number with its unit [{node['unit']}]"
    units = [one["unit"] for one in branches if "unit" in one]
    if branches:
        what = "number" if any(one.get("type") == "number" for one in branches) else "number with its unit"
        words = [f"{what} [{units[0]}]" if units[0] else what] if units else []
        words += [
            _type(one) for one in branches if not units or (one.get("type") not in ("number", "string"))
        ]
        return " or ".join(dict.fromkeys(word for word in words if word))
    kind = node.get("type")
    if kind == "array":
        if "prefixItems" in node:
            return f"[{', '.join(_type(one) for one in node['prefixItems'])}]"
        return f"list of {_type(node['items'])}" if "items" in node else "list"
    if kind == "object" and isinstance(node.get("additionalProperties"), dict):
        return f"name: {_type(node['additionalProperties'])}"
    if "$ref" in node or kind == "object":
        return "mapping"
    if isinstance(kind, list):
        return " or ".join(_type({"type": one}) for one in kind)
    return "path" if node.get("format") == "path" else _WORDS.get(str(kind), "")


def _cell(text: str) -> str:
    return " ".join(text.replace("|", r"\|").split())
