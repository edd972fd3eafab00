"""A response-spectrum analysis of a reduced structure without gaps, as a Dataset.

Peaks of what the ground adds have both signs; static values are those of the loads at rest. Tension is
positive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.core.motion import AXES
from romdam.core.scene import Scene, StressSites
from romdam.core.system import System
from romdam.postprocess.response_spectrum import ModalPeaks, Spectrum, largest_normal_stress
from romdam.postprocess.stress.faces import PERCENTILES, area_percentiles
from romdam.postprocess.stress.sections import AXES as SECTION_AXES
from romdam.postprocess.stress.summary import COMPONENTS, principal_stresses, stress_along
from romdam.results.checking import check_spectrum
from romdam.results.dataset import open_netcdf
from romdam.results.joint_traction import JointTraction, joint_traction
from romdam.results.stress.file import StressFields


def open_spectrum(path: Path) -> xr.Dataset | None:
    """Open a response-spectrum analysis lazily, once it is known to be one; None for another kind of file.

    Raises
    ------
    ResultError
        where there is no such file, or it is damaged.
    """
    dataset, known = open_netcdf(path)
    if "spectral_acceleration" not in dataset:
        dataset.close()
        return None
    try:
        check_spectrum(dataset, known, path)
    except ResultError:
        dataset.close()
        raise
    return dataset


@dataclass(frozen=True)
class SpectrumModel:
    """What a response is computed from.

    Attributes
    ----------
    scene : with its joints, which are tied in what follows
    static : (n,) reduced coordinates at rest
    observe : (3 p, n) displacement of the output nodes
    stress : block name -> stress at its stress nodes
    traction : across the joints; None without joints
    """

    scene: Scene
    static: Floats
    observe: Floats
    stress: Mapping[str, StressFields]
    traction: JointTraction | None


def structure_of(
    scene: Scene,
    system: System,
    stress: Mapping[str, StressFields],
    at_joints: Mapping[str, StressFields] | None,
    begins: str,
) -> SpectrumModel:
    """The structure of a diagonal system without gaps.

    Parameters
    ----------
    at_joints : stress at the nodes of `joint_sites`; None without joints
    begins : "static" under the loads at rest, or "undeformed"
    """
    static = np.zeros(system.size) if begins == "undeformed" else system.force / system.K.diagonal()
    traction = None if at_joints is None else joint_traction(scene, at_joints, system.size)
    return SpectrumModel(scene, static, system.observe[system.of_probes].toarray(), stress, traction)


def spectrum_dataset(
    structure: SpectrumModel, spectrum: Spectrum, peaks: ModalPeaks, total_mass: Floats
) -> xr.Dataset:
    """Gather modes, displacements, stress, tractions and section forces.

    Parameters
    ----------
    total_mass : (3,) of all that is shaken [kg]
    """
    dataset, sites = _modes(spectrum, total_mass), structure.scene.stress
    if structure.scene.probes:
        dataset = dataset.merge(_displacement(structure, peaks), combine_attrs="drop_conflicts")
    if sites is not None:
        dataset = dataset.merge(_stress(structure, sites, peaks), combine_attrs="drop_conflicts")
    if structure.traction is not None:
        dataset = dataset.merge(
            _tractions(structure, structure.traction, peaks), combine_attrs="drop_conflicts"
        )
    return dataset


def _variable(dims: str | tuple[str, ...], values: Any, units: str, text: str) -> xr.Variable:
    return xr.Variable(dims, values, ({"units": units} if units else {}) | {"long_name": text})


def _modes(spectrum: Spectrum, total_mass: Floats) -> xr.Dataset:
    mass = spectrum.load**2
    of_mode = ("mode", "direction")
    share = np.divide(mass.sum(axis=0), total_mass, out=np.zeros(3), where=total_mass > 0.0)
    return xr.Dataset(
        {
            "frequency": _variable("mode", spectrum.freq, "Hz", "natural frequency, joints tied"),
            "damping_ratio": _variable("mode", spectrum.damping, "1", "damping ratio of the mode"),
            "participation": _variable(
                of_mode, spectrum.load, "kg0.5", "phi^T M r of the mode, whose modal mass is 1"
            ),
            "effective_mass": _variable(of_mode, mass, "kg", "effective modal mass"),
            "total_mass": _variable(
                "direction", total_mass, "kg", "mass of all that is shaken, with the added mass"
            ),
            "modal_mass_share": _variable(
                "direction", 100.0 * share, "%", "share of total_mass that the effective masses sum to"
            ),
            "spectral_acceleration": _variable(
                of_mode, spectrum.sa.T, "m s-2", "spectral acceleration at the mode"
            ),
            "rigid_acceleration": _variable(
                "direction", spectrum.zpa, "m s-2", "acceleration that what is stiffer follows statically"
            ),
        },
        {
            "mode": _variable("mode", np.arange(1, len(spectrum.freq) + 1), "1", "mode"),
            "direction": _variable("direction", list(AXES), "", "direction of the ground"),
        },
    )


def _displacement(structure: SpectrumModel, peaks: ModalPeaks) -> xr.Dataset:
    shape = (len(structure.scene.probes), 3)
    dims = ("node", "component")
    rest = (structure.observe @ structure.static).reshape(shape)
    added = peaks.combined(structure.observe).reshape(shape)
    each = peaks.by_direction(structure.observe).reshape(3, *shape)
    return xr.Dataset(
        {
            "static_displacement": _variable(dims, rest, "m", "displacement of the loads at rest"),
            "peak_displacement": _variable(dims, added, "m", "peak of what the ground adds, of both signs"),
            "peak_displacement_by_direction": _variable(
                ("direction", *dims), each, "m", "the same of one direction of the ground"
            ),
        },
        {
            "node": _variable("node", [probe.name for probe in structure.scene.probes], "", "output node"),
            "component": _variable("component", list(AXES), "", "global axis"),
        },
    )


def _stress(structure: SpectrumModel, sites: StressSites, peaks: ModalPeaks) -> xr.Dataset:
    scene, of_blocks = structure.scene, list[dict[str, Floats]]()
    for name, nodes in sites.blocks.items():
        if not len(nodes.nodes):  # a section cuts it, and no stress of it is asked for
            continue
        stress = structure.stress[name]
        q = structure.static[stress.columns]
        static = stress.fields @ (stress.combinations @ q) + stress.offset
        on_modes = ModalPeaks(
            np.einsum("rm,dmc->drc", stress.combinations, peaks.columns[:, stress.columns]),
            peaks.correlation,
            peaks.directions,
        )
        values: dict[str, Floats] = {
            "static_stress": static,
            "peak_stress": on_modes.combined(np.vstack(list(stress.fields))).reshape(-1, 6),
            "static_principal_stress": principal_stresses(static)[:, 0],
            "max_principal_stress": largest_normal_stress(
                static, on_modes.covariance(stress.fields), peaks.directions
            ),
        }
        for measure, axes in (("vertical", nodes.up), ("arch", nodes.arch)):
            weights = stress_along(np.eye(6)[:, None], axes[None]).T  # (k, 6)
            rest = (static * weights).sum(axis=1)
            added = on_modes.combined(np.einsum("kc,kcr->kr", weights, stress.fields))
            values[f"max_{measure}_stress"], values[f"min_{measure}_stress"] = rest + added, rest - added
        of_blocks.append(values)
    node = "stress_node"
    joined = {key: np.concatenate([values[key] for values in of_blocks]) for key in of_blocks[0]}
    texts = {
        "static_stress": "stress tensor of the loads at rest, tension positive",
        "peak_stress": "peak of each component of what the ground adds, of both signs; not of one instant",
        "static_principal_stress": "major principal stress of the loads at rest",
        "max_principal_stress": "largest normal stress along any direction, at rest and by the ground",
        "max_vertical_stress": "cantilever stress at rest and by the ground, largest",
        "min_vertical_stress": "cantilever stress at rest and by the ground, smallest",
        "max_arch_stress": "arch stress at rest and by the ground, largest",
        "min_arch_stress": "arch stress at rest and by the ground, smallest",
    }
    variables = {
        key: _variable((node, "stress_component") if values.ndim == 2 else node, values, "Pa", texts[key])
        for key, values in joined.items()
    }
    counted = np.concatenate([nodes.counted for nodes in sites.blocks.values()])
    variables["stress_ring"] = _variable(
        node, (~counted).astype(np.int8), "1", "whether the node lies in the ring, which headlines leave out"
    )
    largest = joined["max_principal_stress"]
    if sites.strength is not None:
        text = "max_principal_stress over the tensile strength"
        variables["demand_capacity_ratio"] = _variable(node, largest / sites.strength, "1", text)
    coordinates = {
        "stress_block": _variable(
            node,
            np.concatenate([np.full(len(n.nodes), name) for name, n in sites.blocks.items()]),
            "",
            "block of the stress node",
        ),
        "stress_node_number": _variable(
            node, np.concatenate([n.nodes for n in sites.blocks.values()]), "1", "node number in its block"
        ),
        "stress_position": _variable(
            (node, "component"),
            np.concatenate([scene.blocks[name].points[n.nodes] for name, n in sites.blocks.items()]),
            "m",
            "position of the stress node",
        ),
        "stress_component": _variable("stress_component", list(COMPONENTS), "", "component of the tensor"),
    }
    dataset = xr.Dataset(variables, coordinates)
    dataset = dataset.merge(_faces(sites, largest, counted), combine_attrs="drop_conflicts")
    return dataset.merge(_sections(structure, sites, peaks), combine_attrs="drop_conflicts")


def _faces(sites: StressSites, largest: Floats, counted: Floats) -> xr.Dataset:
    """Percentiles of whole faces outside the ring, and what exceeds the strength of them."""
    if not sites.faces:
        return xr.Dataset()
    counts = [len(nodes.nodes) for nodes in sites.blocks.values()]
    first = dict(zip(sites.blocks, np.cumsum([0, *counts])[:-1], strict=True))
    stress, ratio, share = [], [], []
    for face in sites.faces:
        rows = first[face.block] + face.rows
        outside = counted[rows]
        values, area = largest[rows][outside], face.area[outside]
        stress.append(area_percentiles(values, area, PERCENTILES))
        if sites.strength is not None:
            ratio.append(values.max() / sites.strength if len(values) else np.nan)
            over = area @ (values > sites.strength)
            share.append(100.0 * over / area.sum() if area.sum() else np.nan)
    of_face = "stress_face"
    variables = {
        "face_principal_stress": _variable(
            (of_face, "area_percentile"),
            stress,
            "Pa",
            "max_principal_stress, not exceeded on area_percentile of the face outside the ring",
        )
    }
    if sites.strength is not None:
        variables["face_demand_capacity_ratio"] = _variable(
            of_face, ratio, "1", "largest demand-capacity ratio outside the ring"
        )
        variables["face_overstressed_share"] = _variable(
            of_face, share, "%", "share of the area outside the ring that exceeds the strength"
        )
    return xr.Dataset(
        variables,
        {
            of_face: _variable(of_face, [face.name for face in sites.faces], "", "name of the face"),
            "area_percentile": _variable(
                "area_percentile", PERCENTILES, "%", "share of a face's area outside the ring"
            ),
        },
    )


def _sections(structure: SpectrumModel, sites: StressSites, peaks: ModalPeaks) -> xr.Dataset:
    if not sites.sections:
        return xr.Dataset()
    count, size = len(sites.sections), len(structure.static)
    rows, offset = np.zeros((count, 6, size)), np.zeros((count, 6))
    for stress in structure.stress.values():
        rows[..., stress.columns] += stress.sections
        offset += stress.section_offset
    rest = rows @ structure.static + offset
    added = peaks.combined(rows.reshape(-1, size)).reshape(count, 6)
    variables = {}
    for name, part, units in (("force", slice(0, 3), "N"), ("moment", slice(3, 6), "N m")):
        dims = ("section", "section_axis")
        text = f"{name} on the section, as in results of runs"
        variables[f"static_section_{name}"] = _variable(dims, rest[:, part], units, f"{text}, at rest")
        variables[f"peak_section_{name}"] = _variable(
            dims, added[:, part], units, f"{text}, peak of what the ground adds, of both signs"
        )
    return xr.Dataset(
        variables,
        {
            "section": _variable("section", [s.name for s in sites.sections], "", "name of the section"),
            "section_axis": _variable(
                "section_axis", list(SECTION_AXES), "", "normal, and two axes in the plane"
            ),
        },
    )


def _tractions(structure: SpectrumModel, traction: JointTraction, peaks: ModalPeaks) -> xr.Dataset:
    joints, size = list(structure.scene.joints.values()), len(structure.static)
    rest = traction.rows @ structure.static + traction.offset
    added = peaks.combined(traction.rows.reshape(-1, size)).reshape(-1, 3)
    area = np.concatenate([joint.area for joint in joints])
    opens = rest[:, 0] + added[:, 0] > 0.0
    of_joint, first = list[slice](), 0
    for joint in joints:
        of_joint.append(slice(first, first + len(joint.area)))
        first = of_joint[-1].stop
    normal = np.array([area[of] @ traction.rows[of, 0] for of in of_joint])
    return xr.Dataset(
        {
            "static_traction": _variable(
                ("gap", "gap_axis"), rest, "Pa", "traction across the tied joint of the loads at rest"
            ),
            "peak_traction": _variable(
                ("gap", "gap_axis"), added, "Pa", "peak of what the ground adds, of both signs"
            ),
            "max_joint_tension": _variable(
                "joint",
                [(rest[of, 0] + added[of, 0]).max() for of in of_joint],
                "Pa",
                "largest normal traction, at rest and by the ground; tension would open the joint",
            ),
            "static_normal_force": _variable(
                "joint", [area[of] @ rest[of, 0] for of in of_joint], "N", "normal force at rest, tension > 0"
            ),
            "peak_normal_force": _variable(
                "joint", peaks.combined(normal), "N", "peak of what the ground adds to it, of both signs"
            ),
            "joint_tension_share": _variable(
                "joint",
                [100.0 * (area[of] @ opens[of]) / area[of].sum() for of in of_joint],
                "%",
                "share of the joint's area that is in tension at its own peak",
            ),
        },
        {
            "gap_axis": _variable("gap_axis", ["normal", "j", "k"], "", "axis of the gap"),
            "gap_joint": _variable(
                "gap",
                np.concatenate([np.full(len(joint.area), joint.name) for joint in joints]),
                "",
                "joint of the gap",
            ),
            "gap_position": _variable(
                ("gap", "component"), structure.scene.gap_position, "m", "position of the gap"
            ),
            "joint": _variable("joint", [joint.name for joint in joints], "", "name of the joint"),
        },
    )


def tension_over_time(structure: SpectrumModel, q: Floats) -> xr.Dataset:
    """Largest normal traction and force of every joint over a history of the reduced coordinates.

    Parameters
    ----------
    q : (nt, n)
    """
    if structure.traction is None:
        return xr.Dataset()
    joints, tension, force, share = list(structure.scene.joints.values()), [], [], []
    first = 0
    for joint in joints:
        rows = slice(first, first + len(joint.area))
        normal = structure.traction.rows[rows, 0] @ q.T + structure.traction.offset[rows, :1]  # (gaps, nt)
        largest = normal.max(axis=1)
        tension.append(largest.max())
        force.append((joint.area @ normal).max())
        share.append(100.0 * (joint.area @ (largest > 0.0)) / joint.area.sum())
        first = rows.stop
    return xr.Dataset(
        {
            "history_max_joint_tension": _variable(
                "joint", tension, "Pa", "largest normal traction of the linear time history"
            ),
            "history_max_normal_force": _variable(
                "joint", force, "N", "largest normal force of the linear time history, tension positive"
            ),
            "history_joint_tension_share": _variable(
                "joint", share, "%", "share of the joint's area that is in tension at some time"
            ),
        },
        {"joint": [joint.name for joint in joints]},
    )
