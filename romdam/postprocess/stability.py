"""Static stability of joints: factor of safety, resultant and open share, against a required factor.

References
----------
USACE, EM 1110-2-6053 (2007), Earthquake Design and Evaluation of Concrete Hydraulic Structures: afterwards a
dam has to be stable under static loads with the strength, the uplift and the drains that the earthquake left.
USACE, EM 1110-2-2100 (2005), Stability Analysis of Concrete Structures: required factors, location of the
resultant.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.core.system import OPEN
from romdam.postprocess.joint_roles import mean_normal, rock_of, upper_is_J, upward

STABLE, NOT_STABLE, NO_EQUILIBRIUM, NOT_FOUND = "stable", "not stable", "no equilibrium", "not found"
_KERN = 1.0 / 6.0  # of a joint's length, from its middle: a resultant farther out leaves a part unloaded
_ROUND_OFF = 1e-9  # of the compression: so little shear is none
Row = tuple[str, ...]
HEAD: Row = (
    "record", "joint", "verdict", "factor", "required", "shear [MN]", "compression [MN]", "water [MN]",
    "resultant [share of length from the heel]", "it is", "toe pressure [MPa]", "cracked length [m]",
    "open [% of area]", "intact bond [% of area]", "slip left [mm]",
)  # fmt: skip
FORCES_HEAD: Row = (
    "record", "body", "of", "F_x [MN]", "F_y [MN]", "F_z [MN]", "M_x [MN m]", "M_y [MN m]", "M_z [MN m]",
    "left [share of the forces]",
)  # fmt: skip


@dataclass(frozen=True)
class JointStability:
    """A joint at rest, or several that share a load.

    Attributes
    ----------
    record, joint : names
    factor, required : of safety against sliding
    shear, compression, water : resultants: shear along the joint's mean plane, contact force across it less
        the tension of bonds, water in the joint and in its cracks [N]
    resultant : where the contact force's resultant stands along the direction in which the block that
        stands on the other would slide: 0 at the heel, 1 at the toe; NaN without shear, and of several joints
    toe_pressure : at the toe of a pressure that is linear along the joint, without tension, and has this
        resultant, N / A (1 + 6 e / L) in the kern [Pa]; NaN where `resultant` is, or beyond the base
    cracked_length : of the joint's length, the part that is open; where uplift is redrawn, from the heel to
        the crack's tip [m]; NaN where `resultant` is
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
    toe_pressure: float
    cracked_length: float
    open_share: float
    bonded_share: float
    slip: float

    @property
    def verdict(self) -> str:
        """Whether the factor reaches what is required."""
        return STABLE if not self.factor < self.required else NOT_STABLE

    @property
    def location(self) -> str:
        """Where the resultant stands, in words."""
        if np.isnan(self.resultant):
            return "-"
        from_middle = abs(self.resultant - 0.5)
        if from_middle <= _KERN + 1e-9:
            return "in the kern (middle third)"
        end = "toe" if self.resultant > 0.5 else "heel"
        if from_middle <= 0.25:
            return f"in the middle half, towards the {end}"
        return f"in the base, near the {end}" if from_middle <= 0.5 else f"outside the base, beyond the {end}"


def joint_stability(
    dataset: xr.Dataset, record: str, required: float, joints: Collection[str] | None
) -> list[JointStability]:
    """Judge joints in the first state of a result, which is at rest; then those on rock that share a load.

    Parameters
    ----------
    dataset : a result
    joints : names; None for all that carry shear
    """
    first, judged = dataset.isel(time=0), list[JointStability]()
    rock, up = rock_of(dataset), upward(dataset)
    names = list(map(str, dataset.joint.values)) if "sliding_safety_factor" in dataset else []
    names = [name for name in names if joints is None or name in joints]
    for name in names:
        of_joint, gaps = first.sel(joint=name), first.isel(gap=dataset.gap_joint.values == name)
        area, position = gaps.gap_area.values, gaps.gap_position.values
        normal, (block_I, block_J) = mean_normal(gaps), map(str, of_joint.joint_blocks.values)
        whole, shear = _contact(of_joint, normal)
        size, pressed = float(np.linalg.norm(shear)), -gaps.normal_force.values
        if size <= _ROUND_OFF * whole:
            size = 0.0
        open_share = float(area[gaps.joint_state.values == OPEN].sum() / area.sum())
        resultant, toe_pressure, cracked = np.nan, np.nan, np.nan
        if size > 0.0 and whole > 0.0:
            # the joint's shear holds back the block that stands on the other: J, or I against its sign
            on_J = upper_is_J(normal, (block_I, block_J), rock, up)
            along = position @ (-shear / size if on_J else shear / size)
            low, length = float(along.min()), float(np.ptp(along))
            if length > 0.0:
                resultant = float((pressed @ along / pressed.sum() - low) / length)
                toe_pressure = _toe_pressure(whole / float(area.sum()), resultant)
                cracked = open_share * length
                if "crack_at_rest" in gaps and not np.isnan(gaps.crack_at_rest.values).any():
                    cracked = float(np.average(gaps.crack_at_rest.values, weights=area))
        water = 0.0
        if "joint_water_force" in first:
            water = float(np.linalg.norm(of_joint.joint_water_force.values))
        bonded = float(of_joint.bonded_area) if "bonded_area" in first else 0.0
        slip = gaps.slip.values
        mean_slip = np.einsum("g,gj,gjx->x", area, slip, gaps.gap_tangent.values) / area.sum()
        judged.append(
            JointStability(
                record=record,
                joint=name,
                factor=float(of_joint.sliding_safety_factor) if size > 0.0 else np.nan,
                required=required,
                shear=size,
                compression=whole,
                water=water,
                resultant=resultant,
                toe_pressure=toe_pressure,
                cracked_length=cracked,
                open_share=open_share,
                bonded_share=bonded / float(area.sum()),
                slip=float(np.linalg.norm(mean_slip)),
            )
        )
    return [*judged, *_groups(first, judged, rock)]


def _contact(of_joint: xr.Dataset, normal: Floats) -> tuple[float, Floats]:
    """Compression, and shear (3,) on block J in the mean plane: `joint_force` without its water [N]."""
    force: Floats = of_joint.joint_force.values
    if "joint_water_force" in of_joint:
        force = force - of_joint.joint_water_force.values
    compression = float(force @ normal)
    return compression, np.asarray(force - compression * normal)


def _toe_pressure(mean: float, resultant: float) -> float:
    """Pressure at the toe that is linear along the base without tension, from its mean [Pa].

    References
    ----------
    USACE, EM 1110-2-2200 (1995), Gravity Dam Design, chapter 4: N / A (1 + 6 e / L); beyond the kern N acts
    in the third of what is pressed.
    """
    out = resultant - 0.5
    if not 0.0 < resultant < 1.0:
        return np.nan
    if abs(out) <= _KERN:
        return mean * (1.0 + 6.0 * out)
    return 2.0 * mean / (3.0 * (1.0 - resultant)) if out > 0.0 else 0.0


def _groups(
    first: xr.Dataset, judged: Sequence[JointStability], rock: Collection[str]
) -> list[JointStability]:
    """Joints to rock of blocks that joints hold together: they slide as one, and share the load."""
    blocks = {
        str(name): [str(b) for b in first.joint_blocks.sel(joint=name).values] for name in first.joint.values
    }
    group = {name: name for pair in blocks.values() for name in pair if name not in rock}

    def root(name: str) -> str:
        while group[name] != name:
            name = group[name]
        return name

    for one, other in blocks.values():
        if one in group and other in group:
            group[root(one)] = root(other)
    members = dict[str, list[JointStability]]()
    for joint in judged:
        dam = [name for name in blocks[joint.joint] if name in group]
        if len(dam) == 1:
            members.setdefault(root(dam[0]), []).append(joint)
    found = list[JointStability]()
    for several in members.values():
        if len(several) < 2:
            continue
        names = [joint.joint for joint in several]
        strength, shear = 0.0, np.zeros(3)
        for name in names:
            gaps = first.isel(gap=first.gap_joint.values == name)
            of_joint, sign = first.sel(joint=name), 1.0 if blocks[name][1] in group else -1.0
            shear += sign * _contact(of_joint, mean_normal(gaps))[1]
            strength += float(of_joint.joint_shear_strength.values.min())
        size = float(np.linalg.norm(shear))
        area = np.array(
            [float(first.gap_area.values[first.gap_joint.values == name].sum()) for name in names]
        )

        def mean(values: Sequence[float], weights: Floats = area) -> float:
            return float(np.average(values, weights=weights))

        found.append(
            JointStability(
                record=several[0].record,
                joint=" + ".join(names),
                factor=strength / size if size > 0.0 and np.isfinite(strength) else np.nan,
                required=several[0].required,
                shear=size,
                compression=sum(joint.compression for joint in several),
                water=sum(joint.water for joint in several),
                resultant=np.nan,
                toe_pressure=np.nan,
                cracked_length=np.nan,
                open_share=mean([joint.open_share for joint in several]),
                bonded_share=mean([joint.bonded_share for joint in several]),
                slip=mean([joint.slip for joint in several]),
            )
        )
    return found


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
        joint.location,
        "-" if np.isnan(joint.toe_pressure) else f"{1e-6 * joint.toe_pressure:.4g}",
        "-" if np.isnan(joint.cracked_length) else f"{joint.cracked_length:.4g}",
        f"{100.0 * joint.open_share:.3g}",
        f"{100.0 * joint.bonded_share:.3g}",
        f"{1e3 * joint.slip:.4g}",
    )


def force_rows(dataset: xr.Dataset, record: str) -> list[Row]:
    """Rows under `FORCES_HEAD`: what acts on the dam and its bodies at rest; none where that is not known."""
    rows = []
    for name in map(str, dataset.body.values) if "loads_at_rest" in dataset else ():
        body = dataset.sel(body=name)
        kinds = {kind: body[f"{kind}_at_rest"].values for kind in ("loads", "joints", "supports")}
        least = 1e-9 * max(float(np.abs(values).max()) for values in kinds.values())
        for kind, values in kinds.items():
            shown = np.where(np.abs(values) < least, 0.0, values)
            left = f"{float(body.imbalance_at_rest):.1e}" if kind == "loads" else ""
            rows.append((record, name, kind, *(f"{1e-6 * value:.6g}" for value in shown), left))
    return rows
