"""A parametric arch dam: what stands in the configuration for it."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.names import Name
from romdam.config.quantities import Dimensionless, Length, Whole
from romdam.config.sections.geometry.refinement import Count, Divisions
from romdam.config.sections.joints import JointProperties
from romdam.config.sections.places import GridElement

Positive = Field(gt=0.0)
Size = Annotated[Length, Positive]
Points = Annotated[tuple[tuple[Length, Length], ...], Field(min_length=1)]
Range = tuple[Length, Length]

CANTILEVER, PERIMETER, ROCK, JOINT = "C", "perimeter", "rock", "J"


class Polynomial(Model):
    """c_0 + c_1 z + c_2 z^2 + ... with z the elevation; SI."""

    polynomial: Annotated[tuple[Dimensionless, ...], Field(min_length=1)]
    """Coefficients c_0, c_1, ... from the lowest power."""


Profile = Annotated[
    Annotated[Length, Tag("number")] | Annotated[Points, Tag("list")] | Annotated[Polynomial, Tag("mapping")],
    by_shape(
        "a length, points such as [[0 m, 25 m], [100 m, 6 m]] (elevation first), or {polynomial: [...]}"
    ),
]


class CrownConfig(Model):
    """The crown cantilever over the elevation: y of the upstream face, and the thickness."""

    upstream: Profile = 0.0
    """Coordinate y of the upstream face over the elevation."""
    thickness: Profile
    """Thickness over the elevation."""


class ArcsConfig(Model):
    """Horizontal arcs: radius at the crown over the elevation, of both faces (concentric if one is given).

    `thickening` is the part of the thickness that is added at the abutment, growing with the square of the
    angle from the crown.
    """

    shape: Literal["circular", "parabolic"] = "circular"
    """Shape of a horizontal section."""
    upstream_radius: Profile
    """Radius of the upstream face at the crown, over the elevation."""
    downstream_radius: Profile | None = None
    """Radius of the downstream face at the crown, over the elevation; concentric if not given."""
    thickening: Annotated[Dimensionless, Field(ge=0.0, le=5.0)] = 0.0
    """Part of the thickness that is added at the abutment, growing with the square of the angle from the
    crown."""


class PerimeterConfig(Model):
    """The block between the cantilevers and the rock."""

    material: str
    """A name of `materials`."""
    thickness: Size
    """Thickness of the layer, normal to the contact."""


class ZoneConfig(Model):
    """Rock of one material: the cells whose centre lies in these ranges and in no zone with more of them.

    Its `weight` has acted before the dam is built, so that gravity leaves it out unless told otherwise.
    """

    material: str
    """A name of `materials`."""
    x: Range | None = None
    """Range of the zone along x; everything if not given."""
    y: Range | None = None
    """Range of the zone along y; everything if not given."""
    z: Range | None = None
    """Range of the zone along z; everything if not given."""
    mass: bool | None = None
    """Mass of the rock counts; without it the rock is stiff only. If not given, rock has mass only where a
    viscous boundary takes up its waves: on a fixed base it would amplify a record made at its surface."""
    weight: bool = False
    """Gravity acts on the rock; if not, its weight has acted before the dam is built."""

    @model_validator(mode="after")
    def _ascending(self) -> Self:
        for axis, limits in (("x", self.x), ("y", self.y), ("z", self.z)):
            if limits is not None and limits[0] >= limits[1]:
                raise ValueError(
                    f"`{axis}` must go up, got {limits[0]:g} to {limits[1]:g} m; swap the two numbers"
                )
        return self


class RockConfig(Model):
    """A box of rock around the valley: x within +- half_width, y from -upstream to downstream, z from -depth.

    Its top is level with the crest. `zones` become blocks `rock_<name>`. A `fixed` boundary holds the base,
    and the sides normal to themselves; a `viscous` one takes up the waves that the dam sends out, and needs
    rock with mass, on which the ground's acceleration does not act then: the record is that of the contact.
    """

    half_width: Size
    """Distance from the middle of the valley to the banks' ends."""
    upstream: Size
    """Length of the rock upstream of y = 0."""
    downstream: Size
    """Length of the rock downstream of y = 0."""
    depth: Size
    """Depth of the rock below z = 0."""
    zones: Annotated[dict[Name, ZoneConfig], Field(min_length=1, max_length=9)]
    boundary: Literal["fixed", "viscous"] = "fixed"
    """Condition at the base and the sides: fixed, or dashpots and springs that absorb waves."""

    @model_validator(mode="after")
    def _waves(self) -> Self:
        light = [name for name, zone in self.zones.items() if zone.mass is False]
        if self.boundary == "viscous" and light:
            raise ValueError(
                f"`boundary: viscous` takes up waves, and zone {light[0]!r} has no mass to carry any "
                f"({len(light)} of {len(self.zones)} zones have none, limit 0); leave out `mass: false`, or "
                "take `boundary: fixed`"
            )
        return self


class DivisionsConfig(Divisions):
    """Elements (hexahedra before any split into tetrahedra): along a cantilever's arc, through the thickness,
    up its height; layers of the perimeter and of the rock; rows of rock up- and downstream.

    `growth` is the ratio of neighbouring sizes in the rock.
    """

    along: Count = 2
    """Number of elements along a cantilever's arc."""
    through: Count = 2
    """Number of elements through the thickness."""
    up: Count = 6
    """Number of elements up a cantilever."""
    perimeter: Count = 1
    """Layers of the perimeter."""
    rock: Count = 4
    """Layers of rock."""
    upstream: Count = 3
    """Rows of rock upstream."""
    downstream: Count = 3
    """Rows of rock downstream."""


class ArchDamConfig(Model):
    """A double-curvature arch dam; x runs from the left to the right bank, y downstream, z up.

    It makes the blocks C1, C2, ... from left to right, `perimeter` and `rock_<zone>`, tied along
    their contacts, the joints J1, J2, ... between the cantilevers (`tied`: none), and holds its rock
    (the base, and the sides normal to themselves) or, without rock, the contact.

    `valley` is the half-width at elevations; above `crest - abutment_height` the walls are vertical, so that
    the outermost cantilevers end in a face and not in an edge.
    `material` is that of the cantilevers.
    """

    crest: Length
    """Elevation of the crest."""
    base: Length = 0.0
    """Elevation of the lowest point."""
    crown: CrownConfig
    arcs: ArcsConfig
    valley: Points
    """Half-width of the valley at elevations, elevation first."""
    abutment_height: Size
    """Height of the vertical ends of the valley's walls below the crest."""
    cantilevers: Annotated[Whole, Field(ge=1, le=99)] = 8
    """Number of cantilevers, a joint between each two."""
    material: str
    """Material of the cantilevers, a name of `materials`."""
    element: GridElement = "hex20"
    """Shape and order of the elements."""
    divisions: DivisionsConfig = DivisionsConfig()
    perimeter: PerimeterConfig | None = None
    rock: RockConfig | None = None
    joints: Annotated[
        Annotated[JointProperties, Tag("mapping")] | Annotated[Literal["tied"], Tag("word")],
        by_shape("what the joints do, such as {normal_stiffness: 20 GPa/m}, or tied", "tied"),
    ]
    """Properties of the joints between the cantilevers; `tied`: there are none."""

    @model_validator(mode="after")
    def _heights(self) -> Self:
        height = self.crest - self.base
        if height <= 0.0:
            raise ValueError(f"`crest` {self.crest:g} m must be above `base` {self.base:g} m")
        if self.abutment_height >= height:
            raise ValueError(
                f"`abutment_height` {self.abutment_height:g} m must be below the dam's height, {height:g} m"
            )
        self.divisions.refuse_halved(rock=self.rock is not None)
        return self

    @property
    def shared_divisions(self) -> DivisionsConfig:
        """The divisions as they are after refinement."""
        return self.divisions.refined

    @property
    def cantilever_names(self) -> tuple[str, ...]:
        """C1, C2, ... from left to right."""
        return tuple(f"{CANTILEVER}{k + 1}" for k in range(self.cantilevers))

    @property
    def block_names(self) -> tuple[str, ...]:
        """Every block it makes."""
        zones = self.rock.zones if self.rock else ()
        perimeter = (PERIMETER,) if self.perimeter else ()
        return (*self.cantilever_names, *perimeter, *(f"{ROCK}_{zone}" for zone in zones))

    @property
    def joint_pairs(self) -> dict[str, tuple[str, str]]:
        """J1, J2, ... and the cantilevers they part; empty where those are tied."""
        names = self.cantilever_names
        if self.joints == "tied":
            return {}
        return {f"{JOINT}{k + 1}": pair for k, pair in enumerate(pairwise(names))}

    @property
    def materials(self) -> dict[str, str]:
        """Key of every material named, below `arch_dam`, and its name."""
        names = {"material": self.material}
        if self.perimeter:
            names["perimeter.material"] = self.perimeter.material
        for name, zone in self.rock.zones.items() if self.rock else ():
            names[f"rock.zones.{name}.material"] = zone.material
        return names
