"""The far end of a reservoir as the beginning of a channel without end.

A wave of the channel's n-th section mode, (H - lambda_n^2 G) phi = 0, goes upstream as exp(-kappa x) with

    kappa_n = sqrt(lambda_n^2 + s^2/c^2) = lambda_n Z(s / (lambda_n c)),      Z(s) = sqrt(1 + s^2),

evanescent below its cut-off lambda_n c and slower than sound above it, where a dashpot rho c is wrong: it
takes the mode for a plane wave. So each section mode below twice the reservoir's cut-off meets a network of
four oscillators and one dashpot that has the impedance Z(s)/s, scaled by lambda_n and c:

    K = [[1 + sum k_j^2/w_j^2, -k], [-k, diag w_j^2]],   M = diag(0, 1, ..),   C = l l^T,   l = (1, l_j).

Any network of this form takes energy and makes none. With these numbers it has Z within 0.7 % at every
frequency, but for 1 % on either side of the cut-off; statically, and at infinite frequency, it is exact.
(Graded layers that damp, up to sixteen depths long, were 70 % off at 1 % from the cut-off.) Higher section
modes decay before they reach the far end, which is rigid to them.

The ground's motion across the channel makes waves all along it, which do not come from the dam. They are
those of a section by itself, y'' + c^2 b y' + (lambda c)^2 y = rho c^2 r v_g, and pass the far end unseen:
the network acts on what the reservoir's motion differs from them.

References
----------
Fenves, Chopra, UCB/EERC-84/10 (1984) (modes of the channel); Givoli, J. Comput. Phys. 94 (1991) 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.linalg import eigh, expm
from scipy.sparse import block_diag, csr_matrix, diags_array, hstack, identity, kron

from romdam.core.motion import Motion
from romdam.core.scene import Sound
from romdam.core.system import Histories, Rates
from romdam.fem.water.body import WaterSection
from romdam.geometry.elements import Floats

_NETWORK = np.array(  # w_j, k_j, l_j
    [
        [0.655172, -0.036207, 0.758922],
        [0.986497, -0.005120, -0.186877],
        [1.026186, -0.117273, -0.241513],
        [1.704574, 1.989230, -1.297566],
    ]
)
_RADIATING = 2.0  # section modes below so many times the reservoir's cut-off


@dataclass(frozen=True)
class ChannelDrive:
    """Ground acceleration and velocity v, and N oscillators y'' + c y' + k y = velocity v, with their rates.

    Attributes
    ----------
    c : (N, N) [1/s]
    k : (N,) [1/s2]
    velocity : (N, 3) of y, per velocity of the base
    """

    c: Floats
    k: Floats
    velocity: Floats
    whole_record: ClassVar[bool] = False

    def drive(self, histories: Histories, dt: float, rates: Rates) -> Histories:
        """Add the base's velocity, y and y' at every step: exact where its acceleration is linear."""
        acc = histories.rows[Motion.BASE]
        N = len(self.k)
        velocity, y, rate, size = slice(0, 3), slice(3, 3 + N), slice(3 + N, 3 + 2 * N), 3 + 2 * N
        A = np.zeros((size + 6, size + 6))  # the states, acceleration, its slope
        A[velocity, size : size + 3] = A[size : size + 3, size + 3 :] = np.eye(3)
        A[y, rate], A[rate, y], A[rate, rate] = np.eye(N), -np.diag(self.k), -self.c
        A[rate, velocity] = self.velocity
        step = expm(dt * A)[:size]
        added = step[:, size : size + 3] @ acc[:, :-1] + step[:, size + 3 :] @ np.diff(acc) / dt
        states = np.zeros((size, acc.shape[1]))
        for i in range(acc.shape[1] - 1):
            states[:, i + 1] = step[:, :size] @ states[:, i] + added[:, i]
        motions = {
            Motion.BASE_VELOCITY: states[velocity],
            Motion.CHANNEL: states[y],
            Motion.CHANNEL_RATE: states[rate],
        }
        return replace(histories, rows=histories.rows | motions)


@dataclass(frozen=True)
class FarEnd:
    """Matrices over the k nodes of the far end below the surface, and the network's m unknowns behind them.

    Attributes
    ----------
    M, C, K : (k + m, k + m) sparse
    load : (k + m, 2 N) of the waves of sections by themselves and of their rates
    drive : these waves, of N section modes that radiate
    """

    M: csr_matrix
    C: csr_matrix
    K: csr_matrix
    load: Floats
    drive: ChannelDrive


def impedance_network() -> tuple[Floats, Floats, Floats]:
    """M, C, K of the network that has Z(s), the section's amplitude first."""
    w, k, l = _NETWORK.T
    through = np.concatenate([[1.0], l])
    K = np.diag(np.concatenate([[1.0 + (k**2 / w**2).sum()], w**2]))
    K[0, 1:] = K[1:, 0] = -k
    return np.diag(np.concatenate([[0.0], np.ones(len(w))])), np.outer(through, through), K


def radiating_end(section: WaterSection, sound: Sound, admittance: float, density: float) -> FarEnd:
    """Let the waves of a channel go on beyond its far end.

    Parameters
    ----------
    section : of its k nodes below the surface
    admittance : q of the floor [s/m], to which that of rock is added
    density : of the water [kg/m3]
    """
    c = sound.speed
    H, G, B = section.H, section.G, section.floor
    highest = (_RADIATING * 2.0 * np.pi * sound.cutoff / c) ** 2
    square, phi = eigh(H.toarray(), G.toarray(), subset_by_value=(0.0, highest))
    flux, wave = phi.T @ section.rigid, np.sqrt(square)
    damped = phi.T @ (admittance * B + density * section.rock) @ phi
    M, C, K = impedance_network()
    spread = identity(len(wave) * (len(M) - 1))
    onto = csr_matrix(block_diag([csr_matrix(G @ phi).T, spread]))  # amplitudes of section modes, oscillators
    inertia, slow = diags_array(1.0 / (wave * c**2)), damped / np.sqrt(np.outer(wave, wave))
    dashpot, spring = identity(len(wave)) / c, diags_array(wave)
    load = hstack([kron(K[:, :1], spring), kron(C[:, :1], dashpot)])
    return FarEnd(
        M=csr_matrix(onto.T @ kron(M, inertia) @ onto),
        C=csr_matrix(onto.T @ (kron(C, dashpot) + kron(M, slow)) @ onto),
        K=csr_matrix(onto.T @ kron(K, spring) @ onto),
        load=(onto.T @ load).toarray(),
        drive=ChannelDrive(c**2 * damped, c**2 * square, density * c**2 * flux),
    )
