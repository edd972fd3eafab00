"""Springs, dashpots and masses that are attached to blocks, as effects: anchors, gates, piers.

With R the rows of the attachments, e = R u, the system gets

    M + R^T m R,    C + R^T c R,    K + R^T k R,    force + R^T (weight - tension),

and where the base or supports move, what the masses, dashpots and springs feel of it as loads. A reduced
basis answers unit forces along R exactly. Springs and masses couple the modes, of one block and across
blocks: a dense eigenproblem of the modes that they touch, solved once for each reduction, makes the system
diagonal again. Unknowns without mass (`romdam.reduction.methods.massless`) follow the others at once and are
condensed before; a mass does not act on them. Dashpots come after the damping of the solids and leave the
modes coupled. Rayleigh damping acts on the mass and the springs as on those of the blocks.

Rigid motions that a spring stops are no longer rigid: a system that only joints held may not float any more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix, diags_array, vstack

from romdam.core.arrays import Floats
from romdam.core.attachment import Attachment, BearingRows, of_all, stacked_rows
from romdam.core.errors import ReductionError
from romdam.core.motion import Motion
from romdam.core.scene import LOAD_KINDS, Scene
from romdam.core.system import PseudoStatic, System
from romdam.effects.effect import EffectCoordinates, MeshCoordinates, ModalCoordinates
from romdam.effects.moving_supports import applied
from romdam.effects.turned import NewUnknowns, turned
from romdam.linalg.dense import eigh, soft_and_stiff_modes

_FREE = 1e-9  # of a spring's stretch in the largest of rigid motions: what is less is none


@dataclass(frozen=True)
class AttachedSprings:
    """Springs and masses of a scene's attachments, their static forces, and what is recorded of them.

    Attributes
    ----------
    scene : with `attachments`
    rows : block name -> (k, 3 nodes) sparse, of all attachments
    """

    scene: Scene
    rows: Mapping[str, csr_matrix]

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """Unit forces along each row."""
        return {name: rows.T.toarray() for name, rows in self.rows.items()}

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Add mass, stiffness, static forces, and rows that observe the forces; reduced, diagonalise again.

        Raises
        ------
        ReductionError
            where the eigenproblem of a reduced system fails.
        """
        attached = self.scene.every(Attachment)
        k, m = of_all(attached, "stiffness"), of_all(attached, "mass")
        R = coordinates.observe(self.rows)
        system = self._observed(self._pressed(self._shaken(system, R, k, m), R), R)
        if isinstance(coordinates, ModalCoordinates):
            return _diagonalised(system, coordinates, np.asarray(R), k, m)
        assert isinstance(coordinates, MeshCoordinates)
        R = csr_matrix(R)
        M = csr_matrix(system.M + R.T @ diags_array(m) @ R)
        K = csr_matrix(system.K + R.T @ diags_array(k) @ R)
        rigid = coordinates.rigid.toarray()
        rigid = csr_matrix(rigid @ _unstretched(R @ rigid, k, np.linalg.norm(rigid, axis=0)))
        # a part without a support whose rigid motions are all stretched is held
        floating = system.floating and (rigid.shape[1] > 0 or not coordinates.rigid.shape[1])
        return replace(system, M=M, K=K, floating=floating), replace(coordinates, rigid=rigid)

    def _shaken(self, system: System, R: csr_matrix | Floats, k: Floats, m: Floats) -> System:
        """With the loads that follow the base and supports."""
        scene = self.scene
        with_base = np.concatenate([one.with_ground(scene.radiating) for one in scene.every(Attachment)])
        loads = {Motion.BASE: np.asarray(R.T @ (m[:, None] * with_base))}
        moving = system.pseudo_static
        if moving is not None:
            carried = applied(self.rows, moving.shapes)
            loads[Motion.SUPPORTS] = np.asarray(R.T @ (m[:, None] * carried))
            if k.any():
                loads[Motion.SUPPORTS_DISPLACEMENT] = np.asarray(R.T @ (k[:, None] * carried))
        return system.loaded(loads)

    def _pressed(self, system: System, R: csr_matrix | Floats) -> System:
        """With the static forces, among the loads of their kind where these come one after another."""
        attached, order = self.scene.every(Attachment), self.scene.loads.order
        forces = {
            "weight": np.asarray(R.T @ of_all(attached, "weight")),
            "forces": -np.asarray(R.T @ of_all(attached, "tension")),
        }
        steps = dict(system.load_steps)
        for kind, force in forces.items() if order else ():
            if force.any():
                steps[kind] = steps.get(kind, np.zeros(system.size)) + force
        steps = {kind: steps[kind] for kind in order or LOAD_KINDS if kind in steps}
        return replace(system, force=system.force + sum(forces.values()), load_steps=steps)

    def _observed(self, system: System, R: csr_matrix | Floats) -> System:
        """With the rows of the attachments that bear a force behind those of the output nodes."""
        attached = self.scene.every(Attachment)
        some = np.flatnonzero(np.repeat([one.bears for one in attached], [len(one) for one in attached]))
        if not len(some):
            return system
        k, c, tension = (of_all(attached, name)[some] for name in ("stiffness", "damping", "tension"))
        bearing = BearingRows(system.observe.shape[0], k, c, tension)
        moving, R = system.pseudo_static, csr_matrix(R)
        if moving is not None:
            moving = replace(
                moving, observe=np.vstack([moving.observe, applied(self.rows, moving.shapes)[some]])
            )
        observe = csr_matrix(vstack([system.observe, R[some]]))
        return replace(system, observe=observe, bearing=bearing, pseudo_static=moving)


@dataclass(frozen=True)
class AttachedDashpots:
    """Dashpots of a scene's attachments.

    Attributes
    ----------
    scene, rows : see `AttachedSprings`
    """

    scene: Scene
    rows: Mapping[str, csr_matrix]

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """None here: those of `AttachedSprings` are the same."""
        return {}

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Add the dashpots, which leave the modes coupled."""
        c, R = of_all(self.scene.every(Attachment), "damping"), csr_matrix(coordinates.observe(self.rows))
        moving = system.pseudo_static
        if moving is not None:
            carried = applied(self.rows, moving.shapes)
            system = system.loaded({Motion.SUPPORTS_VELOCITY: np.asarray(R.T @ (c[:, None] * carried))})
        C = csr_matrix(system.C + R.T @ diags_array(c) @ R)
        return replace(system, C=C, diagonal=False), coordinates


def attached_springs(scene: Scene) -> AttachedSprings | None:
    """The springs and masses of a scene's attachments; None without any attachment."""
    return AttachedSprings(scene, _rows(scene)) if scene.every(Attachment) else None


def attached_dashpots(scene: Scene) -> AttachedDashpots | None:
    """The dashpots of a scene's attachments; None where none has any."""
    some = any(one.damping.any() for one in scene.every(Attachment))
    return AttachedDashpots(scene, _rows(scene)) if some else None


def _rows(scene: Scene) -> dict[str, csr_matrix]:
    return stacked_rows(
        scene.every(Attachment), {name: block.points.size for name, block in scene.blocks.items()}
    )


def _unstretched(stretch: Floats, k: Floats, size: Floats) -> Floats:
    """(r, s) combinations of r rigid motions that no spring stretches.

    Parameters
    ----------
    stretch : (rows, r) of the motions
    size : (r,) of the motions
    """
    count = stretch.shape[1]
    if not count or not k.any():
        return np.eye(count)
    scaled = np.asarray(stretch)[k > 0.0] / size
    _, singular, V = np.linalg.svd(scaled, full_matrices=True)
    stopped = int((singular > _FREE * np.abs(scaled).max(initial=1e-300)).sum())
    free = V[stopped:].T / size[:, None]
    return np.asarray(free / np.linalg.norm(free, axis=0))


def _diagonalised(
    system: System, coordinates: ModalCoordinates, R: Floats, k: Floats, m: Floats
) -> tuple[System, ModalCoordinates]:
    """A diagonal system with the springs and masses on rows R (rows, unknowns).

    Raises
    ------
    ReductionError
        where the eigenproblem fails.
    """
    acting = (k > 0.0) | (m > 0.0)
    if not acting.any():
        return system, coordinates
    R, k, m = R[acting], k[acting], m[acting]
    touched = np.zeros(system.size, dtype=bool)
    for part in system.parts.values():
        touched[part] = np.abs(R[:, part]).max(initial=0.0) > 0.0
    heavy = system.M.diagonal() > 0.0
    dynamic, light = np.flatnonzero(touched & heavy), np.flatnonzero(touched & ~heavy)
    omega2, R_d, R_l = system.K.diagonal(), R[:, dynamic], R[:, light]
    K = np.diag(omega2[dynamic]) + R_d.T @ (k[:, None] * R_d)
    K_l = np.diag(omega2[light]) + R_l.T @ (k[:, None] * R_l)
    M = np.eye(len(dynamic)) + R_d.T @ (m[:, None] * R_d)
    rigid = np.flatnonzero(omega2[dynamic] == 0.0)
    left = _unstretched(R_d[:, rigid], k, np.ones(len(rigid))).shape[1] if len(rigid) else 0
    try:
        # those without mass answer at once: light = follow @ dynamic + what they do by themselves
        follow = -np.linalg.solve(K_l, R_l.T @ (k[:, None] * R_d))
        K = K + (R_d.T @ (k[:, None] * R_l)) @ follow
        squares, V = soft_and_stiff_modes(0.5 * (K + K.T), 0.5 * (M + M.T), left)
        squares_l, V_l = eigh(K_l, np.eye(len(light)))
    except (LinAlgError, np.linalg.LinAlgError) as error:
        raise ReductionError(
            f"attachments: the modes with their springs and masses could not be found ({error})"
        ) from error
    mixed = np.concatenate([dynamic, light])
    both = np.zeros((len(mixed), len(mixed)))
    n = len(dynamic)
    both[:n, :n], both[n:, :n], both[n:, n:] = V, follow @ V, V_l
    order = np.argsort(mixed)
    new = NewUnknowns(
        part="attachments",
        mixed=mixed[order],
        V=both[order],
        stiffness=np.concatenate([squares, squares_l]),
        mass=np.concatenate([np.ones(n), np.zeros(len(light))]),
    )
    system, coordinates = turned(system, coordinates, new)
    free = (system.K.diagonal() == 0.0) & (system.M.diagonal() > 0.0)
    return replace(system, floating=bool(free.any())), coordinates
