"""`romdam info` of a response-spectrum analysis: lines, and a document for `--json`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from romdam.core.printable import one_line

if TYPE_CHECKING:
    import xarray as xr

_SHOWN = 5  # modes that a line names


def spectrum_lines(dataset: xr.Dataset) -> list[str]:
    """Describe a response-spectrum analysis: its making, modes, and largest values of every place.

    Values are those at rest and what the ground adds, with the sign that makes them largest.
    """
    document = spectrum_document(dataset, None)
    attrs, modes = dataset.attrs, document["modes"]
    frequencies = ", ".join(f"{freq:.4g}" for freq in document["frequencies_Hz"][:_SHOWN])
    more = ", ..." if modes > _SHOWN else ""
    shares = ", ".join(
        f"{axis} {share:.3g} %" for axis, share in document["modal_mass_shares_percent"].items()
    )
    rigid = ", ".join(f"{axis} {acc:.3g}" for axis, acc in document["rigid_acceleration_m_s2"].items())
    lines = [
        str(attrs["title"]),
        f"record         {attrs['record']}, response spectrum {attrs['spectrum']}",
        f"configuration  {attrs['configuration_file']}, SHA-256 {str(attrs['configuration_sha256'])[:12]}",
        f"combination    modes by {attrs['combination']}, directions by {attrs['directions']}, joints tied",
        f"modes          {modes} below {float(attrs['cutoff_hz']):g} Hz: {frequencies}{more} Hz",
        f"modal mass     {shares} of what is shaken; what is stiffer follows statically, {rigid} m/s²",
    ]
    for name, node in document["nodes"].items():
        largest = ", ".join(f"{axis} {1e3 * u:.4g}" for axis, u in node["largest_displacement_m"].items())
        lines.append(f"displacement   {name}: {largest} mm at most, either sign")
    if (stress := document["stress"]) is not None:
        x, y, z = stress["position_m"]
        lines.append(
            f"stress         {1e-6 * stress['largest_principal_Pa']:.4g} MPa at most outside the ring, in "
            f"{stress['block']} at ({x:.4g}, {y:.4g}, {z:.4g}) m, tension > 0"
        )
    for name, joint in document["joints"].items():
        lines.append(
            f"joint          {name}: tension {1e-6 * joint['largest_tension_Pa']:.4g} MPa at most, over "
            f"{joint['tension_share_percent']:.3g} % of its area; normal force "
            f"{1e-6 * joint['static_normal_force_N']:.4g} MN at rest, "
            f"{1e-6 * joint['peak_normal_force_N']:.4g} MN more or less by the ground, tension > 0"
        )
    for name, section in document["sections"].items():
        force, moment = (1e-6 * np.array(section[key]) for key in ("peak_force_N", "peak_moment_N_m"))
        lines.append(
            f"section        {name}: by the ground ({', '.join(f'{value:.4g}' for value in force)}) MN, "
            f"({', '.join(f'{value:.4g}' for value in moment)}) MN m, either sign"
        )
    lines.append(f"written        {attrs.get('date_created', 'at an unknown time')} by {attrs['source']}")
    lines += [f"warning        {text}" for text in document["warnings"]]
    return [one_line(line) for line in lines]  # a text of the file makes no line of its own


def spectrum_document(dataset: xr.Dataset, path: Path | None) -> dict[str, Any]:
    """A response-spectrum analysis; keys have the units of their values.

    Parameters
    ----------
    path : of its file
    """
    from romdam.postprocess.record_measures import stated_warnings

    attrs = dataset.attrs
    return {
        "result": path,
        "title": attrs["title"],
        "record": attrs["record"],
        "configuration_file": attrs["configuration_file"],
        "configuration_sha256": attrs["configuration_sha256"],
        "spectrum": attrs["spectrum"],
        "combination": attrs["combination"],
        "directions": attrs["directions"],
        "cutoff_Hz": attrs["cutoff_hz"],
        "modes": dataset.sizes["mode"],
        "frequencies_Hz": dataset.frequency.values.tolist(),
        "damping_ratios": dataset.damping_ratio.values.tolist(),
        "modal_mass_shares_percent": _by_name(dataset, "direction", "modal_mass_share"),
        "rigid_acceleration_m_s2": _by_name(dataset, "direction", "rigid_acceleration"),
        "nodes": {
            str(name): {"largest_displacement_m": _largest_displacement(dataset.sel(node=name))}
            for name in (dataset.node.values if "peak_displacement" in dataset else ())
        },
        "stress": _stress(dataset),
        "joints": {
            str(name): {
                "largest_tension_Pa": float(dataset.max_joint_tension.sel(joint=name)),
                "tension_share_percent": float(dataset.joint_tension_share.sel(joint=name)),
                "static_normal_force_N": float(dataset.static_normal_force.sel(joint=name)),
                "peak_normal_force_N": float(dataset.peak_normal_force.sel(joint=name)),
            }
            for name in (dataset.joint.values if "max_joint_tension" in dataset else ())
        },
        "sections": {
            str(name): {
                "peak_force_N": dataset.peak_section_force.sel(section=name).values.tolist(),
                "peak_moment_N_m": dataset.peak_section_moment.sel(section=name).values.tolist(),
            }
            for name in (dataset.section.values if "peak_section_force" in dataset else ())
        },
        "warnings": stated_warnings(attrs),
        "written": attrs.get("date_created"),
        "by": attrs["source"],
    }


def _by_name(dataset: xr.Dataset, dim: str, variable: str) -> Mapping[str, float]:
    names, values = dataset[dim].values, dataset[variable].values
    return {str(name): float(value) for name, value in zip(names, values, strict=True)}


def _largest_displacement(node: xr.Dataset) -> Mapping[str, float]:
    largest = np.abs(node.static_displacement.values) + node.peak_displacement.values
    return {axis: float(value) for axis, value in zip("xyz", largest, strict=True)}


def _stress(dataset: xr.Dataset) -> dict[str, Any] | None:
    """The largest principal stress outside the ring; None where none is known there."""
    if "max_principal_stress" not in dataset or (dataset.stress_ring.values != 0).all():
        return None
    outside = np.where(dataset.stress_ring.values == 0, dataset.max_principal_stress.values, -np.inf)
    worst = int(outside.argmax())
    return {
        "largest_principal_Pa": float(outside[worst]),
        "block": str(dataset.stress_block.values[worst]),
        "position_m": dataset.stress_position.values[worst].tolist(),
    }
