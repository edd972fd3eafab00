"""Free-interface reduction of a part: blocks whose interfaces are merged.

A dam on flexible rock is one part with thousands of joint DOFs. Craig-Bampton would retain all of them on
both sides of every joint and diagonalise a dense matrix of that size. Here the basis is

    u = Phi q + A a,    A = K^-1 [B^T, M r, f],

Phi the open-joint modes below the cut-off (Lanczos on one factorisation) and A the static answers to a unit
force in every gap, to the inertia of the ground's acceleration r and to the static loads f, among them the
tractions of absorbing faces that move rigidly and the forces that hold rock in the free field's shapes, so
that rock alone moves as the mesh does whatever the number of modes. It answers every joint force statically
right, carries the mass of A, and A made orthogonal to Phi leaves Phi's frequencies those of the mesh; only
the small rest, one vector for each gap direction, is diagonalised densely. What floats answers what its rigid
acceleration leaves of a force (`merged_part`).

With as many vectors more modes do better than longer chains K^-1 M K^-1 B: on a dam of 1,796 unknowns 116
vectors up to 50 Hz leave 0.9 % of the openings in L2, 125 with modes to 8 Hz and a second link 0.9 %, and a
link of the chain costs as many solutions as there are gap directions.

References
----------
Rubin, AIAA Journal 13 (1975) 995; Hintz, AIAA Journal 13 (1975) 1007 (free modes with attachment modes).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError
from romdam.core.threads import at_once
from romdam.fem.parts import gather
from romdam.linalg.condensed import CondensedSingle
from romdam.linalg.conjugate import WIDTH
from romdam.linalg.dense import without_roundoff
from romdam.linalg.modes.eigen import dense_modes, span_of_modes
from romdam.linalg.modes.rigid import without_strain
from romdam.linalg.multifrontal import Multifrontal
from romdam.linalg.solvers import SMALL, make_solver
from romdam.linalg.symmetric import Symmetric
from romdam.reduction.methods.attachment_modes import (
    StaticPencil,
    diagonalised,
    orthogonal_remainder,
    with_more,
)
from romdam.reduction.methods.craig_bampton import ReducedBlock, eigen_residual, highest_hz
from romdam.reduction.methods.flexible_rest import (
    FEWEST,
    needs_no_mass,
    wider,
    with_more_without_mass,
    without_mass,
)
from romdam.reduction.methods.merged_part import (
    MergedPart,
    boundary_tractions,
    free_field_forces,
    ground_inertia,
    merge_blocks,
    sustained_forces,
)
from romdam.reduction.methods.residual_vectors import FINER_VECTORS
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.reductor import Bases, BasisFiles, Reductor
from romdam.reduction.storage.keys import key_content
from romdam.reduction.storage.model_file import StreamedBasis
from romdam.reduction.storage.out_of_core_matrix import OutOfCoreMatrix
from romdam.reduction.substructure import Substructure

log = logging.getLogger(__name__)

# The basis that estimates compare with has modes up to so many times the highest frequency, at least so many
# more of them, and as many answers to the inertia of the lowest vectors that are no modes.
BEYOND, FURTHER = 1.5, 10
_NODES = 4096  # of a block's basis at a time
_TOGETHER, _READ = 64, 200e6  # modes looked at, and bytes of them: each time all of them are read


class FreeInterface(Reductor):
    """Free modes and static responses of a part with mass, of one block or several."""

    name: ClassVar[str] = "free_interface"
    out_of_core: ClassVar[bool] = True

    def serves(self, substructure: Substructure, choice: ModeChoice) -> bool:
        """Every part with mass."""
        return not substructure.has_no_mass

    def refuse(self, substructure: Substructure) -> None:
        """Refuse parts of several ratios of their moduli that nothing but joints holds."""
        part, scene = substructure.mesh_part, substructure.scene
        ratios = {scene.blocks[name].material.sustained_ratio for name in part.blocks}
        if len(ratios) > 1 and not part.stands_free(scene):
            raise ConfigError(
                f"materials.<name>.E_dynamic: blocks of part {part.name!r} have ratios E / E_dynamic of "
                f"{min(ratios):.4g} to {max(ratios):.4g} and joints alone hold them, which no reduced basis "
                "is made for; give them one ratio, a support, or set model.order: full"
            )

    def key(self, substructure: Substructure, choice: ModeChoice) -> object:
        """Everything in the part, and the number of free modes."""
        return key_content(substructure, _with_more_modes(choice))

    def reduce(self, substructure: Substructure, choice: ModeChoice, files: BasisFiles) -> Iterator[Bases]:
        """Yield the bases of the blocks, in their files from the first column on.

        The finer ones have further modes, as far as Lanczos has come to them, and static responses to the
        inertia of vectors that are no modes.
        """
        mesh_part, assembly = substructure.mesh_part, substructure.assembly
        choice = _with_more_modes(choice)
        shaken, *heavy = ground_inertia(substructure)
        lasting = [substructure.operator.T, shaken, substructure.static_forces, *heavy]
        loads = [
            *lasting,
            sustained_forces(substructure, lasting, choice.solving),
            boundary_tractions(substructure),
            free_field_forces(substructure),
            gather(mesh_part, substructure.block_loads.carried),
        ]
        part = merge_blocks(substructure, loads, f"part {mesh_part.name}")
        inertia = {name: assembly.inertia(name) for name in mesh_part.blocks}
        assembly.release(mesh_part.blocks)
        size = part.K.shape[0]
        every = choice.keeps_all or (choice.count is not None and choice.count >= size)
        if every and (part.M.diagonal() > 0.0).all():
            omega2, Phi = dense_modes(part.K.whole(), part.M)
            T = files.scratch(len(part.row), size)
            T.fill(size, lambda first, last: part.over_blocks(Phi[:, first:last]))
            levels = [_Level(T, size, without_roundoff(omega2), np.eye(size))] * len(files.keys)
        else:
            massless = needs_no_mass(substructure, part.right.shape[1])
            choice = wider(choice) if massless else choice
            choice = replace(choice, count=size if every else choice.count)
            choice = choice.with_rigid_motions(part.rigid.shape[1])
            T, levels = _ritz_levels(part, choice, files, massless=massless)
        rigid = part.rigid.shape[1]
        levels = [level._replace(omega2=without_strain(level.omega2, rigid)) for level in levels]
        # largest relative residual of the eigenvalues, which the finer basis shares
        residual, modes = 0.0, levels[0].modes
        together = max(_TOGETHER, int(_READ / (8 * len(part.row))))
        for first in range(0, modes, together):
            some = slice(first, min(first + together, modes))
            Phi = levels[0].T.combined(levels[0].V[:, some])[part.first]
            residual = max(residual, eigen_residual(part.K, part.M @ Phi, levels[0].omega2[some], Phi))
        coarse: Bases = {}
        for number, level in enumerate(levels):
            log.info(
                "%s: %d modes, %d attachment modes",
                part.label, level.modes, len(level.omega2) - level.modes,
            )  # fmt: skip
            numbers = ReducedBlock(
                omega2=level.omega2,
                basis=np.zeros((0, 0)),
                more=np.zeros((0, 0)),
                mix=np.zeros((0, 0)),
                retained=len(level.omega2) - level.modes,
                fixed_interface=level.modes,
                highest=highest_hz(level.omega2[: level.modes]),
                orthonormality=0.0,
                residual=residual,
            )
            report = numbers.report() | {"part": mesh_part.name} | choice.report()
            tasks, last = [], 0
            for name in mesh_part.blocks:
                first, last = last, last + 3 * len(substructure.scene.blocks[name].points)
                ends = [*range(first, last, 3 * _NODES), last]
                # of a finer basis what it has besides the other
                further = len(level.V) - (len(coarse[name].omega2) if coarse else 0)
                basis = StreamedBasis(
                    omega2=level.omega2,
                    rows=level.T.pieces(ends, level.T.shape[1] - further),
                    inertia=inertia[name],
                    report=report,
                    mix=level.V,
                    contained=coarse.get(name),
                    massless=level.massless,
                )
                tasks.append(partial(files.write, substructure.scene.blocks[name], basis, number))
            bases: Bases = dict(zip(mesh_part.blocks, level.T.each(tasks), strict=True))
            coarse = coarse or bases
            yield bases
        T.remove()


def _with_more_modes(choice: ModeChoice) -> ModeChoice:
    """Return a choice with free modes in place of residual vectors, to which they leave nothing.

    There are at least half as many again, so that a finer choice is finer in this form too.
    """
    if choice.count is None or choice.keeps_all or not choice.residual_vectors:
        return choice
    more = max(choice.residual_vectors, choice.count // 2)
    return replace(choice, count=choice.count + more, residual_vectors=0)


class _Level(NamedTuple):
    """A basis T V, or of Ritz vectors T after an inner basis X, [X, T] V.

    Attributes
    ----------
    modes : how many of its vectors are modes; they come first
    massless : how many of the last vectors have no mass
    """

    T: OutOfCoreMatrix
    modes: int
    omega2: Floats
    V: Floats
    massless: int = 0


def _ritz_levels(
    part: MergedPart, choice: ModeChoice, files: BasisFiles, *, massless: bool
) -> tuple[OutOfCoreMatrix, list[_Level]]:
    """Static responses and, after them, vectors that span the modes; and the bases that they make.

    A finer basis contains the other one and, besides, further modes and responses to inertia: that of the
    lowest vectors of the first that are no modes, and that of the water in its lowest modes. Modes up to a
    frequency would leave it the same where the spectrum has a gap. The solver goes with the end.

    Parameters
    ----------
    massless : whether the static responses are without mass, see `flexible_rest`
    """
    right, finer = part.right, files.finer
    shifted = Symmetric(part.K.upper - part.shift * part.M) if part.shift else part.K
    columns = right.shape[1] + choice.columns
    solver = make_solver(shifted, part.motions, columns, choice.solving, part.label, part.inner)
    T = files.scratch(len(part.row), right.shape[1])
    width = solver.width if isinstance(solver, CondensedSingle | Multifrontal) else WIDTH
    K = part.K if part.K.shape[0] > SMALL else part.K.whole()
    static = T.shape[1]

    def fill_static() -> None:
        T.fill(
            static,
            lambda a, b: part.over_blocks(part.static_response(solver, right[:, a:b].toarray())),
            width,
        )
        log.info("%s: %d static responses; the modes are to come", part.label, static)

    # other solvers' factors serve one thread
    unknowns = K.shape[0] if isinstance(solver, Multifrontal) else 0
    more = (BEYOND, FURTHER) if finer else (1.0, 0)
    fewest = min(FEWEST, K.shape[0] // 10) if massless else 0

    def find_modes() -> tuple[tuple[int, int], Callable[[int, int], Floats]]:
        span = partial(span_of_modes, K, part.M, solver=solver, shift=part.shift)
        if choice.count is not None:
            return span(max(choice.count, fewest), None, beyond=more[0], further=more[1])
        below = span(None, choice.cutoff, beyond=more[0], further=more[1])
        return below if below[0][0] >= fewest else span(fewest, None, beyond=more[0], further=more[1])

    _, ((modes, every), combine) = at_once(fill_static, find_modes, unknowns)
    T.widen(every)
    for count in (modes, every):
        T.fill(static + count, lambda a, b: part.over_blocks(combine(a - static, b - static)), width)
    pencil, work = StaticPencil(part.K, part.M, part.shift, part.first), part.work(T)
    ritz = T.narrowed(static + modes)
    diagonalise = without_mass if massless else diagonalised
    omega2, V = diagonalise(ritz, modes, pencil, work[:, : static + modes])
    rest = V.shape[1] - modes if massless else 0
    levels = [_Level(ritz, modes, omega2, V, rest)]
    if not finer:
        return T, levels
    apart = ritz.combined(V[:, modes : modes + FURTHER])[part.first]
    forces = part.M @ apart
    if part.wet is not None:
        low = ritz.combined(V[:, : min(modes, FINER_VECTORS)])[part.first]
        forces = np.hstack([forces + part.wet.inertia(apart), part.wet.inertia(low)])
    D = orthogonal_remainder(T, static, part.static_response(solver, forces), pencil)
    last = T.shape[1]
    T.widen(D.shape[1])
    T.fill(T.shape[1], lambda a, b: part.over_blocks(D[:, a - last : b - last]))
    work = np.hstack([work, right.T @ D - (right.T @ part.rigid) @ (part.rigid.T @ (part.M @ D))])
    beyond = T.shape[1] - static - modes
    if beyond and massless:
        omega2, V, massive = with_more_without_mass(T, beyond, modes, pencil, work, omega2, V)
        return T, [*levels, _Level(T, massive, omega2, V, len(omega2) - massive)]
    if beyond:
        omega2, V = with_more(T, beyond, pencil, work, omega2, V)
    else:
        V = np.eye(len(omega2))
    return T, [*levels, _Level(T, modes + beyond, omega2, V, rest)]
