"""Matrices of a part: its blocks' matrices added where their interfaces are merged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.basis import BlockBasis
from romdam.core.scene import Bools, Scene
from romdam.fem.assembly import Assembly
from romdam.geometry.elements import Floats
from romdam.scene.ties import Part, scene_parts


def assemble_part(part: Part, assembly: Assembly) -> tuple[csr_matrix, csr_matrix]:
    """Stiffness and mass over the part's DOFs, (3 nodes, 3 nodes) each; supports not applied."""
    size = 3 * part.nodes
    K, M = csr_matrix((size, size)), csr_matrix((size, size))
    for name in part.blocks:
        spread = part.spread(name)
        stiffness, mass = assembly.matrices(name)
        K, M = K + spread.T @ stiffness @ spread, M + spread.T @ mass @ spread
    return csr_matrix(K), csr_matrix(M)


def assemble_inertia(part: Part, scene: Scene, assembly: Assembly) -> Floats:
    """M r of the blocks that the ground's acceleration acts on, (3 nodes, 3) [kg].

    Block by block: the part's own mass lacks the coupling to slave nodes that supports hold.
    """
    still = scene.radiating
    return gather(part, {name: (name not in still) * assembly.inertia(name) for name in part.blocks})


def part_operator(part: Part, operators: dict[str, csr_matrix]) -> csr_matrix:
    """Gap operator over the part's DOFs from those of the blocks, (rows, 3 nodes)."""
    rows = next(iter(operators.values())).shape[0]
    total = csr_matrix((rows, 3 * part.nodes))
    for name in part.blocks:
        if name in operators:
            total = total + operators[name] @ part.spread(name)
    total = csr_matrix(total)
    total.eliminate_zeros()  # a gap between nodes that are one
    return total


def gather(part: Part, values: Mapping[str, Floats]) -> Floats:
    """Values per DOF of the blocks, (3 n,) or (3 n, k), added where DOFs are one."""
    total = 0.0
    for name in part.blocks:
        total = total + part.spread(name).T @ values[name]
    return np.asarray(total)


@dataclass(frozen=True)
class Unknowns:
    """Numbers of the free DOFs of a whole scene, part by part.

    Attributes
    ----------
    parts : part name -> slice of its unknowns
    free : part name -> (3 nodes,) True where no support holds
    of_block : block name -> (3 n, unknowns) matrix that takes its DOFs from the unknowns, zero where held
    """

    parts: dict[str, slice]
    free: dict[str, Bools]
    of_block: dict[str, csr_matrix]


def unknowns(scene: Scene) -> Unknowns:
    """Number the free DOFs of a scene."""
    parts = scene_parts(scene)
    free = {name: ~part.fixed(scene.fixed).ravel() for name, part in parts.items()}
    ends = np.cumsum([0, *(int(f.sum()) for f in free.values())])
    slices = {name: slice(a, b) for name, a, b in zip(parts, ends[:-1], ends[1:], strict=True)}
    of_block: dict[str, csr_matrix] = {}
    for key, part in parts.items():
        rows, columns = np.flatnonzero(free[key]), np.arange(slices[key].start, slices[key].stop)
        numbered = csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(3 * part.nodes, int(ends[-1])))
        of_block |= {name: csr_matrix(part.spread(name) @ numbered) for name in part.blocks}
    return Unknowns(slices, free, {name: of_block[name] for name in scene.blocks})


def basis_over_unknowns(scene: Scene, basis: Mapping[str, BlockBasis], size: int) -> Floats:
    """The reduced basis over a scene's free DOFs, (unknowns, size); u = basis @ q.

    Parameters
    ----------
    basis : of every block by name
    size : number of reduced coordinates
    """
    numbered = unknowns(scene)
    total = np.zeros((sum(int(free.sum()) for free in numbered.free.values()), size))
    for key, part in scene_parts(scene).items():
        first = basis[part.blocks[0]]
        whole = np.zeros((3 * part.every_node, first.vectors.shape[1]))
        for name in part.blocks:
            rows = (3 * part.number[name][:, None] + np.arange(3)).ravel()
            whole[rows] = basis[name].vectors.rows()
        total[numbered.parts[key], first.columns] = whole[: 3 * part.nodes][numbered.free[key]]
    return total
