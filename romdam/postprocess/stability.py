"""Static stability of joints: factor of safety, resultant and open share, against a required factor.

References
----------
USACE, EM 1110-2-6053 (2007), Earthquake Design and Evaluation of Concrete Hydraulic Structures: afterwards a
dam has to be stable under static loads with the strength, the uplift and the drains that the earthquake left.
USACE, EM 1110-2-2100 (2005), Stability Analysis of Concrete Structures: required factors, location of the
resultant.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import xarray as xr

from romdam.core.system import OPEN

STABLE, NOT_STABLE, NO_EQUILIBRIUM = "stable", "not stable", "no equilibrium"
Row = tuple[str, ...]
HEAD: Row = (
    "record", "joint", "verdict", "factor", "required", "shear [MN]", "compression [MN]", "water [MN]",
    "resultant [share of length]", "open [% of area]", "intact bond [% of area]", "slip left [mm]",
)  # fmt: skip


@dataclass(frozen=True)
class JointStability:
    """A joint at rest.

    Attributes
    ----------
    record, joint : names
    factor, required : of safety against sliding
    shear, compression, water : resultants: shear along the joint, contact pressure, water in the joint [N]
    resultant : where the contact pressure's resultant stands along the direction in which the joint would
        slide: 0 at the end behind (the heel of a dam pushed downstream), 1 at the end ahead (its toe); NaN
        without shear
    open_share, bonded_share : of the joint's area
    slip : mean over the joint since its first state [m]
    """

    record: str
    joint: str
    factor: float
    required: float
    shear: float
    compression: float
    water: float
    resultant: float
    open_share: float
    bonded_share: float
    slip: float

    @property
    def verdict(self) -> str:
        """Whether the factor reaches what is required."""
        return STABLE if not self.factor < self.required else NOT_STABLE


def joint_stability(
    dataset: xr.Dataset, record: str, required: float, joints: Collection[str] | None
) -> list[JointStability]:
    """Judge joints in the first state of a result, which is at rest.

    Parameters
    ----------
    dataset : a result
    joints : names; None for all that carry shear
    """
    first, judged = dataset.isel(time=0), list[JointStability]()
    for name in map(str, dataset.joint.values):
        if (joints is not None and name not in joints) or "sliding_safety_factor" not in dataset:
            continue
        of_joint, gaps = first.sel(joint=name), first.isel(gap=dataset.gap_joint.values == name)
        area, position = gaps.gap_area.values, gaps.gap_position.values
        pressed = np.maximum(-gaps.normal_force.values, 0.0)
        shear = np.einsum("gj,gjx->x", gaps.shear_force.values, gaps.gap_tangent.values)
        size, whole = float(np.linalg.norm(shear)), float(pressed.sum())
        resultant = np.nan
        if size > 0.0 and whole > 0.0:
            along = position @ (-shear / size)  # the joint's shear on block J holds it back
            length = float(np.ptp(along))
            resultant = float((pressed @ along / whole - along.min()) / length) if length else np.nan
        water = 0.0
        if "water_force" in first:
            water = float(np.linalg.norm(of_joint.water_force.values))
        bonded = float(of_joint.bonded_area) if "bonded_area" in first else 0.0
        slip = gaps.slip.values
        mean_slip = np.einsum("g,gj,gjx->x", area, slip, gaps.gap_tangent.values) / area.sum()
        factor = float(of_joint.sliding_safety_factor)
        judged.append(
            JointStability(
                record=record,
                joint=name,
                factor=factor,
                required=required,
                shear=size,
                compression=whole,
                water=water,
                resultant=resultant,
                open_share=float(area[gaps.joint_state.values == OPEN].sum() / area.sum()),
                bonded_share=bonded / float(area.sum()),
                slip=float(np.linalg.norm(mean_slip)),
            )
        )
    return judged


def stability_row(joint: JointStability) -> Row:
    """A row of the table under `HEAD`."""
    return (
        joint.record,
        joint.joint,
        joint.verdict,
        "carries no shear" if np.isnan(joint.factor) else f"{joint.factor:.4g}",
        f"{joint.required:.4g}",
        *(f"{1e-6 * force:.5g}" for force in (joint.shear, joint.compression, joint.water)),
        "-" if np.isnan(joint.resultant) else f"{joint.resultant:.3f}",
        f"{100.0 * joint.open_share:.3g}",
        f"{100.0 * joint.bonded_share:.3g}",
        f"{1e3 * joint.slip:.4g}",
    )
