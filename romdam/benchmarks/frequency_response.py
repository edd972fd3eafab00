"""Steady response to harmonic ground motion: the crest of a dam, the force on a rigid wall.

Published periods of dams with compressible water are those of the largest response.
"""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from romdam.core.scene import Scene
from romdam.core.system import System
from romdam.effects.channel import ChannelDrive
from romdam.effects.compressible_water import reservoir_waves

Complexes = NDArray[np.complex128]
_HYSTERESIS = 0.01  # ratio of the concrete, small: it makes the largest response finite


def channel_inputs(drive: ChannelDrive, omega: float, axis: int) -> Complexes:
    """What drives the far end of a reservoir, (3 + 2 waves,): velocity, waves of the sections, their rates.

    Parameters
    ----------
    omega : of unit ground acceleration exp(i omega t) [rad/s]
    axis : number of its direction
    """
    velocity = np.eye(3)[axis] / (1j * omega)
    matrix = np.diag(drive.k - omega**2) + 1j * omega * drive.c
    y = np.linalg.solve(matrix, drive.velocity @ velocity)
    return np.concatenate([velocity, y, 1j * omega * y])


def inputs(system: System, omega: float, axis: int) -> Complexes:
    """What the load of a system multiplies, of the same ground acceleration, (columns of the load,)."""
    drives = (channel_inputs(cast(ChannelDrive, drive), omega, axis) for drive in system.drives)
    return np.concatenate([np.eye(3)[axis].astype(complex), *drives])


def crest_response(system: System, dam: str, omega: float) -> float:
    """Acceleration of the first output node over that of the base, along y.

    Parameters
    ----------
    dam : name of its block, whose stiffness has hysteretic damping
    omega : [rad/s]
    """
    K = system.K.tocoo()
    inside = (K.row < system.parts[dam].stop) & (K.col < system.parts[dam].stop)
    factors = np.where(inside, 1.0 + 2j * _HYSTERESIS, 1.0)
    hysteretic = csc_matrix((factors * K.data, (K.row, K.col)), shape=K.shape)
    A = csc_matrix(hysteretic - omega**2 * system.M + 1j * omega * system.C)
    u = splu(A).solve(-(system.load @ inputs(system, omega, 1)).astype(complex))
    return float(abs(1.0 - omega**2 * (system.observe @ u)[1]))


def first_period(system: System, dam: str, low: float, high: float, tolerance: float = 1e-3) -> float:
    """Period of the largest response of the crest between two, by golden sections [s].

    Parameters
    ----------
    tolerance : relative, of the period
    """
    ratio = (np.sqrt(5.0) - 1.0) / 2.0
    periods = [high - ratio * (high - low), low + ratio * (high - low)]
    responses = [crest_response(system, dam, 2 * np.pi / period) for period in periods]
    while high / low > 1.0 + tolerance:
        if responses[0] > responses[1]:  # of the two between, one is kept
            high, new, at = periods[1], periods[1] - ratio * (periods[1] - low), 0
        else:
            low, new, at = periods[0], periods[0] + ratio * (high - periods[0]), 1
        del periods[1 - at], responses[1 - at]
        periods.insert(at, new)
        responses.insert(at, crest_response(system, dam, 2 * np.pi / new))
    return 0.5 * (low + high)


def force_on_rigid_wall(scene: Scene, omega: float) -> complex:
    """Force of compressible water along y on blocks that move with the ground, over its acceleration [kg]."""
    waves = reservoir_waves(scene)
    assert waves is not None
    rigid = {name: np.tile(np.eye(3), (len(block.points), 1)) for name, block in scene.blocks.items()}
    swept = np.sum([waves.coupling[name] @ rigid[name] for name in rigid], axis=0)[:, 1]
    A = csc_matrix(waves.K - omega**2 * waves.M + 1j * omega * waves.C)
    x = splu(A).solve(waves.load @ channel_inputs(waves.drive, omega, 1))
    return complex(1j * omega * swept @ (waves.at_dam.T @ x))
