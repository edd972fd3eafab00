"""Which of the approximations a job has, by the modules that a row of the table names.

A row that says itself which jobs have it (`acts`) is asked. Any other applies where one of its modules works
for the job; what is not listed here works for every job.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

from romdam.config.effects import EFFECTS, has_viscous_boundary
from romdam.error.approximations import Approximation

if TYPE_CHECKING:
    from romdam.config.job import Config

Needs = Callable[["Config"], bool]
_LAWS = "contact.laws."
_INTEGRATORS = "timestepping.integrators."
_STATEMENTS = "error.statement:"


def _effects(*names: str) -> Needs:
    return lambda config: any(EFFECTS[name].acts(config) for name in names)


def _joints(asks: Callable[..., bool]) -> Needs:
    return lambda config: any(asks(joint) for joint in config.every_joint.values())


def _has_stress(config: Config) -> bool:
    return config.outputs.stress is not None


def _has_mesh_file(config: Config) -> bool:
    return any(block.mesh is not None for block in config.blocks.values())


def _has_mortar(config: Config) -> bool:
    """Mortar joins faces whose nodes differ: where it is named, of mesh files, cuts and unlike boxes."""
    named = {one.discretization for one in config.every_joint.values()}
    named |= {tie.discretization for tie in config.ties.values()}
    boxes = {(block.box.element, block.box.element_size) for block in config.blocks.values() if block.box}
    return "mortar" in named or _has_mesh_file(config) or bool(config.cut) or len(boxes) > 1


def _is_suite(config: Config) -> bool:
    return config.pipeline == "suite"


NEEDS: dict[str, Needs] = {  # module below romdam, or the beginning of its name -> jobs that it works for
    "config.other_mesh": lambda config: config.outputs.mesh_error is not False,
    "geometry.arch_dam": lambda config: config.arch_dam is not None,
    "geometry.boxes": lambda config: False,  # straight edges on arcs are an arch dam's alone
    "geometry.cutting": lambda config: bool(config.cut),
    "geometry.meshes": _has_mesh_file,
    "scene.joints": lambda config: bool(config.every_joint),
    "scene.mortar": _has_mortar,
    "scene.ties": lambda config: bool(config.ties),
    "scene.patches": _joints(lambda joint: joint.spacing is not None),
    "scene.joint_stiffness": _joints(lambda joint: "auto" in joint.law_keys.values()),
    "scene.plausible": _joints(lambda joint: joint.law_keys["fracture"] is not None),
    "scene.stress": _has_stress,
    "scene.temperature": _effects("temperature"),
    "scene.strength_field": _joints(lambda joint: joint.field is not None),
    "scene.reservoir": _effects("incompressible water"),
    "scene.joint_water": _effects("water in joints"),
    "scene.points": _effects("anchors", "dampers", "masses"),
    "fem.gaps": lambda config: bool(config.every_joint),
    "fem.stress": _has_stress,
    "fem.absorbing": has_viscous_boundary,
    "fem.column": _effects("free field"),
    "fem.water": _effects("incompressible water", "compressible water"),
    "fem.water.prism": _effects("incompressible water"),
    "effects.damping": has_viscous_boundary,
    "effects.free_field": _effects("free field"),
    "effects.added_mass": _effects("Westergaard's added mass", "incompressible water", "compressible water"),
    "effects.channel": _effects("compressible water"),
    "effects.compressible_water": _effects("compressible water"),
    "effects.moving_supports": _effects("moving supports", "motion along"),
    "effects.force_histories": _effects("force histories"),
    "effects.attachments": _effects("anchors", "dampers", "masses"),
    "effects.sustained_moduli": _effects("moduli by duration"),
    "effects.construction": _effects("staged construction"),
    "records.processing.support_motions": _effects("moving supports", "motion along"),
    "records.processing.force_rows": _effects("force histories"),
    "records.processing.correction": lambda config: any(bool(one.correction) for one in config.records),
    "records.spectra": lambda config: False,  # of records, not of a run
    "reduction": lambda config: config.model.order == "reduced",
    "reduction.stress": lambda config: config.model.order == "reduced" and _has_stress(config),
    "reduction.synthesis": _is_suite,
    "timestepping.uplift": _effects("water in joints"),
    "timestepping.construction": _effects("staged construction"),
    "timestepping.grouting": _effects("grouting"),
    "timestepping.peaks": lambda config: bool(config.every_joint),
    "contact": lambda config: bool(config.every_joint),
    "error.mesh_stress": _has_stress,
    "postprocess.floor_spectra": lambda config: config.outputs.floor_spectra is not None,
    "results.stress": _has_stress,
    "pipelines.automatic_spacing": _joints(lambda joint: joint.spacing is not None),
    "pipelines.linear": lambda config: config.linear_stage is not None,
    "pipelines.suites": _is_suite,
}


def applies(row: Approximation, config: Config, integrator: str, statements: Collection[str]) -> bool:
    """Tell whether a run has an approximation.

    Parameters
    ----------
    config : of the run
    integrator : that it was integrated with
    statements : kinds of the statements of error that it has
    """
    if row.acts is not None:
        return row.acts(config)
    if named := [place.removeprefix(_STATEMENTS) for place in row.where if place.startswith(_STATEMENTS)]:
        return any(kind in statements for kind in named)
    return any(_works(place.partition(":")[0], config, integrator) for place in row.where)


def _works(module: str, config: Config, integrator: str) -> bool:
    """Tell whether a module works for a run; the longest beginning of its name that is listed decides."""
    if module.startswith(_INTEGRATORS):
        return module.removeprefix(_INTEGRATORS) == integrator
    if module.startswith(_LAWS):
        module_of_law = f"romdam.{module}"
        laws = {law.__module__ for joint in config.every_joint.values() for law in joint.every_law}
        return module_of_law in laws
    known = [start for start in NEEDS if module == start or module.startswith(f"{start}.")]
    return NEEDS[max(known, key=len)](config) if known else True
