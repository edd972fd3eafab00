"""Input that makes matrices bad: solved to the tolerance by every solver, or refused with the reason."""

import dataclasses

import numpy as np
import pytest

from romdam.config.sections.geometry.mesh_file import MeshFileConfig
from romdam.config.sections.job import BoxConfig, DampingConfig
from romdam.core.errors import MeshError
from romdam.core.scene import Material, Scene, Tie
from romdam.fem.assembly import Assembly, assemble
from romdam.fem.parts import assemble_part
from romdam.geometry.boxes import box_block
from romdam.geometry.meshes.files import MeshFiles
from romdam.geometry.meshes.quality import refuse_bad_cells
from romdam.linalg.modes.eigen import modes_below
from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import Solving, make_solver
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.supports import rigid_motions
from romdam.scene.ties import merged_parts

CONCRETE = Material(30e9, 0.2, 2400.0)


def box(size, edges, material=CONCRETE, origin=(0.0, 0.0, 0.0), name="b"):
    config = BoxConfig(origin=origin, size=size, element_size=edges, element="tet10")
    return box_block(name, config, material, name)


def held(block, K, M):
    free = np.repeat(block.points[:, 2] > 0.0, 3)
    motions = Motions(np.flatnonzero(free), rigid_motions(block).reshape(-1, 6)[free])
    return K[free][:, free], M[free][:, free], motions


def flat_elements():
    """Aspect ratio 50: 2.5 m by 2.5 m by 5 cm."""
    block = box((5.0, 5.0, 0.2), (2.5, 2.5, 0.05))
    return held(block, *assemble(block))


def nearly_incompressible():
    block = box((2.0, 2.0, 6.0), 1.0, Material(30e9, 0.49, 2400.0))
    return held(block, *assemble(block))


def soft_on_stiff():
    """A block of 3 MPa grown together with one of 30 GPa below it."""
    low = box((2.0, 2.0, 3.0), 1.0, name="low")
    high = box((2.0, 2.0, 3.0), 1.0, dataclasses.replace(CONCRETE, E=3e6), (0.0, 0.0, 3.0), "high")
    below, above = (np.flatnonzero(b.points[:, 2] == 3.0) for b in (low, high))
    order = [b[np.lexsort(p.points[b].T)] for b, p in ((below, low), (above, high))]
    blocks = {"low": low, "high": high}
    tie = Tie("t", ("low", "high"), (order[0], order[1]))
    (part,) = merged_parts({n: np.zeros(b.points.shape, bool) for n, b in blocks.items()}, (tie,)).values()
    return held(part.mesh(blocks), *assemble_part(part, Assembly(blocks)))


CASES = {"aspect ratio 50": flat_elements, "nu 0.49": nearly_incompressible, "contrast 1e4": soft_on_stiff}


@pytest.mark.parametrize("case", list(CASES))
def test_every_solver_reaches_the_tolerance(case):
    pytest.importorskip("pypardiso")
    K, M, motions = CASES[case]()
    forces = np.random.default_rng(2).standard_normal((K.shape[0], 3))
    answers, modes = {}, {}
    for name in ("superlu", "pardiso", "multigrid"):
        solver = make_solver(K, motions, 3, Solving(name), case)
        assert type(solver).__name__ == {"superlu": "Factor", "pardiso": "PardisoFactor"}.get(
            name, "Multigrid"
        )
        answers[name] = solver.solve(forces)
        modes[name] = modes_below(K, M, 6, None, solver)
    scale = np.abs(answers["superlu"]).max()
    for name in ("pardiso", "multigrid"):
        assert np.abs(answers[name] - answers["superlu"]).max() < 1e-6 * scale
        omega2, phi = modes[name]
        assert np.abs(omega2 / modes["superlu"][0] - 1.0).max() < 1e-7
        overlap = np.linalg.svd(phi[:, :3].T @ (M @ modes["superlu"][1]), compute_uv=False)
        assert 1.0 - overlap.min() < 1e-10


def test_a_loose_node_is_named():
    block = box((2.0, 2.0, 2.0), 1.0)
    loose = dataclasses.replace(block, points=np.vstack([block.points, [5.0, 6.0, 7.5]]))
    message = rf"node {len(block.points)} at \(5, 6, 7.5\) of block 'b' belongs to no element \(1 such"
    with pytest.raises(MeshError, match=message):
        refuse_bad_cells(loose, "mesh")
    fixed = np.repeat(loose.points[:, 2:] == 0.0, 3, axis=1)
    scene = Scene({"b": loose}, {}, {"b": fixed})
    with pytest.raises(MeshError, match=message):
        reduce_scene(scene, ModeChoice(count=3), DampingConfig())


def test_a_loose_node_of_a_mesh_file_is_named_and_left_out(tmp_path):
    import meshio

    block = box((2.0, 2.0, 2.0), 1.0)
    points = np.vstack([[5.0, 6.0, 7.5], block.points])
    meshio.write(tmp_path / "b.vtu", meshio.Mesh(points, [("tetra10", block.cells + 1)]))
    files = MeshFiles(tmp_path)
    read = files.block("b", MeshFileConfig(file="b.vtu"), CONCRETE, "job: blocks.b.mesh")
    assert len(read.points) == len(block.points)
    (remark,) = files.remarks
    assert "node 0 (at (5, 6, 7.5) in the file's unit) belongs to no element" in remark


def test_duplicate_nodes_inside_a_block_are_counted():
    """A box whose upper half stands on nodes of its own: 25 pairs on the cut of 2 x 2 quadratic elements."""
    block = box((2.0, 2.0, 2.0), 1.0)
    upper = block.points[block.cells].mean(axis=1)[:, 2] > 1.0
    cut = np.flatnonzero(block.points[:, 2] == 1.0)
    twin = np.arange(len(block.points))
    twin[cut] = len(block.points) + np.arange(len(cut))
    cells = block.cells.copy()
    cells[upper] = twin[cells[upper]]
    cracked = dataclasses.replace(block, points=np.vstack([block.points, block.points[cut]]), cells=cells)
    with pytest.raises(MeshError, match=r"25 pairs of nodes of block 'b' coincide .* merge duplicate nodes"):
        refuse_bad_cells(cracked, "mesh")
    refuse_bad_cells(block, "mesh")
