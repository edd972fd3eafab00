"""Moving supports: the displacement that supports of their own motion make by themselves, and its inertia.

With supports that move by d(t) against the base the displacement is u + u_s d, u_s the static answer of the
mesh, its joints open, to their unit displacements. u is zero at supports, and its equation is that of one
motion with -M u_s d'' beside -M r a_g: u_s is exact, at full order and reduced, and the basis has only u to
answer. K u_s is zero where nothing holds, so that stiffness-proportional damping does nothing for u_s d;
neither does the mass-proportional part, nor modal ratios: a structure that is carried along is not damped.
What else has inertia or damping acts on all of the displacement, and so adds loads that follow the supports:
water their acceleration or velocity, dashpots of viscous faces their velocity.

Motion by position has d of a few stations and shares of them at every node of a support (`ground.along`): u_s
is then the answer to the shares of each station, and sums to a unit displacement of all.

References
----------
Chopra, Dynamics of Structures, section 9.7; Clough, Penzien, Dynamics of Structures, section 26-2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.errors import ConfigError
from romdam.core.motion import Motion, MovingSupports
from romdam.core.scene import Scene
from romdam.core.system import PseudoStatic, System
from romdam.effects.effect import EffectCoordinates
from romdam.fem.assembly import Assembly
from romdam.fem.gaps import gap_operators, point_operators
from romdam.fem.parts import assemble_part, gather
from romdam.geometry.elements import Floats
from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import AUTO, Solving, make_solver
from romdam.scene.supports import rigid_motions
from romdam.scene.ties import Part, scene_parts


@dataclass(frozen=True)
class CarriedInertia:
    """Moving supports of a scene as an effect.

    Attributes
    ----------
    moving : the displacement that they make
    inertia : block name -> M u_s, (3 nodes, m) [kg]
    """

    moving: PseudoStatic
    inertia: dict[str, Floats]

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Add the inertia of what the supports displace."""
        load = np.asarray(coordinates.press(self.inertia))
        return replace(system, pseudo_static=self.moving).loaded({Motion.SUPPORTS: load}), coordinates

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """That inertia."""
        return self.inertia


def moving_supports(
    scene: Scene, directions: int, assembly: Assembly, solving: Solving = AUTO
) -> CarriedInertia | None:
    """The effect of a scene's moving supports; None where all move as the base does. See `pseudo_static`."""
    moving = pseudo_static(scene, directions, assembly, solving)
    if moving is None:
        return None
    inertia = {name: assembly.matrices(name)[1] @ u for name, u in moving.shapes.items()}
    return CarriedInertia(moving, {name: np.asarray(values) for name, values in inertia.items()})


def pseudo_static(
    scene: Scene, directions: int, assembly: Assembly, solving: Solving = AUTO
) -> PseudoStatic | None:
    """Solve for what a scene's moving supports displace; None where all move as the base does.

    Parameters
    ----------
    directions : of every gap, 1 or 3
    assembly : matrices of the scene's blocks
    solving : how large parts are solved

    Raises
    ------
    ConfigError
        where supports alone do not hold a part that they move.
    """
    moving = scene.find(MovingSupports)
    if moving is None:
        return None
    shapes: dict[str, Floats] = {}
    for part in scene_parts(scene).values():
        shapes |= _shapes(part, moving, scene, assembly, solving)
    more = point_operators(scene, directions)
    rows = [shapes[probe.block][3 * probe.node : 3 * probe.node + 3] for probe in scene.probes]
    return PseudoStatic(
        motions=moving.motions,
        shapes=shapes,
        jump=applied(gap_operators(scene, directions), shapes),
        at_point=None if more is None else applied(more, shapes),
        observe=np.vstack([np.zeros((0, 3 * len(moving.motions))), *rows]),
        stiffness=sum(u.T @ (assembly.matrices(name)[0] @ u) for name, u in shapes.items()),
        incoherence=moving.incoherence,
    )


def applied(operators: Mapping[str, csr_matrix], shapes: Mapping[str, Floats]) -> Floats:
    """Sum over the blocks of operators (rows, 3 nodes) on what they move by, (rows, m)."""
    return np.asarray(sum(operator @ shapes[name] for name, operator in operators.items()))


def _shapes(
    part: Part, moving: MovingSupports, scene: Scene, assembly: Assembly, solving: Solving
) -> dict[str, Floats]:
    """u_s of a part's blocks."""
    size = 3 * part.nodes
    held = np.zeros((3 * part.every_node, 3 * len(moving.motions)))  # slaves behind the others
    for name in part.blocks:
        node, axis = np.nonzero(moving.components[name] >= 0)
        motion = moving.components[name][node, axis]
        held[3 * part.number[name][node] + axis, 3 * motion + axis] = 1.0
        if name in moving.shares:
            node, axis = np.nonzero(scene.fixed[name])
            columns = 3 * np.arange(len(moving.motions)) + axis[:, None]
            rows = 3 * part.number[name][node] + axis
            held[rows[:, None], columns] = moving.shares[name][node].toarray()
    moved, free = held[:size].copy(), ~part.fixed(scene.fixed).ravel()
    if held.any() and free.any():
        if not part.stands_free(scene):
            raise ConfigError(
                f"{moving.motions[0].key}: part {part.name!r} is carried by supports that "
                "leave it a rigid motion, limit 0: where they carry it is undetermined; hold more of its "
                "components"
            )
        blocks = _of_blocks(part, moved, held[size:])
        force = gather(part, {name: -(assembly.matrices(name)[0] @ u) for name, u in blocks.items()})
        K = csr_matrix(assemble_part(part, assembly)[0][free][:, free])
        rigid = rigid_motions(part.mesh(scene.blocks), np.arange(part.nodes)).reshape(-1, 6)[free]
        motions = Motions(np.flatnonzero(free), rigid)
        moved[free] = make_solver(K, motions, held.shape[1], solving, f"part {part.name}").solve(force[free])
    return _of_blocks(part, moved, held[size:])


def _of_blocks(part: Part, moved: Floats, slaves: Floats) -> dict[str, Floats]:
    """Displacement of the part's blocks from that of its independent DOFs, and of slaves that are held."""
    every = moved if part.slaves is None else np.vstack([moved, part.slaves @ moved + slaves])
    axes = np.arange(3)
    return {name: every[(3 * part.number[name][:, None] + axes).ravel()] for name in part.blocks}
