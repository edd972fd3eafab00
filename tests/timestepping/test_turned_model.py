"""A model turned with its ground and its weight moves as before: openings, slips, forces and steps."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import romdam
from romdam.core.motion import GroundMotion
from romdam.results.dataset import SINGLE

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
    "none": {},
}
UPRIGHT = np.radians(37.0) * np.array([0.0, 0.0, 1.0])
SKEW = np.radians(50.0) * np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
AROUND = ((0, 0), (1, 0), (1, 1), (0, 1))


def write_mesh(path, turn):
    """Three columns of 3, 5 and 4 cubes, side by side along x, on a slab of rock; turned, and mirrored."""
    nodes, elements, sets = [], [], []

    def add(name, corners, cubes, foot):
        first = len(nodes) + 1
        number = {corner: first + i for i, corner in enumerate(corners)}
        nodes.extend(turn @ (SIZE * np.array(corner, dtype=float)) for corner in corners)
        around = AROUND if np.linalg.det(turn) > 0.0 else AROUND[::-1]
        each = [[number[x + a, y + b, z + up] for up in (0, 1) for a, b in around] for x, y, z in cubes]
        sets.append((name, len(elements), each, [number[corner] for corner in foot]))
        elements.extend(each)

    for column, height in enumerate((3, 5, 4)):
        corners = list(itertools.product((column, column + 1), (0, 1), range(height + 1)))
        add(f"B{column}", corners, [(column, 0, z) for z in range(height)], [c for c in corners if c[2] == 0])
    corners = list(itertools.product(range(4), (0, 1), (-2, -1, 0)))
    cubes = [(x, 0, z) for x in range(3) for z in (-2, -1)]
    add("ROCK", corners, cubes, [c for c in corners if c[2] == -2])
    lines = ["*NODE"]
    lines += [f"{i}, {x:.17g}, {y:.17g}, {z:.17g}" for i, (x, y, z) in enumerate(nodes, start=1)]
    for name, start, each, foot in sets:
        lines.append(f"*ELEMENT, TYPE=C3D8, ELSET={name}")
        lines += [f"{start + i}, " + ", ".join(map(str, cube)) for i, cube in enumerate(each, start=1)]
        lines += [f"*NSET, NSET=FOOT{name}", ", ".join(map(str, foot))]
    path.write_text("\n".join(lines) + "\n")


def result(folder, turn, laws, slides, transient):
    """Results of the columns held at their feet; or of columns that slide on the rock under their weight."""
    write_mesh(folder / "columns.inp", turn)
    names = ["B0", "B1", "B2", *(["ROCK"] if slides else [])]
    mesh = {"file": str(folder / "columns.inp"), "unit": "m"}
    shear = {"shear_stiffness": 15e9} if laws else {}
    joint = {"normal_stiffness": 30e9, **shear, **laws}
    job = {
        "materials": {"concrete": {"E": 25e9, "nu": 0.2, "rho": 2400}},
        "blocks": {name: {"material": "concrete", "mesh": mesh | {"group": name}} for name in names},
        "supports": [{"block": name, "face": f"FOOT{name}"} for name in (["ROCK"] if slides else names)],
        "joints": {f"j{i}": {"between": [f"B{i}", f"B{i + 1}"], **joint} for i in range(2)},
        "damping": {"rayleigh": {"frequencies": [5, 40], "ratio": 0.05}},
        "model": {"modes": 15},
        "transient": {"tolerance": 1e-12, **transient},
        "outputs": {"output_interval": DT, "plots": False, "error_estimate": False},
    }
    if slides:
        job["joints"] |= {f"base{i}": {"between": ["ROCK", f"B{i}"], **joint} for i in range(3)}
        job["loads"] = {"gravity": (turn @ [0.0, 0.0, -9.81]).tolist()}
    motion = GroundMotion("shaking", np.ascontiguousarray(turn @ SHAKING), DT, {}, ())
    return romdam.run(job, motions=motion).results[0].dataset


def size_of(variable):
    """A variable, or the length of its vectors in the plane of the joint, which have other axes there."""
    return np.linalg.norm(variable.values, axis=-1) if "tangent" in variable.dims else variable.values


def round_off(name):
    """What a turn may change, relative: some histories are written in single precision."""
    return 2e-7 if name in SINGLE else 1e-9


def compare(folder, turn, laws, *, slides=False, transient=None, rows=None):
    transient = transient or {"finest_step": 0.00125}
    straight, turned = (result(folder, each, laws, slides, transient) for each in (np.eye(3), turn))
    for count in ("solver_steps", "solver_refused_steps", "solver_finest_step"):
        assert straight.attrs[count] == turned.attrs[count]
    assert straight.attrs["solver_refused_steps"] > 0.0
    for name in ("opening", "slip", "normal_force", "shear_force"):
        if name in straight:
            one, other = size_of(straight[name])[:rows], size_of(turned[name])[:rows]
            assert np.abs(one).max() > 0.0
            assert np.abs(one - other).max() <= round_off(name) * np.abs(one).max(), name
    return straight, turned


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (name not in ("bond", "friction"))) for name in LAWS],
)
def test_a_turned_model_moves_as_before(tmp_path, name):
    """About the vertical the axes of the joints turn with it, so components are equal, too."""
    straight, turned = compare(tmp_path, Rotation.from_rotvec(UPRIGHT).as_matrix(), LAWS[name])
    for variable in ("slip", "shear_force") if LAWS[name] else ():
        one, other = straight[variable].values, turned[variable].values
        assert np.abs(one - other).max() <= round_off(variable) * np.abs(one).max(), variable


@pytest.mark.parametrize("name", ["friction", pytest.param("static", marks=pytest.mark.slow)])
def test_no_choice_of_axes_in_the_joints_changes_a_run(tmp_path, name):
    """Turned about a skew axis j and k are others within the joint, and one mirrored has them left-handed."""
    turn = Rotation.from_rotvec(SKEW).as_matrix()
    compare(tmp_path, turn, LAWS[name])
    compare(tmp_path, turn @ np.diag([1.0, -1.0, 1.0]), LAWS[name])


def test_columns_that_slide_on_rock(tmp_path):
    """In the first second; from 0.8 s on round-off grows tenfold every fifth of a second, as blocks slide."""
    turn = Rotation.from_rotvec(SKEW).as_matrix()
    compare(tmp_path, turn, LAWS["friction"], slides=True, rows=100)


def test_the_steps_that_an_accuracy_chooses(tmp_path):
    turn = Rotation.from_rotvec(SKEW).as_matrix()
    compare(tmp_path, turn, LAWS["friction"], transient={"accuracy": 0.02})
