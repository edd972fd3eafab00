"""Reduced blocks are found again by what they depend on, and nothing damaged or foreign is ever used."""

import logging
import os
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from small_scenes import DAMPING, march, raw, scene

from romdam.config.sections.job import ModelConfig, RayleighConfig
from romdam.core.basis import BlockBasis
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Material, Scene
from romdam.core.system import with_parameters
from romdam.fem.gaps import gap_law
from romdam.reduction.basis import Augmented, Dense, Mapped
from romdam.reduction.methods.craig_bampton import CraigBampton
from romdam.reduction.methods.residual_vectors import FINER_VECTORS
from romdam.reduction.storage import model_file
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import ReducedModel, reduce_scene, reduce_scene_twice
from romdam.results.model_info import model_lines

MODEL = ModelConfig(modes=6, residual_vectors=2)


@pytest.fixture
def counted(monkeypatch):
    """Names of the blocks that are reduced, one entry each time."""
    done = []
    real = CraigBampton.reduce

    def reduce(self, substructure, *rest):
        done.extend(substructure.blocks)
        return real(self, substructure, *rest)

    monkeypatch.setattr(CraigBampton, "reduce", reduce)
    return done


def reduced(store: BlockStore | None, built: Scene | None = None, **settings) -> ReducedModel:
    options = {"model": MODEL, "damping": DAMPING} | settings
    return reduce_scene(built or scene(raw()), store=store, **options)


def identical(a: ReducedModel, b: ReducedModel) -> bool:
    dense = [(x.system.B.toarray(), x.system.K.toarray(), x.system.C.toarray()) for x in (a, b)]
    plain = [(x.system.load, x.system.force, x.system.observe.toarray()) for x in (a, b)]
    return all(np.array_equal(x, y) for pair in (dense, plain) for x, y in zip(*pair, strict=True))


def with_joints(built: Scene, **changes) -> Scene:
    return replace(built, joints={k: replace(j, **changes) for k, j in built.joints.items()})


def test_second_reduction_reads_every_block_and_changes_no_bit(tmp_path, counted):
    plain, first = reduced(None), reduced(BlockStore(tmp_path))
    blocks = list(plain.basis)
    assert counted == 2 * blocks
    second = reduced(BlockStore(tmp_path))
    assert counted == 2 * blocks, "nothing may be reduced again"
    assert identical(plain, first) and identical(first, second)
    assert second.report.keys() == plain.report.keys()
    assert all(second.report[name] == plain.report[name] for name in blocks)


def test_the_finer_basis_is_kept_beside_and_both_are_found(tmp_path, counted):
    store, built = BlockStore(tmp_path), scene(raw())
    made = reduce_scene_twice(built, MODEL, DAMPING, store)
    assert counted == list(made[0].basis), "each block is factored once for both"
    found = reduce_scene_twice(built, MODEL, DAMPING, store)
    assert identical(reduced(store, built), made[0])
    assert len(counted) == len(made[0].basis), "nothing may be reduced again"
    assert all(identical(a, b) for a, b in zip(made, found, strict=True))
    assert made[1].system.size > made[0].system.size
    for name, finer in found[1].basis.items():
        assert (
            isinstance(finer.vectors, Augmented)
            and finer.vectors.inner.vectors is found[0].basis[name].vectors
        )


def test_of_a_finer_basis_the_file_has_what_the_other_has_not(tmp_path):
    coarse, fine = reduce_scene_twice(scene(raw()), MODEL, DAMPING, BlockStore(tmp_path))
    columns = {}
    for path in tmp_path.glob("block-*.h5"):
        with h5py.File(path) as file:
            if "mix" in file:
                columns[path] = file["basis"].shape[2]
    more = [len(fine.basis[name].omega2) - len(own.omega2) for name, own in coarse.basis.items()]
    assert sorted(columns.values()) == sorted(more) and 0 < max(more) <= FINER_VECTORS
    for path, own in columns.items():
        lines = model_lines(path)
        assert "block (cache), finer basis of an error estimate" in lines
        assert lines[-1].endswith(f"modes of another file, {own} residual vectors beside them")


def test_a_finer_basis_stands_on_the_mapped_one(tmp_path, monkeypatch):
    """The one in memory goes when it is written."""
    built, known = scene(raw()), reduce_scene_twice(scene(raw()), MODEL, DAMPING)
    monkeypatch.setattr(model_file, "_MAPPED", 1.0)
    for _ in range(2):  # made, and read
        models = reduce_scene_twice(built, MODEL, DAMPING, BlockStore(tmp_path))
        for own, finer in zip(models[0].basis.values(), models[1].basis.values(), strict=True):
            assert isinstance(own.vectors, Mapped)
            assert isinstance(finer.vectors, Augmented) and finer.vectors.inner.vectors is own.vectors
        assert all(identical(a, b) for a, b in zip(known, models, strict=True))


def test_a_finer_basis_over_one_of_another_reduction_is_made_again(tmp_path, counted, caplog):
    """Two machines that share a store each leave one of the pair: the other's modes have other signs."""
    store, built = BlockStore(tmp_path), scene(raw())
    coarse, fine = reduce_scene_twice(built, MODEL, DAMPING, store)
    name = next(iter(coarse.basis))
    own = replace(coarse.basis[name], columns=slice(0, len(coarse.basis[name].omega2)))
    signs = np.where(np.arange(len(own.omega2)) == 3, -1.0, 1.0)
    turned = replace(
        own,
        vectors=Dense(own.vectors.rows() * signs),
        participation=own.participation * signs[:, None],
    )
    for path in tmp_path.glob("block-*.h5"):
        with h5py.File(path) as file:
            found, key = "mix" not in file and np.array_equal(file["omega2"], own.omega2), file.attrs["key"]
        if found:
            store.write(key, built.blocks[name], turned)
            break
    before = len(counted)
    with caplog.at_level(logging.WARNING):
        again = reduce_scene_twice(built, MODEL, DAMPING, store)
    assert counted[before:] == [name]
    assert "the basis that it contains is of another reduction" in caplog.text
    assert all(identical(a, b) for a, b in zip((coarse, fine), again, strict=True))


def test_joints_damping_and_loads_reduce_nothing(tmp_path, counted):
    built, store = scene(raw()), BlockStore(tmp_path)
    reduced(store, built)
    before = len(counted)
    joint = next(iter(built.joints.values()))
    other = with_joints(built, K_n=2.0 * joint.K_n, gap=joint.gap + 1e-3)
    other = replace(other, loads=replace(other.loads, gravity=np.array([0.0, 0.0, -5.0])))
    damping = DAMPING.model_copy(update={"rayleigh": RayleighConfig(alpha=0.1, beta=1e-3)})
    found = reduced(store, other, damping=damping)
    assert len(counted) == before
    assert identical(found, reduced(None, other, damping=damping))


@pytest.mark.parametrize("change", ["material", "mesh", "modes", "friction", "supports"])
def test_what_the_basis_depends_on_reduces_again(tmp_path, counted, change):
    built, store = scene(raw()), BlockStore(tmp_path)
    reduced(store, built)
    settings, other = {}, built
    name, block = next(iter(built.blocks.items()))
    if change == "material":
        other = replace(
            built, blocks=built.blocks | {name: replace(block, material=replace(block.material, E=1.0e10))}
        )
    elif change == "mesh":
        other = replace(built, blocks=built.blocks | {name: replace(block, points=1.0001 * block.points)})
    elif change == "modes":
        settings = {"model": ModelConfig(modes=7, residual_vectors=2)}
    elif change == "friction":
        joint = next(iter(built.joints.values()))
        other = with_joints(built, mu=joint.mu + 0.5, K_s=joint.K_n)
    else:
        fixed = built.fixed[name].copy()
        fixed[:, 0] |= fixed[:, 1]
        fixed[np.flatnonzero(~fixed.any(axis=1))[0]] = True
        other = replace(built, fixed=built.fixed | {name: fixed})
    before = len(counted)
    found = reduced(store, other, **settings)
    assert len(counted) > before and name in counted[before:]
    assert identical(found, reduced(None, other, **settings))


@pytest.mark.parametrize("damage", ["truncated", "empty", "flipped", "foreign", "another key", "old layout"])
def test_damaged_and_foreign_files_are_noticed_and_made_again(tmp_path, counted, caplog, damage):
    plain, store = reduced(BlockStore(tmp_path)), BlockStore(tmp_path)
    first, second = sorted(tmp_path.glob("block-*.h5"))[:2]
    if damage == "truncated":
        first.write_bytes(first.read_bytes()[:-500])
    elif damage == "empty":
        first.write_bytes(b"")
    elif damage == "foreign":
        first.write_bytes(b"not HDF5 at all")
    elif damage == "another key":
        first.write_bytes(second.read_bytes())
    else:
        with h5py.File(first, "r+") as file:
            if damage == "flipped":
                file["basis"][0, 0, 0] += 1e-9
            else:
                file.attrs["layout"] = "romdam-block-0"
    before = len(counted)
    with caplog.at_level(logging.WARNING):
        found = reduced(store)
    assert len(counted) == before + 1 and first.name in caplog.text and "reducing again" in caplog.text
    assert identical(found, plain)
    reduced(store)
    assert len(counted) == before + 1, "the mended file is good"


def test_basis_for_friction_serves_frictionless_joints_too():
    built = scene(raw())
    joint = next(iter(built.joints.values()))
    rough = with_joints(built, mu=joint.mu + 0.5, K_s=joint.K_n)
    everything = ModelConfig(modes="all")
    smooth, made = (reduced(None, s, model=everything) for s in (built, rough))
    back = with_parameters(made.system, smooth.system.law, None)
    assert back.law.directions == 1 and back.B.shape == smooth.system.B.shape
    assert np.array_equal(back.B.toarray(), made.system.B.toarray()[::3])
    runs = [march(system) for system in (smooth.system, back)]
    np.testing.assert_allclose(runs[1].jump, runs[0].jump, atol=1e-6 * np.abs(runs[0].jump).max())
    with pytest.raises(ConfigError, match="reduce it with friction"):
        with_parameters(smooth.system, gap_law(rough), None)


def test_a_large_basis_is_checked_without_coming_into_memory(tmp_path):
    """What is resident grows by less than a tenth of it, and a changed word in its middle is seen."""
    nodes, modes = 40_000, 100
    matrix = np.random.default_rng(0).standard_normal((3 * nodes, modes))
    points, cells = np.zeros((nodes, 3)), np.arange(nodes).reshape(-1, 8)
    block = Block("b", "hex8", points, cells, Material(1.0, 0.0, 1.0), {})
    basis = BlockBasis(Dense(matrix), slice(0, modes), np.ones(modes), np.zeros((modes, 3)), {})
    store = BlockStore(tmp_path)
    store.write("key", block, basis)
    before = resident()
    found = store.read("key")
    assert found is not None and resident() - before < 0.1 * matrix.nbytes
    assert np.array_equal(found.vectors.rows(slice(777, 778))[0], matrix[777])
    with h5py.File(store.path("key"), "r+") as file:
        file["basis"][nodes // 2, 1, modes // 2] += 1e-9
    assert store.read("key") is None


def resident() -> int:
    """Bytes of this process in memory, with the pages of maps."""
    status = Path("/proc/self/statm")
    if not status.is_file():
        pytest.skip("the system does not tell")
    return int(status.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
