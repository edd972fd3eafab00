"""What is said twice of the package, said alike: version, bounds of libraries, Pythons, pictures."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import yaml

import romdam

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
BOUND = re.compile(r"([\w-]+)>=([\w.]+)")
OTHER_NAMES = {"matplotlib": "matplotlib-base"}  # conda's, without windows


def test_the_version_is_one():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))["version"]
    recipe = re.search(r'set version = "(.+)"', (ROOT / "conda-recipe" / "meta.yaml").read_text("utf-8"))
    assert cited == recipe[1] == romdam.__version__


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
