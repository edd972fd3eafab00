"""`romdam init`: jobs to begin with, whole in their folder, each a right configuration."""

import json

import pytest
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

import romdam
from romdam.cli import app
from romdam.config.yaml_text import read_yaml
from romdam.examples import EXAMPLES, SCHEMA, contents


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_whole_in_its_folder(name, tmp_path):
    answer = CliRunner().invoke(app, ["init", name, "--out", str(tmp_path)])
    assert answer.exit_code == 0, answer.output
    config = tmp_path / f"{name}.yaml"
    assert f"romdam run {config}" in answer.output
    assert config.read_text().startswith(f"# yaml-language-server: $schema={SCHEMA}\n")
    romdam.load_config(config)
    for path in (path for path in config.read_text().split() if ".txt" in path or ".msh" in path):
        assert "/" not in path and (tmp_path / path.strip("{},")).exists()
    Draft202012Validator(json.loads((tmp_path / SCHEMA).read_text())).validate(read_yaml(config))


def test_an_example_says_of_itself_how_it_is_run():
    for name in EXAMPLES:
        assert f"`romdam run {name}.yaml" in contents(name)[f"{name}.yaml"]


def test_what_is_there_stays(tmp_path):
    (tmp_path / "mesh.yaml").write_text("mine")
    answer = CliRunner().invoke(app, ["init", "mesh", "--out", str(tmp_path)])
    assert answer.exit_code != 0 and "mesh.yaml: is there already" in str(answer.exception)
    assert [path.name for path in tmp_path.iterdir()] == ["mesh.yaml"]


def test_written_twice_is_written_once(tmp_path):
    for _ in range(2):
        assert CliRunner().invoke(app, ["init", "suite", "--out", str(tmp_path)]).exit_code == 0


def test_without_a_name_they_are_listed_and_a_wrong_one_is_refused():
    listed = CliRunner().invoke(app, ["init"]).output
    assert [line.split()[0] for line in listed.splitlines()] == list(EXAMPLES)
    refused = CliRunner().invoke(app, ["init", "dam"])
    assert refused.exit_code == 2 and "two_cantilevers" in refused.output
