"""Sliding of joints: the factor of safety over time, what is left of the slip, and the verdict.

References
----------
USACE, EM 1110-2-2200 (1995), Gravity Dam Design, chapter 4: FS = (N tan phi + c L) / T, the resisting over
the applied shear along the plane. USBR, Design Criteria for Concrete Arch and Gravity Dams, Engineering
Monograph 19 (1977): the shear-friction factor of safety Q = (C A + N tan phi) / V.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.round_off import without_round_off
from romdam.core.system import OPEN, SLIP, STICK
from romdam.postprocess.joint_roles import bears, mean_normal, rock_of, upward

if TYPE_CHECKING:  # workers write no file
    import xarray as xr

REST = 1.0  # [s] at the end of a run, over which residual openings and slips are averaged
_SAME = 5e-4  # of the least factor of safety, what the table shows of it: a joint that slides rests at 1
_ROUNDING = 1e-12  # of the resultant, below which a direction carries nothing


def row_seconds(time: Floats) -> Floats:
    """Half of the intervals beside every written row, (nt,) [s]: what it stands for; they sum to the run."""
    half = 0.5 * np.diff(time)
    return np.asarray(np.append(half, 0.0) + np.append(0.0, half))


def safety_factor(strength: Floats, shear: Floats) -> Floats:
    """Factor of safety against sliding, (...): strength over shear, NaN where there is no shear or no bound.

    Equal strengths along j and k bound the resultant, as the gaps' laws do; else the lesser of the directions
    counts that are bounded and loaded.

    Parameters
    ----------
    strength, shear : (..., 2) of whole joints along their local axes j and k [N]
    """
    size = np.hypot(shear[..., 0], shear[..., 1])
    counts = np.isfinite(strength) & (np.abs(shear) > _ROUNDING * size[..., None])
    with np.errstate(divide="ignore", invalid="ignore"):
        resultant = strength[..., 0] / size
        each = np.where(counts, strength / np.abs(shear), np.inf).min(axis=-1)
    factor = np.where(strength[..., 0] == strength[..., 1], resultant, each)
    return np.where(np.isfinite(factor), factor, np.nan)


@dataclass(frozen=True)
class Sliding:
    """Sliding of block J on block I in a joint, by the written rows; round-off is 0.

    Attributes
    ----------
    joint, blocks : names of the joint, and of the blocks I and J
    bears : whether it is a base or a lift, no contraction joint
    factor, factor_time : least factor of safety, and when it is first reached, but for 0.05 % [s]; NaN where
        the joint carries no shear
    sliding_time, open_time : time in which every closed gap slides, and in which no gap is closed, see
        `row_seconds` [s]
    unbounded : whether it carries shear that no law bounds, as an elastic joint does
    slipped : whether any gap has slid
    residual : (3,) mean displacement of J over I that is left, along x, y, z [m]
    residual_slip, largest_slip : its part along the joint's mean plane; the largest of a gap [m]
    rotation : of J over I about the plane's normal, least squares [rad]
    cumulative_slip : path of the mean displacement along the plane while some gap slides [m]
    """

    joint: str
    blocks: tuple[str, str]
    bears: bool
    factor: float
    factor_time: float
    sliding_time: float
    open_time: float
    unbounded: bool
    slipped: bool
    residual: Floats
    residual_slip: float
    largest_slip: float
    rotation: float
    cumulative_slip: float

    @property
    def verdict(self) -> str:
        """The joint slides where all its closed gaps do at once, and slips in part where some do."""
        if np.isnan(self.factor):
            return "carries shear without a bound" if self.unbounded else "carries no shear"
        words = [
            "slides" if self.sliding_time > 0.0 else "slips in part" if self.slipped else "does not slide"
        ]
        return ", ".join([*words, *(["opens wholly"] if self.open_time > 0.0 else [])])


def sliding(dataset: xr.Dataset) -> list[Sliding]:
    """Sliding of every joint of a result, bases and lifts before contraction joints.

    Nothing where no joint carries shear.
    """
    if "sliding_safety_factor" not in dataset:
        return []
    joints, rock, up = list[Sliding](), rock_of(dataset), upward(dataset)
    for name in map(str, dataset.joint.values):
        of_joint, gaps = dataset.sel(joint=name), dataset.isel(gap=dataset.gap_joint.values == name)
        time, state = of_joint.time.values, gaps.joint_state.values
        factor, seconds = of_joint.sliding_safety_factor.values, row_seconds(time)
        least = np.fmin.reduce(factor)
        moves, stays = (state == SLIP).any(axis=1), (state == STICK).any(axis=1)
        normal, blocks = mean_normal(gaps), of_joint.joint_blocks.values
        along = _along(of_joint.joint_displacement.values, normal)
        residual, rotation = _rigid_motion(gaps, normal)
        steps = np.linalg.norm(np.diff(along, axis=0), axis=1)
        residual_slip = np.linalg.norm(_along(residual, normal))
        largest_slip = np.linalg.norm(_left(gaps.slip), axis=1).max()
        cumulative_slip = steps[moves[1:]].sum()
        lengths = without_round_off([*residual, residual_slip, largest_slip, cumulative_slip])
        residual, (residual_slip, largest_slip, cumulative_slip) = lengths[:3], lengths[3:]
        joints.append(
            Sliding(
                joint=name,
                blocks=(str(blocks[0]), str(blocks[1])),
                bears=bears(normal, list(map(str, blocks)), rock, up),
                factor=float(least),
                factor_time=float(time[(factor <= (1.0 + _SAME) * least).argmax()]),
                sliding_time=float(seconds[moves & ~stays].sum()),
                open_time=float(seconds[(state == OPEN).all(axis=1)].sum()),
                unbounded=bool(np.isinf(of_joint.joint_shear_strength.values).any()),
                slipped=bool(moves.any()),
                residual=residual,
                residual_slip=float(residual_slip),
                largest_slip=float(largest_slip),
                rotation=float(without_round_off([rotation])[0]),
                cumulative_slip=float(cumulative_slip),
            )
        )
    return sorted(joints, key=lambda joint: not joint.bears)


def least_factor(joints: Sequence[Sliding]) -> Sliding | None:
    """The joint with the least factor of safety: a base or a lift, if any of them carries shear.

    A contraction joint that slides leaves the dam standing.
    """
    known = [joint for joint in joints if np.isfinite(joint.factor)]
    bearing = [joint for joint in known if joint.bears]
    return min(bearing or known, key=lambda joint: joint.factor, default=None)


def mean_slip(dataset: xr.Dataset) -> xr.DataArray:
    """Mean slip of block J over block I along every joint's mean plane since the start, (time, joint) [m]."""
    factor = dataset.sliding_safety_factor
    slip = factor.copy(data=np.zeros_like(factor.values)).rename("mean_slip")
    for name in dataset.joint.values:
        normal = mean_normal(dataset.isel(gap=dataset.gap_joint.values == name))
        along = _along(dataset.joint_displacement.sel(joint=name).values, normal)
        slip.loc[{"joint": name}] = np.linalg.norm(along, axis=1)
    return slip.assign_attrs(units="m")


def _along(displacement: Floats, normal: Floats) -> Floats:
    """(..., 3) part of it along the plane."""
    return displacement - (displacement @ normal)[..., None] * normal


def _left(values: xr.DataArray) -> Floats:
    """Mean of a variable over the last `REST`, less its first row."""
    time = values.time.values
    return np.asarray(values.values[time >= time[-1] - REST].mean(axis=0) - values.values[0], dtype=float)


def _rigid_motion(gaps: xr.Dataset, normal: Floats) -> tuple[Floats, float]:
    """Rigid motion of J over I that is left: (3,) of the joint's middle [m], rotation about the normal [rad].

    Of w = d + r x (x - middle) over the gaps, least squares by their areas.
    """
    area, position = gaps.gap_area.values, gaps.gap_position.values
    jump = np.column_stack([_left(gaps.opening), _left(gaps.slip)])
    axes = np.concatenate([gaps.gap_normal.values[:, None], gaps.gap_tangent.values], axis=1)
    arm = position - area @ position / area.sum()
    motions = np.tile(np.eye(3, 6), (len(area), 1, 1))
    motions[:, :, 3:] = -np.cross(arm[:, None], np.eye(3)).transpose(0, 2, 1)  # r x arm
    root = np.sqrt(area)[:, None]
    moved = np.einsum("gd,gdx->gx", jump, axes)
    fit = np.linalg.lstsq((root[..., None] * motions).reshape(-1, 6), (root * moved).ravel(), rcond=None)[0]
    return fit[:3], float(fit[3:] @ normal)


Row = tuple[str, ...]
HEAD: Row = (
    "joint", "block", "on", "verdict", "least factor of safety", "at [s]", "slides [s]", "open [s]",
    "residual slip [mm]", "largest left [mm]", "x [mm]", "y [mm]", "z [mm]", "rotation [mrad]", "path [mm]",
)  # fmt: skip


def sliding_rows(dataset: xr.Dataset) -> list[Row]:
    """The table of a result under `HEAD`: how block J slides on block I, a row for each joint."""
    rows = []
    for joint in sliding(dataset):
        factor = ("-", "-")
        if not np.isnan(joint.factor):
            factor = (f"{joint.factor:.4g}", f"{joint.factor_time:.3f}")
        times = (f"{joint.sliding_time:.3g}", f"{joint.open_time:.3g}")
        lengths = (joint.residual_slip, joint.largest_slip, *joint.residual, joint.cumulative_slip)
        *shown, path = lengths
        thousandths = (f"{1e3 * value:.4g}" for value in (*shown, joint.rotation, path))
        block_I, block_J = joint.blocks
        rows.append((joint.joint, block_J, block_I, joint.verdict, *factor, *times, *thousandths))
    return rows
