"""Joint stiffness that follows from the elements beside the joint (`normal_stiffness: auto`)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from romdam.config.sections.joints import JointConfig
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError, listed
from romdam.core.scene import Block, Joint
from romdam.geometry.elements import ELEMENTS

AUTOMATIC_KEYS = ("normal_stiffness", "shear_stiffness")
# stiffness of the joint over that of the elements beside it: a closed joint then adds a tenth of their
# flexibility; codes of contact take 1 to 50 times
STIFFER_THAN_ELEMENTS = 10.0
_OF_FACET = 3  # corners that a cell has on the joint if it stands on it


def automatic_keys(joint: JointConfig) -> tuple[str, ...]:
    """The keys of a joint whose stiffness is `auto`."""
    return tuple(key for key in AUTOMATIC_KEYS if getattr(joint, key) == "auto")


def element_stiffness(
    blocks: Iterable[Block], nodes: Iterable[Ints], normal: Floats, location: str
) -> tuple[float, float]:
    """Normal and shear stiffness of the two layers of elements beside a joint, one behind the other [N/m3].

    A layer of height h has M / h along the normal and G / h along the joint, with the constrained modulus
    M = E (1 - nu) / ((1 + nu) (1 - 2 nu)) and the shear modulus G = E / (2 (1 + nu)). h is the mean extent
    along the normal of the cells that stand on the joint.

    Parameters
    ----------
    blocks, nodes : of both sides: the block, and the numbers of its nodes on the joint
    normal : (3,) mean unit normal of the joint
    location : file and key, for messages

    Raises
    ------
    ConfigError
        for a block of matrices, whose elements are unknown, and where no cell stands on the joint.
    """
    flexibility = np.zeros(2)
    for block, on_joint in zip(blocks, nodes, strict=True):
        if block.matrices is not None:
            raise ConfigError(
                f"{location}: auto needs the elements beside the joint, but block {block.name!r} comes as "
                "matrices of another program; give a stiffness such as 16 GPa/m, or rigid"
            )
        corners = block.cells[:, : ELEMENTS[block.element].corners]
        stands = np.isin(corners, on_joint).sum(axis=1) >= _OF_FACET
        if not stands.any():
            raise ConfigError(
                f"{location}: auto needs the elements beside the joint, but no cell of block "
                f"{block.name!r} has {_OF_FACET} corners on it; give a stiffness such as 16 GPa/m, or rigid"
            )
        height = float(np.ptp(block.points[corners[stands]] @ normal, axis=1).mean())
        E, nu = block.material.E, block.material.nu
        constrained, shear = E * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))
        flexibility += height / np.array([constrained, shear])
    normal_stiffness, shear_stiffness = (1.0 / flexibility).tolist()
    return normal_stiffness, shear_stiffness


def with_automatic_stiffness(joint: JointConfig, of_elements: tuple[float, float]) -> JointConfig:
    """The joint with numbers in place of `auto` [N/m3].

    Parameters
    ----------
    of_elements : see `element_stiffness`
    """
    values = dict(zip(AUTOMATIC_KEYS, of_elements, strict=True))
    return joint.model_copy(
        update={key: STIFFER_THAN_ELEMENTS * values[key] for key in automatic_keys(joint)}
    )


def automatic_remarks(joints: Iterable[Joint], keys: dict[str, tuple[str, ...]]) -> list[str]:
    """Say which stiffness `auto` stands for, in one line for each key.

    Parameters
    ----------
    keys : joint -> its keys that are `auto`
    """
    remarks = []
    for k, key in enumerate(AUTOMATIC_KEYS):
        chosen = {joint.name: joint.element_stiffness[k] for joint in joints if key in keys[joint.name]}
        if chosen:
            values = [f"{STIFFER_THAN_ELEMENTS * value / 1e9:.4g} GPa/m" for value in chosen.values()]
            named = (
                values[0]
                if len(set(values)) == 1
                else ", ".join(f"{value} ({name})" for name, value in zip(chosen, values, strict=True))
            )
            of_joints = "" if len(set(values)) > 1 else f" in {listed(list(chosen))}"
            remarks.append(
                f"joints: {key}: auto is {named}{of_joints}, {STIFFER_THAN_ELEMENTS:g} times that of the "
                "elements beside the joint"
            )
    return remarks
