"""Optional laws of a joint beyond stiffness and friction; all off by default."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from romdam.config.base import Model
from romdam.config.quantities import Dimensionless, Length, Pressure, ViscosityPerArea


def _friction(value: object) -> object:
    return (value, value) if not isinstance(value, list | tuple) else value


FrictionNumber = Annotated[Dimensionless, Field(ge=0.0, le=2.0)]
Friction = Annotated[tuple[FrictionNumber, FrictionNumber], BeforeValidator(_friction)]
NonNegative = Field(ge=0.0)


class ShearKeyConfig(Model):
    """Keys that hold the shear while the opening is less than their depth, along the local axes named."""

    depth: Annotated[Length, Field(gt=0.0)]
    directions: Annotated[tuple[Literal["j", "k"], ...], Field(min_length=1)] = ("j", "k")


class JointLaws(Model):
    """Laws that a joint may have besides.

    `tensile_strength`: the closed gap holds with normal_stiffness in tension too, up to this traction.
    `cohesion` c: the stuck gap holds c A + mu p of shear. Both are one bond, lost for good at the first
    opening or slip; gaps with an initial gap have none. `friction_static`: until a gap slides, and again once
    it sticks; `friction` is then the dynamic one. `shear_key`: no sliding while the opening is less than the
    depth, closed or open; a key that comes back in holds where it then is. `viscosity`: normal dashpot per
    area [N s/m3] that acts while the gap overlaps and never pulls.
    """

    tensile_strength: Annotated[Pressure, NonNegative] = 0.0
    cohesion: Annotated[Pressure, NonNegative] = 0.0
    friction_static: Friction | None = None
    shear_key: ShearKeyConfig | None = None
    viscosity: Annotated[ViscosityPerArea, NonNegative] = 0.0

    def inconsistent(self, friction: tuple[float, float], shear: float, rigid: bool) -> str | None:
        """What does not fit together, and the remedy; None if all does.

        Parameters
        ----------
        friction : the dynamic coefficients
        shear : shear_stiffness, per area or per gap
        rigid : whether normal_stiffness is "rigid"
        """
        static = self.friction_static or friction
        if min(s - d for s, d in zip(static, friction, strict=True)) < 0.0:
            return f"friction_static {static} must be at least friction {friction}; raise it, or leave it out"
        if shear <= 0.0 and (max(static) > 0.0 or self.cohesion > 0.0 or self.shear_key is not None):
            what = f"friction {max(static):g}" if max(static) > 0.0 else "`cohesion` or `shear_key`"
            return (
                f"{what} needs `shear_stiffness` above 0 (the stick stiffness K_s); "
                "give it, commonly half of normal_stiffness, or set friction to 0"
            )
        if max(static) * self.tensile_strength > self.cohesion:
            return (
                f"cohesion {self.cohesion:g} Pa must be at least friction times tensile_strength, "
                f"{max(static) * self.tensile_strength:g} Pa, or the bond slips before it opens; "
                "raise cohesion, or lower tensile_strength"
            )
        if rigid and self.viscosity > 0.0:
            return "viscosity needs a finite `normal_stiffness`, not rigid; give a stiffness, or leave it out"
        return None
