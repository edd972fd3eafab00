"""The configuration of one job as frozen models; every quantity is SI once it is here."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.names import Name, OfFile
from romdam.config.patterns import patterns_in
from romdam.config.quantities import (
    AngularFrequency,
    Density,
    Dimensionless,
    Expansion,
    Frequency,
    Length,
    Memory,
    Pressure,
    Time,
)
from romdam.config.sections.attachments import AnchorConfig, DamperConfig, MassConfig
from romdam.config.sections.combinations import CombinationConfig
from romdam.config.sections.comparison import ComparisonConfig
from romdam.config.sections.construction import ConstructionStageConfig
from romdam.config.sections.floor_spectra import FloorSpectraConfig
from romdam.config.sections.geometry.arch_dam import ArchDamConfig
from romdam.config.sections.geometry.cut import CutConfig, pieces_of
from romdam.config.sections.geometry.gravity_dam import GravityDamConfig, joint_between
from romdam.config.sections.geometry.matrices import MatricesConfig
from romdam.config.sections.geometry.mesh_file import BlockMeshConfig
from romdam.config.sections.ground import GroundConfig
from romdam.config.sections.joints import (
    TOUCHING,
    JointConfig,
    JointProperties,
    JointSections,
    TieConfig,
    TouchingConfig,
)
from romdam.config.sections.linear_stage import LinearStageConfig
from romdam.config.sections.loads import LoadsConfig
from romdam.config.sections.motions.records import RecordConfig
from romdam.config.sections.places import ElementName, NodeConfig, Vector
from romdam.config.sections.post_earthquake import PostEarthquakeConfig
from romdam.config.sections.stress import StressConfig
from romdam.config.sections.study import Modes, ResidualVectors, StudyConfig
from romdam.config.sections.suite import SuiteConfig
from romdam.config.sections.supports import SupportConfig
from romdam.config.sections.transient import TransientConfig
from romdam.config.sections.water import WaterConfig

NonNegative = Field(ge=0.0)
Positive = Field(gt=0.0)
Edges = tuple[Annotated[Length, Positive], Annotated[Length, Positive], Annotated[Length, Positive]]


class RayleighConfig(Model):
    """C = alpha M + beta K of the solids, from two frequencies and one ratio, or the coefficients."""

    frequencies: tuple[Annotated[Frequency, Positive], Annotated[Frequency, Positive]] | None = None
    """Two frequencies at which damping has this ratio."""
    ratio: Annotated[Dimensionless, Field(ge=0.0, lt=1.0)] | None = None
    """Damping ratio, of critical damping, at the two frequencies."""
    alpha: Annotated[AngularFrequency, NonNegative] | None = None
    """Coefficient of the mass matrix."""
    beta: Annotated[Time, NonNegative] | None = None
    """Coefficient of the stiffness matrix."""

    @model_validator(mode="after")
    def _ratio_or_coefficients(self) -> Self:
        by_ratio = self.frequencies is not None and self.ratio is not None
        by_coefficient = self.alpha is not None and self.beta is not None
        count = sum(v is not None for v in (self.frequencies, self.ratio, self.alpha, self.beta))
        if count != 2 or by_ratio == by_coefficient:
            raise ValueError("give either `frequencies` and `ratio`, or `alpha` and `beta`")
        if self.frequencies is not None and self.frequencies[0] == self.frequencies[1]:
            raise ValueError(f"the two frequencies must differ, both are {self.frequencies[0]:g} Hz")
        return self

    @property
    def acts(self) -> bool:
        """Tell whether it damps anything."""
        return any(self.coefficients)

    @property
    def coefficients(self) -> tuple[float, float]:
        """(alpha [1/s], beta [s]).

        Two frequencies with one ratio xi give alpha = 2 xi w1 w2 / (w1 + w2), beta = 2 xi / (w1 + w2).
        """
        if self.frequencies is None or self.ratio is None:
            return float(self.alpha or 0.0), float(self.beta or 0.0)
        w1, w2 = (2.0 * math.pi * f for f in self.frequencies)
        return 2.0 * self.ratio * w1 * w2 / (w1 + w2), 2.0 * self.ratio / (w1 + w2)


class MaterialConfig(Model):
    """Isotropic linear elasticity; `expansion` is the coefficient of linear thermal expansion."""

    E: Annotated[Pressure, Positive]
    """Young's modulus."""
    E_dynamic: Annotated[Pressure, Positive] | None = None
    """Young's modulus of what the record adds; `E` is then that of loads that last: weight, water,
    temperature, grouting."""
    nu: Annotated[Dimensionless, Field(gt=-1.0, lt=0.5)]
    """Poisson's ratio."""
    rho: Annotated[Density, Positive]
    """Density of the material."""
    expansion: Annotated[Expansion, NonNegative] = 0.0
    """Coefficient of linear thermal expansion."""
    damping: RayleighConfig | None = None
    """Rayleigh damping of this material, of its own mass and stiffness; that of `damping` if left out."""


class BoxConfig(Model):
    """A box meshed by a regular grid; its faces are xmin, xmax, ymin, ymax, zmin, zmax.

    `element_size` is that of all edges, or of those along x, y and z; it must divide the box.
    """

    origin: Vector
    """Corner with the lowest coordinates."""
    size: Edges
    """Edges along x, y and z."""
    element_size: Annotated[
        Annotated[Length, Positive, Tag("number")] | Annotated[Edges, Tag("list")],
        by_shape("one edge length, or three such as [2.5 m, 2.5 m, 5 m]"),
    ]
    """Size of the elements, one for all edges or those along x, y and z; it divides the box."""
    element: ElementName = "hex8"
    """Shape and order of the elements."""


class BlockConfig(Model):
    """A box or the cells of a mesh file, of one material.

    Without `mass` it is stiff only; without `weight` it has its mass, but gravity leaves it out. With
    `matrices` its stiffness and mass come from files, and box or mesh are its shape; without either it is the
    block of that name which a dam of a few keys has.
    """

    material: str
    """A name of `materials`."""
    mass: bool = True
    """Mass of the block counts; without it the block is stiff only."""
    weight: bool = True
    """Gravity acts on the block."""
    box: BoxConfig | None = None
    mesh: BlockMeshConfig | None = None
    matrices: MatricesConfig | None = None

    @property
    def of_dam(self) -> bool:
        """Tell whether its shape is that of a dam's block."""
        return self.matrices is not None and self.box is None and self.mesh is None

    @model_validator(mode="after")
    def _one_geometry(self) -> Self:
        if (self.box is None) == (self.mesh is None) and not self.of_dam:
            raise ValueError("give exactly one of `box` and `mesh`")
        if self.matrices is not None and not self.mass:
            raise ValueError(
                "`mass: false` is for blocks that are assembled, and `matrices` has a mass; leave it out"
            )
        if self.matrices is not None and self.mesh is not None and self.mesh.bodies is not None:
            raise ValueError(
                "`matrices` are of one block, and `mesh.bodies` makes several; name one body by `mesh.body`"
            )
        if self.matrices is not None and self.mesh is not None and self.mesh.refine:
            raise ValueError("`mesh.refine` is for blocks that are assembled, and `matrices` has its nodes")
        return self


ModalRatio = Annotated[Dimensionless, Field(ge=0.0, lt=1.0)]
ModalRatios = Annotated[
    Annotated[ModalRatio, Tag("number")]
    | Annotated[tuple[ModalRatio, ...], Field(min_length=1), Tag("list")],
    by_shape("one ratio such as 5 %, or a list of them"),
]


class DampingConfig(Model):
    """Rayleigh damping, or ratios of the open-joint modes (the last one holds for all higher modes)."""

    rayleigh: RayleighConfig | None = None
    modal: ModalRatios | None = None
    """Damping ratio of all open-joint modes, or a list of one for each."""

    @model_validator(mode="after")
    def _at_most_one(self) -> Self:
        if self.rayleigh is not None and self.modal is not None:
            raise ValueError("give `rayleigh` or `modal`, not both")
        return self

    @property
    def acts(self) -> bool:
        """Tell whether anything is damped."""
        ratios = self.modal if isinstance(self.modal, tuple) else (self.modal,)
        return any(ratios) or (self.rayleigh is not None and self.rayleigh.acts)


ModeCount = Annotated[
    Annotated[Modes, Tag("number")] | Annotated[Literal["all", "auto"], Tag("word")],
    by_shape('a number of modes per block such as 60, "all" or "auto"', "all", "auto"),
]


class ModelConfig(Model):
    """Reduced (Craig-Bampton) or full order; fixed-interface modes per block by count or by cut-off.

    `modes: auto` takes as many as `transient.accuracy` needs on the strongest record, for modes and steps
    together, and 20 residual vectors where none are named.
    `residual_vectors` lowest open-joint modes of a block each add what they leave unbalanced to its basis.
    Blocks that see more nodes than they have gaps (`gaps: corners`) are reduced by open-joint modes, as many
    as both together, and static answers to the gaps' forces.
    `solver` and `memory` (such as 8 GB) say what large blocks are reduced with: "auto" takes the quickest
    that is installed and fits, in four fifths of the machine's memory if none is given.
    """

    order: Literal["reduced", "full"] = "reduced"
    """Order of the model: blocks are reduced, or `full` keeps the unreduced mesh."""
    modes: ModeCount | None = None
    """Fixed-interface modes of each block."""
    cutoff: Annotated[Frequency, Positive] | None = None
    """Frequency up to which fixed-interface modes are kept, in place of `modes`."""
    residual_vectors: ResidualVectors = 0
    """Number of residual vectors of each block: responses to unbalanced forces of its open-joint modes."""
    solver: Literal["auto", "superlu", "multifrontal", "pardiso", "pardiso_single", "multigrid"] = "auto"
    """Solver that large blocks are reduced with; auto: the quickest that is installed and fits in the
    memory."""
    memory: Annotated[Memory, Positive] | None = None
    """Memory that a reduction may take; four fifths of the machine's if not given."""

    @model_validator(mode="after")
    def _basis(self) -> Self:
        if self.order == "reduced" and (self.modes is None) == (self.cutoff is None):
            raise ValueError("a reduced model needs exactly one of `modes` (per block) and `cutoff`")
        return self


class OutputsConfig(Model):
    """Histories that are written: at named nodes and every gap, at the interval `output_interval`.

    `error_estimate` adds an estimate of the reduction error to every result.
    """

    nodes: dict[Name, NodeConfig] = Field(default_factory=dict)
    floor_spectra: FloorSpectraConfig | None = None
    stress: StressConfig | None = None
    output_interval: Annotated[Time, Positive] | None = None
    """Interval between two rows of the histories; the record's own step if not given."""
    plots: bool = True
    """Figures are drawn beside each result, and the page of several runs."""
    xlsx: bool = False
    """Summary of several runs as a spreadsheet too (needs the extra `xlsx`)."""
    parquet: bool = False
    """Table of several runs as a Parquet file too (needs the extra `arrays`)."""
    zarr: bool = False
    """Summary of several runs as a Zarr store too (needs the extra `arrays`)."""
    error_estimate: bool = True
    """Estimate of the reduction error in every result."""
    rock: bool = False
    """Displacement of every node of rock is kept too, which takes most of an arch dam's disk space."""
    mesh_error: Literal["auto", "finer", "coarser", False] = "auto"
    """Mesh of half (finer) or twice (coarser) the size of the elements, on which every run is made again to
    state the error of its own mesh; of a suite the strongest record, at its largest and smallest scale. auto:
    coarser where there is such a mesh; false: the error of the mesh is not stated."""


class Sections(Model):
    """The sections of a job, each sound by itself; see `romdam.config.job.Config`."""

    title: str = ""
    """Title of figures and reports."""
    blocks: dict[Name, BlockConfig] = Field(default_factory=dict)
    arch_dam: ArchDamConfig | None = None
    gravity_dam: GravityDamConfig | None = None
    cut: dict[Name, CutConfig] = Field(default_factory=dict)
    """Blocks that are cut into several, by name."""
    materials: dict[Name, MaterialConfig]
    supports: tuple[SupportConfig, ...] = ()
    ground: GroundConfig = GroundConfig()
    joints: JointSections = Field(default_factory=dict)
    """Joints by name; that of the name `touching` stands for all between blocks that touch."""
    ties: dict[Name, TieConfig] = Field(default_factory=dict)
    loads: LoadsConfig = LoadsConfig()
    anchors: dict[Name, AnchorConfig] = Field(default_factory=dict)
    """Bars and tendons between two points."""
    dampers: dict[Name, DamperConfig] = Field(default_factory=dict)
    """Viscous dampers between two points."""
    masses: dict[Name, MassConfig] = Field(default_factory=dict)
    """Masses of gates, piers and equipment on blocks."""
    construction: tuple[ConstructionStageConfig, ...] = ()
    """Stages in which the dam was built, before the loads act together."""
    water: WaterConfig | None = None
    damping: DampingConfig = DampingConfig()
    records: Annotated[tuple[RecordConfig, ...], Field(min_length=1)]
    """Ground motions, or where they come from; each is a run."""
    model: ModelConfig
    transient: TransientConfig
    outputs: OutputsConfig = OutputsConfig()
    study: StudyConfig = StudyConfig()
    linear_stage: LinearStageConfig | None = None
    """Linear analyses with joints tied, which a run makes first."""
    pipeline: Literal["run", "suite", "comparison"] = "run"
    """A run for each record, the whole of `suite`, or the variants of `comparison`."""
    suite: SuiteConfig | None = None
    comparison: ComparisonConfig | None = None
    post_earthquake: PostEarthquakeConfig | None = None
    combinations: dict[Annotated[str, OfFile], CombinationConfig] = Field(default_factory=dict)
    """Load combinations, each with what it requires."""

    @property
    def damped(self) -> bool:
        """Tell whether the solids have damping, of the section `damping` or of a material."""
        of_materials = (material.damping for material in self.materials.values())
        return self.damping.acts or any(damping is not None and damping.acts for damping in of_materials)

    @property
    def dam(self) -> ArchDamConfig | GravityDamConfig | None:
        """The dam that is made of a few keys, if any."""
        return self.arch_dam or self.gravity_dam

    @property
    def block_names(self) -> tuple[str, ...]:
        """Every block, those of such a dam first."""
        dam_blocks = self.dam.block_names if self.dam else ()
        made = (piece for name in self.blocks for piece in self.made_of(name))
        return tuple(dict.fromkeys((*dam_blocks, *made)))

    def made_of(self, section: str) -> tuple[str, ...]:
        """The blocks that a section of `blocks` becomes: its bodies, each of them cut if it is."""
        return tuple(piece for body in self._bodies_of(section) for piece in pieces_of(body, self.cut))

    def _bodies_of(self, section: str) -> tuple[str, ...]:
        mesh = self.blocks[section].mesh
        return (mesh.names if mesh is not None else ()) or (section,)

    @property
    def touching(self) -> TouchingConfig | None:
        """The section of the joints between all that touches, if any."""
        section = self.joints.get(TOUCHING)
        return section if isinstance(section, TouchingConfig) else None

    @property
    def unfound(self) -> tuple[str, ...]:
        """Keys that say "all that is there", and what that is has not been looked up in the meshes yet."""
        bodies = (
            f"blocks.{name}.mesh.bodies"
            for name, block in self.blocks.items()
            if block.mesh is not None and block.mesh.bodies == "auto"
        )
        touching = self.touching
        pairs = (f"joints.{TOUCHING}",) if touching is not None and touching.pairs is None else ()
        return (*bodies, *pairs, *patterns_in(self))

    @property
    def every_joint(self) -> dict[str, JointConfig]:
        """Every joint, those of a dam first, then those of cuts."""
        generated = self.gravity_dam.generated_joints if self.gravity_dam else {}
        for section in (*((self.arch_dam,) if self.arch_dam else ()), *self.cut.values()):
            if isinstance(section.joints, JointProperties):
                template = section.joints
                generated |= {
                    name: joint_between(name, pair, template) for name, pair in section.joint_pairs.items()
                }
        touching = self.touching
        if touching is not None:
            generated |= {
                name: joint_between(name, pair, touching) for name, pair in (touching.pairs or {}).items()
            }
        return generated | {
            name: joint for name, joint in self.joints.items() if isinstance(joint, JointConfig)
        }

    @property
    def joint_sections(self) -> dict[str, tuple[JointProperties, tuple[str, ...]]]:
        """Path of every section with keys of joints -> what stands there, and the joints that it makes."""
        sections: dict[str, tuple[JointProperties, tuple[str, ...]]] = {
            f"joints.{name}": (
                joint,
                tuple(joint.pairs or ()) if isinstance(joint, TouchingConfig) else (name,),
            )
            for name, joint in self.joints.items()
        }
        dam = self.gravity_dam
        for key, value in dam.joints if dam else ():
            if dam and isinstance(value, JointProperties):
                sections[f"gravity_dam.joints.{key}"] = value, dam.joints_of_kinds.get(key, ())
        several = {f"cut.{name}": cut for name, cut in self.cut.items()}
        for path, section in (several | ({"arch_dam": self.arch_dam} if self.arch_dam else {})).items():
            if isinstance(section.joints, JointProperties):
                sections[f"{path}.joints"] = section.joints, tuple(section.joint_pairs)
        return sections

    @property
    def joint_places(self) -> dict[str, tuple[str, ...]]:
        """Path of every section with keys of joints, of dams and cuts too -> the joints that have them."""
        single = {f"joints.{name}": (name,) for name in self.every_joint}
        return single | {path: names for path, (_, names) in self.joint_sections.items() if names}
