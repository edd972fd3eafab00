"""A gravity dam of monoliths: what stands in the configuration for it."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, Tag, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.quantities import Length
from romdam.config.sections.geometry.refinement import MOST_DIVISIONS, Count, Counts, Divisions, in_all
from romdam.config.sections.joints import JointConfig, JointProperties
from romdam.config.sections.places import GridElement

Positive = Field(gt=0.0)
Size = Annotated[Length, Positive]
Extent = Annotated[Length, Field(ge=0.0)]
Points = Annotated[tuple[tuple[Length, Length], ...], Field(min_length=2, max_length=50)]
Bases = Annotated[
    Annotated[Length, Tag("number")]
    | Annotated[tuple[Length, ...], Field(min_length=1, max_length=99), Tag("list")],
    by_shape("one elevation, or one for each monolith"),
]
Kind = Annotated[
    Annotated[JointProperties, Tag("mapping")] | Annotated[Literal["tied"], Tag("word")],
    by_shape("what the joints do, such as {normal_stiffness: 20 GPa/m}, or tied", "tied"),
]

Intervals = Annotated[
    Annotated[Count, Tag("number")]
    | Annotated[tuple[Count, ...], Field(min_length=1, max_length=MOST_DIVISIONS), Tag("list")],
    by_shape("a number of elements, or a list of them, one for each interval"),
]

_THIN = 0.02  # of a row of elements, that two elevations must be apart


class MonolithJointsConfig(Model):
    """Joints by kind; `tied` makes the faces one."""

    base: Kind
    """Joints on the rock, below monoliths and beside steps; tied without rock."""
    contraction: Kind | None = None
    """Joints between neighbouring monoliths; required where there are several."""
    lift: Kind | None = None
    """Joints at the elevations of `lifts`; required with them."""


class GalleryConfig(Model):
    """A rectangular opening along all monoliths that stand below it; a row and columns of elements less."""

    floor: Length
    """Elevation of the floor."""
    height: Size
    """Height from its floor to its roof."""
    upstream: Length
    """Coordinate y of its upstream wall."""
    width: Size
    """Width, from its upstream wall downstream."""


class FoundationConfig(Model):
    """Rock below the monoliths' bases: its blocks, tied to each other, are rock_1 below monolith_1 and so on.

    Its ground lies at the bases up- and downstream, and at `banks` beside the dam. The base of the box is
    held, and its sides normal to themselves.
    """

    material: str
    """A name of `materials`."""
    mass: bool | None = None
    """Mass of the rock counts; without it the rock is stiff only. If not given, rock has mass only where a
    viscous boundary takes up its waves: on a fixed base it would amplify a record made at its surface."""
    weight: bool = False
    """Gravity acts on the rock; if not, it has settled before the dam is built."""
    depth: Size
    """Depth of the rock below the lowest base."""
    upstream: Size
    """Length of the rock upstream of the heel of the lowest base."""
    downstream: Size
    """Length of the rock downstream of the toe of the lowest base."""
    left: Extent = 0.0
    """Width of the rock beside the first monolith; makes block rock_left."""
    right: Extent = 0.0
    """Width of the rock beside the last monolith; makes block rock_right."""
    banks: tuple[Length, Length] | None = None
    """Elevations of the ground to the left and to the right; those of the next bases if not given."""

    @model_validator(mode="after")
    def _banks(self) -> Self:
        if self.banks is not None and not (self.left and self.right):
            raise ValueError(
                f"`banks` are elevations of rock beside the dam, and `left` is {self.left:g} m, `right` "
                f"{self.right:g} m wide; make both wider than 0, or leave `banks` out"
            )
        return self


class GravityDivisionsConfig(Divisions):
    """Elements (hexahedra before any split) along a monolith, through the dam, up from the lowest base.

    In the rock: layers below, rows up- and downstream, beside the dam; `growth` is the ratio of neighbours.
    """

    along: Count = 2
    """Number of elements along a monolith's width."""
    through: Intervals = 6
    """Number of elements from face to face, shared out between the faces and the walls of a gallery, at least
    one each; or the numbers in each of these three, from upstream."""
    up: Intervals = 12
    """Number of elements up the dam, shared out between the elevations where something changes (bases, points
    of the faces, lifts, a gallery, banks), at least one each; or the numbers in each of them, upwards. Only
    where each is even, or a multiple of 3, is there a coarser mesh to judge this one by."""
    depth: Count = 4
    """Layers of rock below."""
    upstream: Count = 3
    """Rows of rock upstream."""
    downstream: Count = 3
    """Rows of rock downstream."""
    banks: Count = 3
    """Rows of rock to the left and to the right."""


class GravityDamConfig(Model):
    """A straight gravity dam; x runs from the left to the right bank, y downstream, z up.

    The two faces are joined by straight lines from point to point, elevation first; both end at the crest.
    It makes the blocks monolith_1, monolith_2, ... from the left bank at x = 0; with lifts monolith_1_1,
    monolith_1_2, ... upwards; and the joints base_1 (on rock_1), contraction_1_2, lift_1_1 (on monolith_1_1)
    and, where a neighbour's rock is higher, step_1_2. With lifts, joints at the sides end in the lift's
    number: contraction_1_2_3.
    """

    upstream: Points
    """Upstream face, [elevation, y] upwards."""
    downstream: Points
    """Downstream face, the same."""
    monoliths: Annotated[tuple[Size, ...], Field(min_length=1, max_length=99)]
    """Widths from left to right."""
    base: Bases
    """Elevation of the monoliths' bases."""
    lifts: Annotated[tuple[Length, ...], Field(max_length=50)] = ()
    """Elevations of lift joints, which cut every monolith that reaches below them."""
    gallery: GalleryConfig | None = None
    material: str
    """Material of the monoliths, a name of `materials`."""
    element: GridElement = "hex8"
    """Shape and order of the elements."""
    divisions: GravityDivisionsConfig = GravityDivisionsConfig()
    rock: FoundationConfig | None = None
    joints: MonolithJointsConfig

    @model_validator(mode="after")
    def _shape(self) -> Self:
        for key, points in (("upstream", self.upstream), ("downstream", self.downstream)):
            for (a, _), (b, _) in pairwise(points):
                if a >= b:
                    raise ValueError(f"`{key}`: elevations must ascend, got {a:g} m then {b:g} m")
        if self.downstream[-1][0] != self.crest:
            raise ValueError(
                f"both faces end at the crest, got elevation {self.crest:g} m for `upstream` and "
                f"{self.downstream[-1][0]:g} m for `downstream`; make them equal"
            )
        if isinstance(self.base, tuple) and len(self.base) != len(self.monoliths):
            raise ValueError(
                f"`base` has {len(self.base)} elevations, and there are {len(self.monoliths)} monoliths; "
                "give one for all, or one for each"
            )
        self._refuse_elevations()
        self._refuse_counts()
        self.divisions.refuse_halved(rock=self.rock is not None)
        self._refuse_thickness()
        self._refuse_kinds()
        return self

    def _refuse_elevations(self) -> None:
        foot = max(self.upstream[0][0], self.downstream[0][0])
        for key, values in (("base", self.bases), ("rock.banks", (self.rock and self.rock.banks) or ())):
            for z in values:
                if not foot <= z < self.crest or z < self.lowest:
                    low = foot if key == "base" else self.lowest
                    raise ValueError(
                        f"`{key}`: {z:g} m is not within {low:g} m, the lowest point of "
                        f"{'the faces' if key == 'base' else 'the bases'}, and below the crest at "
                        f"{self.crest:g} m; correct it"
                    )
        inside = {f"`lifts` at {z:g} m": z for z in self.lifts}
        if self.gallery is not None:
            inside |= {"`gallery.floor`": self.gallery.floor, "the gallery's roof": self._roof}
        for name, z in inside.items():
            if not self.lowest < z < self.crest:
                raise ValueError(
                    f"{name}: {z:g} m is not between the lowest base, {self.lowest:g} m, and the crest, "
                    f"{self.crest:g} m; correct it"
                )
        for a, b in pairwise(self.lifts):
            if a >= b:
                raise ValueError(f"`lifts` must ascend, got {a:g} m then {b:g} m")
        limit = _THIN * (self.crest - self.lowest) / in_all(self.divisions.up)
        for a, b in pairwise(self.levels):
            if b - a < limit:
                raise ValueError(
                    f"something changes at elevations {a:g} m and {b:g} m (bases, points of the faces, "
                    f"lifts, the gallery), {b - a:.3g} m apart, limit {limit:.3g} m for the row of elements "
                    "between; make them one, or set them apart"
                )

    def _refuse_counts(self) -> None:
        intervals = {"up": len(self.levels) - 1, "through": 3 if self.gallery else 1}
        for key, ends in self.ends_of_intervals.items():
            counts = getattr(self.divisions, key)
            if isinstance(counts, tuple) and len(counts) != intervals[key]:
                raise ValueError(
                    f"`divisions.{key}` has {len(counts)} numbers, of intervals between {ends} there "
                    f"{'is' if intervals[key] == 1 else 'are'} {intervals[key]}; give one number for all, or "
                    "one for each"
                )
            if in_all(counts) > MOST_DIVISIONS:
                raise ValueError(
                    f"`divisions.{key}` are {in_all(counts)} elements, limit {MOST_DIVISIONS}; give fewer"
                )

    def _refuse_thickness(self) -> None:
        for z in self.levels:
            walls = self.walls(z)
            for a, b in pairwise(walls):
                if a >= b:
                    what = "the faces" if len(walls) == 2 else "the faces and the gallery's walls"
                    raise ValueError(
                        f"{what} must follow each other downstream at every elevation from base to crest, at "
                        f"{z:g} m they stand at y = {', '.join(f'{y:.4g}' for y in walls)} m; move them apart"
                    )
        for base in self.bases if self.gallery else ():
            if self.gallery and self.gallery.floor - 1e-9 <= base < self._roof:
                raise ValueError(
                    f"`gallery`: a base at {base:g} m leaves no concrete below its floor at "
                    f"{self.gallery.floor:g} m (roof {self._roof:g} m); raise it, or lower it below the base"
                )

    def _refuse_kinds(self) -> None:
        for key, needed, why in (
            ("contraction", len(self.monoliths) > 1, f"{len(self.monoliths)} monoliths"),
            ("lift", bool(self.lifts), f"{len(self.lifts)} lift joints"),
        ):
            if needed and getattr(self.joints, key) is None:
                raise ValueError(f"`joints.{key}` is missing for {why}; give its stiffness, or tied")
        if self.rock is None and self.joints.base != "tied":
            raise ValueError(
                "`joints.base` joins the monoliths to `rock`, and there is none; give `rock`, or base: tied, "
                "which holds the bases"
            )

    @property
    def crest(self) -> float:
        """Elevation [m]."""
        return self.upstream[-1][0]

    @property
    def bases(self) -> tuple[float, ...]:
        """Elevation of every monolith's base [m]."""
        return self.base if isinstance(self.base, tuple) else (self.base,) * len(self.monoliths)

    @property
    def lowest(self) -> float:
        """Elevation of the lowest base [m]."""
        return min(self.bases)

    @property
    def _roof(self) -> float:
        return self.gallery.floor + self.gallery.height if self.gallery else self.crest

    @property
    def levels(self) -> tuple[float, ...]:
        """Elevations from the lowest base to the crest where rows of elements must begin or end [m]."""
        changes = {*self.bases, *self.lifts, *(z for z, _ in (*self.upstream, *self.downstream))}
        changes |= set((self.rock and self.rock.banks) or ())
        changes |= {self.gallery.floor, self._roof} if self.gallery else set()
        return tuple(sorted(z for z in changes if z >= self.lowest))

    @property
    def rows(self) -> tuple[int, ...]:
        """Numbers of elements between `levels`, upwards."""
        return _shared_out(self.divisions.up, self.levels, self.divisions.parts)

    @property
    def columns(self) -> tuple[int, ...]:
        """Numbers of elements from face to face, or between the faces and the walls of a gallery."""
        walls = self.walls(self.gallery.floor if self.gallery else self.crest)
        return _shared_out(self.divisions.through, walls, self.divisions.parts)

    @property
    def ends_of_intervals(self) -> dict[str, str]:
        """Between what the numbers of a division are shared out, in words."""
        walls = "the faces and the gallery's walls" if self.gallery else "the faces"
        return {"up": f"elevations {', '.join(f'{z:g}' for z in self.levels)} m", "through": walls}

    @property
    def shared_divisions(self) -> GravityDivisionsConfig:
        """The divisions as they are after refinement, with the numbers of each interval."""
        each = {
            key: counts if len(counts) > 1 else counts[0]
            for key, counts in (("up", self.rows), ("through", self.columns))
        }
        return self.divisions.refined.model_copy(update=each)

    def walls(self, z: float) -> tuple[float, ...]:
        """y of the upstream face, of the gallery's walls if it has one, of the downstream face [m]."""
        first, last = (float(np.interp(z, *np.transpose(face))) for face in (self.upstream, self.downstream))
        if self.gallery is None:
            return first, last
        return first, self.gallery.upstream, self.gallery.upstream + self.gallery.width, last

    def lift_of(self, z: float) -> int:
        """Number, from 1, of the lift at an elevation between lift joints."""
        return 1 + sum(z > at for at in self.lifts)

    @property
    def lift_range(self) -> tuple[tuple[float, float], ...]:
        """Lower and upper end of every lift [m]."""
        return tuple(pairwise((self.lowest, *self.lifts, self.crest)))

    def monolith(self, k: int, lift: int) -> str:
        """Block of monolith k at a lift, both from 1."""
        return f"monolith_{k}_{lift}" if self.lifts else f"monolith_{k}"

    def _lifts_of(self, k: int) -> list[int]:
        return [n for n, (_, top) in enumerate(self.lift_range, start=1) if top > self.bases[k - 1]]

    @property
    def slices(self) -> dict[str, float]:
        """Slices of rock from left to right, "left", "1", ..., "right", and their ground's elevation [m]."""
        left, right = (self.rock and self.rock.banks) or (self.bases[0], self.bases[-1])
        slices = {"left": left} if self.rock and self.rock.left else {}
        slices |= {str(k): base for k, base in enumerate(self.bases, start=1)}
        return slices | ({"right": right} if self.rock and self.rock.right else {})

    @property
    def monolith_names(self) -> tuple[str, ...]:
        """Blocks of concrete."""
        numbers = range(1, len(self.monoliths) + 1)
        return tuple(self.monolith(k, lift) for k in numbers for lift in self._lifts_of(k))

    @property
    def block_names(self) -> tuple[str, ...]:
        """Every block it makes."""
        return (*self.monolith_names, *(f"rock_{name}" for name in self.slices if self.rock))

    @property
    def _kinds(self) -> dict[str, tuple[Kind | None, tuple[str, str]]]:
        """Every joint, tied or not: what it does and its blocks."""
        kinds: dict[str, tuple[Kind | None, tuple[str, str]]] = {}
        for k, lifts in ((k, self._lifts_of(k)) for k in range(1, len(self.monoliths) + 1)):
            if self.rock:
                kinds[f"base_{k}"] = self.joints.base, (f"rock_{k}", self.monolith(k, lifts[0]))
                kinds |= self._steps(k, lifts)
            for low, high in pairwise(lifts):
                pair = self.monolith(k, low), self.monolith(k, high)
                kinds[f"lift_{k}_{low}"] = self.joints.lift, pair
            for lift in lifts if k < len(self.monoliths) else ():
                if lift in self._lifts_of(k + 1):
                    pair = self.monolith(k, lift), self.monolith(k + 1, lift)
                    kinds[self._of_lift(f"contraction_{k}_{k + 1}", lift)] = self.joints.contraction, pair
        return kinds

    def _steps(self, k: int, lifts: list[int]) -> dict[str, tuple[Kind | None, tuple[str, str]]]:
        """Joints of a monolith's sides with rock below its neighbours, or beside the dam, that is higher."""
        order = list(self.slices)
        at = order.index(str(k))
        neighbours = [*order[max(at - 1, 0) : at], *order[at + 1 : at + 2]]
        return {
            self._of_lift(f"step_{k}_{name}", lift): (
                self.joints.base,
                (f"rock_{name}", self.monolith(k, lift)),
            )
            for name in neighbours
            for lift in lifts
            if self.slices[name] > max(self.bases[k - 1], self.lift_range[lift - 1][0])
        }

    def _of_lift(self, name: str, lift: int) -> str:
        return f"{name}_{lift}" if self.lifts else name

    @property
    def joint_pairs(self) -> dict[str, tuple[str, str]]:
        """Joints and the blocks they part, without what is tied."""
        return {name: pair for name, (kind, pair) in self._kinds.items() if isinstance(kind, JointProperties)}

    @property
    def tied_pairs(self) -> tuple[tuple[str, str], ...]:
        """Blocks whose common face is one: tied joints, and the rock."""
        rock = [f"rock_{name}" for name in self.slices if self.rock]
        return (*(pair for kind, pair in self._kinds.values() if kind == "tied"), *pairwise(rock))

    @property
    def generated_joints(self) -> dict[str, JointConfig]:
        """Joints with what they do, those tied left out."""
        return {
            name: joint_between(name, pair, kind)
            for name, (kind, pair) in self._kinds.items()
            if isinstance(kind, JointProperties)
        }

    @property
    def joints_of_kinds(self) -> dict[str, tuple[str, ...]]:
        """Key of `joints` -> the joints that it makes, those tied left out."""
        kinds: dict[str, tuple[str, ...]] = {}
        for name in self.joint_pairs:
            kind = name.split("_")[0].replace("step", "base")
            kinds[kind] = (*kinds.get(kind, ()), name)
        return kinds

    @property
    def materials(self) -> dict[str, str]:
        """Key of every material named, below `gravity_dam`, and its name."""
        return {"material": self.material} | ({"rock.material": self.rock.material} if self.rock else {})


def joint_between(name: str, pair: tuple[str, str], properties: JointProperties) -> JointConfig:
    """The joint of two blocks with properties that stand elsewhere."""
    keys = properties.model_fields_set & JointProperties.model_fields.keys()
    values = {key: getattr(properties, key) for key in keys}
    if isinstance(properties.spacing, dict):
        values["spacing"] = properties.spacing_of(name)
    return JointConfig(between=pair, **values)


def _shared_out(counts: Counts, ends: tuple[float, ...], parts: int) -> tuple[int, ...]:
    """Numbers of elements in the intervals between `ends`, each of them in so many parts."""
    if isinstance(counts, int):
        whole = ends[-1] - ends[0]
        counts = tuple(max(1, round(counts * (b - a) / whole)) for a, b in pairwise(ends))
    return tuple(count * parts for count in counts)
