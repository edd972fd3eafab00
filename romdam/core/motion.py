"""The ground motion that every later stage sees."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Ints

MOST_SAMPLES = 20_000_000  # of a motion: 5 hours at 1 ms, 500 MB for its three components


@dataclass(frozen=True)
class GroundMotion:
    """Ground acceleration in the model's axes, SI.

    Attributes
    ----------
    name : identifier, unique in a suite; the result file's stem
    acc : (3, nt) ground acceleration along x, y, z [m/s2]; a component that is not given is zero
    dt : sampling interval [s]
    provenance : source file, SHA-256, station, event, unit, what was done to it; plain JSON values
    warnings : what a careful reader should know, one sentence each
    """

    name: str
    acc: NDArray[np.float64]
    dt: float
    provenance: dict[str, object] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def time(self) -> NDArray[np.float64]:
        """(nt,) sample times [s]."""
        return np.arange(self.acc.shape[1], dtype=np.float64) * self.dt

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return (self.acc.shape[1] - 1) * self.dt

    @property
    def peak(self) -> float:
        """Largest acceleration of a component [m/s2]."""
        return float(np.abs(self.acc).max())


@dataclass(frozen=True)
class SupportMotion:
    """Motion of a support's own: factor times the record, later by the delay; or a record of its own.

    Attributes
    ----------
    support : number of the first entry of `supports` that moves so
    delay : [s]
    factor : of all components
    record : in place of delay and factor
    """

    support: int
    delay: float = 0.0
    factor: float = 1.0
    record: GroundMotion | None = None

    @property
    def name(self) -> str:
        """The key of that entry."""
        return f"supports[{self.support}]"


@dataclass(frozen=True)
class MovingSupports:
    """Supports that do not move as the base does.

    Attributes
    ----------
    motions : those that differ from each other
    components : block name -> (n, 3) number of the motion that a component has; -1 where it has none
    """

    motions: tuple[SupportMotion, ...]
    components: dict[str, Ints]
