"""Exports say, or carry, that damping leaves rigid motions alone which joints alone hold."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from decks import boxes, built
from scipy.io import mmread
from small_scenes import scene
from test_massless import raw_block_on_rock

from romdam.config import parse_config
from romdam.config.load import Job
from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.core.scene import BlockMatrices
from romdam.core.sealed import reading
from romdam.effects.full_order import assemble_full
from romdam.export.matrices import write
from romdam.fem.assembly import assemble
from romdam.fem.parts import unknowns
from romdam.pipelines.job_warnings import with_scene_warnings
from romdam.reduction.natural_modes import natural_modes

ALPHA, BETA = 1.64, 4e-4
DAMPING = DampingConfig(rayleigh=RayleighConfig(alpha=ALPHA, beta=BETA))


def translations(count):
    return np.tile(np.eye(3), (count, 1))


def test_decks_say_that_the_other_code_brakes_what_joints_hold():
    slab = {"material": "concrete", "box": {"origin": [0, 0, 20], "size": [5, 10, 5], "element_size": 5}}
    raw = boxes()
    raw["blocks"] |= {"slab": slab}
    raw["joints"] |= {"bed": {"between": ["right", "slab"], "normal_stiffness": "16 GPa/m"}}
    (sentence,) = built(raw)[1].stated
    assert "alpha = 2.86 1/s, brakes the rigid motion of what joints alone hold (slab)" in sentence
    assert not built(boxes())[1].stated, "supports hold both"


def test_matrices_of_a_mesh_carry_what_is_taken_off(tmp_path):
    """C = damping - drag drag^T has no force on translations, in the block's files and in the system's."""
    whole = scene(raw_block_on_rock(stiff=1.0) | {"model": {"order": "full"}})
    write(whole, assemble_full(whole, DAMPING), None, DAMPING, tmp_path)
    C, D = (mmread(tmp_path / f"block_{key}.mtx") for key in ("damping", "drag"))
    assert D.shape[1] == 6
    C = C.toarray() - D @ D.T
    T = translations(len(C) // 3)
    assert np.abs(C @ T).max() <= 1e-9 * np.abs(C).max()
    assert np.linalg.eigvalsh(C)[6:].min() > 0.0
    assert not (tmp_path / "rock_drag.mtx").exists()
    with reading(tmp_path / "system.h5") as file:
        assert file["drag"].shape[1] == 6


def test_a_matrix_that_a_block_brings_acts_as_it_is_and_is_told():
    """C = alpha M + beta K as a matrix stands in Rayleigh's place and brakes; beta K alone does not."""
    raw = raw_block_on_rock(stiff=1.0) | {"damping": {"rayleigh": {"alpha": ALPHA, "beta": BETA}}}
    plain = scene(raw)
    block = plain.blocks["block"]
    K, M = assemble(block)
    motion = np.tile(np.arange(3), (len(block.points), 1))
    unit = translations(len(block.points))
    job = Job(parse_config(raw, "job.yaml"), Path("job.yaml"))
    told = {}
    for name, C in (("braked", ALPHA * M + BETA * K), ("free", BETA * K)):
        own = BlockMatrices(K, M, motion, unit, C, None, np.zeros(K.shape[0]))
        brought = replace(plain, blocks=plain.blocks | {"block": replace(block, matrices=own)})
        system = assemble_full(brought, DAMPING)
        rows = system.parts["block"]
        assert np.abs(system.damping_force(np.eye(system.size))[rows, rows] - C).max() <= 1e-9 * abs(C).max()
        told[name] = with_scene_warnings(brought, job).scene_warnings
    assert "blocks.block.matrices.damping: acts on rigid motion too, up to 1.64 1/s" in told["braked"][0]
    assert not told["free"]
    assert "acts on what strains block" in with_scene_warnings(plain, job).scene_warnings[0]


@pytest.mark.parametrize("bonded", [True, False])
def test_ratios_of_modes_are_those_of_the_damping_that_runs_have(bonded):
    """phi^T C phi / (2 omega) with C of the mesh, joints open and on their springs."""
    whole = scene(raw_block_on_rock(stiff=0.01))
    found = natural_modes(whole, DAMPING, 9, bonded)
    system = assemble_full(whole, DAMPING)
    of_block = unknowns(whole).of_block
    free = sum(matrix.T @ found.shapes[name].reshape(9, -1).T for name, matrix in of_block.items())
    c = np.einsum("nm,nm->m", free, system.damping_force(free)) / found.modal_mass
    some = found.freq > 0.0
    exact = c[some] / (4.0 * np.pi * found.freq[some])
    assert found.damping_ratio[some] == pytest.approx(exact, rel=1e-6)
    assert some.sum() == (9 if bonded else 3)
