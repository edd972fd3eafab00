"""Uplift of a cracked base: full head in the crack, then linear from its tip to the toe.

Sources: EM 1110-2-2200 (1995), 3-3.d, and figure 3-3; FERC, Engineering Guidelines, chapter 3; Bureau of
Reclamation, Engineering Monograph 19 (1977). Drains that the crack has passed are lost.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy.sparse import csr_matrix

from romdam.config.sections.joint_water import JointWaterConfig
from romdam.core.arrays import Bools, Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.scene import Joint, JointFace
from romdam.scene.joint_water.diagram import Diagram, PressureOutline, mean_pressure

_SAME_LINE = 1e-6  # of the joint's width: gaps that stand on one line from heel to toe
_FEWEST = 3  # gaps on a line, on average, below which lines are strips of an unstructured face
_STRIP = 2.0  # widths of a gap: that of such a strip
_APART = 0.5  # of a line's length: heels of one line that are no heel any more, but a side of the joint


@dataclass(frozen=True)
class CrackedBase:
    """Water in a joint whose pressure follows from the crack at rest, see `romdam.core.system.CrackedUplift`.

    Attributes
    ----------
    water : the configuration's entry
    weight : of the water per volume [N/m3]
    outline : of the face
    points : (nodes, 3) of the face's block [m]
    face, corner, patches, area : of the joint
    line : (n,) line from heel to toe on which each gap stands
    distance : (n,) of each gap from its heel [m]
    across : (lines,) where the lines stand across the joint, rising [m]
    length : (lines,) from heel to toe [m]
    """

    water: Mapping[str, Any]
    weight: float
    outline: PressureOutline
    points: Floats
    face: JointFace
    corner: Ints
    patches: csr_matrix | None
    area: Floats
    line: Ints
    distance: Floats
    across: Floats
    length: Floats

    @classmethod
    def of(
        cls, joint: Joint, water: JointWaterConfig, points: Floats, diagram: Diagram, location: str
    ) -> Self:
        """Find the lines of a joint from the heel to the toe.

        Parameters
        ----------
        points : (nodes, 3) of the face's block [m]
        diagram : of the closed joint
        location : of the entry in the configuration, for messages

        Raises
        ------
        ConfigError
            where lines beside each other begin far apart: at a side of the joint, not at its heel.
        """
        outline = diagram.outline
        assert outline is not None and joint.face is not None
        at = points[joint.corner]
        heel, toe, _ = outline.lines(at)
        across = at @ outline.across
        line = _lines(across, joint.area)
        count = np.bincount(line)
        mean = np.bincount(line, toe - heel) / count
        first, last = np.full(len(count), np.inf), np.full(len(count), -np.inf)
        np.minimum.at(first, line, heel)
        np.maximum.at(last, line, heel)
        worst = int(np.argmax((last - first) / mean))
        if last[worst] - first[worst] > _APART * mean[worst]:
            where = ", ".join(f"{x:.6g}" for x in at[line == worst].mean(axis=0))
            raise ConfigError(
                f"{location}.downstream: lines in the direction {list(water.downstream or ())} through joint "
                f"{joint.name!r} begin at its side, not at its heel: near ({where}) those beside each other "
                f"begin {last[worst] - first[worst]:.4g} m apart, and are {mean[worst]:.4g} m long (limit "
                f"{_APART:g} of that), so no crack can be followed from the heel; give the direction of the "
                "joint's sides, and joints that differ in it an entry of their own"
            )
        return cls(
            water=water.model_dump(),
            weight=diagram.weight,
            outline=outline,
            points=points,
            face=joint.face,
            corner=joint.corner,
            patches=joint.patches,
            area=joint.area,
            line=line,
            distance=at @ outline.downstream - heel,
            across=np.bincount(line, across) / count,
            length=mean,
        )

    @property
    def redrawn(self) -> bool:
        """Whether the pressure at rest follows from the tips."""
        return bool(self.water["crack"] == "redrawn")

    @property
    def earthquake(self) -> str:
        """What gaps that open later get: "frozen", "zero" or "full"."""
        return str(self.water["earthquake"] or "frozen")

    @property
    def drains_at(self) -> float:
        """Distance of the drains from the heel, inf without any [m]."""
        return np.inf if self.water["drains"] is None else float(self.water["drains"]["at"])

    def tips(self, opening: Floats, is_open: Bools, rigid: Bools) -> Floats:
        """(lines,) distance of the crack's tip from the heel [m].

        The crack reaches from the heel over all gaps that are open. Its tip is where the jump, linear between
        the last open gap and the next, is zero; in rigid joints, which have no jump there, in the middle.

        Parameters
        ----------
        opening : (n,) of the gaps, negative where springs are pressed in [m]
        is_open, rigid : (n,) gaps that carry nothing, and those that have no springs
        """
        tips = np.zeros(len(self.length))
        for line in range(len(tips)):
            gaps = np.flatnonzero(self.line == line)
            gaps = gaps[np.argsort(self.distance[gaps], kind="stable")]
            cracked = int(np.logical_and.accumulate(is_open[gaps]).sum())
            if cracked == len(gaps):
                tips[line] = self.length[line]
            elif cracked > 0:
                last, after = gaps[cracked - 1], gaps[cracked]
                overlap = opening[last] if rigid[after] else max(-opening[after], 0.0)
                share = opening[last] / (opening[last] + overlap)
                tips[line] = self.distance[last] + share * (self.distance[after] - self.distance[last])
        return np.minimum(tips, self.length)

    def at_gaps(self, tips: Floats) -> Floats:
        """(n,) tips on the lines through the gaps [m]."""
        return np.asarray(tips[self.line])

    def in_crack(self, tips: Floats) -> Bools:
        """(n,) gaps between the heel and the tip."""
        return np.asarray(self.distance <= tips[self.line])

    def force(self, tips: Floats) -> Floats:
        """(n,) force of the water in the gaps for tips (lines,) [N]."""
        crack = np.column_stack([self.across, tips]) if tips.any() else None
        return self._force(replace(self._diagram, tips=crack))

    def full_force(self) -> Floats:
        """(n,) force of the reservoir's pressure in the gaps [N]."""
        return self._force(replace(self._diagram, outline=None))

    @property
    def _diagram(self) -> Diagram:
        return Diagram(JointWaterConfig(**self.water), self.weight, self.outline)

    def _force(self, diagram: Diagram) -> Floats:
        pressure = mean_pressure(self.points, self.face, diagram)
        at_gaps = pressure[self.corner] if self.patches is None else self.patches @ np.nan_to_num(pressure)
        return np.asarray(at_gaps * self.area)


def _lines(across: Floats, area: Floats) -> Ints:
    """Number of the line on which each gap stands, from where it stands across the joint [m]."""
    order = np.argsort(across, kind="stable")
    begins = np.diff(across[order], prepend=-np.inf) > _SAME_LINE * max(float(np.ptp(across)), 1e-300)
    if begins.sum() * _FEWEST <= len(across):
        line = np.empty(len(across), dtype=np.int64)
        line[order] = np.cumsum(begins) - 1
        return line
    width = _STRIP * float(np.sqrt(area.mean()))
    strips = max(1, int(np.ptp(across) / width))
    edges = np.linspace(across.min(), across.max(), strips + 1)[1:-1]
    return np.unique(np.searchsorted(edges, across, side="right"), return_inverse=True)[1].astype(np.int64)
