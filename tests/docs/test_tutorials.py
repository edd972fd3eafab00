"""The tutorials run from the wheel alone: a new environment, an empty folder, the extras that they name."""

import json
import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TUTORIALS = ROOT / "docs" / "tutorials"
NOTEBOOKS = sorted(path.stem for path in TUTORIALS.glob("*.md") if path.stem != "index")
EXTRAS = "[notebooks,cluster]"  # as docs/tutorials/index.md says
BUILT = ("romdam", "pipelines", "configs", "data")  # folders that the wheel is made of
SAYS = {  # of what must be among the outputs of each
    "records": ("is an HTML or XML page", "largest one by", "in memory", "channel: 1"),
    "runs": (
        "24 (1 records, 2 scales, 12 samples)",
        "0 of 24 runs were made by the second call",
        "friction   ",
    ),
    "results": ("the ledger closes within", "northridge_mul", "\nTrue\n"),
}
FIGURES = {"records": 1, "runs": 1, "results": 3}


def done(*command, **settings):
    """The standard output of a command that ends well."""
    found = subprocess.run([*map(str, command)], capture_output=True, text=True, **settings)
    assert found.returncode == 0, found.stdout[-3000:] + found.stderr[-3000:]
    return found.stdout


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """The `bin` of a new environment with the wheel; nothing of the repository's own is seen from there."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = ["-m", "pip", "--disable-pip-version-check", "-q"]
    source = folder / "source"
    for name in BUILT:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=ignored)
    for file in ROOT.glob("*.*"):
        if file.is_file():
            shutil.copy(file, source)
    shutil.copy(ROOT / "LICENSE", source)
    done(sys.executable, *pip, "wheel", "--no-deps", "--wheel-dir", folder, source)
    (wheel,) = folder.glob("romdam-*.whl")
    venv.create(folder / "env", with_pip=True)
    found = folder / "env" / ("Scripts" if os.name == "nt" else "bin")
    done(found / "python", *pip, "install", "--no-compile", f"{wheel}{EXTRAS}")
    return found


def test_the_index_names_the_extras_and_every_tutorial():
    text = (TUTORIALS / "index.md").read_text()
    assert f"romdam{EXTRAS}" in text and set(SAYS) == set(NOTEBOOKS)
    assert set(text.rpartition("```{toctree}")[2].split()) >= set(NOTEBOOKS)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_tutorial_holds_no_outputs_and_needs_nothing_of_the_repository(name):
    text = (TUTORIALS / f"{name}.md").read_text()
    assert text.startswith("---\nfile_format: mystnb\n") and "!romdam init " in text
    assert "../" not in text.replace("](../", ""), "a file beside the tutorial is not in the wheel"


@pytest.mark.slow
def test_tutorials_run_from_the_wheel_in_an_empty_folder(environment, tmp_path):
    keep = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "NUMBA"))}
    keep["PATH"] = os.pathsep.join([str(environment), os.defpath])
    where = done(
        environment / "python", "-c", "import romdam; print(romdam.__file__)", cwd=tmp_path, env=keep
    )
    assert Path(where.strip()).is_relative_to(environment.parent), "the wheel's, not the repository's"
    for name in NOTEBOOKS:
        (folder := tmp_path / name).mkdir()
        file = folder / f"{name}.ipynb"
        convert = Path(sys.executable).with_name("mystnb-to-jupyter")
        done(convert, TUTORIALS / f"{name}.md", file)
        done(environment / "jupyter-execute", "--inplace", "--timeout=300", file, cwd=folder, env=keep)
        outputs = [one for cell in json.loads(file.read_text())["cells"] for one in cell.get("outputs", ())]
        text = "\n".join(_text(one) for one in outputs)
        assert "error" not in {one["output_type"] for one in outputs}
        assert not [part for part in SAYS[name] if part not in text], text
        assert sum("image/png" in one.get("data", {}) for one in outputs) == FIGURES[name]


def _text(output):
    """What an output says, as text and as HTML."""
    data = output.get("data", {})
    return "".join(["\n", *output.get("text", ()), *data.get("text/plain", ()), *data.get("text/html", ())])
