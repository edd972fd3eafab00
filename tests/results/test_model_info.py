"""`romdam info` on files of reduced blocks."""

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from romdam.cli import app
from romdam.config.sections.job import BoxConfig, DampingConfig
from romdam.core.errors import ResultError
from romdam.core.scene import Material, Scene
from romdam.geometry.boxes import box_block
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import reduce_scene
from romdam.results.fields import write_model
from romdam.results.model_info import model_lines
from romdam.results.stress.file import StressFields, write_stress


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A scene of one held box, its block in the cache and its basis file."""
    folder = tmp_path_factory.mktemp("info")
    box = BoxConfig(origin=(0.0,) * 3, size=(2.0, 2.0, 6.0), element_size=1.0)
    block = box_block("tower", box, Material(30e9, 0.2, 2400.0), "s")
    fixed = {"tower": np.repeat((block.points[:, 2] == 0.0)[:, None], 3, axis=1)}
    scene = Scene({"tower": block}, {}, fixed)
    made = reduce_scene(scene, ModeChoice(cutoff=200.0), DampingConfig(), BlockStore(folder))
    return folder / write_model(folder, scene, made.basis), next(folder.glob("block-*.h5")), made


def test_it_tells_sizes_cutoff_version_and_hash(stored):
    model, cached, made = stored
    for path in (model, cached):
        text = CliRunner().invoke(app, ["info", str(path)]).output
        assert "48 hex8" not in text and "24 hex8, 63 nodes, 189 DOFs" in text
        size = made.system.size  # with one static vector for each axis of the ground
        assert (
            f"{size}: 0 retained, {size - 3} fixed-interface modes (below 200 Hz), 3 static vectors" in text
        )
        assert "written by romdam 0" in text and "reduced block, whole" in text
    with h5py.File(cached) as file:
        assert f"SHA-256        {file.attrs['key']}" in model_lines(cached)


def test_a_damaged_block_is_told(stored, tmp_path):
    copy = tmp_path / "block.h5"
    copy.write_bytes(stored[1].read_bytes())
    with h5py.File(copy, "r+") as file:
        file["omega2"][0] *= 1.5
    with pytest.raises(ResultError, match=r"block\.h5: was damaged or changed since it was written"):
        model_lines(copy)


def test_another_file_is_refused(tmp_path):
    path = tmp_path / "x.h5"
    with pytest.raises(ResultError, match="no such file"):
        model_lines(path)
    with h5py.File(path, "w") as file:
        file["a"] = 1.0
    with pytest.raises(
        ResultError, match=r"is not a file of reduced blocks of this version \(romdam-block-2\)"
    ):
        model_lines(path)


def test_a_stress_file_is_told_from_one_of_blocks(tmp_path):
    fields = StressFields(np.arange(2), np.ones((2, 6, 3)), np.eye(3), np.zeros((2, 6)), slice(0, 3), "ones")
    path = tmp_path / write_stress(tmp_path, {"tower": fields})
    with pytest.raises(ResultError, match=r"holds the stress of modes.* name the file .*model-\*\.h5"):
        model_lines(path)
