"""Motion of an infinite channel of water by the ground: velocity of its walls, waves of its sections."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import expm

from romdam.core.arrays import Floats
from romdam.core.system import Rates


@dataclass(frozen=True)
class ChannelDrive:
    """Ground acceleration and velocity v, and N oscillators y'' + c y' + k y = drive v, with their rates.

    Attributes
    ----------
    c : (N, N) [1/s]
    k : (N,) [1/s2]
    drive : (N, 3)
    """

    c: Floats
    k: Floats
    drive: Floats
    band_limited: ClassVar[bool] = False

    def histories(self, acc: Floats, dt: float, rates: Rates) -> tuple[Floats, int, tuple[str, ...]]:
        """Acceleration, velocity, y and y' at every step, (6 + 2 N, nt): exact where `acc` is linear."""
        N = len(self.k)
        velocity, y, rate, size = slice(0, 3), slice(3, 3 + N), slice(3 + N, 3 + 2 * N), 3 + 2 * N
        A = np.zeros((size + 6, size + 6))  # the states, acceleration, its slope
        A[velocity, size : size + 3] = A[size : size + 3, size + 3 :] = np.eye(3)
        A[y, rate], A[rate, y], A[rate, rate] = np.eye(N), -np.diag(self.k), -self.c
        A[rate, velocity] = self.drive
        step = expm(dt * A)[:size]
        added = step[:, size : size + 3] @ acc[:, :-1] + step[:, size + 3 :] @ np.diff(acc) / dt
        states = np.zeros((size, acc.shape[1]))
        for i in range(acc.shape[1] - 1):
            states[:, i + 1] = step[:, :size] @ states[:, i] + added[:, i]
        return np.concatenate([acc, states]), 0, ()
