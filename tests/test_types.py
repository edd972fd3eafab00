"""The types of what a user calls are checked: a wrong call does not pass mypy."""

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


@pytest.mark.slow
def test_wrong_calls_of_the_pipelines_are_told(tmp_path):
    for number, code in enumerate(WRONG):
        (tmp_path / f"wrong_{number}.py").write_text(code)
    command = [sys.executable, "-m", "mypy", "--config-file", ROOT / "pyproject.toml", tmp_path]
    out = subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout
    for number, message in enumerate(WRONG.values()):
        told = [line for line in out.splitlines() if f"wrong_{number}.py" in line]
        assert any(message in line for line in told), f"{message} not among {told or out}"
