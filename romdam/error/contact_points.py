"""What the contact points of each joint add to the error of all openings, and the fewest for an accuracy.

Joint j of n_j gaps, h_j apart, adds e_j to the error of all openings, and e_j grows as h_j^p. The fewest gaps
sum_j n_j / t_j^2 on lengths t_j h_j that keep an accuracy, sum_j e_j^2 t_j^(2 p) = accuracy^2, have

    t_j = c (n_j / e_j^2)^(1 / (2 p + 2)),

the same c in all joints (Lagrange): one that hardly opens, whose e_j is small, has few gaps. The order p is
that of `romdam.error.discretisation` for linear elements, as the jump is linear between contact points.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from romdam.error.alignment import coinciding_of_joints
from romdam.error.comparison import OVER_FINER
from romdam.error.discretisation import MeshRun
from romdam.error.metrics import from_rest

_ORDER = math.log2(OVER_FINER / (OVER_FINER - 1.0))  # p, from OVER_FINER = 1 / (1 - 2^-p)
_LEAST = 1e-3  # of the largest error: less is none


def joint_differences(judged: MeshRun, better: MeshRun) -> dict[str, float]:
    """What two runs differ by in every joint, in L2 over its area and relative to all openings of the better.

    Joints without a gap of both are left out.
    """
    here, there, joints = coinciding_of_joints(judged.position, judged.joints, better.position, better.joints)
    difference, size = dict[str, float](), 0.0
    for name, gaps in joints.items():
        area, whole = judged.area[here[gaps]], judged.area[judged.joints[name]].sum()
        own, wanted = from_rest(judged.opening[:, here[gaps]], better.opening[:, there[gaps]])
        scale = area * whole / area.sum()
        difference[name] = float((scale * (own - wanted) ** 2).sum())
        size += float((scale * wanted**2).sum())
    return {name: math.sqrt(value / size) if size else 0.0 for name, value in difference.items()}


def fewest_gaps(errors: Mapping[str, float], gaps: Mapping[str, int], accuracy: float) -> dict[str, float]:
    """Factors of lengths, at most 1, by which the fewest gaps leave an accuracy; see the module."""
    error = np.maximum(np.array(list(errors.values())), _LEAST * max(errors.values()))
    shape = (np.array([gaps[name] for name in errors]) / error**2) ** (1.0 / (2.0 * _ORDER + 2.0))
    low, high = 0.0, 1.0 / float(shape.min())
    for _ in range(60):  # bisection, to round-off
        c = (low + high) / 2.0
        left = float(np.linalg.norm(error * np.minimum(c * shape, 1.0) ** _ORDER))
        low, high = (c, high) if left <= accuracy else (low, c)
    return dict(zip(errors, np.minimum(low * shape, 1.0).tolist(), strict=True))


def error_over_difference(length: float | None, finer: float | None) -> float:
    """The error of a length over its difference to a finer one, or to a gap at every node."""
    return 1.0 if not length or not finer else 1.0 / (1.0 - (finer / length) ** _ORDER)
