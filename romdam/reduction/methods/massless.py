"""Reduction of a part without mass that joints alone connect with the others, such as rock below a dam.

Without inertia K u = f + B^T p at every instant: the part has no states of its own, and all that the joints
and the static loads see of it is in

    u = K^-1 [B^T, f] a,

its answers to a unit force in every gap and to the loads. They are combined so that K is diagonal with one
omega^2 for all; the unknowns of the system that belong to them have no mass (`romdam.core.system.System`), so
that integrators take them as a flexibility, and omega^2 scales the unknowns and nothing else.

References
----------
Monjaraz-Tec, Gross, Krack, Computers & Structures 260 (2022) 106698: massless boundaries are quasi-static.
"""

from __future__ import annotations

import logging

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags_array, hstack

from romdam.core.arrays import Floats, Ints
from romdam.core.basis import BlockBasis
from romdam.core.errors import ConfigError
from romdam.core.fingerprint import fingerprint
from romdam.core.scene import Scene
from romdam.fem.parts import gather, part_matrices, part_operator
from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import make_solver
from romdam.reduction.methods.block_loads import BlockLoads
from romdam.reduction.methods.craig_bampton import ModeChoice
from romdam.reduction.storage.keys import part_keys
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.storage.out_of_core_matrix import OutOfCoreMatrix
from romdam.scene.supports import rigid_motions
from romdam.scene.ties import Part, scene_parts

log = logging.getLogger(__name__)

_OMEGA2 = (2.0 * np.pi * 1e4) ** 2  # [1/s2] any would do
_DEPENDENT = 1e-12  # share of the largest flexibility, below which a direction is round-off
_NODES = 4096  # of a block's basis at a time


def has_no_mass(part: Part, scene: Scene) -> bool:
    """Tell whether no block of a part has mass."""
    return all(scene.blocks[name].material.rho == 0.0 for name in part.blocks)


def refuse_wet(scene: Scene) -> None:
    """Refuse water whose mass is on a part without mass.

    Raises
    ------
    ConfigError
    """
    wet = {face.block for face in scene.reservoir.faces} if scene.reservoir is not None else set()
    for part in scene_parts(scene).values():
        if has_no_mass(part, scene) and wet & set(part.blocks):
            raise ConfigError(
                f"water.faces: block {min(wet & set(part.blocks))!r} has no mass, and its reduced model no "
                "inertia that the water's could be added to; leave its faces out, leave out `mass: false`, "
                "or set model.order: full"
            )


def massless_keys(part: Part, scene: Scene, block_loads: BlockLoads) -> dict[str, str]:
    """Block name -> what its basis is stored under; no choice of modes moves it."""
    operator, static = part_operator(part, block_loads.operators), gather(part, block_loads.forces)
    return part_keys(part, scene, operator, static, ModeChoice(count=0))


def massless_bases(
    part: Part, scene: Scene, block_loads: BlockLoads, choice: ModeChoice, store: BlockStore | None = None
) -> dict[str, BlockBasis]:
    """The bases of a massless part's blocks, of the same coordinates: from the store, or made and kept there.

    Parameters
    ----------
    choice : its solver counts, its modes do not

    Raises
    ------
    ReductionError
        where the factorisation fails.
    """
    store, keys = store or BlockStore.passing(), massless_keys(part, scene, block_loads)
    kept = {name: basis for name, key in keys.items() if (basis := store.read(key)) is not None}
    if len(kept) == len(keys):
        return kept
    free = ~part.fixed(scene.fixed).ravel()
    dofs = [(3 * part.number[name][:, None] + np.arange(3)).ravel() for name in part.blocks]
    row = np.where(free, np.cumsum(free) - 1, -1)[np.concatenate(dofs)]
    T, flexibility = _answers(part, scene, block_loads, choice, store, fingerprint(keys), row)
    mix, found, first = _combined(flexibility), dict[str, BlockBasis](), 0
    report = {"retained_dofs": T.shape[1], "fixed_interface_modes": 0, "part": part.name}
    for name, key in keys.items():
        block = scene.blocks[name]
        last = first + 3 * len(block.points)
        rows = T.times(mix, [*range(first, last, 3 * _NODES), last])
        omega2, none = np.full(mix.shape[1], _OMEGA2), np.zeros((last - first, 3))
        found[name] = store.write_streamed(key, block, omega2, rows, none, dict(report))
        first = last
    T.remove()
    return found


def _answers(
    part: Part,
    scene: Scene,
    block_loads: BlockLoads,
    choice: ModeChoice,
    store: BlockStore,
    key: str,
    row: Ints,
) -> tuple[OutOfCoreMatrix, Floats]:
    """K^-1 R over the DOFs of every block, and R^T K^-1 R, for unit forces in gaps and static loads R.

    Parameters
    ----------
    store, key : where the answers go, and what they are stored under
    row : the number of every DOF of every block among the free ones, -1 where held
    """
    free, place = ~part.fixed(scene.fixed).ravel(), f"part {part.name}, which has no mass"
    K = csr_matrix(part_matrices(part, scene.blocks)[0][free][:, free])
    static = gather(part, block_loads.forces)[free, None]
    right = _unit_columns(part_operator(part, block_loads.operators)[:, free].T, static)
    rigid = rigid_motions(part.mesh(scene.blocks)).reshape(-1, 6)
    solver = make_solver(K, Motions(np.flatnonzero(free), rigid[free]), right.shape[1], choice.solving, place)
    T = OutOfCoreMatrix(store.scratch(key), key, (len(row), right.shape[1]))
    T.fill(T.shape[1], lambda a, b: _over_blocks(solver.solve(right[:, a:b].toarray()), row))
    log.info("%s: %d static answers", place, T.shape[1])
    first = np.empty(len(K.indptr) - 1, dtype=np.int64)  # where each free DOF stands first
    here = np.flatnonzero(row >= 0)[::-1]
    first[row[here]] = here
    across = csr_matrix(right.T)
    forces = csr_matrix((across.data, first[across.indices], across.indptr), shape=T.shape[::-1])
    return T, T.before(forces)


def _over_blocks(values: Floats, row: Ints) -> Floats:
    """Values of the free DOFs over those of every block, zero where held."""
    return np.where((row >= 0)[:, None], values[row], 0.0)


def _combined(flexibility: Floats) -> Floats:
    """The combinations of answers, of unit omega^2 each, without directions that are round-off."""
    scale = 1.0 / np.sqrt(np.maximum(flexibility.diagonal(), np.finfo(float).tiny))
    size, U = np.linalg.eigh(0.5 * (flexibility + flexibility.T) * scale * scale[:, None])
    keep = size > _DEPENDENT * size.max(initial=0.0)
    return np.asarray(scale[:, None] * U[:, keep] * np.sqrt(_OMEGA2 / size[keep]))


def _unit_columns(operator: csr_matrix, static: Floats) -> csc_matrix:
    """The columns that are not zero, each of unit length."""
    right = csc_matrix(hstack([operator, csc_matrix(static)]))
    length = np.sqrt(np.asarray(right.multiply(right).sum(axis=0)).ravel())
    some = np.flatnonzero(length > 0.0)
    return csc_matrix(right[:, some] @ diags_array(1.0 / length[some]))
