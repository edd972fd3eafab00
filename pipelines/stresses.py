"""Stress of a run: the fields of a model once, the summary of every ground motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.fem.sections import gap_section_operator, modal_section_forces
from romdam.fem.stress import carried_stress, modal_stress, stress_operators, with_carried
from romdam.postprocess.stress.sections import gap_section_forces, section_forces
from romdam.postprocess.stress.summary import StressHistory, StressSummary, summarise
from romdam.reduction.storage.staging import initial_forces, initial_stress
from romdam.reduction.stress import digest_of_stress, stress_factors
from romdam.reduction.synthesis import ReducedModel
from romdam.results.case import water_at_rest
from romdam.results.stress.file import StressFields, kept_stress


def stress_fields(
    scene: Scene, reduced: ReducedModel | None, folder: Path | None = None
) -> dict[str, StressFields]:
    """Stress of every reduced coordinate at stress nodes and on sections; none at full order.

    Parameters
    ----------
    reduced : with the system that is shaken, whose state at rest sustained moduli need
    folder : of results, where an earlier run may have left them
    """
    if reduced is None or scene.stress is None:
        return {}
    basis, operators = reduced.basis, stress_operators(scene)
    sustained = reduced.system.sustained
    rest = None if sustained is None else sustained.rest
    offset = initial_stress(scene, operators, basis, rest)
    sections, initial = modal_section_forces(scene, basis), initial_forces(scene, basis, rest)
    moving = reduced.system.pseudo_static
    carried = {} if moving is None else carried_stress(scene, moving)
    stress_carried = {name: carried_by for name, (carried_by, _) in carried.items()}
    sections = with_carried(sections, {name: carried_by for name, (_, carried_by) in carried.items()})
    made_of = {
        name: digest_of_stress(
            operator, basis[name], name, sites.nodes, offset[name], stress_carried.get(name)
        )
        for (name, sites), operator in zip(scene.stress.blocks.items(), operators.values(), strict=True)
    }
    kept = {} if folder is None else kept_stress(folder, made_of)
    factors = kept or stress_factors(with_carried(modal_stress(operators, basis), stress_carried))
    return {
        name: StressFields(
            scene.stress.blocks[name].nodes,
            *fields,
            offset[name],
            basis[name].columns,
            made_of[name],
            sections[name],
            initial[name],
        )
        for name, fields in factors.items()
    }


def stress_of(
    scene: Scene, fields: Mapping[str, StressFields], history: History
) -> tuple[History, StressSummary | None]:
    """The stress summary of a history, and the history without what was observed for it."""
    if scene.stress is None:
        return history, None
    if history.q is not None:
        coordinates = {name: stress.coordinates(history) for name, stress in fields.items()}
        source = StressHistory(
            fields={name: stress.fields for name, stress in fields.items()},
            coordinates={name: fields[name].combined(q) for name, q in coordinates.items()},
            offset={name: stress.offset for name, stress in fields.items()},
            sections=section_forces(
                (coordinates[name], stress.sections, stress.section_offset) for name, stress in fields.items()
            ),
        )
    else:
        # what was observed: motions of probes, stress of nodes, forces on sections
        probes, nodes = 3 * len(scene.probes), {n: len(s.nodes) for n, s in scene.stress.blocks.items()}
        end = probes + 6 * sum(nodes.values())
        offset = initial_stress(scene, stress_operators(scene), rest=history.rest)
        source = StressHistory.observed(history.disp[:, probes:end], nodes, offset)
        forces = history.disp[:, end:].reshape(len(history.time), -1, 6)
        source = replace(source, sections=forces + sum(initial_forces(scene, rest=history.rest).values()))
        motion = {name: getattr(history, name)[:, :probes] for name in ("disp", "vel", "acc", "node_peaks")}
        history = replace(history, **motion)
    if scene.stress.sections and scene.joints:
        operator = gap_section_operator(scene, history.traction.shape[2])
        water = history.water, water_at_rest(scene, history)
        gaps = gap_section_forces(operator, history.traction, water)
        source = replace(source, sections=source.sections + gaps)
    return history, summarise(scene.stress, source, history.time)
