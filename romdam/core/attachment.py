"""What is attached to blocks beside their elements: springs, dashpots and masses.

An anchor is a spring on the distance of two points, a pad between two blocks a dashpot on it, a gate a mass
on the mean motion of a face. Each acts on a scalar displacement that is linear in those of the blocks,

    e = sum over blocks b of R_b u_b,   f = weight - tension - stiffness e - damping e' - mass e'',

with f the force along e, so that the force on a block is R_b^T f. From the rows R_b and these few numbers
follow mass, damping, stiffness, loads and what is recorded, on the mesh and on reduced coordinates
(`romdam.effects.attachments`). `romdam.scene.attachments.BUILDERS` makes them from a configuration.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_matrix, vstack

from romdam.core.arrays import Floats
from romdam.core.scene_effect import SceneEffect


def _none() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True)
class Attachment(SceneEffect):
    """Springs, dashpots and masses on k displacements e, which do not act on each other.

    Attributes
    ----------
    effect : its name in `romdam.config.effects.EFFECTS`
    name : its own, unique within its effect
    rows : block name -> R_b, (k, 3 nodes) sparse
    stiffness, damping, mass : (k,) each, zero where they are not given [N/m], [N s/m], [kg]
    tension : (k,) static force at e = 0, which pulls e back [N]
    weight : (k,) static force along e that gravity makes, and that acts with the weight of the blocks [N]
    limits : (least, largest) force tension + stiffness e + damping e' that the model holds for, such as 0 of
        a tendon, which would go slack; a run warns beyond them [N]
    key : of the configuration, for messages
    """

    effect: str
    name: str
    rows: Mapping[str, csr_matrix]
    stiffness: Floats = field(default_factory=_none)
    damping: Floats = field(default_factory=_none)
    mass: Floats = field(default_factory=_none)
    tension: Floats = field(default_factory=_none)
    weight: Floats = field(default_factory=_none)
    limits: tuple[float, float] = (-np.inf, np.inf)
    key: str = ""

    def __post_init__(self) -> None:
        count = next(iter(self.rows.values())).shape[0]
        for name in ("stiffness", "damping", "mass", "tension", "weight"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.zeros(count))

    def __len__(self) -> int:
        return len(self.stiffness)

    def with_ground(self, still: Collection[str]) -> Floats:
        """(k, 3) e in unit translations along x, y, z of the blocks that the ground shakes.

        Parameters
        ----------
        still : blocks that it does not shake
        """
        moved = np.zeros((len(self), 3))
        for name, rows in self.rows.items():
            if name not in still:
                moved += rows @ np.tile(np.eye(3), (rows.shape[1] // 3, 1))
        return moved

    @property
    def bears(self) -> bool:
        """Tell whether it has a force to be recorded: a spring, a dashpot or a tension."""
        return bool(self.stiffness.any() or self.damping.any() or self.tension.any())


def stacked_rows(attachments: Sequence[Attachment], sizes: Mapping[str, int]) -> dict[str, csr_matrix]:
    """Block name -> rows of all attachments, one after another, (k of all, 3 nodes); of blocks that have any.

    Parameters
    ----------
    sizes : block name -> its number of DOFs
    """
    names = [name for name in sizes if any(name in one.rows for one in attachments)]
    return {
        name: csr_matrix(
            vstack([one.rows.get(name, csr_matrix((len(one), sizes[name]))) for one in attachments])
        )
        for name in names
    }


def of_all(attachments: Sequence[Attachment], name: str) -> Floats:
    """(k of all,) a number of each row of all attachments, such as its stiffness."""
    return np.concatenate([np.zeros(0), *(getattr(one, name) for one in attachments)])


@dataclass(frozen=True)
class BearingRows:
    """Forces of attachments that a run records, from the rows of `System.observe` that give their e.

    Attributes
    ----------
    first : number of the first of these rows; they come one after another
    stiffness, damping, tension : (k,) as `Attachment` has them
    """

    first: int
    stiffness: Floats
    damping: Floats
    tension: Floats

    @property
    def rows(self) -> slice:
        """The rows of `System.observe`."""
        return slice(self.first, self.first + len(self.stiffness))

    def force(self, e: Floats, rate: Floats) -> Floats:
        """(nt, k) force that pulls e back, for e and its rate (nt, k) [N]."""
        return self.tension + e * self.stiffness + rate * self.damping
