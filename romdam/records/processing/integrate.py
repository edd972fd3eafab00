"""Velocity and displacement of a ground acceleration that is linear between samples, from rest, exactly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def velocity(acc: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
    """Integrate acceleration (..., nt) [m/s2] to velocity (..., nt) [m/s], zero at the first sample."""
    vel = np.zeros_like(acc)
    np.cumsum(0.5 * dt * (acc[..., 1:] + acc[..., :-1]), axis=-1, out=vel[..., 1:])
    return vel


def displacement(acc: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
    """Integrate acceleration (..., nt) [m/s2] to displacement (..., nt) [m], zero and at rest at first."""
    vel = velocity(acc, dt)
    step = dt * vel[..., :-1] + dt**2 / 6.0 * (2.0 * acc[..., :-1] + acc[..., 1:])
    disp = np.zeros_like(acc)
    np.cumsum(step, axis=-1, out=disp[..., 1:])
    return disp
