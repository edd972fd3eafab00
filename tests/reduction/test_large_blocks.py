"""Large blocks reduced through the disk: the same basis, stopped and gone on with, mapped from its file."""

import dataclasses

import h5py
import numpy as np
import pytest
from small_scenes import DAMPING, raw, scene

from romdam.config.sections.job import ModelConfig
from romdam.core.errors import ReductionError
from romdam.reduction.basis import Mapped
from romdam.reduction.methods import out_of_core as large
from romdam.reduction.storage import model_file as store
from romdam.reduction.storage import out_of_core_matrix
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import reduce_scene, reduce_scene_twice


def built(friction=0.0, height=8.0, water=None):
    law = {"discretization": "node_to_node"}  # the form that retains nodes
    law |= {"friction_coefficient": friction} if friction else {}
    config = raw(height=height, **law)
    for block in config["blocks"].values():
        block["box"]["element"] = "tet10"
    if water is not None:
        faces = [{"block": "right", "face": "ymax"}]
        config["water"] = {"level": height, "faces": faces, "model": water}
    return scene(config)


def reduced(where, into=None, **model):
    return reduce_scene(where, ModelConfig(**({"cutoff": 400.0} | model)), DAMPING, into)


@pytest.fixture
def through_the_disk(monkeypatch):
    monkeypatch.setattr(large, "LARGE", 0.0)
    monkeypatch.setattr(store, "_MAPPED", 0.0)
    monkeypatch.setattr(out_of_core_matrix, "WIDTH", 7)
    monkeypatch.setattr(out_of_core_matrix, "_TOGETHER", 10)
    monkeypatch.setattr(large, "_NODES", 20)


def flexibility(system):
    """Of the gaps at 20 Hz."""
    B = system.B.toarray()
    return (B / (system.K.diagonal() + (2.0 * np.pi * 20.0) ** 2)) @ B.T


@pytest.mark.parametrize("solver", ["superlu", "multigrid", "pardiso"])
@pytest.mark.parametrize("free, residual_vectors", [(False, 0), (True, 0), (False, 6)])
def test_a_basis_from_the_disk_is_the_one_from_memory(
    solver, free, residual_vectors, monkeypatch, through_the_disk, tmp_path
):
    pytest.importorskip({"superlu": "scipy", "multigrid": "scipy", "pardiso": "pypardiso"}[solver])
    where = built()
    if free:  # nothing but the gaps holds the right block
        where = dataclasses.replace(where, fixed=where.fixed | {"right": np.zeros_like(where.fixed["right"])})
    made = reduced(where, BlockStore(tmp_path), solver=solver, residual_vectors=residual_vectors)
    monkeypatch.setattr(large, "LARGE", 1e12)
    known = reduced(where, solver="superlu", residual_vectors=residual_vectors)
    assert isinstance(made.basis["left"].vectors.left, Mapped)
    assert made.system.size == known.system.size
    off = np.abs(made.system.K.diagonal() - known.system.K.diagonal())
    assert off.max() < 1e-7 * known.system.K.diagonal().max()
    a, b = flexibility(made.system), flexibility(known.system)
    assert np.abs(a - b).max() < 1e-6 * np.abs(b).max()
    for name in where.blocks:
        x, y = (np.asarray(m.basis[name].vectors.rows()) for m in (made, known))
        k = known.basis[name].omega2 < (2.0 * np.pi * 300.0) ** 2
        projected = y[:, k] @ np.linalg.lstsq(y[:, k], x[:, k], rcond=None)[0]
        assert np.abs(projected - x[:, k]).max() < 1e-6 * np.abs(x[:, k]).max()
    assert np.abs(made.system.load.T @ made.system.load - known.system.load.T @ known.system.load).max() < (
        1e-6 * np.abs(known.system.load.T @ known.system.load).max()
    )


@pytest.mark.parametrize("residual_vectors, water", [(0, None), (6, None), (0, "westergaard")])
def test_the_finer_basis_from_the_disk_is_the_one_from_memory(
    residual_vectors, water, monkeypatch, through_the_disk, tmp_path
):
    where, model = built(water=water), ModelConfig(cutoff=400.0, residual_vectors=residual_vectors)
    made = reduce_scene_twice(where, model, DAMPING, BlockStore(tmp_path))
    monkeypatch.setattr(large, "LARGE", 1e12)
    known = reduce_scene_twice(where, model, DAMPING)
    for mine, other in zip(made, known, strict=True):
        assert isinstance(mine.basis["left"].vectors.left, Mapped)
        assert mine.system.size == other.system.size
        a, b = flexibility(mine.system), flexibility(other.system)
        assert np.abs(a - b).max() < 1e-6 * np.abs(b).max()
    assert made[1].system.size > made[0].system.size


def test_a_reduction_that_was_stopped_goes_on(monkeypatch, through_the_disk, tmp_path):
    where, cache = built(), BlockStore(tmp_path)
    known, solve = reduced(where, cache), large._constraint_modes
    for path in tmp_path.glob("block-*"):
        path.unlink()
    made = []

    def stops(*arguments):
        if len(made) == 2:
            raise KeyboardInterrupt
        made.append(arguments[-2])
        return solve(*arguments)

    monkeypatch.setattr(large, "_constraint_modes", stops)
    with pytest.raises(KeyboardInterrupt):
        reduced(where, cache)
    assert len(list(tmp_path.glob(".block-*.columns"))) == 1 and not list(tmp_path.glob("block-*"))
    again = []
    monkeypatch.setattr(large, "_constraint_modes", lambda *a: again.append(a[-2]) or solve(*a))
    found = reduced(where, cache)
    assert made == [0, 7] and again[0] == 14
    assert np.array_equal(found.system.K.diagonal(), known.system.K.diagonal())
    assert not list(tmp_path.glob(".block-*"))


def test_a_damaged_scratch_file_is_not_gone_on_with(through_the_disk, tmp_path):
    where, cache = built(), BlockStore(tmp_path / "cache")
    reduced(where, cache)
    keys = [h5py.File(path)["/"].attrs["key"] for path in cache.folder.glob("block-*")]
    for path in cache.folder.glob("block-*"):
        path.unlink()
    for key in keys:
        cache.scratch(key).write_bytes(b"not columns")
        cache.scratch(key).with_name(f"{cache.scratch(key).name}.done").write_text(f"{key} 5\n7 abc\n")
    assert reduced(where, cache).system.size > 0


def test_a_mapped_basis_that_was_changed_is_made_again(through_the_disk, tmp_path, caplog):
    where, cache = built(), BlockStore(tmp_path)
    known = reduced(where, cache)
    path = next(iter(tmp_path.glob("block-*")))
    with h5py.File(path, "r+") as file:
        file["basis"][5, 1, 2] += 1e-9
    found = reduced(where, cache)
    assert "carries no digest" in caplog.text
    assert np.array_equal(found.system.K.diagonal(), known.system.K.diagonal())


def test_memory_that_is_too_small_is_refused_before_anything_is_assembled(monkeypatch):
    monkeypatch.setattr("romdam.fem.assembly.assemble", None)
    with pytest.raises(ReductionError, match=r"left: \d+ unknowns need more than model.memory = 0 MB"):
        reduced(built(), memory=100.0)


def test_a_stored_model_is_read_whatever_memory_its_reduction_would_take(tmp_path):
    where, cache = built(), BlockStore(tmp_path)
    known = reduced(where, cache)
    found = reduced(where, cache, memory=100.0)
    assert np.array_equal(found.system.K.diagonal(), known.system.K.diagonal())
    next(iter(tmp_path.glob("block-*"))).unlink()
    with pytest.raises(ReductionError, match=r"unknowns need more than model.memory = 0 MB"):
        reduced(where, cache, memory=100.0)


@pytest.mark.parametrize("solver", ["superlu", "multigrid"])
def test_a_block_without_a_mode_below_the_cutoff_has_constraint_modes_and_static_vectors(
    solver, monkeypatch, through_the_disk, tmp_path
):
    """Lanczos on a block of many unknowns finds none below 5 Hz: a basis without modes is a basis."""
    monkeypatch.setattr("romdam.linalg.modes.eigen.SMALL", 100)
    monkeypatch.setattr("romdam.linalg.modes.eigen._DENSE_SIZE", 50)
    made = reduced(built(), BlockStore(tmp_path), solver=solver, cutoff=5.0)
    for report in (made.report["left"], made.report["right"]):
        assert report["fixed_interface_modes"] == 0 and report["highest_fixed_interface_hz"] == 0.0
        assert report["static_vectors"] >= 3
