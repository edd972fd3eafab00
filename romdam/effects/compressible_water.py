"""Waves in the water of a reservoir, by finite elements, as unknowns beside those of the dam.

The unknown x is the impulse of the pressure on unit area: p = x'. With Q the coupling of the wet faces, whose
normal points into the water, and r the flux of the walls' rigid motion,

    1/rho (G/c^2 x'' + D x' + H x) = Q u' + r v_g,      M_s u'' + C_s u' + K_s u = ... - Q^T x'.

So the coupling is skew and does no work, M and K are symmetric and positive, and the ledger holds:
x'.G x'/(2 rho c^2) is the energy of compression and x.H x/(2 rho) the kinetic energy of the water. D takes
energy:

- the floor's, q = (1 - a)/((1 + a) c) for a reflection a of pressure waves (Fenves, Chopra);
- the far end's, see `romdam.effects.channel`.

The walls move with the base's *velocity*, the integral of its acceleration: floor and banks as the record
says, also where the record comes up through the rock as waves, whose surface it is of. Where supports move by
themselves, the dam sweeps the volume of u' + u_s d' (`romdam.effects.moving_supports`).

A reduced model has a basis X of the reservoir: its modes below the cut-off, what the forces of their damping
make statically, K^-1 C phi, which the modes by themselves approach slowly, and what the base's motion makes.
What these leave of the static answer to the dam's motion,

    F = Q^T (K^-1 - X (X^T K X)^-1 X^T) Q,

is that of water so stiff that it answers at once: an added mass, so that the incompressible answer is kept
exactly. The dam's modes stay those of the dam alone, and so does its damping.

References
----------
Everstine, J. Sound Vib. 79 (1981) 157 (the symmetric form); Hall, Chopra, Earthq. Eng. Struct. Dyn. 10 (1982)
305 and Fenves, Chopra, UCB/EERC-84/10 (1984) (reservoir bottom absorption).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import block_diag, bmat, csr_matrix, diags_array, hstack, vstack

from romdam.core.motion import Motion
from romdam.core.scene import Ints, Reservoir, Scene
from romdam.core.system import PseudoStatic, System
from romdam.effects.channel import ChannelDrive, radiating_end
from romdam.effects.effect import EffectCoordinates, ModalCoordinates
from romdam.effects.moving_supports import applied
from romdam.fem.water.own_mesh import water_body
from romdam.geometry.elements import Floats
from romdam.linalg.dense import eigh, independent
from romdam.linalg.factor import Factor
from romdam.linalg.modes.eigen import modes_below
from romdam.scene.reservoir.reservoir_mesh import PER_WAVE

_FINER = 1.5  # times the cut-off, of a model that estimates compare with
_INDEPENDENT = 1e-6  # of a static answer, what is not in the modes: less is their round-off


@dataclass(frozen=True)
class Waves:
    """M x'' + C x' + K x = at_dam B u' + load (v, y, y'), where B u is the volume that the dam sweeps.

    Attributes
    ----------
    M, C, K : (n, n)
    at_dam : (n, r) the unknowns of the r wet nodes
    coupling : block name -> B (r, 3 * nodes) sparse
    load : (n, 3 + 2 N) of the base's velocity v, the waves y of the channel's sections and their rates
    drive : what the base's motion makes of the channel
    """

    M: csr_matrix
    C: csr_matrix
    K: csr_matrix
    at_dam: csr_matrix
    coupling: dict[str, csr_matrix]
    load: Floats
    drive: ChannelDrive


@dataclass(frozen=True)
class CompressibleWater:
    """Compressible water of a scene as an effect.

    Attributes
    ----------
    waves : the reservoir
    cutoff : frequency up to which a reduced model has the reservoir's own modes [Hz]
    """

    waves: Waves
    cutoff: float

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """Pressure that unit accelerations of the base and of supports make where all moves slowly."""
        waves = self.waves
        swept = [np.ascontiguousarray(waves.load[:, :3])]
        if moving is not None:
            swept.append(waves.at_dam @ applied(waves.coupling, moving.shapes))
        rows = waves.at_dam.T @ Factor(waves.K).solve(np.hstack(swept))
        return {name: np.asarray(coupling.T @ rows) for name, coupling in waves.coupling.items()}

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Put the reservoir's unknowns behind those of the dam."""
        waves, B = self.waves, csr_matrix(coordinates.observe(self.waves.coupling))
        moving = system.pseudo_static
        carried = np.zeros((B.shape[0], 0)) if moving is None else applied(waves.coupling, moving.shapes)
        if isinstance(coordinates, ModalCoordinates):
            reduced = reduced_waves(waves, self.cutoff * (_FINER if coordinates.finer else 1.0))
            waves, rest = reduced.waves, B.T @ reduced.rest
            coordinates = replace(coordinates, reservoir=reduced.basis)
            system = replace(system, M=csr_matrix(system.M + csr_matrix(rest @ B)))
            if moving is not None:
                system = system.loaded({Motion.SUPPORTS: rest @ carried})
        return _behind(system, waves, B, carried), coordinates


def compressible_water(scene: Scene) -> CompressibleWater | None:
    """The effect of a scene's compressible water; None where it has none."""
    waves, water = reservoir_waves(scene), scene.find(Reservoir)
    if waves is None or water is None or water.sound is None:
        return None
    return CompressibleWater(waves, water.sound.cutoff)


def _behind(system: System, waves: Waves, B: csr_matrix, carried: Floats) -> System:
    """A system with a reservoir's unknowns behind its own, which sweep B u (r, n), and supports `carried`."""
    n, m = system.size, waves.M.shape[0]
    swept, sections = csr_matrix(waves.at_dam @ B), len(waves.drive.k)
    above, more = np.zeros((n, waves.load.shape[1])), system.at_point
    sustained = system.sustained
    if sustained is not None:
        sustained = replace(sustained, more=csr_matrix(block_diag([sustained.more, csr_matrix((m, m))])))
    load = np.vstack([above, -waves.load])
    follows = {
        Motion.BASE_VELOCITY: load[:, :3],
        Motion.CHANNEL: load[:, 3 : 3 + sections],
        Motion.CHANNEL_RATE: load[:, 3 + sections :],
    }
    if carried.shape[1]:
        by_supports = -np.asarray(waves.at_dam @ carried)
        follows[Motion.SUPPORTS_VELOCITY] = np.vstack([np.zeros((n, carried.shape[1])), by_supports])
    dry = system.load if isinstance(system.load, csr_matrix) else csr_matrix(system.load)
    dry = csr_matrix(vstack([dry, csr_matrix((m, dry.shape[1]))]))
    wet = replace(
        system,
        M=csr_matrix(block_diag([system.M, waves.M])),
        C=csr_matrix(bmat([[system.C, swept.T], [-swept, waves.C]])),
        K=csr_matrix(block_diag([system.K, waves.K])),
        B=_widened(system.B, m),
        load=dry if isinstance(system.load, csr_matrix) else dry.toarray(),
        force=np.concatenate([system.force, np.zeros(m)]),
        load_steps={kind: np.append(force, np.zeros(m)) for kind, force in system.load_steps.items()},
        observe=_widened(system.observe, m),
        parts=system.parts | {"reservoir": slice(n, n + m)},
        diagonal=False,
        at_point=None if more is None else _widened(more, m),
        drives=(*system.drives, waves.drive),
        gyroscopic=True,
        drag=None if system.drag is None else np.vstack([system.drag, np.zeros((m, system.drag.shape[1]))]),
        sustained=sustained,
    )
    return wet.loaded(follows)


def _widened(operator: csr_matrix, more: int) -> csr_matrix:
    return csr_matrix(hstack([operator, csr_matrix((operator.shape[0], more))]))


def reservoir_waves(scene: Scene) -> Waves | None:
    """Assemble the compressible water of a scene's reservoir; None where it has none."""
    water = scene.find(Reservoir)
    if water is None or water.sound is None:
        return None
    sound = water.sound
    admittance = (1.0 - sound.reflection) / ((1.0 + sound.reflection) * sound.speed)
    body = water_body(water, scene.blocks, sound.speed / (PER_WAVE * sound.cutoff))
    end = radiating_end(body.section, sound, admittance, water.density)
    below, beyond = len(body.rigid), end.M.shape[0] - len(body.end)
    size = below + beyond
    inside, last = np.arange(below), np.concatenate([body.end, np.arange(below, size)])
    fluxes = np.zeros((size, 3 + end.load.shape[1]))
    fluxes[inside, :3] = body.rigid
    fluxes[last, 3:] = end.load / water.density
    of_body, of_end = _chosen(inside, size), _chosen(last, size)
    whole = (body.G / sound.speed**2, admittance * body.floor, body.H)
    M, C, K = (
        (csr_matrix(of_body @ matrix @ of_body.T) + csr_matrix(of_end @ matrix_end @ of_end.T))
        / water.density
        for matrix, matrix_end in zip(whole, (end.M, end.C, end.K), strict=True)
    )
    return Waves(M, C, K, _chosen(body.wet, size), body.coupling, fluxes, end.drive)


def _chosen(rows: Ints, size: int) -> csr_matrix:
    """(size, len(rows)) with a one in each row that is chosen."""
    return csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(size, len(rows)))


@dataclass(frozen=True)
class ReducedWaves:
    """A reservoir in its own coordinates.

    Attributes
    ----------
    waves : the reservoir
    basis : (n, m) its unknowns on the mesh
    rest : (r, r) flexibility of the dam's wet nodes without them
    """

    waves: Waves
    basis: Floats
    rest: Floats


def reduced_waves(waves: Waves, cutoff: float) -> ReducedWaves:
    """Reduce a reservoir to its modes below a frequency [Hz] and their static corrections."""
    factor = Factor(waves.K)
    _, X = modes_below(waves.K, waves.M, None, cutoff, factor)
    static = factor.solve(np.hstack([waves.C @ X, waves.load]))
    size = np.sqrt((static * (waves.M @ static)).sum(axis=0))
    for _ in range(2):  # twice is enough for round-off
        static -= X @ (X.T @ (waves.M @ static))
    further = np.sqrt((static * (waves.M @ static)).sum(axis=0)) > _INDEPENDENT * size
    X = np.hstack([X, independent(static[:, further], waves.M)]) if further.any() else X
    omega2, V = eigh(X.T @ (waves.K @ X), np.eye(X.shape[1]))
    omega2, X = np.asarray(omega2), X @ V  # diagonal in K, M-orthonormal
    unit = waves.at_dam.toarray()
    at_dam = X.T @ unit
    rest = unit.T @ factor.solve(unit) - at_dam.T @ (at_dam / omega2[:, None])
    reduced = replace(
        waves,
        M=csr_matrix(diags_array(np.ones(len(omega2)))),
        C=csr_matrix(X.T @ (waves.C @ X)),
        K=csr_matrix(diags_array(omega2)),
        at_dam=csr_matrix(at_dam),
        load=X.T @ waves.load,
    )
    return ReducedWaves(reduced, X, 0.5 * (rest + rest.T))
