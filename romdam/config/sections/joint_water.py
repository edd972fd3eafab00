"""The `loads.joint_water:` of a configuration: water in contraction joints, and uplift at the base."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.quantities import Density, Dimensionless, Length
from romdam.config.sections.places import Direction

Positive = Field(gt=0.0)
USBR_EFFECTIVENESS = 2.0 / 3.0  # of drains: a third of the head's difference stays


class DrainsConfig(Model):
    """A line of drains: from the heel to them, and from them to the toe, the head is linear.

    With reservoir H1, tailwater H2 (or `gallery`, where that is higher), length L of the base, distance X and
    effectiveness E the head at the drains is

    `usace`: H2 + (1 - E) (H1 - H2) (L - X) / L, a share of what would be there without drains (EM
    1110-2-2200, 3-3.d; chapter 3 of FERC's guidelines is alike);
    `usbr`: H2 + (1 - E) (H1 - H2), with E = 2/3 if not given (Engineering Monograph 19, 1977: tailwater and a
    third of the difference). Rules of other countries that leave another share of the difference give that.
    """

    at: Annotated[Length, Positive]
    """Distance downstream of the heel."""
    rule: Literal["usace", "usbr"]
    """Formula of the head at the drains."""
    effectiveness: Annotated[Dimensionless, Field(ge=0.0, le=1.0)] | None = None
    """Effectiveness E of the drains; `usbr` has 2/3 if not given."""
    gallery: Length | None = None
    """Elevation of the gallery's floor, to which the drains rise: below it they lower no head."""

    @model_validator(mode="after")
    def _stated(self) -> Self:
        if self.rule == "usace" and self.effectiveness is None:
            raise ValueError("`effectiveness` is missing; EM 1110-2-2200 has 0.25 to 0.5")
        return self

    @property
    def share_left(self) -> float:
        """1 - E."""
        return 1.0 - (USBR_EFFECTIVENESS if self.effectiveness is None else self.effectiveness)


class JointWaterConfig(Model):
    """Water in joints: the pressure rho g (head - z) pushes both faces apart, at rest and while shaken.

    The head is `level` everywhere; with `downstream` it falls from `level` at the heel to `tailwater` (or the
    toe itself, where that is higher) at the toe, linearly or by `drains`, along each line through the joint
    in that direction; up to a `waterstop` it is `level`, and `tailwater` (or nothing) behind. What the gaps
    then carry, and their friction, is the effective force.
    """

    joints: Annotated[tuple[str, ...], Field(min_length=1)]
    """Names of `joints`, or patterns such as base_*."""
    level: Length
    """Elevation of the reservoir."""
    downstream: Direction | None = None
    """Direction from heel to toe."""
    tailwater: Length | None = None
    """Elevation of the water at the toe."""
    drains: DrainsConfig | None = None
    waterstop: Annotated[Length, Positive] | None = None
    """Distance downstream of the upstream edge."""
    crack: Literal["unchanged", "redrawn", "full"] = "unchanged"
    """Uplift where the joint opens: the diagram of the closed joint; that of the cracked base at rest,
    redrawn from its tip until it agrees with the stresses; or at once that of `level` (ICOLD)."""
    earthquake: Literal["frozen", "zero", "full"] | None = None
    """Uplift in what opens while shaken: as at rest (frozen), none (zero), or that of `level` (full)."""
    density: Annotated[Density, Positive] = 1000.0
    """Density of the water."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        needing = [key for key in ("tailwater", "drains", "waterstop") if getattr(self, key) is not None]
        if needing and self.downstream is None:
            raise ValueError(f"`{needing[0]}` needs `downstream`, such as [0, 1, 0], from heel to toe")
        if self.drains is not None and self.waterstop is not None:
            raise ValueError("`drains` and `waterstop` exclude each other; leave one out")
        key = f"`crack: {self.crack}`" if self.crack != "unchanged" else f"`earthquake: {self.earthquake}`"
        if self.follows_crack and (self.waterstop is not None or self.downstream is None):
            why = (
                "a waterstop keeps it from the joint"
                if self.waterstop
                else "without `downstream` it is there"
            )
            raise ValueError(f"{key} lets in the reservoir's pressure, and {why}; leave it out")
        if self.crack == "full" and self.earthquake not in (None, "full"):
            raise ValueError(
                f"`earthquake: {self.earthquake}` contradicts `crack: full`, which fills every gap that "
                "opens; set `crack: redrawn`"
            )
        if self.downstream is not None and not any(self.downstream):
            raise ValueError("`downstream` must have a length above 0, got [0, 0, 0]")
        for key, height in (("tailwater", self.tailwater), ("drains.gallery", self._gallery)):
            if height is not None and height > self.level:
                raise ValueError(f"`{key}` at {height:g} m is above `level`, {self.level:g} m; lower it")
        return self

    @property
    def follows_crack(self) -> bool:
        """Whether the pressure in a crack is another than in the closed joint."""
        return self.crack != "unchanged" or self.earthquake in ("zero", "full")

    @property
    def needs_rest(self) -> bool:
        """Whether the pressure follows from the crack at rest."""
        return self.crack != "full" and self.follows_crack

    @property
    def _gallery(self) -> float | None:
        return None if self.drains is None else self.drains.gallery
