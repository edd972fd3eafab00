"""Variables of a result that tell of sliding: forces of whole joints, what they bear, how far they move."""

from __future__ import annotations

import numpy as np

from romdam.core.system import SLIP
from romdam.postprocess.sliding import REST, safety_factor
from romdam.results.case import Array, Case, Variable

_RESTS = 0.05  # of the residual slip: less motion about that mean, and a joint rests
_NO_SLIP = 1e-9  # [m] of motion about the mean, which is round-off of a state at rest


def _strength(case: Case) -> Array:
    strength = case.joint_sums(case.history.strength)
    return np.where(np.isfinite(strength), strength, np.nan)


def _safety_factor(case: Case) -> Array:
    return safety_factor(_strength(case), case.joint_sums(case.history.traction[..., 1:]))


def _displacement(case: Case) -> Array:
    """Area-weighted mean of the jumps in global axes, less that of the first row."""
    area, jump = case.of_gaps("whole_area"), case.history.jump
    moved = np.einsum(
        "tgd,gdx->tgx", jump - jump[0], case.of_gaps("axes") * area[:, None, None], optimize=True
    )
    return case.joint_sums(moved) / case.joint_sums(area[None])[..., None]


def _demand_ratio(case: Case) -> Array:
    with np.errstate(divide="ignore"):
        ratio = 1.0 / _safety_factor(case)
    return np.fmax.reduce(ratio, axis=0)


def _slip(case: Case) -> Array:
    """Mean displacement along the joints' mean planes, (nt, joints, 3) [m]."""
    moved, area = _displacement(case), case.of_gaps("whole_area")
    normal = case.joint_sums((area[:, None] * case.of_gaps("axes")[:, 0])[None])[0]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(moved - (moved * normal).sum(axis=-1, keepdims=True) * normal)


def _residual(case: Case) -> Array:
    """Mean slip that is left."""
    time = case.history.time
    return np.linalg.norm(_slip(case)[time >= time[-1] - REST].mean(axis=0), axis=1)


def sliding_warnings(case: Case) -> list[str]:
    """Write a sentence for each joint that still slides while its residual slip is averaged."""
    if not case.carries_shear():
        return []
    last, sentences, first = case.history.time >= case.history.time[-1] - REST, [], 0
    slip, residual = _slip(case)[last], _residual(case)
    farthest = np.linalg.norm(slip - slip.mean(axis=0), axis=-1).max(axis=0)
    for number, (name, joint) in enumerate(case.scene.joints.items()):
        gaps = slice(first, first := first + len(joint.area))
        slides = (case.history.state[last, gaps] == SLIP).any()
        if slides and farthest[number] > max(_RESTS * residual[number], _NO_SLIP):
            size = 1e3 * np.linalg.norm(slip[:, number], axis=1)
            sentences.append(
                f"joint {name} still slides in the last {REST:g} s of the run: its slip there is "
                f"{size.min():.3g} to {size.max():.3g} mm, and the residual slip of "
                f"{1e3 * residual[number]:.3g} mm, their mean, is not what is left; give a longer "
                "transient.duration, or a record that ends at rest"
            )
    return sentences


UNDEFINED = ("joint_shear_strength", "sliding_safety_factor")  # may be no numbers
SLIDING_VARIABLES: dict[str, Variable] = {
    "joint_normal_force": Variable(
        ("time", "joint"),
        "N",
        "normal force of the whole joint, sum over its gaps, compression negative",
        lambda c: c.joint_sums(-c.history.traction[..., 0]),
        Case.carries_shear,
    ),
    "joint_shear_force": Variable(
        ("time", "joint", "tangent"),
        "N",
        "shear force of the whole joint on block J",
        lambda c: c.joint_sums(c.history.traction[..., 1:]),
        Case.carries_shear,
    ),
    "joint_shear_strength": Variable(
        ("time", "joint", "tangent"),
        "N",
        "shear that the gaps' laws let the whole joint carry now, c A + mu N; NaN where a shear key holds",
        _strength,
        Case.carries_shear,
    ),
    "sliding_safety_factor": Variable(
        ("time", "joint"),
        "1",
        "factor of safety against sliding, strength over shear; NaN where the joint carries no shear",
        _safety_factor,
        Case.carries_shear,
    ),
    "bonded_area": Variable(
        ("time", "joint"),
        "m2",
        "area whose bond is intact",
        lambda c: c.joint_sums(c.history.bonded * c.of_gaps("area")),
        lambda c: bool(c.history.bonded.any()),
    ),
    "joint_displacement": Variable(
        ("time", "joint", "component"),
        "m",
        "displacement of block J relative to block I since the start, mean over the joint's area",
        _displacement,
        Case.carries_shear,
    ),
}
SLIDING_ROWS: dict[str, Variable] = {
    "sliding_demand_ratio": Variable(
        ("joint",),
        "1",
        "largest shear over shear strength, 1 / least factor of safety against sliding, by the written rows",
        _demand_ratio,
        Case.carries_shear,
    ),
    "residual_sliding": Variable(
        ("joint",),
        "m",
        f"displacement along the joint that is left, mean over its area and over the last {REST:g} s",
        _residual,
        Case.carries_shear,
    ),
}
