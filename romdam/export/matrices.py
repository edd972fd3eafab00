"""Blocks and the whole system as matrices in Matrix Market and HDF5.

Every block is part of M u'' + C u' + K u = force - inertia a_g + G^T p; the jumps w are the sum of G u over
all blocks. At full order its unknowns are the displacements of all its nodes, supports not applied, and C of
what joints alone hold is `damping` less D D^T, D its `drag` (see `romdam.fem.damping`). Reduced, they are
those that joints and outputs see, u_b, and coordinates z of its own: the basis V over the open-joint modes q
has rows V_b there, and q = R u_b + N z with V_b R = 1 and V_b N = 0. N^T diag(omega^2) N is made diagonal,
and R is such that u_b and z have no stiffness in common: the form of Craig and Bampton.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import mmwrite
from scipy.sparse import csr_matrix, issparse

from romdam.config.sections.job import DampingConfig
from romdam.contact.laws.catalogue import further_keys
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.files import replacing
from romdam.core.known import refuse_unknown
from romdam.core.motion import Motion
from romdam.core.scene import Block, Reservoir, Scene
from romdam.core.sealed import creating
from romdam.core.system import System
from romdam.fem.assembly import assemble, inertia
from romdam.fem.damping import (
    further_damping,
    further_drag,
    joints_alone_hold,
    rayleigh_coefficients,
    rigid_drag,
    sliding_motions,
)
from romdam.fem.gaps import gap_operators
from romdam.fem.loads import surface_force
from romdam.geometry.matrices.data import DIRECTIONS, INTERNAL, MatrixUnknowns
from romdam.geometry.matrices.hdf5 import write_matrix, write_unknowns
from romdam.reduction.synthesis import ReducedModel
from romdam.scene.ties import scene_parts

log = logging.getLogger(__name__)

_RANK = 1e-9  # of the least singular value of V_b, relative to the largest, from which on u_b are independent
_RIGID = 1e-12  # of omega^2 held at u_b, relative to the largest, up to which a motion is rigid

_WRITTEN = "written as matrices"
_OF_BLOCK = {
    "name", "element", "points", "cells", "material", "faces", "absorbing", "matrices", "unsound_faces",
}  # fmt: skip
_OF_MATERIAL = {"E", "nu", "rho", "expansion", "damping"}
_OF_SYSTEM = {
    "M", "C", "K", "B", "load", "force", "load_steps", "observe", "at_point", "point_shift", "law", "parts",
    "diagonal", "floating", "reduced", "motions", "drag", "uplift", "extent",
}  # fmt: skip
_OF_GAPS = {
    "K_n", "K_nz", "K_s", "mu", "gap", "slip", "joints", "laws", "viscosity", "grout", "slipped", "memory",
    "uplift",
}  # fmt: skip
_BASE_ALONE = "leave it out: in what is written the base's acceleration alone drives the system"
_REMEDIES = {
    "drives": ("ground.input: free_field, or water.model: compressible,", _BASE_ALONE),
    "gyroscopic": ("water.model: compressible", _BASE_ALONE),
    "pseudo_static": ("supports[].motion, or ground.along,", _BASE_ALONE),
    "signals": ("loads.force_history", _BASE_ALONE),
    "initial": ("loads.initial_state.result: what joints remember of another run", "set static"),
    "construction": ("construction: what joints count from once they are grouted", "leave it out"),
}


@dataclass(frozen=True)
class BlockExport:
    """Matrices and loads of a block as they are written, in SI.

    Attributes
    ----------
    unknowns : of every row
    stiffness, mass, damping : (n, n), the damping without what modes are given by ratios
    gaps : (directions * ng, n) jump of all gaps
    inertia : (n, 3) M r for unit accelerations along x, y, z
    force : (n, 1) static force of all loads but weight and water in joints
    drag : (n, k) D, where C is `damping` - D D^T, a full matrix; without columns where it is `damping`
    """

    unknowns: MatrixUnknowns
    stiffness: csr_matrix
    mass: csr_matrix
    damping: csr_matrix
    gaps: csr_matrix
    inertia: Floats
    force: Floats
    drag: Floats


def write(
    scene: Scene, system: System, reduced: ReducedModel | None, damping: DampingConfig, folder: Path
) -> list[Path]:
    """Write every block, reduced where there is a reduced model, and the system that is integrated.

    Blocks that no matrices of their own can say, for ties, water or too small a basis, are named in the log.

    Parameters
    ----------
    system : with its joints open
    reduced : the reduced model that it is of, if any
    folder : there already

    Returns
    -------
    list of files: BLOCK.h5 and BLOCK_stiffness.mtx, ..., for each block, system.h5

    Raises
    ------
    ConfigError
        where more drives the system than the base's acceleration, or its runs begin with the state of another
        run, which no matrix says.
    WriteError
    """
    _refuse(scene, system)
    left_out = further_keys(system.law) + ["grouting_pressure"] * bool(system.law.grout.any())
    left_out += ["water that follows cracks"] * bool(system.law.uplift)
    if left_out:
        log.warning("left out of the joints: %s", ", ".join(left_out))
    operators = gap_operators(scene, system.law.directions)
    written = [_write_system(system, folder / "system.h5")]
    for name, block in scene.blocks.items():
        if reduced is None:
            export: BlockExport | str = _unreduced(scene, block, operators[name], damping)
        else:
            export = _reduced(scene, reduced, name, operators[name])
        if isinstance(export, str):
            log.warning("block %s: no matrices of its own, %s; system.h5 has all of it", name, export)
        else:
            written += _write_block(export, name, folder)
    return written


def _refuse(scene: Scene, system: System) -> None:
    """Refuse what the written matrices do not say."""
    for block in scene.blocks.values():
        refuse_unknown(block, _OF_BLOCK, _WRITTEN)
        refuse_unknown(block.material, _OF_MATERIAL, _WRITTEN)
    refuse_unknown(system, _OF_SYSTEM, _WRITTEN, _REMEDIES)
    refuse_unknown(system.law, _OF_GAPS, _WRITTEN)
    others = [motion for motion in system.motions if motion is not Motion.BASE]
    if others:
        raise ConfigError(f"a load that follows the {others[0]} is not {_WRITTEN}; {_BASE_ALONE}")


def _unreduced(scene: Scene, block: Block, gaps: csr_matrix, damping: DampingConfig) -> BlockExport:
    K, M = assemble(block)
    alpha, beta = rayleigh_coefficients(damping.rayleigh)
    further = further_damping(block, damping.rayleigh)
    C = alpha * M + beta * K if further is None else alpha * M + beta * K + further
    matrices = block.matrices
    motion = np.tile(np.arange(3), len(block.points)) if matrices is None else matrices.motion.ravel()
    some = np.flatnonzero(motion >= 0)
    return BlockExport(
        unknowns=_named(block, some, motion[some]),
        stiffness=csr_matrix(K[some][:, some]),
        mass=csr_matrix(M[some][:, some]),
        damping=csr_matrix(C[some][:, some]),
        gaps=csr_matrix(gaps[:, some]),
        inertia=inertia(block, M)[some],
        force=surface_force(scene, block.name).reshape(-1, 1)[some],
        drag=_drag(scene, block, K, M, alpha + further_drag(block, damping.rayleigh))[some],
    )


def _drag(scene: Scene, block: Block, K: csr_matrix, M: csr_matrix, alpha: float) -> Floats:
    """D of a block, see `romdam.fem.damping`; without columns where not joints alone hold it.

    Parameters
    ----------
    alpha : of the mass term of its damping [1/s]
    """
    part = next(part for part in scene_parts(scene).values() if block.name in part.blocks)
    if alpha == 0.0 or not joints_alone_hold(part, scene):
        return np.zeros((K.shape[0], 0))
    if len(part.blocks) > 1:
        log.warning(
            "block %s: its damping matrix acts on the rigid motion of %s, which joints alone hold and romdam "
            "does not damp; `drag` of system.h5 takes that off",
            block.name, part.name,
        )  # fmt: skip
        return np.zeros((K.shape[0], 0))
    free = ~part.fixed(scene.fixed).ravel()
    motions = sliding_motions(part, scene, K[free][:, free], M[free][:, free], free)
    R = np.zeros((K.shape[0], motions.shape[1]))
    R[free] = motions
    return rigid_drag(alpha * (M @ R), R)


def _named(block: Block, dof: Ints, motion: Ints, more: int = 0) -> MatrixUnknowns:
    """Unknowns by the number of their node, from 1; rotations and other coordinates have one each."""
    node = np.where(motion < 3, dof // 3, len(block.points) + dof) + 1
    position = np.where((motion != INTERNAL)[:, None], block.points[dof // 3], np.nan)
    behind = 4 * len(block.points) + 1 + np.arange(more)
    return MatrixUnknowns(
        np.concatenate([node, behind]),
        np.concatenate([motion, np.full(more, INTERNAL)]),
        np.concatenate([position, np.full((more, 3), np.nan)]),
    )


def _reduced(scene: Scene, reduced: ReducedModel, name: str, gaps: csr_matrix) -> BlockExport | str:
    """Reduce a block to what joints and outputs see and coordinates of its own, or say why that cannot be."""
    block, basis = scene.blocks[name], reduced.basis[name]
    part = next(part for part in scene_parts(scene).values() if name in part.blocks)
    if len(part.blocks) > 1:
        return f"since ties make it one with {', '.join(b for b in part.blocks if b != name)}"
    if scene.find(Reservoir) is not None:
        return "since water couples it to others"
    if block.material.rho == 0.0:
        return "since it has no mass"
    # (3 n,) displacements that joints see, and of nodes that are written, less what supports hold
    seen = np.zeros(gaps.shape[1], dtype=bool)
    seen[np.unique(gaps.indices[gaps.data != 0.0])] = True
    for probe in scene.probes:
        if probe.block == name:
            seen[3 * probe.node : 3 * probe.node + 3] = True
    seen &= ~scene.fixed[name].ravel()
    V_b = basis.vectors.rows(np.flatnonzero(seen))
    singular = np.linalg.svd(V_b, compute_uv=False)
    if len(V_b) > V_b.shape[1] or (len(singular) and singular[-1] < _RANK * singular[0]):
        rank = int(np.count_nonzero(singular >= _RANK * singular.max(initial=0.0)))
        return (
            f"since joints and outputs see {len(V_b)} of its displacements, of which its {V_b.shape[1]} "
            f"coordinates keep {rank} apart: raise model.modes, name fewer nodes, or take model.order: full"
        )
    T = _transform(V_b, basis.omega2)
    if T is None:
        return "since it can move with all displacements held that joints see; take model.order: full"
    dof = np.flatnonzero(seen)
    force = basis.vectors.project(surface_force(scene, name).ravel())
    C = reduced.system.C[basis.columns, basis.columns]
    return BlockExport(
        unknowns=_named(block, dof, dof % 3, T.shape[1] - len(dof)),
        stiffness=csr_matrix(T.T @ (basis.omega2[:, None] * T)),
        mass=csr_matrix(T.T @ T),
        damping=csr_matrix(T.T @ (C @ T)),
        gaps=csr_matrix(basis.vectors.under(gaps) @ T),
        inertia=T.T @ basis.participation,
        force=(T.T @ force).reshape(-1, 1),
        drag=np.zeros((T.shape[1], 0)),
    )


def _transform(V_b: Floats, omega2: Floats) -> Floats | None:
    """(m, m) q = T [u_b, z]; None where holding u_b leaves a rigid motion."""
    left, singular, right = np.linalg.svd(V_b)
    count = len(singular)
    R = right[:count].T @ ((left / singular).T)
    held, turn = np.linalg.eigh((right[count:] * omega2) @ right[count:].T)
    if len(held) and held[0] < _RIGID * max(held[-1], 1.0):
        return None
    N = right[count:].T @ turn
    R = R - N @ ((N.T @ (omega2[:, None] * R)) / held[:, None])
    return np.hstack([R, N])


def _write_block(export: BlockExport, name: str, folder: Path) -> list[Path]:
    paths = [folder / f"{name}.h5", folder / f"{name}_unknowns.csv"]
    keys = ["stiffness", "mass", "damping", "gaps", "inertia", "force"]
    keys += ["drag"] if export.drag.shape[1] else []
    with creating(paths[0]) as file:
        file.attrs["units"] = "m-kg-s"
        write_unknowns(file, export.unknowns)
        for key in keys:
            value = getattr(export, key)
            if issparse(value):
                write_matrix(file, key, value)
            else:
                file[key] = value
    labels = zip(export.unknowns.node, export.unknowns.motion, export.unknowns.position.tolist(), strict=True)
    rows = [f"{n},{DIRECTIONS[m]},{','.join('' if x != x else repr(x) for x in at)}\n" for n, m, at in labels]
    with replacing(paths[1]) as unfinished:
        unfinished.write_text("node,direction,x,y,z\n" + "".join(rows))
    for key in keys:
        paths.append(folder / f"{name}_{key}.mtx")
        with replacing(paths[-1]) as unfinished:
            mmwrite(unfinished, getattr(export, key), symmetry="general", precision=17)
    return paths


def _write_system(system: System, path: Path) -> Path:
    """The system that is integrated: M u'' + C u' + K u = force - inertia a_g + G^T p, w = G u.

    C is `damping`, less D D^T where there is a `drag` D.
    """
    with creating(path) as file:
        file.attrs["units"] = "m-kg-s"
        file.attrs["directions"] = system.law.directions
        matrices = {"mass": system.M, "damping": system.C, "stiffness": system.K, "gaps": system.B}
        for key, matrix in matrices.items():
            write_matrix(file, key, csr_matrix(matrix))
        write_matrix(file, "observe", csr_matrix(system.observe[system.of_probes]))
        file["inertia"] = system.load.toarray() if isinstance(system.load, csr_matrix) else system.load
        file["force"] = system.force
        if system.drag is not None:
            file["drag"] = system.drag
        blocks = file.create_group("blocks")
        for name, columns in system.parts.items():
            blocks.attrs[name] = (columns.start, columns.stop)
        law = file.create_group("law")
        for key in ("K_n", "K_nz", "K_s", "mu", "gap"):
            law[key] = getattr(system.law, key)
        for name, gaps in system.law.joints.items():
            law.attrs[name] = (gaps.start, gaps.stop)
    return path
