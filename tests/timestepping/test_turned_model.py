"""A model and its ground turned by 37 degrees about z move as before: openings, slips, forces and steps."""

import itertools

import numpy as np
import pytest

import romdam
from romdam.core.motion import GroundMotion

DT, SIZE = 0.01, 4.0
TIME = np.arange(0.0, 2.0, DT)
ENVELOPE = np.sin(np.pi * TIME / 2.0) ** 2
SHAKING = np.stack(
    [
        5.0 * ENVELOPE * np.sin(2.0 * np.pi * 2.3 * TIME),
        3.0 * ENVELOPE * np.sin(2.0 * np.pi * 3.1 * TIME + 1.0),
        1.5 * ENVELOPE * np.sin(2.0 * np.pi * 4.7 * TIME),
    ]
)
LAWS = {
    "friction": {"friction": 0.5},
    "bond": {"friction": 0.4, "tensile_strength": 2e4, "cohesion": 4e4},
    "static": {"friction": 0.3, "friction_static": 0.5},
}


def turn(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def written_mesh(path, angle):
    """Three columns of 3, 5 and 4 cubes, side by side along x, turned about z."""
    nodes, elements, sets = [], [], []
    for column, height in enumerate((3, 5, 4)):
        corners = list(itertools.product((0, 1), (0, 1), range(height + 1)))
        first = len(nodes) + 1
        number = {corner: first + i for i, corner in enumerate(corners)}
        nodes += [turn(angle) @ (SIZE * np.array([x + column, y, z], dtype=float)) for x, y, z in corners]
        around = ((0, 0), (1, 0), (1, 1), (0, 1))
        each = [[number[x, y, z + up] for up in (0, 1) for x, y in around] for z in range(height)]
        sets.append((column, len(elements), each, [number[x, y, 0] for x, y in around]))
        elements += each
    lines = ["*NODE"]
    lines += [f"{i}, {x:.17g}, {y:.17g}, {z:.17g}" for i, (x, y, z) in enumerate(nodes, start=1)]
    for column, start, each, base in sets:
        lines.append(f"*ELEMENT, TYPE=C3D8, ELSET=B{column}")
        lines += [f"{start + i}, " + ", ".join(map(str, one)) for i, one in enumerate(each, start=1)]
        lines += [f"*NSET, NSET=FOOT{column}", ", ".join(map(str, base))]
    path.write_text("\n".join(lines) + "\n")


def result(folder, angle, laws):
    written_mesh(folder / "columns.inp", angle)
    joint = {"normal_stiffness": 30e9, "shear_stiffness": 15e9, **laws}
    job = {
        "materials": {"concrete": {"E": 25e9, "nu": 0.2, "rho": 2400}},
        "blocks": {
            f"b{i}": {"material": "concrete", "mesh": {"file": "columns.inp", "group": f"B{i}", "unit": "m"}}
            for i in range(3)
        },
        "supports": [{"block": f"b{i}", "face": f"FOOT{i}"} for i in range(3)],
        "joints": {f"j{i}": {"between": [f"b{i}", f"b{i + 1}"], **joint} for i in range(2)},
        "damping": {"rayleigh": {"frequencies": [5, 40], "ratio": 0.05}},
        "model": {"modes": 15},
        "transient": {"finest_step": 0.00125},
        "outputs": {"output_interval": DT, "plots": False, "error_estimate": False},
    }
    motion = GroundMotion("shaking", turn(angle) @ SHAKING, DT, {}, ())
    return romdam.run(romdam.load_config(job, folder=folder), motions=motion).results[0].dataset


@pytest.mark.parametrize("name", LAWS)
def test_a_turned_model_moves_as_before(tmp_path, name):
    straight, turned = (result(tmp_path, np.radians(angle), LAWS[name]) for angle in (0.0, 37.0))
    for count in ("solver_steps", "solver_refused_steps"):
        assert straight.attrs[count] == turned.attrs[count]
    assert straight.attrs["solver_refused_steps"] > 0.0
    for variable in ("opening", "slip", "normal_force", "shear_force"):
        one, other = straight[variable].values, turned[variable].values
        assert np.abs(one).max() > 0.0
        assert np.abs(one - other).max() <= 1e-9 * np.abs(one).max(), variable
