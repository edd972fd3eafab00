"""The configuration of one job as frozen models; every quantity is SI once it is here."""

from __future__ import annotations

import difflib
from collections.abc import Collection
from typing import Annotated, Literal, Self

from pydantic import Field, Tag, ValidationInfo, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.construction import refuse_wrong_construction
from romdam.config.coupling import couplings, refuse_coupled
from romdam.config.effects import refuse_excluded
from romdam.config.linear_stage import refuse_linear_stage
from romdam.config.names import Name
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
from romdam.config.sections.comparison import ComparisonConfig
from romdam.config.sections.construction import ConstructionStageConfig
from romdam.config.sections.floor_spectra import FloorSpectraConfig
from romdam.config.sections.geometry.arch_dam import ArchDamConfig
from romdam.config.sections.geometry.cut import CutConfig, pieces_of, refuse_wrong_cuts
from romdam.config.sections.geometry.gravity_dam import GravityDamConfig, joint_between
from romdam.config.sections.geometry.matrices import MatricesConfig, refuse_wrong_matrices
from romdam.config.sections.geometry.mesh_file import BlockMeshConfig
from romdam.config.sections.ground import GroundConfig, refuse_wrong_ground
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
from romdam.config.sections.suite import KeepConfig, SuiteConfig
from romdam.config.sections.supports import SupportConfig, refuse_wrong_motions
from romdam.config.sections.transient import TransientConfig
from romdam.config.sections.water import WaterConfig
from romdam.core.errors import listed, quote
from romdam.core.integrators import INTEGRATORS

OF_SAMPLE = "of_sample"  # in the context of a validation: `joints` may have those that dams and cuts make
NonNegative = Field(ge=0.0)
Positive = Field(gt=0.0)
Edges = tuple[Annotated[Length, Positive], Annotated[Length, Positive], Annotated[Length, Positive]]


class MaterialConfig(Model):
    """Isotropic linear elasticity; `expansion` is the coefficient of linear thermal expansion."""

    E: Annotated[Pressure, Positive]
    """Young's modulus."""
    nu: Annotated[Dimensionless, Field(gt=-1.0, lt=0.5)]
    """Poisson's ratio."""
    rho: Annotated[Density, Positive]
    """Density of the material."""
    expansion: Annotated[Expansion, NonNegative] = 0.0
    """Coefficient of linear thermal expansion."""


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
    def _one_form(self) -> Self:
        by_ratio = self.frequencies is not None and self.ratio is not None
        by_coefficient = self.alpha is not None and self.beta is not None
        count = sum(v is not None for v in (self.frequencies, self.ratio, self.alpha, self.beta))
        if count != 2 or by_ratio == by_coefficient:
            raise ValueError("give either `frequencies` and `ratio`, or `alpha` and `beta`")
        if self.frequencies is not None and self.frequencies[0] == self.frequencies[1]:
            raise ValueError(f"the two frequencies must differ, both are {self.frequencies[0]:g} Hz")
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
        r = self.rayleigh
        return any(ratios) or (r is not None and bool(r.ratio or r.alpha or r.beta))


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
    error_estimate: bool = True
    """Estimate of the reduction error in every result."""
    rock: bool = False
    """Displacement of every node of rock is kept too, which takes most of an arch dam's disk space."""
    mesh_error: Literal["auto", "finer", "coarser", False] = "auto"
    """Mesh of half (finer) or twice (coarser) the size of the elements, on which every run is made again to
    state the error of its own mesh; of a suite the strongest record, at its largest and smallest scale. auto:
    coarser where there is such a mesh; false: the error of the mesh is not stated."""


class Config(Model):
    """One job: scene, records, model, time integration and outputs."""

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
                    name: joint_between(pair, template) for name, pair in section.joint_pairs.items()
                }
        touching = self.touching
        if touching is not None:
            generated |= {
                name: joint_between(pair, touching) for name, pair in (touching.pairs or {}).items()
            }
        return generated | {
            name: joint for name, joint in self.joints.items() if isinstance(joint, JointConfig)
        }

    @property
    def joint_places(self) -> dict[str, tuple[str, ...]]:
        """Path of every section with keys of joints, of dams and cuts too -> the joints that have them."""
        places: dict[str, tuple[str, ...]] = {f"joints.{name}": (name,) for name in self.every_joint}
        if self.gravity_dam:
            places |= {
                f"gravity_dam.joints.{kind}": of for kind, of in self.gravity_dam.joints_of_kinds.items()
            }
        if self.touching is not None and self.touching.pairs:
            places[f"joints.{TOUCHING}"] = tuple(self.touching.pairs)
        if self.arch_dam and self.arch_dam.joint_pairs:
            places["arch_dam.joints"] = tuple(self.arch_dam.joint_pairs)
        return places | {
            f"cut.{name}.joints": tuple(cut.joint_pairs) for name, cut in self.cut.items() if cut.joint_pairs
        }

    @model_validator(mode="after")
    def _references(self, info: ValidationInfo) -> Self:
        self._refuse_no_blocks(of_sample=bool((info.context or {}).get(OF_SAMPLE)))
        for name, block in self.blocks.items():
            self._known(f"blocks.{name}.material", block.material, self.materials)
        if not self.unfound:  # else names of blocks and joints are known once they are found
            self._refuse_wrong_references()
        return self

    def _refuse_wrong_references(self) -> None:
        if self.model.order == "full" and self.transient.finest_step is None:
            raise ValueError(
                "transient.finest_step is missing; a full-order model needs a step, `accuracy` is for "
                "reduced ones"
            )
        if self.model.modes == "auto" and self.transient.accuracy is None:
            raise ValueError("model.modes: auto needs transient.accuracy, which it is to meet; give it")
        self._refuse_accuracy_of_no_slips()
        self._refuse_automatic_spacing_that_nothing_judges()
        self._refuse_state_of_no_such_model()
        self._refuse_damping_that_the_integrator_does_not_know()
        blocks = frozenset(self.block_names)
        self._refuse_total_that_no_run_states()
        self._refuse_interval_that_no_steps_divide()
        self._refuse_grouting_without_rest()
        parameters = self.suite.parameters.values() if self.suite else ()
        varied = [path for parameter in parameters for path in parameter.paths]
        refuse_excluded(self)
        refuse_wrong_construction(self)
        if self.linear_stage is not None:
            refuse_linear_stage(self)
        refuse_wrong_ground(self.ground, self.arch_dam)
        refuse_coupled(couplings(self), self.transient.integrator, varied)
        several = len(self.records) > 1 or self.pipeline == "suite"
        refuse_wrong_motions(self.supports, self.ground.along, self.transient, several)
        for i, support in enumerate(self.supports):
            self._known(f"supports[{i}].block", support.block, blocks)
        for key, name in self.ground.named.items():
            self._known(f"ground.{key}", name, blocks)
        named = [(f"joints.{n}", j.between) for n, j in self.joints.items() if isinstance(j, JointConfig)]
        for key, between in (*named, *((f"ties.{name}", tie.between) for name, tie in self.ties.items())):
            for block_name in between:
                self._known(f"{key}.between", block_name, blocks)
        for i, pressure in enumerate(self.loads.pressure):
            self._known(f"loads.pressure[{i}].block", pressure.block, blocks)
        for i, water in enumerate(self.loads.hydrostatic):
            for k, face in enumerate(water.faces):
                self._known(f"loads.hydrostatic[{i}].faces[{k}].block", face.block, blocks)
        for i, wet in enumerate(self.loads.joint_water):
            for joint_name in wet.joints:
                self._known(f"loads.joint_water[{i}].joints", joint_name, self.every_joint)
        for i, warm in enumerate(self.loads.temperature):
            for block_name in warm.blocks or ():
                self._known(f"loads.temperature[{i}].blocks", block_name, blocks)
        for i, stage in enumerate(self.construction):
            for block_name in (
                *stage.pour,
                *(name for warm in stage.temperature for name in warm.blocks or ()),
            ):
                self._known(f"construction[{i}]", block_name, blocks)
            for zone in stage.grout:
                for joint_name in zone.joints:
                    self._known(f"construction[{i}].grout.joints", joint_name, self.every_joint)
        for i, force in enumerate(self.loads.force):
            self._known(f"loads.force[{i}].block", force.block, blocks)
        for i, history in enumerate(self.loads.force_history):
            self._known(f"loads.force_history[{i}].block", history.block, blocks)
        for joint_name in (self.post_earthquake.joints if self.post_earthquake else None) or ():
            self._known("post_earthquake.joints", joint_name, self.every_joint)
        for name, node in self.outputs.nodes.items():
            self._known(f"outputs.nodes.{name}.block", node.block, blocks)
        self._refuse_floors_without_nodes()
        if self.outputs.stress is not None:
            self._known_in_stress(self.outputs.stress, blocks)
        for name, both in (self.comparison.relative if self.comparison else {}).items():
            for node_name in both:
                self._known(f"comparison.relative.{name}", node_name, self.outputs.nodes)
        for i, face in enumerate(self.water.faces if self.water else ()):
            self._known(f"water.faces[{i}].block", face.block, blocks)

    def _refuse_floors_without_nodes(self) -> None:
        asked, nodes = self.outputs.floor_spectra, self.outputs.nodes
        if asked is None:
            return
        if not nodes:
            raise ValueError(
                "outputs.floor_spectra: spectra are of the motion of `outputs.nodes`, and there is none; "
                "name at least one, such as crest: {block: C4, at: [0, 0, 120 m]}"
            )
        for place, names in (asked.places or {}).items():
            for name in names:
                self._known(f"outputs.floor_spectra.places.{place}", name, nodes)

    def _refuse_grouting_without_rest(self) -> None:
        grouted = [name for name, joint in self.every_joint.items() if joint.law_keys["grouting_pressure"]]
        if grouted and self.loads.initial_state == "undeformed":
            raise ValueError(
                f"joints.{grouted[0]}.grouting_pressure is what the joint has at rest, and "
                "loads.initial_state: undeformed starts without rest; set static, or leave the pressure out"
            )

    def _refuse_state_of_no_such_model(self) -> None:
        state = self.loads.initial_state
        if isinstance(state, str):
            return
        key = "loads.initial_state"
        automatic = [name for name, joint in self.every_joint.items() if joint.spacing == "auto"]
        others: dict[str, tuple[bool, str]] = {
            "transient.accuracy.total tries other meshes": (
                self.transient.total_accuracy is not None,
                "give an accuracy of the steps, 1 %",
            ),
            f"joints.{next(iter(automatic), '')}.spacing: auto tries other gaps": (
                bool(automatic),
                "give the length that the state's run came to",
            ),
            f"outputs.mesh_error: {self.outputs.mesh_error} runs another mesh": (
                self.outputs.mesh_error in ("finer", "coarser"),
                "leave it out",
            ),
        }
        if state.take == "all":
            others |= {
                "model.modes: auto may choose others": (
                    self.model.modes == "auto",
                    "give the number that the state's run came to, or take: joints",
                ),
                "suite.parameters vary it": (
                    self.pipeline == "suite" and bool(self.suite and self.suite.parameters),
                    "set take: joints",
                ),
            }
        for why, (there, remedy) in others.items():
            if there:
                raise ValueError(f"{key}: a state belongs to one model, and {why}; {remedy}")

    def _refuse_no_blocks(self, *, of_sample: bool) -> None:
        if not self.block_names:
            raise ValueError("blocks: name at least one block, or give `arch_dam` or `gravity_dam`")
        if self.arch_dam and self.gravity_dam:
            raise ValueError("gravity_dam: a scene has one dam, and arch_dam is given too; leave one out")
        dam, key = self.dam, "gravity_dam" if self.gravity_dam else "arch_dam"
        for name in dam.block_names if dam else ():
            if name in self.blocks and not self.blocks[name].of_dam:
                raise ValueError(f"blocks.{name}: {key} makes a block of that name; rename this one")
        refuse_wrong_matrices(self, dam.block_names if dam else ())
        self._refuse_bodies_of_taken_names()
        bodies = [body for name in self.blocks for body in self._bodies_of(name)]
        if not self.unfound:
            refuse_wrong_cuts(self.cut, bodies, dam.block_names if dam else ())
        makers = dict.fromkeys(dam.joint_pairs if dam else (), key)
        makers |= {name: f"cut.{whole}" for whole, cut in self.cut.items() for name in cut.joint_pairs}
        touching = self.touching
        makers |= dict.fromkeys((touching.pairs if touching else None) or {}, f"joints.{TOUCHING}")
        for name, section in self.joints.items():
            if isinstance(section, TouchingConfig) and name != TOUCHING:
                raise ValueError(
                    f"joints.{name}.pairs: is of joints.{TOUCHING}, the joints of all that touches; give "
                    "`between`, the names of two blocks"
                )
            if name in makers and not of_sample:
                raise ValueError(f"joints.{name}: {makers[name]} makes a joint of that name; rename this one")
        for inner, material in (dam.materials if dam else {}).items():
            self._known(f"{key}.{inner}", material, self.materials)

    def _refuse_bodies_of_taken_names(self) -> None:
        seen = dict[str, str]()
        for name in self.blocks:
            for body in self._bodies_of(name):
                other = seen.setdefault(body, name)
                if other != name or self._bodies_of(name).count(body) > 1:
                    raise ValueError(
                        f"blocks.{name}.mesh.bodies: the name {quote(body)} is that of another block or "
                        "body; rename one of the two"
                    )

    def _refuse_damping_that_the_integrator_does_not_know(self) -> None:
        name = self.transient.integrator
        if name is not None and not INTEGRATORS[name].damped and self.damping.acts:
            raise ValueError(
                f"transient.integrator: {name} is for scenes without damping, and `damping` is given; "
                "leave the integrator out, adaptive is the default there"
            )

    def _refuse_total_that_no_run_states(self) -> None:
        if self.transient.total_accuracy is None:
            return
        lacking = {
            "joints, whose openings it is of": bool(self.every_joint),
            "damping, without which histories part in time whatever the mesh": self.damping.acts,
            "outputs.error_estimate, which states what the modes leave": self.outputs.error_estimate,
        }
        for what, there in lacking.items():
            if not there:
                raise ValueError(
                    f"transient.accuracy.total: needs {what}; or give an accuracy of the steps, 1 %"
                )
        if self.outputs.mesh_error in ("finer", "coarser"):
            raise ValueError(
                "outputs.mesh_error: transient.accuracy.total states the error of the mesh that it chooses; "
                "leave one of the two out"
            )

    def _refuse_accuracy_of_no_slips(self) -> None:
        asked = next(iter(self.transient.slip_accuracies), None)
        if asked is None:
            return
        laws = [(law, joint.law_keys) for joint in self.every_joint.values() for law in joint.every_law]
        if not any(law.needs_shear(keys) for law, keys in laws):
            raise ValueError(
                f"transient.accuracy.{asked}: no joint of the job carries shear, so none has slips; "
                "leave it out, or give a joint `friction` and `shear_stiffness`"
            )
        if not self.damping.acts:
            raise ValueError(
                f"transient.accuracy.{asked}: without `damping` runs are compared by their peak openings, "
                "not by slips; leave it out, or give damping"
            )

    def _refuse_automatic_spacing_that_nothing_judges(self) -> None:
        automatic = [name for name, joint in self.every_joint.items() if joint.spacing == "auto"]
        if not automatic:
            return
        lacking = {
            "transient.accuracy, which it is to meet": self.transient.accuracy is not None,
            "an accuracy of the steps (accuracy: 1 %), as accuracy.total chooses contact points itself": (
                self.transient.total_accuracy is None
            ),
            "model.order: reduced": self.model.order == "reduced",
        }
        for what, there in lacking.items():
            if not there:
                raise ValueError(f"spacing: auto of joint {automatic[0]} needs {what}; or give a length")

    def _refuse_interval_that_no_steps_divide(self) -> None:
        key, interval = "outputs.output_interval", self.outputs.output_interval
        if self.pipeline == "suite" and self.suite and isinstance(self.suite.keep, KeepConfig):
            key, interval = "suite.keep.output_interval", self.suite.keep.output_interval
        step = self.transient.finest_step
        if step is None or interval is None:
            return
        stride = round(interval / step)
        if step > interval and step >= 1.0:  # no dam is integrated in seconds
            raise ValueError(
                f"transient.finest_step: {step:g} s is longer than {key}, {interval:g} s; is "
                f"`{step:g} ms` meant?"
            )
        if stride < 1 or abs(interval / step - stride) > 1e-6 * interval / step:
            raise ValueError(
                f"{key} must be a whole multiple of transient.finest_step ({step:g} s), "
                f"got {interval:g} s; {max(1, stride) * step:g} s is the nearest"
            )

    def _known_in_stress(self, stress: StressConfig, blocks: Collection[str]) -> None:
        for name in stress.blocks if stress.blocks != "all" else ():
            self._known("outputs.stress.blocks", name, blocks)
        for i, face in enumerate(stress.faces):
            self._known(f"outputs.stress.faces[{i}].block", face.block, blocks)
        for name, node in stress.nodes.items():
            self._known(f"outputs.stress.nodes.{name}.block", node.block, blocks)
        for key, section in stress.sections.items():
            for name in section.blocks if section.blocks != "all" else ():
                self._known(f"outputs.stress.sections.{key}.blocks", name, blocks)

    @staticmethod
    def _known(key: str, name: str, among: Collection[str]) -> None:
        if name not in among:
            near = difflib.get_close_matches(name, among, n=1)
            meant = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"{key}: no {quote(name)} is defined; defined are {listed(among)}{meant}")
