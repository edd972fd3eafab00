"""One physical model written in other ways: turned about the vertical, in another order, in other units.

Two blocks stand side by side on rock, water presses on their upstream faces and under their bases. What is
asked of the model must not depend on how it is written down.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from romdam.config.sections.job import BoxConfig
from romdam.core.scene import Material
from romdam.geometry.boxes import box_block

Job = dict[str, Any]
STEP = 0.01
_CELLS = {"hex8": "hexahedron", "hex20": "hexahedron20", "tet4": "tetra", "tet10": "tetra10"}
_FACETS = {"hex8": "quad", "hex20": "quad8", "tet4": "triangle", "tet10": "triangle6"}
_FOOT, _POUND = 0.3048, 0.45359237
_POUND_FORCE = _POUND * 9.80665
_UNITS = {  # of a quantity by the name of its key: size [SI], and name
    "length": (_FOOT, "ft"),
    "pressure": (_POUND_FORCE / _FOOT**2, "psf"),
    "density": (_POUND / _FOOT**3, "lbm/ft3"),
    "stiffness": (_POUND_FORCE / _FOOT**3, "psf/ft"),
    "acceleration": (_FOOT, "ft/s2"),
    "frequency": (1.0, "Hz"),
}
_OF_JOINTS = {
    "normal_stiffness": "stiffness", "shear_stiffness": "stiffness", "spacing": "length",
    "cohesion": "pressure", "tensile_strength": "pressure",
}  # fmt: skip


def two_blocks(element: str = "hex8", discretization: str = "", height: float = 8.0) -> Job:
    """Blocks of 4 by 6 m and of 2 by 6 m beside each other on rock, in SI numbers.

    Parameters
    ----------
    element : of all blocks
    discretization : "mortar" with faces that do not meet at nodes, "spacing" or "" of the joints
    """

    def box(x: float, wide: float, z: float, high: float, across: float = 2.0) -> Job:
        sizes = [across, 2.0, high / 4.0 if z >= 0.0 else high / 2.0]
        shape = {"origin": [x, 0.0, z], "size": [wide, 6.0, high], "element_size": sizes}
        return {"box": shape | {"element": element}}

    meets = 1.5 if discretization == "mortar" else 2.0
    joint: Job = {"normal_stiffness": 20e9, "shear_stiffness": 10e9, "friction": 0.75}
    if discretization == "mortar":
        joint["discretization"] = "mortar"
    elif discretization == "spacing":
        joint["spacing"] = 3.0
    wet = [{"block": name, "face": "ymin"} for name in ("left", "right")]
    return {
        "materials": {"concrete": {"E": 25e9, "nu": 0.2, "rho": 2400.0}},
        "blocks": {
            "rock": {"material": "concrete", "mass": False, "weight": False}
            | box(0.0, 6.0, -3.0, 3.0, meets),
            "left": {"material": "concrete"} | box(0.0, 4.0, 0.0, height),
            "right": {"material": "concrete"} | box(4.0, 2.0, 0.0, height - 2.0),
        },
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {
            "between": joint | {"between": ["left", "right"]},
            "base_left": joint | {"between": ["rock", "left"]},
            "base_right": joint | {"between": ["rock", "right"]},
        },
        "loads": {
            "gravity": [0.0, 0.0, -9.81],
            "hydrostatic": [{"level": 5.5, "faces": wet}],
            "joint_water": [
                {
                    "joints": ["base_left", "base_right"],
                    "level": 5.5,
                    "tailwater": 0.5,
                    "downstream": [0.0, 1.0, 0.0],
                }
            ],
        },
        "damping": {"rayleigh": {"frequencies": [8.0, 80.0], "ratio": 0.05}},
        "model": {"modes": 8},
        "transient": {"finest_step": 0.0025},
        "outputs": {"plots": False, "error_estimate": False, "mesh_error": False},
    }


def shaking(seconds: float = 0.6) -> NDArray[np.float64]:
    """(3, nt) acceleration that ends at rest, along x and y [m/s2]."""
    time = np.arange(0.0, seconds + STEP / 2, STEP)
    disp = np.sin(np.pi * time / seconds) ** 6 * np.sin(20.0 * time)
    acc = np.gradient(np.gradient(disp, STEP), STEP)
    acc *= 4.0 / np.abs(acc).max()
    return np.stack([0.5 * acc, acc, 0.0 * acc])


def turn(degrees: float) -> NDArray[np.float64]:
    """Rotation about z, (3, 3)."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turned(raw: Job, degrees: float, folder: Path) -> Job:
    """The model turned about z, its blocks as meshes of files; with an angle of 0 those of the same frame."""
    R, made = turn(degrees), copy.deepcopy(raw)
    folder.mkdir(parents=True, exist_ok=True)
    for name, block in made["blocks"].items():
        box = BoxConfig.model_validate(block.pop("box"))
        mesh = box_block(name, box, Material(1.0, 0.0, 1.0), name)
        cells = [(_CELLS[mesh.element], mesh.cells)]
        cells += [(_FACETS[mesh.element], facets) for facets in mesh.faces.values()]
        numbers = [np.full(len(of), k + 1) for k, (_, of) in enumerate(cells)]
        fields = {"body": np.array([1, 3])} | {
            face: np.array([k + 2, 2]) for k, face in enumerate(mesh.faces)
        }
        path = folder / f"{name}.msh"
        data = {"gmsh:physical": numbers, "gmsh:geometrical": numbers}
        meshio.write(
            path,
            meshio.Mesh(mesh.points @ R.T, cells, cell_data=data, field_data=fields),
            file_format="gmsh22",
            binary=False,
            float_fmt=".17g",
        )
        block["mesh"] = {"file": str(path), "unit": "m", "group": "body"}
    for entry in made["loads"]["joint_water"]:
        entry["downstream"] = (R @ entry["downstream"]).tolist()
    for node in made["outputs"].get("nodes", {}).values():
        node["at"] = (R @ node["at"]).tolist()
    return made


def reordered(raw: Job) -> Job:
    """Blocks and joints named in the reversed order, and each joint from the other side."""
    made = copy.deepcopy(raw)
    for key in ("blocks", "joints"):
        made[key] = {name: made[key][name] for name in reversed(made[key])}
    for joint in made["joints"].values():
        joint["between"] = joint["between"][::-1]
    for entry in made["loads"]["joint_water"]:
        entry["joints"] = entry["joints"][::-1]
    return made


def in_us_units(raw: Job) -> Job:
    """All quantities as texts in feet and pounds."""

    def text(value: Any, kind: str) -> Any:
        if isinstance(value, list):
            return [text(member, kind) for member in value]
        size, name = _UNITS[kind]
        return f"{value / size!r} {name}"

    made = copy.deepcopy(raw)
    for material in made["materials"].values():
        material["E"], material["rho"] = text(material["E"], "pressure"), text(material["rho"], "density")
    for block in made["blocks"].values():
        if "box" in block:
            for key in ("origin", "size", "element_size"):
                block["box"][key] = text(block["box"][key], "length")
    for joint in made["joints"].values():
        for key, kind in _OF_JOINTS.items():
            if key in joint:
                joint[key] = text(joint[key], kind)
    loads = made["loads"]
    loads["gravity"] = text(loads["gravity"], "acceleration")
    for entry in (*loads["hydrostatic"], *loads["joint_water"]):
        for key in ("level", "tailwater"):
            if key in entry:
                entry[key] = text(entry[key], "length")
    for node in made["outputs"].get("nodes", {}).values():
        node["at"] = text(node["at"], "length")
    made["damping"]["rayleigh"]["frequencies"] = text(made["damping"]["rayleigh"]["frequencies"], "frequency")
    return made
