"""The manual's list of constants against the code: none is missing, none is gone, every value is today's."""

import ast
import math
import re
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
ROOMS = ("contact", "timestepping", "effects", "reduction", "linalg", "error", "export")
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
    ("mode_split.py", "_SLOW"),
}  # fmt: skip
UNNAMED = {  # numbers below LEAST_NAMED in the midst of code; more of them get a name
    ("conserving.py", 1e-9), ("conserving.py", 1e-10), ("step_control.py", 1e-9), ("steps.py", 1e-6),
    ("steps.py", 1e-9),
}  # fmt: skip
LEAST_NAMED, NO_NUMBER = (
    0.02,
    1e-290,
)  # between them lie tolerances; what is smaller only keeps from dividing by zero
ENTRY = re.compile(r"^`(?P<file>[\w/.]+\.py)`$|^- `(?P<name>_?[A-Z]\w*)` (?P<value>[^:]+)", re.M)


def in_code():
    """(file, name) -> value of every number of a module, private or in capitals; a file by its name."""
    rooms = [path for room in ROOMS for path in sorted((ROOT / "romdam" / room).rglob("*.py"))]
    rooms.append(ROOT / "romdam" / "core" / "threads.py")
    stages = [ROOT / "pipelines" / f"{name}.py" for name in STAGES]
    return {
        (path.name, name): value
        for path in [*rooms, *stages]
        for name, value in _numbers(ast.parse(path.read_text()))
        if (path.name, name) in TUNED or (name not in CODES and path.name not in INDICES | {"pardiso.py"})
    }


def _numbers(tree):
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target in targets:
                names, values = [target], [node.value]
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    names, values = target.elts, node.value.elts
                for name, value in zip(names, values, strict=True):
                    number = _number(value)
                    if isinstance(name, ast.Name) and re.fullmatch(r"_?[A-Z][A-Z0-9_]*", name.id) and number:
                        yield name.id, number


def _number(node):
    """The numbers of an expression of numbers (and pi) alone, as a tuple; None of any other."""
    allowed = (ast.BinOp, ast.UnaryOp, ast.Constant, ast.operator, ast.unaryop, ast.Tuple, ast.Load)
    text = ast.unparse(node).replace("np.pi", repr(math.pi))
    node = ast.parse(text, mode="eval")
    if not all(isinstance(part, allowed) for part in ast.walk(node.body)):
        return None
    value = eval(compile(node, "constant", "eval"), {"__builtins__": {}})
    values = value if isinstance(value, tuple) else (value,)
    return values if all(type(one) in (int, float) for one in values) else None


def in_manual():
    """The same from docs/constants.md: a line of a file, and below it entries "- `name` value: meaning"."""
    text = (ROOT / "docs" / "constants.md").read_text()
    constants, file = {}, ""
    for entry in ENTRY.finditer(text):
        if entry["file"]:
            file = Path(entry["file"]).name
        else:
            key = (file, entry["name"])
            assert key not in constants, f"{key} stands twice in docs/constants.md"
            constants[key] = _value(entry["value"])
    return constants


def _value(text):
    return tuple(float(word) for word in re.findall(r"-?\d[\d.]*(?:e[+-]?\d+)?", text))


def test_the_list_holds_every_constant_with_its_value():
    code, manual = in_code(), in_manual()
    assert len(code) > 40
    missing, gone = sorted(code.keys() - manual.keys()), sorted(manual.keys() - code.keys())
    assert not missing, f"add to docs/constants.md: {missing}"
    assert not gone, f"remove from docs/constants.md: {gone}"
    other = {
        key: (manual[key], code[key]) for key in code if not np.allclose(manual[key], code[key], 1e-4, 0)
    }
    assert not other, f"docs/constants.md has other values than the code: {other}"


def test_no_number_that_decides_something_is_without_a_name():
    """Round-off, tolerances and shares are module constants, so that the list above can hold them."""
    unnamed = {
        (path.name, number): f"{path.relative_to(ROOT)}:{line}: {number:g}"
        for room in ROOMS[:4]
        for path in sorted((ROOT / "romdam" / room).rglob("*.py"))
        for line, number in _unnamed(ast.parse(path.read_text()))
    }
    new = [place for key, place in unnamed.items() if key not in UNNAMED]
    assert not new, f"make them constants of the module and add entries to docs/constants.md: {new}"


def _unnamed(tree):
    """(line, number) of small numbers outside of constants of the module and defaults of settings."""
    kinds = (ast.Assign, ast.AnnAssign)
    named = {id(one) for node in tree.body if isinstance(node, kinds) for one in ast.walk(node)}
    for node in (one for one in ast.walk(tree) if isinstance(one, ast.ClassDef)):
        named |= {id(one) for field in node.body if isinstance(field, kinds) for one in ast.walk(field)}
    floats = (one for one in ast.walk(tree) if isinstance(one, ast.Constant) and isinstance(one.value, float))
    for one in floats:
        if id(one) not in named and NO_NUMBER < abs(one.value) <= LEAST_NAMED:
            yield one.lineno, one.value
