"""Joints and ties between blocks: what stands in the configuration for them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from romdam.config.base import Model, by_shape
from romdam.config.explain import explain
from romdam.config.names import Name
from romdam.config.quantities import Dimensionless, Length
from romdam.config.sections.joint_laws import JointLaws, UserLaw, read_user_laws
from romdam.config.sections.places import Direction, Tolerance
from romdam.contact.laws import LAWS, Bond, ElasticShear, ShearStiffness
from romdam.contact.laws.coulomb import Coulomb
from romdam.contact.laws.law import Law
from romdam.core.errors import ConfigError

Discretization = Literal["auto", "node_to_node", "mortar"]


class GapTable(Model):
    """Initial gap from a CSV file with columns x, y, z, gap in metres, linear between its points."""

    table: Path
    """CSV file with columns x, y, z and gap in metres."""


InitialGap = Annotated[
    Annotated[Length, Tag("number")] | Annotated[GapTable, Tag("mapping")],
    by_shape("a length such as 2 mm, or {table: gaps.csv}"),
]
NormalRule = Annotated[
    Annotated[Literal["face", "nodes"], Tag("number")] | Annotated[Direction, Tag("list")],
    by_shape('"face", "nodes", or a vector such as [0, 1, 0]'),
]


SpacingOfJoint = Annotated[
    Annotated[Annotated[Length, Field(gt=0.0)], Tag("number")] | Annotated[Literal["auto"], Tag("word")],
    by_shape('a length such as 2.5 m, or "auto"', "auto"),
]
Spacing = Annotated[
    Annotated[Annotated[Length, Field(gt=0.0)], Tag("number")]
    | Annotated[Literal["auto"], Tag("word")]
    | Annotated[dict[Name, SpacingOfJoint], Field(min_length=1), Tag("mapping")],
    by_shape('a length such as 2.5 m, "auto", or one for each joint: {J1: 5 m, J2: auto}', "auto"),
]


class StrengthField(Model):
    """Strengths that vary along a joint at random: a lognormal factor of mean 1 at every gap."""

    of: Annotated[
        tuple[
            Literal[
                "friction",
                "friction_static",
                "tensile_strength",
                "cohesion",
                "fracture.tensile_strength",
                "fracture.energy",
                "fracture.cohesion",
                "fracture.shear_energy",
            ],
            ...,
        ],
        Field(min_length=1),
    ]
    """Keys of the joint that the factor multiplies, all by the same one."""
    coefficient_of_variation: Annotated[Dimensionless, Field(gt=0.0, le=2.0)]
    """Standard deviation of the factor, whose mean is 1."""
    length: Annotated[Length, Field(gt=0.0)]
    """Correlation length: the factor's logarithm has a correlation of exp(-distance / length)."""
    seed: Annotated[Dimensionless, Field(ge=0.0)] = 1.0
    """Number that the field is drawn by: each has another field; joints of one seed are independent."""


class JointProperties(JointLaws):
    """Properties of gap elements, wherever they stand.

    The keys of its laws are theirs (`romdam.contact.laws`), `law` adds those of a user's file. `gaps` stand
    at every node of coinciding faces, or at the corners of quadratic facets only, node to node.
    """

    law: tuple[UserLaw, ...] = ()
    gap: InitialGap = 0.0
    """Initial opening: a length, or a table of lengths."""
    field: StrengthField | None = None
    """Random field of strengths along the joint."""
    gaps: Literal["nodes", "corners"] = "nodes"
    """Places of the gaps: every node of the faces, or corners of quadratic facets only."""
    spacing: Spacing | None = None
    """Distance of the gaps, where that is more than the distance of the nodes; auto: as large as
    `transient.accuracy` allows, for each joint. Of a section that makes several joints also one for each of
    those it names; the others have a gap at every node."""
    normal: NormalRule = "face"
    """Direction in which gaps open: the face's, the line between two nodes, or a vector from the first
    block to the second."""
    tolerance: Tolerance = 1e-3
    """Distance up to which two nodes coincide, and two faces by mortar beyond their curvature;
    `gap` is not added."""
    discretization: Discretization = "auto"
    """Gaps between coinciding nodes, or at corners of faces coupled by mortar, which need not match; auto:
    node to node where nodes of linear faces coincide or `gaps: corners` asks for it, else mortar."""
    overlap: Annotated[float, Field(gt=0.0, le=1.0)] = 0.5
    """Least share of either face that lies on the other, of the facets that meet; for mortar."""

    @model_validator(mode="before")
    @classmethod
    def _laws_of_files(cls, keys: Any, info: ValidationInfo) -> Any:
        if not isinstance(keys, dict) or "law" not in keys:
            return keys
        try:
            return read_user_laws(keys, (info.context or {}).get("folder"))
        except ValidationError as error:
            raise ValueError(explain(error, "law", cls)) from None
        except ConfigError as error:
            raise ValueError(str(error)) from None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        keys = self.law_keys
        for law in self.every_law:
            wrong = law.wrong(keys) or _without_shear_stiffness(law, keys)
            if wrong is not None:
                raise ValueError(wrong)
        return self

    @model_validator(mode="after")
    def _gaps_of_nodes(self) -> Self:
        if self.gaps == "corners" and self.discretization == "mortar":
            raise ValueError(
                "`gaps: corners` is for discretization: node_to_node, the gaps of a mortar joint stand at "
                "corners anyway; remove it"
            )
        return self

    @model_validator(mode="after")
    def _spacing_of_areas(self) -> Self:
        for key, value in self.law_keys.items():
            if self.spacing is not None and isinstance(value, dict) and value.get("per_gap"):
                raise ValueError(
                    f"`{key}` is {value['per_gap']:g} N/m of each gap, and `spacing` changes the number of "
                    "gaps; give it per area (16 GPa/m), or leave spacing out"
                )
        return self

    def spacing_of(self, name: str) -> float | Literal["auto"] | None:
        """Distance of the gaps [m] in one of the joints that have these properties."""
        return self.spacing.get(name) if isinstance(self.spacing, dict) else self.spacing

    @property
    def law_keys(self) -> dict[str, Any]:
        """Every key of every law, a section as a mapping [SI]."""
        keys = self.model_dump(include={key for law in LAWS for key in law.key_names()})
        return keys | {key: value for law in self.law for key, value in law.values.items()}

    @property
    def every_law(self) -> tuple[type[Law], ...]:
        """The laws that the joint has, in the order in which they apply."""
        keys = self.law_keys
        laws = (*(law for law in LAWS if law.is_on(keys)), *(user.law for user in self.law))
        bounded = any(law.needs_shear(keys) for law in laws)
        return (*laws, ElasticShear) if not bounded and ElasticShear.is_on(keys) else laws

    @property
    def has_idle_shear(self) -> bool:
        """Tell whether `shear_stiffness` does nothing, and no key of a law with shear says so."""
        keys = self.law_keys
        said = {key for law in LAWS if law.shear or law is Bond for key in law.key_names()}
        if not ShearStiffness.is_on(keys) or said & self.model_fields_set:
            return False
        return not any(law.needs_shear(keys) for law in self.every_law)


def _without_shear_stiffness(law: type[Law], keys: Mapping[str, Any]) -> str | None:
    """Complain of a law that needs the stick stiffness where there is none."""
    stiffness = keys["shear_stiffness"]
    if not law.needs_shear(keys) or stiffness not in (0.0, {"per_gap": 0.0}):
        return None
    what = " with ".join(f"`{key}`" for key in law.key_names() if keys[key])
    if law is Coulomb:
        what = f"friction {max(keys['friction']):g}"
    return (
        f"{what} needs `shear_stiffness` above 0 (the stick stiffness K_s); give it, commonly half of "
        f"normal_stiffness, or set {law.key_names()[0]} to 0"
    )


class JointConfig(JointProperties):
    """Gap elements between the faces of two blocks that lie on each other."""

    between: tuple[str, str]
    """Names of the two blocks; slip and opening are those of the second against the first."""

    @model_validator(mode="after")
    def _two_blocks(self) -> Self:
        refuse_twice(self.between)
        if isinstance(self.spacing, dict):
            raise ValueError(
                f"`spacing` names {len(self.spacing)} joints, and this is one; give a length, or auto"
            )
        return self


class TouchingConfig(JointProperties):
    """Joints between all blocks that touch and that neither a joint nor a tie is between.

    Their names are those of their blocks, `<a>-<b>`, in the order of the blocks.
    """

    pairs: dict[Name, tuple[str, str]] | None = None
    """Names of the joints, and the blocks that they part; found where the key is left out."""


TOUCHING = "touching"  # among `joints`: the joints of all that touches


def unlike_pairs(joints: Any) -> Any:
    """What stands in `joints`, with the section `touching` marked as that of all that touches."""
    if not isinstance(joints, dict):
        return joints
    section = joints.get(TOUCHING)
    if not isinstance(section, dict) or "between" in section:
        return joints
    return joints | {TOUCHING: {"pairs": None} | section}


def _kind_of_joint(value: Any) -> str:
    if isinstance(value, Model):
        return type(value).__name__
    of_all = isinstance(value, dict) and "pairs" in value
    return TouchingConfig.__name__ if of_all else JointConfig.__name__


JointSections = Annotated[
    dict[
        Name,
        Annotated[
            Annotated[JointConfig, Tag(JointConfig.__name__)]
            | Annotated[TouchingConfig, Tag(TouchingConfig.__name__)],
            Discriminator(_kind_of_joint),
        ],
    ],
    BeforeValidator(unlike_pairs),
]


class TieConfig(Model):
    """Two blocks whose faces that lie on each other are one: a merged interface."""

    between: tuple[str, str]
    """Names of the two blocks."""
    tolerance: Tolerance = 1e-3
    """Distance up to which two nodes coincide, and two faces by mortar beyond their curvature."""
    discretization: Discretization = "auto"
    """Coinciding nodes are one, or by mortar those of one face follow the other, whose mesh need not match;
    auto: mortar where nodes do not coincide."""
    overlap: Annotated[float, Field(gt=0.0, le=1.0)] = 0.5
    """Least share of either face that lies on the other, of the facets that meet; for mortar."""

    @model_validator(mode="after")
    def _two_blocks(self) -> Self:
        refuse_twice(self.between)
        return self


def refuse_twice(between: tuple[str, str]) -> None:
    """Raise if both blocks are the same one.

    Raises
    ------
    ValueError
    """
    if between[0] == between[1]:
        raise ValueError(f"`between` names block {between[0]!r} twice")
