"""The types of what a user calls are checked: a wrong call does not pass mypy; and what arguments may be."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
WRONG = {
    "from romdam.pipelines.run import run\nrun(1, 2, 3)\n": 'Argument 1 to "run"',
    "from romdam.pipelines.error.verify import verify\nverify(3, 'out')\n": 'Argument 1 to "verify"',
    "from romdam.pipelines.suites.run import run_suite\nrun_suite().path\n": "Missing positional arguments",
    "import romdam\nromdam.run(romdam.load_config('a.yaml'), 3)\n": 'Argument 2 to "run"',
}


def _is_tuple_of_unlike_things(annotation):
    """Tell whether an annotation is a tuple whose members have different types, or such a tuple or None."""
    if isinstance(annotation, ast.BinOp):
        return _is_tuple_of_unlike_things(annotation.left) or _is_tuple_of_unlike_things(annotation.right)
    if not isinstance(annotation, ast.Subscript) or ast.unparse(annotation.value) != "tuple":
        return False
    members = annotation.slice.elts if isinstance(annotation.slice, ast.Tuple) else [annotation.slice]
    return len({ast.unparse(member) for member in members} - {"..."}) > 1


def _arguments_of_unlike_things(code):
    """Line, function and argument of every argument that is a tuple of unlike things."""
    for function in ast.walk(ast.parse(code)):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            args = function.args
            for argument in (*args.posonlyargs, *args.args, args.vararg, *args.kwonlyargs, args.kwarg):
                if argument is not None and _is_tuple_of_unlike_things(argument.annotation):
                    yield f"{function.lineno}: {function.name}({argument.arg})"


@pytest.mark.parametrize(
    ("annotation", "unlike"),
    [
        ("tuple[float, bool]", True),
        ("tuple[int, str] | None", True),
        ("None | tuple[Floats, int, Floats]", True),
        ("tuple[float, float]", False),
        ("tuple[str, ...]", False),
        ("tuple[int]", False),
        ("list[tuple[int, str]]", False),
        ("float", False),
    ],
)
@pytest.mark.parametrize("signature", ["def f(a, {}): ...", "class A:\n  async def f(self, *, {}=0): ..."])
def test_a_tuple_of_unlike_things_is_seen(annotation, unlike, signature):
    assert bool([*_arguments_of_unlike_things(signature.format(f"b: {annotation}"))]) == unlike


def test_no_argument_is_a_tuple_of_unlike_things():
    """Unlike things have names: they are arguments of their own, or fields of a dataclass."""
    files = [*(ROOT / "romdam").rglob("*.py"), *(ROOT / "pipelines").rglob("*.py")]
    assert len(files) > 200
    found = {
        path.relative_to(ROOT).as_posix(): seen
        for path in files
        if (seen := [*_arguments_of_unlike_things(path.read_text())])
    }
    assert found == {}


@pytest.mark.slow
def test_wrong_calls_of_the_pipelines_are_told(tmp_path):
    for number, code in enumerate(WRONG):
        (tmp_path / f"wrong_{number}.py").write_text(code)
    command = [sys.executable, "-m", "mypy", "--config-file", ROOT / "pyproject.toml", tmp_path]
    out = subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout
    for number, message in enumerate(WRONG.values()):
        told = [line for line in out.splitlines() if f"wrong_{number}.py" in line]
        assert any(message in line for line in told), f"{message} not among {told or out}"
