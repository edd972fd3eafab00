"""Waves in the water of a reservoir, by finite elements, as unknowns beside those of the dam.

The unknown x is the impulse of the pressure on unit area: p = x'. With Q the coupling of the wet faces, whose
normal points into the water, and r the flux of the walls' rigid motion,

    1/rho (G/c^2 x'' + D x' + H x) = Q u' + r v_g,      M_s u'' + C_s u' + K_s u = ... - Q^T x'.

So the coupling is skew and does no work, M and K are symmetric and positive, and the ledger holds:
x'.G x'/(2 rho c^2) is the energy of compression and x.H x/(2 rho) the kinetic energy of the water. D takes
energy:

- the floor's, q = (1 - a)/((1 + a) c) for a reflection a of pressure waves (Fenves, Chopra);
- the far end's, see `romdam.fem.water.radiation`.

The walls move with the ground's *velocity*, the integral of its acceleration.

References
----------
Everstine, J. Sound Vib. 79 (1981) 157 (the symmetric form); Hall, Chopra, Earthq. Eng. Struct. Dyn. 10 (1982)
305 and Fenves, Chopra, UCB/EERC-84/10 (1984) (reservoir bottom absorption).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import block_diag, bmat, csr_matrix, hstack

from romdam.core.scene import Ints, Scene
from romdam.core.system import System
from romdam.fem.water.drive import ChannelDrive
from romdam.fem.water.own_mesh import water_body
from romdam.fem.water.radiation import radiating_end
from romdam.scene.elements import Floats
from romdam.scene.reservoir.own_mesh import PER_WAVE


@dataclass(frozen=True)
class Waves:
    """M x'' + C x' + K x = at_dam B u' + load (ground), where B u is the volume that the dam sweeps.

    Attributes
    ----------
    M, C, K : (n, n)
    at_dam : (n, r) the unknowns of the r wet nodes
    coupling : block name -> B (r, 3 * nodes) sparse
    load : (n, k) of the drive's histories but for the ground's acceleration
    drive : what the ground's motion makes of the channel
    """

    M: csr_matrix
    C: csr_matrix
    K: csr_matrix
    at_dam: csr_matrix
    coupling: dict[str, csr_matrix]
    load: Floats
    drive: ChannelDrive

    def on(self, maps: Mapping[str, csr_matrix]) -> csr_matrix:
        """B (r, m) of coordinates that give each block's displacement by a (3 n, m) map."""
        return csr_matrix(sum(self.coupling[name] @ maps[name] for name in self.coupling))


def reservoir_waves(scene: Scene) -> Waves | None:
    """Assemble the compressible water of a scene's reservoir; None where it has none."""
    water = scene.reservoir
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
    whole = (body.G / sound.speed**2, admittance * body.floor, body.H)
    M, C, K = (
        (_placed(part, inside, size) + _placed(own, last, size)) / water.density
        for part, own in zip(whole, (end.M, end.C, end.K), strict=True)
    )
    return Waves(M, C, K, _chosen(body.wet, size), body.coupling, fluxes, end.drive)


def _placed(matrix: csr_matrix, rows: Ints, size: int) -> csr_matrix:
    """A matrix over some of the unknowns as one over all."""
    onto = _chosen(rows, size)
    return csr_matrix(onto @ matrix @ onto.T)


def _chosen(rows: Ints, size: int) -> csr_matrix:
    """(size, len(rows)) with a one in each row that is chosen."""
    return csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(size, len(rows)))


def with_waves(system: System, waves: Waves, B: csr_matrix) -> System:
    """Put a reservoir's unknowns behind those of a system, whose dam sweeps the volumes B u."""
    n, m = system.size, waves.M.shape[0]
    swept = csr_matrix(waves.at_dam @ B)
    load = np.zeros((n + m, 3 + waves.load.shape[1]))
    load[:n, :3], load[n:, 3:] = system.load, -waves.load
    more = system.at_point
    return replace(
        system,
        M=csr_matrix(block_diag([system.M, waves.M])),
        C=csr_matrix(bmat([[system.C, swept.T], [-swept, waves.C]])),
        K=csr_matrix(block_diag([system.K, waves.K])),
        B=_widened(system.B, m),
        load=load,
        force=np.concatenate([system.force, np.zeros(m)]),
        observe=_widened(system.observe, m),
        parts=system.parts | {"reservoir": slice(n, n + m)},
        diagonal=False,
        at_point=None if more is None else _widened(more, m),
        drive=waves.drive,
        gyroscopic=True,
        drag=None if system.drag is None else np.vstack([system.drag, np.zeros((m, system.drag.shape[1]))]),
    )


def _widened(operator: csr_matrix, more: int) -> csr_matrix:
    return csr_matrix(hstack([operator, csr_matrix((operator.shape[0], more))]))
