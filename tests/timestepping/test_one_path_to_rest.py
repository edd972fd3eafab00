"""The state at rest of two monoliths on rock is one, whatever the axes, the order of names, and the water."""

import copy
import json
import re
from pathlib import Path

import numpy as np
import pytest

import romdam
from romdam.core.motion import GroundMotion
from romdam.postprocess.stability import joint_stability

STILL = GroundMotion.from_arrays("still", {"y": [0.0] * 5}, 0.01)
SIZE, GRAVITY = 2.0, [0.0, 0.0, -9.81]
SOFT = {"tensile_strength": 1e5, "energy": 20.0, "cohesion": 2e5, "shear_energy": 60.0}
AROUND = ((0, 0), (1, 0), (1, 1), (0, 1))


def write_mesh(path, degrees):
    """Blocks a and b of 2 by 4 cubes, 4 and 3 high, side by side along x on rock r, turned about z."""
    turn = np.radians(degrees)
    c, s = np.cos(turn), np.sin(turn)
    lines, elements, number, sets = ["*NODE"], [], {}, {}

    def node(block, corner):
        if (block, corner) not in number:
            number[block, corner] = len(number) + 1
            x, y, z = SIZE * np.array(corner, dtype=float)
            lines.append(f"{len(number)}, {c * x - s * y:.17g}, {s * x + c * y:.17g}, {z:.17g}")
        return number[block, corner]

    for name, xs, zs in (("A", (0, 2), (0, 4)), ("B", (2, 4), (0, 3)), ("R", (0, 4), (-2, 0))):
        elements.append(f"*ELEMENT, TYPE=C3D8, ELSET={name}")
        for x in range(*xs):
            for y in range(4):
                for z in range(*zs):
                    cube = [node(name, (x + a, y + b, z + up)) for up in (0, 1) for a, b in AROUND]
                    sets.setdefault(name, []).append(cube)
                    elements.append(f"{sum(map(len, sets.values()))}, " + ", ".join(map(str, cube)))
    for name in ("A", "B"):
        face = [n for (block, corner), n in number.items() if block == name and corner[1] == 0]
        elements += [f"*NSET, NSET=WET{name}", ", ".join(map(str, face))]
    foot = [n for (block, corner), n in number.items() if block == "R" and corner[2] == -2]
    elements += ["*NSET, NSET=FOOT", ", ".join(map(str, foot))]
    path.write_text("\n".join([*lines, *elements]) + "\n")


def change_to(raw, kind, degrees):
    """Make the scene that is named of the plain one."""
    joints, loads = raw["joints"], raw["loads"]
    bases = [joints["fa"], joints["fb"]]
    downstream = [-np.sin(np.radians(degrees)), np.cos(np.radians(degrees)), 0.0]
    water = {"joints": ["fa", "fb"], "level": 5.0, "tailwater": 0.5, "downstream": downstream}
    cooled = [{"change": -6.0, "blocks": ["a", "b"]}]
    stages = [{"name": "poured", "pour": ["a", "b"]}, {"name": "cooled", "temperature": cooled}]
    if "softening" in kind:
        joints["j"]["fracture"] = SOFT
    if "bonds" in kind:
        for joint in joints.values():
            joint |= {"tensile_strength": 5e4, "cohesion": 1e5}
    if "static friction" in kind:
        for joint in joints.values():
            joint["friction_static"] = joint["friction"] + 0.2
    if "weakening" in kind:
        joints["j"]["slip_weakening"] = {"mu_s": 0.7, "mu_d": 0.4, "d_c": 1e-4}
        del joints["j"]["friction"]
    if "keys" in kind:
        joints["j"]["shear_key"] = {"depth": 0.002}
    if "spacing" in kind:
        for joint in joints.values():
            joint["spacing"] = 2.7
    if "mortar" in kind:
        for joint in joints.values():
            joint["discretization"] = "mortar"
    if "gaps" in kind:
        joints["j"]["gap"] = 1e-4
    if "uplift" in kind:
        loads["joint_water"] = [water]
    if "redrawn" in kind:
        loads["joint_water"] = [water | {"crack": "redrawn"}]
        loads["hydrostatic"][0]["level"] = loads["joint_water"][0]["level"] = 7.0
    if "grouting" in kind:
        joints["j"]["grouting_pressure"] = 2e5
        for base in bases:  # before weight nothing else holds the blocks against it
            base |= {"tensile_strength": 2e6, "cohesion": 2e6}
        loads["temperature"] = cooled
    if "stages" in kind:
        loads["temperature"] = []
        raw["construction"] = stages
        if "grouted" in kind:
            stages.append({"name": "grouted", "grout": [{"joints": ["j"]}]})
    if "rough" in kind:
        for base in bases:
            base["friction"] = 0.5


def job(folder, degrees, kind):
    write_mesh(folder / f"turned_{degrees}.inp", degrees)
    mesh = {"file": str(folder / f"turned_{degrees}.inp"), "unit": "m"}
    joint = {"normal_stiffness": 40e9, "shear_stiffness": 20e9, "friction": 0.9}
    wet = [{"block": "a", "face": "WETA"}, {"block": "b", "face": "WETB"}]
    raw = {
        "materials": {"c": {"E": 30e9, "nu": 0.2, "rho": 2400, "expansion": 1e-5}},
        "blocks": {
            "a": {"material": "c", "mesh": mesh | {"group": "A"}},
            "b": {"material": "c", "mesh": mesh | {"group": "B"}},
            "r": {"material": "c", "mesh": mesh | {"group": "R"}, "mass": False, "weight": False},
        },
        "supports": [{"block": "r", "face": "FOOT"}],
        "joints": {
            "j": joint | {"between": ["a", "b"], "friction": 0.6},
            "fa": joint | {"between": ["r", "a"]},
            "fb": joint | {"between": ["r", "b"]},
        },
        "loads": {
            "gravity": GRAVITY,
            "hydrostatic": [{"level": 5.0, "faces": wet}],
            "temperature": [{"change": 6.0, "blocks": ["a", "b"]}],
        },
        "damping": {"rayleigh": {"frequencies": [5, 50], "ratio": 0.05}},
        "model": {"modes": 25},
        "transient": {"finest_step": 0.001, "duration": 0.02},
        "outputs": {"plots": False, "error_estimate": False, "mesh_error": False},
    }
    change_to(raw, kind, degrees)
    return raw, wet


def forces(raw):
    """Compression and shear of each joint at rest, and the warnings of the run."""
    dataset = romdam.run(raw, motions=STILL).results[0].dataset
    first, found = dataset.isel(time=0), {}
    for name in ("j", "fa", "fb"):
        gaps = first.isel(gap=first.gap_joint.values == name)
        shear = np.einsum("gj,gjx->x", gaps.shear_force.values, gaps.gap_tangent.values)
        found[name] = np.array([-gaps.normal_force.values.sum(), np.linalg.norm(shear)])
    assert float(dataset.imbalance_at_rest.max()) <= 1e-8
    return found, json.loads(dataset.attrs["run_warnings"])


SCENES = [
    "friction", "softening", "stages", "friction, spacing", "softening, mortar", "stages, grouted, softening",
    "grouting", "uplift, static friction", "redrawn", "redrawn, spacing", "bonds, uplift", "keys, gaps",
    "weakening, uplift", "stages, uplift, spacing", "redrawn, softening, rough",
]  # fmt: skip
QUICK = {"softening"}


@pytest.mark.parametrize(
    "kind", [kind if kind in QUICK else pytest.param(kind, marks=pytest.mark.slow) for kind in SCENES]
)
def test_the_state_at_rest_is_one(tmp_path, kind):
    straight, wet = job(tmp_path, 0, kind)
    known, _ = forces(straight)
    weight = 2400 * 9.81 * 8 * (32 + 24)
    if "redrawn" not in kind:  # of a closed joint the uplift is known
        uplift = 9810.0 * (5.0 + 0.5) / 2.0 * 64.0 if "uplift" in kind else 0.0
        assert known["fa"][0] + known["fb"][0] == pytest.approx(weight - uplift, rel=1e-6)
    other = {degrees: job(tmp_path, degrees, kind)[0] for degrees in (37, 111, 200)}
    watered = copy.deepcopy(straight) | {"water": {"level": 5.0, "model": "westergaard", "faces": wet}}
    named = copy.deepcopy(straight)
    named["blocks"] = {name: named["blocks"][name] for name in ("r", "b", "a")}
    named["joints"] = {name: named["joints"][name] for name in ("fb", "j", "fa")}
    swapped = copy.deepcopy(straight)
    for joint in swapped["joints"].values():
        joint["between"] = joint["between"][::-1]
    for raw in (*other.values(), watered, named, swapped):
        found, _ = forces(raw)
        for name, force in known.items():
            largest = max(np.abs(each).max() for each in known.values())
            assert np.abs(found[name] - force).max() <= 1e-6 * largest, name


def test_a_run_says_how_far_the_state_depends_on_the_order_of_loads(tmp_path):
    """The reversed order, asked for, gives the forces that the first run says it would."""
    raw, _ = job(tmp_path, 0, "softening")
    known, warnings = forces(raw)
    reverse = copy.deepcopy(raw)
    reverse["loads"]["order"] = ["temperature", "water", "forces", "weight"]
    back, _ = forces(reverse)
    (said,) = [text for text in warnings if "depends on the order of the loads" in text]
    name = re.search(r"joint (\w+) carries", said)[1]
    numbers = [float(number) for number in re.findall(r"([\d.]+)(?: MN| and)", said)]
    assert numbers == pytest.approx([*1e-6 * known[name], *1e-6 * back[name]], rel=1e-3)


def test_loads_together_are_one_increment_whatever_the_axes(tmp_path):
    """One increment, of which nobody is told that another order gives other forces."""
    raw, _ = job(tmp_path, 0, "friction")
    raw["loads"]["order"] = "together"
    known, warnings = forces(raw)
    assert not [text for text in warnings if "order of the loads" in text]
    turned = job(tmp_path, 37, "friction")[0]
    turned["loads"]["order"] = "together"
    found, _ = forces(turned)
    largest = max(np.abs(force).max() for force in known.values())
    for name, force in known.items():
        assert np.abs(found[name] - force).max() <= 1e-6 * largest, name
    one_by_one, _ = forces(job(tmp_path, 0, "friction")[0])
    assert np.abs(one_by_one["j"] - known["j"]).max() > 1e-4 * largest


@pytest.mark.slow
def test_koyna_at_rest_under_loads_that_come_together():
    """Five monoliths on rock on a coarser mesh: thrust and weight by hand, factors of four bases as stated.

    V = g_w b / 2 sum (H - z_base)^2 over the monoliths, N is the weight; the factors are those that were
    stated of this mesh. Four modes a block are enough: statics are exact with any number.
    """
    config = Path(__file__).parents[2] / "configs" / "koyna.yaml"
    raw = romdam.load_config(config).to_dict()
    raw["gravity_dam"]["divisions"] |= {"along": 1, "through": 3, "up": 6}
    raw |= {"model": {"modes": 4}, "outputs": {"plots": False, "error_estimate": False, "mesh_error": False}}
    raw["loads"]["order"] = "together"
    raw["records"], raw["transient"] = [], {"finest_step": 0.005}
    dataset = romdam.run(raw, motions=STILL).results[0].dataset
    dam = dataset.sel(body="whole dam")
    thrust = 9810.0 / 2.0 * 15.24 * (71.7**2 + 3 * 91.7**2 + 81.7**2)
    assert float(dam.loads_at_rest.sel(resultant="F_y")) == pytest.approx(thrust, rel=1e-3)
    assert float(dam.imbalance_at_rest) <= 1e-9
    factors = {joint.joint: joint.factor for joint in joint_stability(dataset, "still", 1.0, None)}
    for name, factor in {"base_1": 1.65, "base_3": 2.16, "base_4": 2.25, "base_5": 1.66}.items():
        assert factors[name] == pytest.approx(factor, rel=5e-3), name
