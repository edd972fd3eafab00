"""The tutorial of a mesh drawn in gmsh: its own script, job and commands, as they stand on the page.

`dam.msh` is what gmsh 4.15.2 writes of that script; where gmsh is installed it writes the mesh itself.
"""

import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from test_cli import call
from test_docs import FENCE

import romdam
from romdam.geometry.meshes.files import read_mesh_file

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "own_mesh.md"
STORED = Path(__file__).with_name("dam.msh")
TEXTS = [match[3] for match in FENCE.finditer(PAGE.read_text())]
AREAS = {  # by hand: (24 + 6) / 2 * 30, 12 * 24 and 14 * 24
    "dam.1-dam.2": 450.0, "dam.2-dam.3": 450.0, "dam.1-rock": 288.0, "dam.2-rock": 336.0, "dam.3-rock": 288.0,
}  # fmt: skip


def written(folder):
    """The script and the job of the page, in folders as a checkout has them."""
    (folder / "configs").mkdir()
    shutil.copytree(ROOT / "data" / "records", folder / "data" / "records")
    for head in ("// configs/dam.geo", "# configs/own_mesh.yaml"):
        (text,) = (text for text in TEXTS if text.startswith(head))
        (folder / head.split()[1]).write_text(text)
    return folder


def commands(program):
    lines = [line[2:] for text in TEXTS for line in text.splitlines() if line.startswith("$ ")]
    return [shlex.split(line) for line in lines if line.split()[0] == program]


@pytest.mark.skipif(shutil.which("gmsh") is None, reason="gmsh is not installed")
def test_gmsh_makes_the_mesh_of_the_script(tmp_path):
    written(tmp_path)
    (command,) = commands("gmsh")
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=300)
    own, stored = (read_mesh_file(path, "mesh") for path in (tmp_path / "configs" / "dam.msh", STORED))
    assert set(own.groups) == set(stored.groups)
    for points in (own.points, stored.points):
        assert len(points) == len(stored.points)
        np.testing.assert_allclose(points.min(axis=0), [0, -25, -30], atol=1e-9)
        np.testing.assert_allclose(points.max(axis=0), [38, 49, 30], atol=1e-9)


def test_the_job_finds_the_joints_of_the_drawing(tmp_path, monkeypatch):
    monkeypatch.chdir(written(tmp_path))
    shutil.copy(STORED, "configs")
    job = romdam.load_config("configs/own_mesh.yaml")
    assert job.config.block_names == ("dam.1", "dam.2", "dam.3", "rock")
    assert [face.block for face in job.config.water.faces] == ["dam.1", "dam.2", "dam.3"]
    checked = romdam.check(job)
    assert {name: joint["area"] for name, joint in checked.joints.items()} == pytest.approx(AREAS, rel=1e-9)


@pytest.mark.slow
def test_the_commands_of_the_page_run_from_the_mesh_to_the_report(tmp_path, monkeypatch):
    monkeypatch.chdir(written(tmp_path))
    shutil.copy(STORED, "configs")
    for command in commands("romdam"):
        code, out, err = call(*command[1:])
        assert code == 0, f"{command}\n{out}\n{err}"
        assert command[1] != "check" or all(f"block dam.{k}: x " in out for k in (1, 2, 3))
    report = Path("results/report.html").read_text()
    assert all(name in report for name in ("mul009", "mul279", "half", "dam.1-dam.2"))
    for name in ("mul009", "mul279", "half"):
        data = romdam.open_result(Path("results") / f"{name}.nc").dataset
        # the weight of the dam rests on the rock: 2400 kg/m3 * 9.81 m/s2 * 450 m2 * 38 m
        on_rock = [str(joint).endswith("-rock") for joint in data.gap_joint.values]
        down = data.normal_force.isel(time=0, gap=np.flatnonzero(on_rock)).sum().item()
        assert abs(down) == pytest.approx(2400 * 9.81 * 450 * 38, rel=0.02)
        assert float(data.peak_opening.max()) > 0.0
