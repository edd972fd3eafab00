"""Warnings name the file and the line of their key, as errors do; what a dam makes has its section's line."""

from pathlib import Path

import pytest

from romdam.config.load import line_named, load_config, naming_lines, with_lines
from romdam.config.yaml_text import line_of
from romdam.core.errors import ConfigError
from romdam.pipelines.check import check
from romdam.pipelines.job_warnings import job_warnings

CONFIGS = Path(__file__).parents[2] / "configs"


def line_with(path, text, after=""):
    """Number of the first line that holds a text, behind the first that holds another."""
    lines = path.read_text().split("\n")
    start = next(k for k, line in enumerate(lines) if after in line)
    return next(k for k in range(start, len(lines)) if text in lines[k]) + 1


@pytest.fixture
def cantilevers(tmp_path):
    """The example with a shear stiffness that does nothing, strange gravity and a short run."""
    text = (CONFIGS / "two_cantilevers.yaml").read_text()
    text = text.replace("../data", str(CONFIGS.parent / "data"))
    text = text.replace("    normal_stiffness: 16", "    shear_stiffness: 8 GPa/m\n    normal_stiffness: 16")
    text = text.replace("  pressure:\n", "  gravity: [0, 0, -1]\n  pressure:\n")
    path = tmp_path / "two.yaml"
    path.write_text(text.replace("finest_step: 2.5 ms", "finest_step: 2.5 ms, duration: 0.1 s"))
    return path


def test_check_names_file_and_line_of_odd_values(cantilevers):
    found = check(cantilevers).warnings
    gravity = line_with(cantilevers, "gravity:")
    assert any(text.startswith(f"{cantilevers}:{gravity}: loads.gravity: its size") for text in found)
    shear = line_with(cantilevers, "shear_stiffness", "joints:")
    assert any(
        text.startswith(f"{cantilevers}:{shear}: joints.contraction.shear_stiffness: does") for text in found
    )
    transient = line_with(cantilevers, "transient:")
    start = f"{cantilevers}:{transient}: northridge_mul009: transient.duration: cuts the record at 0.1 s"
    assert any(text.startswith(start) for text in found), found


def test_old_names_have_the_line_where_they_stand(cantilevers):
    cantilevers.write_text(cantilevers.read_text().replace("output_interval:", "every:"))
    line = line_with(cantilevers, "every:")
    told = job_warnings(load_config(cantilevers), [])
    assert told[0].startswith(f"{cantilevers}:{line}: outputs.every is called outputs.output_interval now")


def test_a_configuration_made_in_python_has_no_lines(cantilevers):
    job = load_config(load_config(cantilevers).to_dict(), cantilevers.parent)
    assert all(not text.startswith(str(cantilevers)) for text in job_warnings(job, []))
    assert any(text.startswith("loads.gravity: its size") for text in job_warnings(job, []))


@pytest.mark.parametrize(
    ("message", "text", "after"),
    [
        ("joints.base_1.shear_stiffness: x", "base: {normal", "  joints:"),
        ("joints.base_1.friction = 3", "base: {normal", "  joints:"),
        ("joints.step_2_1: x", "base: {normal", "  joints:"),
        ("joints.contraction_2_3.friction: x", "contraction: {normal", "  joints:"),
        ("blocks.monolith_2: x", "gravity_dam:", ""),
        ("blocks.rock_1: x", "  rock:", "gravity_dam:"),
        ("blocks: 'monolith_1' and 'monolith_2' touch", "gravity_dam:", ""),
        ("materials.rock.nu = 0.2, x", "  rock: {E", ""),
        ("water.faces[1].block: x", "{block: monolith_2, face: upstream}", ""),  # where &wet has it
    ],
)
def test_what_a_gravity_dam_makes_has_the_line_of_its_section(message, text, after):
    path = CONFIGS / "koyna.yaml"
    found = line_named(load_config(path), message)
    assert found == f"{path}:{line_with(path, text, after)}: "


def test_what_an_arch_dam_makes_has_the_line_of_its_section():
    path = CONFIGS / "arch_dam.yaml"
    job, joints = load_config(path), line_with(path, "  joints:", "arch_dam:")
    assert with_lines(job, ["joints.J3.friction: x"]) == (
        f"{path}:{line_with(path, 'friction:', '  joints:')}: joints.J3.friction: x",
    )
    assert line_named(job, "joints.J3: x") == f"{path}:{joints}: "
    assert line_named(job, "blocks.C2: x") == f"{path}:{line_with(path, 'arch_dam:')}: "
    assert line_named(job, "nothing.of.it: x") == line_named(job, "two words") == ""


def test_what_a_cut_makes_has_the_line_of_the_cut(cantilevers):
    cut = (
        "cut:\n  left:\n    into: [lower, upper]\n"
        "    along: [{plane: {point: [0, 0, 25 m], normal: [0, 0, 1]}}]\n"
        "    joints: {normal_stiffness: 1 GPa/m,\n      shear_stiffness: 1 GPa/m}\n"
    )
    text = cantilevers.read_text().replace(
        "supports:\n  - {block: left", cut + "supports:\n  - {block: lower"
    )
    text = text.replace("between: [left", "between: [upper").replace(
        "{block: left, face: ymin", "{block: upper, face: ymin"
    )
    cantilevers.write_text(text.replace("{block: left, at:", "{block: upper, at:"))
    job = load_config(cantilevers)
    shear = line_with(cantilevers, "shear_stiffness", "cut:")
    told = job_warnings(job, [])
    start = f"{cantilevers}:{shear}: joints.lower-upper.shear_stiffness: does nothing"
    assert any(line.startswith(start) for line in told), told
    assert line_named(job, "blocks.upper: x") == f"{cantilevers}:{line_with(cantilevers, 'into:')}: "


def test_errors_of_a_joint_that_a_dam_makes_have_the_line_of_its_section():
    path = CONFIGS / "koyna.yaml"

    @naming_lines
    def fails(job):
        raise ConfigError(f"{path}: joints.base_2.friction: x\n{path}: joints.of_no_dam: y")

    joints = line_with(path, "base: {normal", "  joints:")
    for job in (path, str(path), load_config(path)):
        with pytest.raises(ConfigError) as caught:
            fails(job)
        assert str(caught.value) == f"{path}:{joints}: joints.base_2.friction: x\n{path}: joints.of_no_dam: y"


def test_keys_of_anchors_have_the_line_where_they_are_written(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(
        "first: &first\n"  # 1
        "  a: 1\n"
        "  b: {c: 2}\n"  # 3
        "second: &second {b: 5, d: 6}\n"
        "taken:\n"  # 5
        "  <<: *first\n"
        "  e: 3\n"  # 7
        "whole: *first\n"
        "both:\n"  # 9
        "  a: 7\n"
        "  <<: [*second, *first]\n"  # 11
    )
    lines = {
        ("taken",): 5, ("taken", "a"): 2, ("taken", "b", "c"): 3, ("taken", "e"): 7, ("taken", "none"): 5,
        ("whole",): 8, ("whole", "b"): 3, ("both", "a"): 10, ("both", "b"): 4, ("both", "d"): 4,
    }  # fmt: skip
    assert {key: line_of(path, key) for key in lines} == lines
    path.write_text("first: 1\n\ntaken: 2\n")  # another text of the same name
    assert line_of(path, ("taken",)) == 3
