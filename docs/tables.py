"""Tables of the manual that come from the code: configuration keys and result variables, as Markdown."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from romdam.config.effects import EFFECTS, EXCLUDED
from romdam.config.schema import limits, plain, schema
from romdam.error.approximations import GROUPS
from romdam.results.case import Variable
from romdam.results.suite.rows import ROWS
from romdam.results.variables import COORDINATES, VARIABLES

Node = dict[str, Any]

_WORDS = {
    "integer": "whole number", "string": "text", "boolean": "true or false", "number": "number",
    "array": "list", "object": "mapping",
}  # fmt: skip


SUBJECTS = {  # page of keys -> sections of a job
    "job": ("",),
    "dam": ("materials", "blocks", "cut", "arch_dam", "gravity_dam", "supports", "ground"),
    "joints": ("joints", "ties"),
    "loads": ("loads", "anchors", "dampers", "masses", "construction", "water", "damping"),
    "records": ("records",),
    "runs": (
        "model",
        "transient",
        "outputs",
        "study",
        "linear_stage",
        "suite",
        "comparison",
        "post_earthquake",
        "combinations",
    ),
}
ROOT = Path(__file__).parents[1]
ROOMS = ("contact", "timestepping", "effects", "reduction", "linalg", "error", "export")  # with constants
STAGES = (  # of pipelines
    "automatic_modes", "error/estimate", "error/certify", "error/verify", "error/study", "export",
)  # fmt: skip
CODES = {  # indices and states
    "OPEN", "STICK", "SLIP", "_SPENT", "_RESTS", "_CONVERGED", "_SLOW", "_CHANGED", "_ALL", "BASE",
    "DISP", "VEL", "FORCE", "RATE", "_WORK", "_LOSS",
}  # fmt: skip
INDICES = {"components.py", "state.py"}
TUNED = {  # what is no code in files full of them
    ("pardiso.py", "SINGLE_TOLERANCE"), ("pardiso.py", "_TOLERANCE"), ("pardiso.py", "_WIDTH"),
}  # fmt: skip


def write(folder: Path) -> None:
    """Write every table into a folder, where it is not as it should be."""
    folder.mkdir(exist_ok=True)
    made = {
        **{f"keys_{subject}.md": configuration(subject) for subject in SUBJECTS},
        "constants.md": constants(),
        "effects.md": effects(),
        "approximations.md": approximations(),
        "coordinates.md": variables(COORDINATES),
        "variables.md": variables(VARIABLES),
        "rows.md": variables(ROWS),
    }
    for name, text in made.items():
        path = folder / name
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


class Constant(NamedTuple):
    """A number of a module: its numbers (several of a tuple), how it is written, and its comment."""

    numbers: tuple[float, ...]
    written: str
    meaning: str


def constants() -> str:
    """Every constant of the code, file by file, with its comment."""
    lines, last = list[str](), ""
    for (file, name), one in constants_of_code().items():
        if file != last:
            lines += ["", f"`{file}`", ""]
            last = file
        lines.append(f"- `{name}` {one.written.replace('np.pi', 'pi').replace('*', '×')}: {one.meaning}")
    return "\n".join(lines) + "\n"


def constants_of_code() -> dict[tuple[str, str], Constant]:
    """(file below romdam, name) -> constant: numbers of modules, private or in capitals."""
    files = [path for room in ROOMS for path in sorted((ROOT / "romdam" / room).rglob("*.py"))]
    files.append(ROOT / "romdam" / "core" / "threads.py")
    files += [ROOT / "pipelines" / f"{name}.py" for name in STAGES]
    return {
        (str(path.relative_to(ROOT)).removeprefix("romdam/"), name): constant
        for path in files
        for name, constant in _constants(path.read_text())
        if (path.name, name) in TUNED or (name not in CODES and path.name not in INDICES | {"pardiso.py"})
    }


def _constants(source: str) -> Iterator[tuple[str, Constant]]:
    lines = source.splitlines()
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
            names, values = [target], [node.value]
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                names, values = target.elts, node.value.elts
            for name, value in zip(names, values, strict=True):
                numbers = _numbers(value)
                if isinstance(name, ast.Name) and re.fullmatch(r"_?[A-Z][A-Z0-9_]*", name.id) and numbers:
                    yield name.id, Constant(numbers, ast.unparse(value), _comment(lines, node))


def _comment(lines: list[str], node: ast.stmt) -> str:
    """The comment of a statement: behind it and in the lines below, else above it; else the text below."""
    last = node.end_lineno or node.lineno
    behind = [line.partition("#")[2] for line in lines[node.lineno - 1 : last] if "#" in line]
    if behind:
        end = last
        while end < len(lines) and lines[end].startswith("#"):
            end += 1
        if end == len(lines) or not lines[end].strip():  # else it is the next statement's
            behind += [line[1:] for line in lines[last:end]]
        return " ".join(" ".join(behind).split())
    first = node.lineno - 1
    while first > 0 and lines[first - 1].startswith("#"):
        first -= 1
    above = [line[1:] for line in lines[first : node.lineno - 1]]
    if not above and last < len(lines) and lines[last].startswith('"""'):
        above = [lines[last].strip('"')]
    return " ".join(" ".join(above).split())


def _numbers(node: ast.expr) -> tuple[float, ...] | None:
    """The numbers of an expression of numbers (and pi) alone; None of any other."""
    allowed = (ast.BinOp, ast.UnaryOp, ast.Constant, ast.operator, ast.unaryop, ast.Tuple, ast.Load)
    tree = ast.parse(ast.unparse(node).replace("np.pi", repr(math.pi)), mode="eval")
    if not all(isinstance(part, allowed) for part in ast.walk(tree.body)):
        return None
    value = eval(compile(tree, "constant", "eval"), {"__builtins__": {}})
    values = value if isinstance(value, tuple) else (value,)
    return values if all(type(one) in (int, float) for one in values) else None


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


def approximations() -> str:
    """A table for each group of approximations: what they change, and what states them."""
    lines = list[str]()
    for group, rows in GROUPS.items():
        lines += [f"**{group[0].upper()}{group[1:]}**", "", "| approximation | changes | stated | code |"]
        lines.append("|---" * 4 + "|")
        for row in rows:
            by = [_reference(row.stated, by) for by in row.by] or ["line `not included`"]
            places = dict.fromkeys(place.partition(":")[0] for place in row.where)
            code = ", ".join(f"`{place.replace('.', '/')}`" for place in places)
            lines.append(f"| {row.name} | {_cell(row.changes)} | {row.stated}: {', '.join(by)} | {code} |")
        lines.append("")
    return "\n".join(lines)


def _reference(stated: str, by: str) -> str:
    """What states an approximation: a statement, the name of a test, words of a sentence, or a remark."""
    if stated == "varied by":
        return f"*{by}*"
    if stated == "said in the result":
        return f'"{by.partition(": ")[2].strip()}"'
    return f"`{by}`" if "::" in by else by


def variables(registry: Mapping[str, Variable]) -> str:
    """A row for every variable of a registry."""
    rows = ["| variable | dimensions | unit | meaning |", "|---|---|---|---|"]
    for name, one in registry.items():
        dims = ", ".join(one.dims) or "(one number)"
        rows.append(f"| `{name}` | {dims} | {one.units or 'text'} | {_cell(one.long_name)} |")
    return "\n".join(rows) + "\n"


def configuration(subject: str = "") -> str:
    """A section for every mapping of the schema, of all or of a subject, in the order in which it is met."""
    sections, headings = [], set[str]()
    for mapping, paths in mappings():
        if subject and re.split(r"[.\[]", paths[0])[0] not in SUBJECTS[subject]:
            continue
        heading = f"`{paths[0]}`" if paths[0] else "Top level"
        if heading in headings:  # one of several that may stand there
            heading = f"{heading}: {_mark(mapping)}"
        headings.add(heading)
        at = "the whole file" if paths == [""] else ", ".join(f"`{path}`" for path in paths)
        rows = ["| key | type and unit | default | limits and meaning |", "|---|---|---|---|"]
        rows += [_row(mapping, name) for name in mapping["properties"]]
        doc = " ".join(re.split(r"\n\s*\w+\n\s*---", mapping["description"])[0].split())
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
            keys = {} if known else node["properties"]
            if isinstance(node.get("additionalProperties"), dict):
                visit(node["additionalProperties"], f"{path}.<name>")
            # motions of supports last: most of their keys are those of `records`
            for name, key in sorted(keys.items(), key=lambda item: item[0] in ("ground", "supports")):
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
