"""Everything that makes a result differ from the exact solution of the stated mechanics, and what states it.

The stated mechanics are linear elasticity of small strains and rotations, joints that follow their laws at
every point, and the loads, water and records as the manual defines them. A row says what differs from them,
where the code does it, and how a result accounts for it:

    varied by            statements of error whose comparison changes it, so that they include it
    bounded by test      a test that holds it below a stated bound over what a job can ask for
    said in the result   a sentence of the result: either the code's, or `not_included`
    not stated           no statement includes it and no sentence says so
    exact                what a registry lists and what approximates nothing, with the test that shows it

A row names modules below `romdam`, and entries of registries as `module:Name`. Every effect, integrator,
reduction method, element, joint law, contact solver, processing step and statement has a row
(`tests/error/test_approximations.py`). The manual's table is made from the rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from romdam.config.effects import EFFECTS, has_viscous_boundary

if TYPE_CHECKING:
    from romdam.config.job import Config

Stated = Literal["varied by", "bounded by test", "said in the result", "not stated", "exact"]


@dataclass(frozen=True)
class Approximation:
    """A row of the table.

    Attributes
    ----------
    name : a noun phrase, as a sentence of a result may name it
    where : modules below `romdam`, or `module:Name` of an entry
    changes : what it changes, or for what is exact why
    stated : see the module
    by : statements ("estimate", ..., and "steps"), tests as "file::function" below `tests`, or "module: text"
        where a sentence of the result has this text; what is known of it where it is not stated
    acts : whether a job has it, where `not_included` says it
    """

    name: str
    where: tuple[str, ...]
    changes: str
    stated: Stated
    by: tuple[str, ...] = ()
    acts: Callable[[Config], bool] | None = None


def not_included(config: Config) -> str:
    """Say what no statement of error of a job's results includes; empty where all is included."""
    names = [row.name for row in APPROXIMATIONS if row.acts is not None and row.acts(config)]
    return f"No statement of error includes {'; '.join(names)}." if names else ""


def _has_rock(config: Config) -> bool:
    dams = config.arch_dam, config.gravity_dam
    return bool(config.ground.rock or config.ground.viscous) or any(dam and dam.rock for dam in dams)


def _has_short_reservoir(config: Config) -> bool:
    water = config.water
    return water is not None and water.model == "incompressible" and (water.length or water.mesh) is not None


def _is_incoherent(config: Config) -> bool:
    along = config.ground.along
    return along is not None and along.incoherence is not None


_MESH = (
    Approximation(
        "size of the elements",
        tuple(
            f"geometry.elements:{name}"
            for name in (
                "hex8", "hex20", "hex27", "tet4", "tet10", "wedge6", "wedge15", "pyramid5", "pyramid13",
                "quad4", "quad8", "quad9", "tri3", "tri6",
            )
        ),
        "displacement, stress and openings, by the order of the element; integration of distorted ones",
        "varied by",
        ("discretisation",),
    ),
    Approximation(
        "kind of the elements",
        ("geometry.elements",),
        "how fast the error falls with the size; both meshes of a comparison have the same kind",
        "bounded by test",
        ("fem/test_frequencies.py::test_order_of_convergence_on_a_cube",
         "fem/test_frequencies.py::test_every_element_converges"),
    ),
    Approximation(
        "a mesh without a coarser one",
        ("config.other_mesh", "pipelines.error.sibling"),
        "odd numbers of elements, one element through a block, files: nothing is compared",
        "said in the result",
        ("pipelines.error.sibling: What the mesh changes is unknown",),
    ),
    Approximation(
        "joints without a gap that both meshes have",
        ("error.discretisation",),
        "their openings are in no comparison of meshes; the details name them",
        "said in the result",
        ("error.discretisation: joints_not_compared",),
    ),
    Approximation(
        "straight edges on arcs of generated dams",
        ("geometry.arch_dam.generator", "geometry.boxes"),
        "middle nodes of quadratic elements stand on chords; elements of another size have other chords",
        "varied by",
        ("discretisation",),
    ),
    Approximation(
        "curved surfaces of mesh files between their nodes",
        ("geometry.meshes", "config.other_mesh"),
        "refined elements stay on the facets of the file",
        "said in the result",
        acts=lambda config: any(block.mesh is not None for block in config.blocks.values()),
    ),
    Approximation(
        "nodes that a cut moves onto its surface",
        ("geometry.cutting",),
        "the shape of elements beside a cut",
        "bounded by test",
        ("geometry/test_cutting.py::test_mass_weight_and_material_are_those_of_the_block",
         "geometry/test_cutting.py::test_an_arch_dam_cut_through_its_elements"),
    ),
    Approximation(
        "contact at nodes, or by mortar",
        ("scene.joints", "scene.mortar", "fem.gaps"),
        "openings, slips and resultants of joints; another mesh has other gaps",
        "varied by",
        ("discretisation",),
    ),
    Approximation(
        "pressure at a single gap",
        ("scene.joints", "scene.mortar", "error.discretisation"),
        "a mean over the gap's area, whose peak grows as areas shrink: the largest of each joint is compared",
        "varied by",
        ("discretisation",),
    ),
    Approximation(
        "contact points farther apart than the nodes",
        ("scene.patches", "pipelines.automatic_spacing"),
        "openings, slips and pressure: compared with a gap at every node",
        "varied by",
        ("discretisation",),
    ),
    Approximation(
        "the spacing of contact points that a joint names, without a statement of the mesh",
        ("scene.patches",),
        "the same, where `outputs.mesh_error` is false",
        "said in the result",
        acts=lambda config: (
            not config.outputs.mesh_error
            and any(joint.spacing is not None for joint in config.every_joint.values())
        ),
    ),
    Approximation(
        "automatic stiffness of joints",
        ("scene.joint_stiffness",),
        "ten times the stiffness of the elements beside the joint, so that it follows the mesh",
        "varied by",
        ("discretisation",),
    ),
    Approximation(
        "mortar on curved faces",
        ("scene.mortar",),
        "a clearance of the sagitta between two facetted faces",
        "bounded by test",
        ("scene/test_mortar_joints.py::test_what_curvature_allows_is_the_sagitta",
         "scene/test_mortar_joints.py::test_a_curved_face_has_its_own_area_and_moves_as_one"),
    ),
    Approximation(
        "gaps that stay where they were",
        ("fem.gaps",),
        "after a large slip or opening the moment of the joint's force about both blocks",
        "said in the result",
        ("postprocess.run_warnings: gaps stay between the points where they started",),
    ),
    Approximation(
        "ties of faces that do not match",
        ("scene.ties", "scene.mortar"),
        "displacement follows in the mean over facets",
        "varied by",
        ("discretisation",),
    ),
    Approximation(
        "gaps of a crack farther apart than its process zone",
        ("scene.plausible",),
        "the load at which a joint with fracture energy cracks",
        "said in the result",
        ("scene.plausible: m apart, farther than E G_f / f_t^2",),
    ),
    Approximation(
        "stress of nodes",
        ("fem.stress", "error.mesh_stress"),
        "stress between the points where elements have it best; all that stands outside the ring of stress",
        "varied by",
        ("discretisation",),
    ),
    Approximation(
        "stress at re-entrant edges",
        ("scene.stress", "postprocess.maxima"),
        "it grows with refinement; a ring around the edges is left out of percentiles",
        "said in the result",
        ("postprocess.maxima: the ring leaves out",),
    ),
    Approximation(
        "bending of linear elements under temperature",
        ("scene.temperature",),
        "stress of one linear element through the thickness",
        "varied by",
        ("discretisation",),
    ),
    Approximation(
        "temperature between the rows of a table",
        ("scene.temperature",),
        "straight along the elevation, through the thickness as the load names it, linear between points",
        "said in the result",
        acts=lambda config: any(one.faces or one.points for one in config.loads.temperature),
    ),
    Approximation(
        "the scatter of random joint strengths between seeds",
        ("scene.strength_field",),
        "one field of 2,048 waves of many that have the same statistics; suites draw them by the seed",
        "said in the result",
        acts=lambda config: any(joint.field is not None for joint in config.every_joint.values()),
    ),
    Approximation(
        "waves of a random field",
        ("scene.strength_field",),
        "moments and correlation of its factors",
        "bounded by test",
        ("scene/test_strength_field.py::"
         "test_factors_are_lognormal_with_the_moments_and_the_correlation_that_are_asked_for",),
    ),
)  # fmt: skip

_SURROUNDINGS = (
    Approximation(
        "how far the rock goes, and what its boundary sends back of waves at an angle",
        ("fem.absorbing", "geometry.arch_dam.generator", "geometry.gravity_dam"),
        "radiation and flexibility of the ground; the other mesh of a comparison has the same rock",
        "said in the result",
        acts=lambda config: has_viscous_boundary(config) or _has_rock(config),
    ),
    Approximation(
        "waves along the normal of viscous faces",
        ("effects.damping:SolidDamping", "fem.absorbing"),
        "what comes back of them, below 1 %",
        "bounded by test",
        ("fem/test_absorbing.py::test_wave_leaves_through_the_base",),
    ),
    Approximation(
        "waves that rock elements cannot carry",
        ("effects.free_field:incoming_waves", "fem.column"),
        "high frequencies of the free field are left out; the column is slower than continuous layers",
        "said in the result",
        ("effects.free_field: free field: left out of the record's acceleration",
         "effects.free_field: free field: acceleration at depth differs"),
    ),
    Approximation(
        "waves at an angle of continuous layers",
        ("effects.inclined_waves:inclined_waves", "fem.inclined"),
        "elements carry them more slowly; a box of rock against the half-space, below 1 %",
        "bounded by test",
        ("fem/test_inclined.py::test_box_of_rock_moves_as_the_half_space",
         "fem/test_inclined.py::test_surface_of_one_wave_has_that_wave_and_its_reflections_below"),
    ),
    Approximation(
        "free field of irregular meshes",
        ("effects.free_field",),
        "the surface of level rock against the record, below 1 %",
        "bounded by test",
        ("fem/test_free_field.py::test_field_of_an_irregular_mesh_returns_the_record_within_one_per_cent",
         "fem/test_free_field.py::test_field_of_tetrahedra_returns_the_record"),
    ),
    Approximation(
        "elements of the water",
        ("fem.water", "effects.added_mass:added_mass"),
        "its pressure; a reservoir without a mesh of its own follows the mesh of the wet faces",
        "varied by",
        ("discretisation",),
    ),
    Approximation(
        "elements of a reservoir of a mesh file",
        ("scene.reservoir.reservoir_mesh",),
        "pressure and frequencies of the water; both meshes of a comparison may have the same",
        "said in the result",
        acts=lambda config: config.water is not None and config.water.mesh is not None,
    ),
    Approximation(
        "far end of incompressible water",
        ("scene.reservoir.build", "fem.water.prism"),
        "a rigid end adds coth(pi L / 2 H) - 1 of the first section mode: 0.02 % at three depths",
        "bounded by test",
        ("fem/test_water.py::test_a_far_end_adds_what_its_closed_form_says",),
    ),
    Approximation(
        "the rigid far end of incompressible water, at the length that the job names (9 % at one depth, "
        "0.4 % at two)",
        ("scene.reservoir.build",),
        "the added mass of a reservoir that ends near the dam, or where its mesh does",
        "said in the result",
        acts=_has_short_reservoir,
    ),
    Approximation(
        "far end of compressible water",
        ("effects.channel", "effects.compressible_water:compressible_water"),
        "the channel beyond it, below 2 % from half a depth on; its network, below 0.7 % but for 1 % beside "
        "each cut-off",
        "bounded by test",
        ("fem/test_compressible_water.py::test_far_end_may_be_near",
         "fem/test_compressible_water.py::test_network_has_the_impedance_of_a_channel_without_end"),
    ),
    Approximation(
        "modes of the reservoir above the cut-off",
        ("effects.compressible_water",),
        "waves in the water; the finer model has those up to 1.5 times the cut-off",
        "varied by",
        ("estimate",),
    ),
    Approximation(
        "modes that stay dry beside 3,000 with water",
        ("effects.added_mass",),
        "wet frequencies, below 0.2 % with half of the modes dry",
        "bounded by test",
        ("fem/test_water.py::test_modes_left_dry_cost_little",),
    ),
    Approximation(
        "motion between stations along the ground",
        ("effects.moving_supports:moving_supports", "records.processing.support_motions"),
        "a polynomial through the stations of waves up to the cut-off",
        "bounded by test",
        ("effects/test_motion_along.py::test_polynomials_through_stations_follow_waves",),
    ),
    Approximation(
        "the scatter of incoherent motion between seeds",
        ("records.processing.incoherence",),
        "one motion of random phases of many that have the same coherency; it is coherent below 0.1 Hz",
        "said in the result",
        acts=_is_incoherent,
    ),
    Approximation(
        "pressure of water in joints between the gaps",
        ("scene.joint_water",),
        "the diagram as forces of gaps, with its resultant and its moment",
        "bounded by test",
        ("scene/test_joint_water.py::test_resultant_and_moment_are_those_of_the_diagram",),
    ),
    Approximation(
        "tip of a crack at rest",
        ("timestepping.uplift",),
        "it lies between two gaps, where the pressure of the joint passes through zero",
        "bounded by test",
        ("fem/test_cracked_base.py::test_the_crack_of_a_rigid_section",
         "fem/test_cracked_base.py::test_the_tip_between_two_gaps"),
    ),
    Approximation(
        "uplift while the crack grows",
        ("timestepping.uplift", "contact.laws.crack_water:CrackWater"),
        "water follows the crack as `crack` and `earthquake` of the load say",
        "said in the result",
        ("postprocess.run_warnings: later, while",
         "postprocess.run_warnings: its uplift stays that of the crack at rest"),
    ),
)  # fmt: skip

_RECORDS = (
    Approximation(
        "ground motion between the samples of a record",
        ("records.assemble", "records.processing.resampling", "records.processing.integrate"),
        "straight lines, or the band-limited signal; the provenance names which",
        "said in the result",
        ("records.assemble: resampling",),
    ),
    Approximation(
        "samples that the steps pass by",
        ("pipelines.job_warnings", "timestepping.steps"),
        "peaks of the record between steps, where steps and samples have no common multiple",
        "said in the result",
        ("pipelines.job_warnings: s pass by its samples and lose ",),
    ),
    Approximation(
        "correction of a record",
        (
            "records.processing.correction:MeanStep",
            "records.processing.correction:DetrendStep",
            "records.processing.correction:TaperStep",
            "records.processing.correction:CornersStep",
            "records.processing.correction:ButterworthStep",
            "records.processing.correction:DisplacementBaselineStep",
            "records.processing.correction:VelocityBaselineStep",
            "records.processing.correction_steps",
            "records.processing.corners",
            "records.processing.final_motion",
        ),
        "PGA, PGV and Arias intensity",
        "said in the result",
        ("records.processing.final_motion: changes, along ",),
    ),
    Approximation(
        "band in which an instrument's response is divided out",
        ("records.processing.response",),
        "motion outside of the band",
        "said in the result",
        ("records.obspy_bridge: the response was divided out from ",),
    ),
    Approximation(
        "length of the pads of a filter",
        ("records.processing.correction:PadStep",),
        "displacement at the ends of the record",
        "bounded by test",
        ("records/test_record_correction.py::test_longer_pads_change_nothing",),
    ),
    Approximation(
        "offset of a recorder",
        ("records.processing.offset",),
        "a constant acceleration",
        "said in the result",
        ("records.assemble: m/s2 was subtracted, the offset of ",),
    ),
    Approximation(
        "start of channels within a sample",
        ("records.processing.align",),
        "a windowed sinc gives the samples between, below nine tenths of Nyquist's frequency",
        "said in the result",
        ("records.processing.align: of a step off the others' samples: interpolated there",),
    ),
    Approximation(
        "rest between the records of a sequence",
        ("records.processing.sequence",),
        "a whole number of intervals",
        "said in the result",
        ("records.processing.sequence:  is taken as ",),
    ),
    Approximation(
        "forces in time between the steps",
        ("effects.force_histories:force_histories", "records.processing.force_rows"),
        "corners of a table between base steps",
        "said in the result",
        ("records.processing.force_rows: % of it in L2, limit ",),
    ),
    Approximation(
        "the point that an anchor, a damper or a mass acts on",
        ("effects.attachments:attached_springs", "effects.attachments:attached_dashpots", "scene.points"),
        "how far the point gives, which in a continuum is without limit: it grows as elements shrink",
        "varied by",
        ("discretisation",),
    ),
    Approximation(
        "what modes, steps and the mesh change in the forces of anchors and dampers",
        ("results.attached",),
        "comparisons are of openings, slips, displacements, joint forces, sections and stress alone",
        "said in the result",
        acts=lambda config: any(one.records and one.acts(config) for one in EFFECTS.values()),
    ),
    Approximation(
        "the end of a record that `duration` cuts",
        ("pipelines.job_warnings",),
        "what comes after it",
        "said in the result",
        ("pipelines.job_warnings: transient.duration: cuts the record at ",),
    ),
)  # fmt: skip

_REDUCTION = (
    Approximation(
        "modes that are left out",
        (
            "reduction.methods.craig_bampton:CraigBampton",
            "reduction.methods.out_of_core:CraigBamptonOutOfCore",
            "reduction.methods.free_interface:FreeInterface",
            "reduction.mode_choice",
        ),
        "dynamic answers between joints; static answers to joint forces and loads are exact",
        "varied by",
        ("estimate", "certificate", "verification"),
    ),
    Approximation(
        "residual vectors",
        ("reduction.methods.residual_vectors",),
        "inertia of the modes that are left out; the finer model has 60 more",
        "varied by",
        ("estimate", "certificate", "verification"),
    ),
    Approximation(
        "static answers of large interfaces without mass",
        ("reduction.methods.flexible_rest",),
        "inertia of what they move; the finer model has more modes beside them",
        "varied by",
        ("estimate", "certificate", "verification"),
    ),
    Approximation(
        "modes of a job without joints",
        ("pipelines.error.estimate",),
        "no estimate is made of a linear run",
        "said in the result",
        ("terminal.lines: not measured against the mesh",),
    ),
    Approximation(
        "modes of a job without damping",
        ("pipelines.error.estimate",),
        "histories part in time whatever the basis",
        "said in the result",
        ("pipelines.error.estimate: without damping histories part in time whatever the basis",),
    ),
    Approximation(
        "contacts that move alike, merged",
        ("timestepping.modal.symmetry",),
        "openings and slips of mirrored gaps, by 1e-6 of the largest jump; the finer model merges too",
        "bounded by test",
        ("timestepping/test_symmetry.py::test_the_same_histories",
         "timestepping/test_symmetry.py::test_what_moves_differently_is_not_merged"),
    ),
    Approximation(
        "eigenpairs of iterations",
        ("linalg.modes.eigen", "linalg.modes.krylov", "linalg.modes.lobpcg"),
        "frequencies, by the square of a residual of 1e-7; modes that are missed are looked for",
        "bounded by test",
        ("linalg/test_solvers.py::test_modes_below_a_frequency_are_those_of_a_sturm_count",
         "linalg/test_solvers.py::test_a_mode_that_was_missed_is_noticed"),
    ),
    Approximation(
        "solutions by multigrid and by factors in single precision",
        ("linalg.multigrid", "linalg.conjugate", "linalg.pardiso", "linalg.condensed"),
        "static answers, by a residual of 1e-10",
        "bounded by test",
        ("linalg/test_ill_conditioned.py::test_every_solver_reaches_the_tolerance",
         "linalg/test_solvers.py::"
         "test_factors_in_single_precision_take_half_the_memory_and_give_the_same_answer"),
    ),
    Approximation(
        "combinations of modes that stress is known of",
        ("reduction.stress",),
        "stress of reduced coordinates, by single precision",
        "bounded by test",
        ("fem/test_stress.py::test_modal_stress_times_coordinates_is_the_meshs_stress",),
    ),
    Approximation(
        "bases that samples of a suite share",
        ("reduction.synthesis",),
        "modes of other levels of water; other moduli and densities are exact",
        "bounded by test",
        ("suite/test_uncertain.py::test_levels_give_the_numbers_of_a_job_but_for_its_basis",
         "suite/test_uncertain.py::test_materials_give_the_numbers_of_a_job_in_which_they_stand"),
    ),
    Approximation(
        "parts without mass",
        ("reduction.methods.massless:Massless", "timestepping.modal.mode_split"),
        "without inertia their answers to unit joint forces and loads are all their motion",
        "exact",
        ("reduction/test_massless.py::test_rock_below_has_no_states_and_all_its_flexibility",
         "reduction/test_massless.py::test_unknowns_without_mass_relax_with_their_own_time"),
    ),
    Approximation(
        "weight, pressure and temperature at rest",
        ("effects.static_loads:static_loads",),
        "their static answers are in the basis",
        "exact",
        ("reduction/test_flexible_rest.py::"
         "test_static_answers_to_joint_forces_and_loads_are_those_of_the_mesh",
         "reduction/test_free_interface.py::test_static_equilibrium_is_that_of_the_mesh"),
    ),
    Approximation(
        "moduli by duration",
        ("effects.sustained_moduli:sustained_moduli",),
        "one modulus at rest and another of what the record adds; answers of both are in the basis",
        "exact",
        ("effects/test_moduli_by_duration.py::"
         "test_state_at_rest_is_that_of_a_job_with_the_sustained_moduli_alone",
         "effects/test_moduli_by_duration.py::test_in_an_elastic_scene_both_states_superpose"),
    ),
    Approximation(
        "Rayleigh damping of materials",
        ("fem.damping", "effects.damping"),
        "C of every material's own K and M on the mesh, projected onto the bases; parts of unlike materials "
        "have coupled modes",
        "exact",
        ("effects/test_damping_by_material.py::"
         "test_pounding_bars_of_three_dampings_move_as_by_scipy",
         "effects/test_damping_by_material.py::test_mass_terms_do_not_brake_what_joints_alone_hold"),
    ),
    Approximation(
        "hysteretic damping of the linear stage",
        ("timestepping.hysteretic:FrequencyDomain",),
        "complex stiffness of each material; the record followed by rest before it comes round again",
        "bounded by test",
        ("effects/test_hysteretic_stage.py::test_bar_of_two_materials_is_that_of_complex_moduli",),
    ),
    Approximation(
        "stages of construction",
        ("effects.construction:construction",),
        "every stage is an equilibrium of the blocks that are there",
        "exact",
        ("fem/test_construction.py::test_column_built_in_lifts_against_built_at_once",),
    ),
)  # fmt: skip

_TIME = (
    Approximation(
        "finest step",
        (
            "timestepping.integrators.adaptive:Adaptive",
            "timestepping.integrators.modal:Modal",
            "timestepping.steps",
        ),
        "joint forces, where contact changes",
        "varied by",
        ("steps",),
    ),
    Approximation(
        "base step",
        ("timestepping.steps", "timestepping.step_control"),
        "forces of joints that stay closed; it is varied where joints carry shear or tension, or are seldom "
        "cut, elsewhere impacts make the error",
        "varied by",
        ("steps",),
    ),
    Approximation(
        "changes of a joint force for which a step is not cut",
        ("timestepping.integrators.adaptive",),
        "at most 0.3 % of the ground's peak velocity, in both runs of a comparison; the error is in what is "
        "stated of the steps, within a factor of two",
        "bounded by test",
        ("error/test_estimate_of_jobs.py::"
         "test_forces_that_change_without_a_cut_are_in_the_stated_error_of_the_steps",),
    ),
    Approximation(
        "joint force constant over a step",
        (
            "timestepping.modal.loop",
            "contact.problem",
            "contact.laws.penalty:Penalty",
            "contact.laws.tension_stiffness:TensionStiffness",
            "contact.laws.shear_stiffness:ShearStiffness",
            "contact.laws.dashpot:Dashpot",
        ),
        "springs and dashpots are taken at a point within the step; impacts lose energy (`energy_contact`)",
        "varied by",
        ("steps",),
    ),
    Approximation(
        "events inside a step",
        (
            "contact.step",
            "contact.softening",
            "contact.laws.coulomb:Coulomb",
            "contact.laws.static_friction:StaticFriction",
            "contact.laws.bond:Bond",
            "contact.laws.shear_key:ShearKey",
        ),
        "a gap that opens, closes, slides or loses strength does so for the whole of the step",
        "varied by",
        ("steps",),
    ),
    Approximation(
        "limits that follow speed, path, pressure or damage within a step",
        (
            "contact.laws.velocity_friction:VelocityFriction",
            "contact.laws.slip_weakening:SlipWeakening",
            "contact.laws.barton_bandis:BartonBandis",
            "contact.laws.fracture:Fracture",
        ),
        "the step has one limit, that of its end or its mean; no speed is regularised",
        "varied by",
        ("steps",),
    ),
    Approximation(
        "end of exponential softening",
        ("contact.laws.fracture",),
        "the curve ends where 1e-10 of strength and energy are left, so that long open cracks carry nothing",
        "bounded by test",
        ("contact/test_fracture.py::test_what_an_exponential_curve_lacks_at_its_end_is_below_1e_10",),
    ),
    Approximation(
        "grouting under pressure",
        ("contact.laws.grouting:Grouting",),
        "the reference of the gaps is where the pressure has pushed the blocks",
        "exact",
        ("fem/test_grouting.py::test_without_other_loads_the_joint_carries_the_pressure",),
    ),
    Approximation(
        "motion of the modes, of rigid and overdamped ones too",
        ("timestepping.modal.propagator", "timestepping.modal.kernels"),
        "each is the exponential of its matrix for loads that are straight over the step",
        "exact",
        ("timestepping/test_propagator.py::test_step_is_the_matrix_exponential",
         "timestepping/test_damped_modes.py::"
         "test_openings_of_strongly_damped_blocks_are_those_of_the_mesh"),
    ),
    Approximation(
        "generalised-alpha's order and numerical damping, reduced",
        ("timestepping.integrators.generalized_alpha:GeneralizedAlpha",),
        "motion of coupled modes; `energy_numerical` is what it takes",
        "varied by",
        ("steps",),
    ),
    Approximation(
        "steps of a run of full order",
        ("timestepping.integrators.generalized_alpha",),
        "no other steps are run",
        "said in the result",
        ("terminal.lines: error not estimated",),
    ),
    Approximation(
        "massless boundary of `conserving`",
        ("timestepping.integrators.conserving:Conserving", "timestepping.modal.massless_boundary"),
        "modes that the step does not resolve follow joint forces alone",
        "said in the result",
        ("postprocess.run_warnings: of the effective mass follow joint forces alone",),
    ),
    Approximation(
        "tolerance of the contact solvers",
        (
            "contact.solvers.state:PivotingState",
            "contact.solvers.state:FrictionalState",
            "contact.solvers.pivoting",
            "contact.solvers.gauss_seidel",
            "contact.solvers.condensation",
            "contact.solvers.newton",
            "contact.solvers.single_contact",
            "contact.solvers.continuation",
        ),
        "joint forces of a step, by `transient.tolerance`; with friction a step may have several solutions",
        "bounded by test",
        ("contact/test_gap_solver.py::test_every_way_alone_finds_the_same_force",
         "contact/test_gap_solver.py::test_frictional_solution_satisfies_the_law",
         "contact/test_gap_solver.py::test_ten_thousand_steps_leave_no_drift_and_no_trace"),
    ),
    Approximation(
        "equilibrium at rest",
        ("timestepping.equilibrium", "timestepping.construction", "timestepping.grouting"),
        "residual forces of the start",
        "bounded by test",
        ("timestepping/test_static_state.py::test_a_run_from_equilibrium_stays_there",),
    ),
    Approximation(
        "energy that is not accounted for",
        ("timestepping.energy",),
        "what the ledger lacks",
        "said in the result",
        ("postprocess.run_warnings: the energy ledger is open by ",),
    ),
)  # fmt: skip

_RESULTS = (
    Approximation(
        "peaks of openings between written rows",
        ("timestepping.peaks",),
        "peaks are those of all steps; of contact points apart from nodes the written ones are raised",
        "bounded by test",
        ("timestepping/test_peaks.py::"
         "test_what_is_reached_between_written_rows_is_added_to_the_written_peaks",
         "timestepping/test_transient_closed_forms.py::test_peaks_see_every_step_and_rows_only_some"),
    ),
    Approximation(
        "peaks of stress between written rows",
        ("postprocess.stress.summary",),
        "stress is that of the written rows; means of joint forces are over all steps",
        "said in the result",
        acts=lambda config: config.outputs.stress is not None,
    ),
    Approximation(
        "spectra of records",
        ("records.spectra",),
        "peaks between the substeps of an oscillator",
        "bounded by test",
        ("records/test_record_measures.py::test_straight_lines_against_the_closed_form",
         "records/test_values_by_hand.py::test_a_step_at_every_period"),
    ),
    Approximation(
        "floor spectra",
        ("postprocess.floor_spectra",),
        "acceleration between base steps is the slope of a spline through velocities; each ordinate has the "
        "difference to a better run",
        "bounded by test",
        ("results/test_floor_spectra.py::"
         "test_spectra_are_those_of_an_independent_oscillator_on_the_written_acceleration",),
    ),
    Approximation(
        "modal combination of the linear stage",
        ("pipelines.linear",),
        "its histories against the whole mesh, its combination by hand",
        "bounded by test",
        ("test_linear_stage.py::test_linear_history_against_newmark_of_the_whole_mesh",
         "test_linear_stage.py::test_spectrum_against_modal_combination_by_hand"),
    ),
    Approximation(
        "single precision of written stress",
        ("results.stress.file",),
        "the last digits of files, 6e-8",
        "bounded by test",
        ("results/test_dataset.py::test_file_reads_back_the_same_with_xarray_alone",),
    ),
)  # fmt: skip

_STATEMENTS = (
    Approximation(
        "what leaving out modes changes in slips, forces and stress, and what steps change in forces and "
        "stress",
        ("error.estimate", "timestepping.step_control"),
        "the estimate is of openings, that of the steps of openings and slips; `romdam certify` states "
        "displacement and energy, `romdam verify` the largest stress",
        "said in the result",
        acts=lambda config: config.model.order == "reduced" and bool(config.every_joint),
    ),
    Approximation(
        "a statement of the steps itself",
        ("error.estimate", "timestepping.step_control"),
        "a quarter of the steps sees nine tenths of their error, and orders between 0.5 and 1.3 are believed",
        "bounded by test",
        ("timestepping/test_friction_events.py::"
         "test_what_is_stated_of_plain_friction_is_not_below_half_of_the_truth",
         "timestepping/test_accuracy_of_closed_joints.py::"
         "test_springs_of_a_joint_that_stays_closed_are_within_the_stated_error"),
    ),
    Approximation(
        "an estimate itself",
        ("error.statement:estimate", "error.estimate"),
        "its finer model is no mesh, and runs while joints move",
        "bounded by test",
        ("error/test_estimate_of_scenes.py::"
         "test_every_case_is_stated_between_half_and_three_times_the_true_error",),
    ),
    Approximation(
        "an estimate of blocks that rock",
        ("error.estimate",),
        "an order of magnitude only",
        "said in the result",
        ("error.estimate: That may be a tenth of the truth, or four times",),
    ),
    Approximation(
        "a certificate itself",
        ("error.statement:certificate", "error.replay", "error.sampled"),
        "the replay has steps of 2.5 ms; without `--full` two windows of the record",
        "bounded by test",
        ("reference/test_certificate_truth.py::"
         "test_certificate_and_estimate_are_within_a_factor_two_of_the_true_error",),
    ),
    Approximation(
        "a verification itself",
        ("error.statement:verification", "error.verification"),
        "the strongest seconds of the record unless `--full`; its sentence names them",
        "said in the result",
        ("error.verification: s of ",),
    ),
    Approximation(
        "order at which meshes are taken to converge",
        ("error.statement:discretisation", "error.discretisation"),
        "the factor from the difference of two meshes to the error; the sentence names it",
        "said in the result",
        ("error.discretisation: of the difference to elements of ",),
    ),
    Approximation(
        "the mesh of runs of a suite",
        ("pipelines.suites",),
        "stated of one record at the largest and the smallest scale",
        "bounded by test",
        ("error/test_mesh_error.py::test_a_suite_states_it_once_at_its_largest_and_smallest_scale",),
    ),
)  # fmt: skip

GROUPS: dict[str, tuple[Approximation, ...]] = {
    "mesh and joints": _MESH,
    "rock, water and supports": _SURROUNDINGS,
    "records": _RECORDS,
    "reduction": _REDUCTION,
    "time": _TIME,
    "results": _RESULTS,
    "statements": _STATEMENTS,
}
APPROXIMATIONS: tuple[Approximation, ...] = tuple(row for rows in GROUPS.values() for row in rows)
