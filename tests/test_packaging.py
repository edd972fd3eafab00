"""What is said twice of the package, said alike: version, bounds of libraries, Pythons, pictures."""

import importlib.util
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import pytest
import yaml

import romdam
from romdam.core.version import commit

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
BOUND = re.compile(r"([\w-]+)>=([\w.]+)")
OTHER_NAMES = {"matplotlib": "matplotlib-base"}  # conda's, without windows


def test_the_version_is_one():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))["version"]
    recipe = re.search(r'set version = "(.+)"', (ROOT / "conda-recipe" / "meta.yaml").read_text("utf-8"))
    assert cited == recipe[1] == romdam.__version__


def test_version_and_date_of_a_release_are_those_of_the_changelog_the_citation_and_the_manual():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    version, when = re.search(
        r"^## (\S+) \((.+)\)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.M
    ).groups()
    manual = (ROOT / "docs" / "citing.md").read_text("utf-8")
    assert f"version = {{{version}}}" in manual
    if "dev" in romdam.__version__:
        assert when == "not released" and "date-released" not in cited
        assert romdam.__version__.startswith(f"{version}.dev")
    else:
        assert (version, when) == (romdam.__version__, str(cited["date-released"]))
        assert f"date = {{{when}}}" in manual


def test_the_page_of_the_package_shows_no_picture_that_it_cannot_find():
    spec = importlib.util.spec_from_file_location("romdam_setup", ROOT / "setup.py")
    setup = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(setup)
    readme = (ROOT / "README.md").read_text("utf-8")
    pictures = re.findall(r"!\[.*?\]\((.+?)\)", readme)
    assert len(pictures) > 1 and all((ROOT / name).is_file() for name in pictures)
    linked = setup.long_description(readme, "https://example.org/dams/romdam/", "0.3.0")
    assert re.findall(r"!\[.*?\]\((.+?)\)", linked) == [
        f"https://example.org/dams/romdam/raw/v0.3.0/{name}" for name in pictures
    ]
    assert linked.replace("https://example.org/dams/romdam/raw/v0.3.0/", "") == readme
    without = setup.long_description(readme, "", "0.3.0")
    assert "![" not in without and "unreduced mesh (solid)" not in without
    kept = [line for line in readme.splitlines() if line and line[0] not in "!*"]
    assert [line for line in without.splitlines() if line and line[0] not in "!*"] == kept
    with tempfile.TemporaryDirectory() as folder:  # what a wheel's metadata has
        command = [
            sys.executable,
            "-c",
            f"import setuptools.build_meta as b; b.prepare_metadata_for_build_wheel({folder!r})",
        ]
        if subprocess.run(command, cwd=ROOT, capture_output=True).returncode:
            pytest.skip("needs setuptools 77")
        (metadata,) = Path(folder).glob("*/METADATA")
        text = metadata.read_text("utf-8")
    assert (
        "Description-Content-Type: text/markdown" in text
        and "![" not in text
        and "## Install and run" in text
    )


def test_the_version_tells_the_commit_of_a_checkout_alone(tmp_path, monkeypatch):
    assert commit(tmp_path) == ""  # an installed package
    git = ["git", "-C", tmp_path, "-c", "user.name=n", "-c", "user.email=e"]
    for words in (["init", "-q"], ["commit", "-q", "--allow-empty", "-m", "first"]):
        subprocess.run([*git, *words], check=True)
    whole = subprocess.run([*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True).stdout
    assert len(commit(tmp_path)) == 10 and whole.startswith(commit(tmp_path))
    (tmp_path / "file").write_text("not of the repository")
    assert whole.startswith(commit(tmp_path))
    subprocess.run([*git, "add", "file"], check=True)
    assert commit(tmp_path) == f"{whole[:10]}, with changes"
    below = tmp_path / "venv" / "site-packages"
    below.mkdir(parents=True)
    assert commit(below) == ""  # a package installed in a folder of somebody's repository
    monkeypatch.setenv("GIT_DIR", str(below))
    assert commit(tmp_path) == f"{whole[:10]}, with changes"
    monkeypatch.setenv("PATH", str(below))
    assert commit(tmp_path) == ""  # no git


def test_nothing_asks_git_unless_the_version_is_asked_for():
    code = (
        "import sys, subprocess; subprocess.run = subprocess.Popen = None\n"
        "import romdam, romdam.cli\n"
        "from typer.testing import CliRunner\n"
        "assert CliRunner().invoke(romdam.cli.app, ['--help']).exit_code == 0"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_every_library_has_a_lower_bound_and_the_recipe_has_the_same():
    bounds = dict(BOUND.fullmatch(one).groups() for one in PROJECT["dependencies"])
    text = (ROOT / "conda-recipe" / "meta.yaml").read_text("utf-8")
    run = text[text.index("  run:") : text.index("test:")]
    listed = dict(re.findall(r"- ([\w-]+) >=([\w.]+)", run))
    python = PROJECT["requires-python"].removeprefix(">=")
    assert listed == {OTHER_NAMES.get(name, name): bound for name, bound in bounds.items()} | {
        "python": python
    }


def test_lowest_versions_are_those_of_the_file():
    done = subprocess.run(
        [sys.executable, ROOT / ".ci" / "lowest.py", "suites"], capture_output=True, text=True, check=True
    )
    pins = dict(line.split("==") for line in done.stdout.splitlines())
    every = (*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["suites"])
    assert pins == dict(BOUND.match(one).groups() for one in every)


def test_the_workflow_tries_what_the_classifiers_say():
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8"))["jobs"]
    matrix = jobs["tests"]["strategy"]["matrix"]
    said = {one.rpartition(" ")[2] for one in PROJECT["classifiers"] if ":: 3." in one}
    assert said <= set(matrix["python"])
    assert {one.partition("-")[0] for one in matrix["os"]} == {"ubuntu", "windows", "macos"}
    assert jobs["lowest"]["steps"][-1]["run"] == "make lowest"


def test_no_page_shows_a_picture_that_a_source_distribution_lacks():
    lines = (ROOT / "MANIFEST.in").read_text("utf-8").splitlines()
    grafted = {line.split()[1] for line in lines if line.startswith("graft ")}
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    shown = {
        (page.parent / name).resolve().relative_to(ROOT)
        for page in pages
        for name in re.findall(r"(?:\{image\} |!\[.*?\]\()([\w./-]+\.png)", page.read_text("utf-8"))
    }
    assert len(shown) > 5 and all((ROOT / one).exists() and one.parts[0] in grafted for one in shown)
