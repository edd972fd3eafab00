"""The names that `import romdam` gives stay, each has its place and its example in the manual, with types."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import romdam

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
FENCE = re.compile(r"^```python\n(.*?)^```$", re.M | re.S)
DOCUMENTED = re.compile(r"^\.\. auto\w+:: romdam\.(\w+)$", re.M)
PUBLIC = {
    "Config", "ConfigError", "ConvergenceError", "GroundMotion", "Job", "MeshError", "ModesOptions",
    "Outcome", "PreparedModel", "RecordError", "ReductionError", "Result", "ResultError", "RomdamError",
    "SuiteOptions", "SuiteOutcome", "WorkerError", "WriteError", "__version__", "cache_folder", "certify",
    "check", "compare", "compare_results", "load_config", "modes", "open_result", "open_suite", "prepare",
    "read_motions", "run", "run_suite", "study", "verify", "verify_mesh",
}  # fmt: skip


def test_public_names_are_these():
    """One that goes breaks somebody's script; one that comes is for good."""
    assert set(romdam.__all__) == PUBLIC and len(romdam.__all__) == len(PUBLIC)
    assert set(dir(romdam)) == PUBLIC


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_every_public_name_is_documented_with_an_example(name):
    assert name == "__version__" or name in DOCUMENTED.findall(PAGE)
    code = "\n".join(FENCE.findall(PAGE))
    alone = name.endswith("Error")  # they are raised, and one example shows how to catch them
    assert alone or f"romdam.{name}" in code
    assert name == "__version__" or getattr(romdam, name).__doc__


def test_the_page_documents_no_name_that_is_not_public():
    assert set(DOCUMENTED.findall(PAGE)) == PUBLIC - {"__version__"}


@pytest.mark.slow
def test_examples_pass_the_strictest_check_of_types(tmp_path):
    """As a user's checker sees them: none of the repository's own settings."""
    (tmp_path / "examples.py").write_text("\n".join(FENCE.findall(PAGE)))
    (tmp_path / "wrong.py").write_text("import romdam\nromdam.run(3)\nromdam.run('a.yaml', motions='b')\n")
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--config-file="]
    command += [
        "--cache-dir",
        str(tmp_path / "cache"),
    ]  # that of `make lint`, beside it, is written meanwhile
    files = [tmp_path / name for name in ("examples.py", "wrong.py")]
    out = subprocess.run([*command, *files], cwd=ROOT, capture_output=True, text=True)
    told = [line.replace(f"{tmp_path}/", "") for line in out.stdout.splitlines() if ": error:" in line]
    assert [line for line in told if not line.startswith("wrong.py")] == [], out.stdout
    assert [line.split(":")[1] for line in told] == ["2", "3"], out.stdout
