"""Forces on sections against statics: what stands above a plane is what the plane bears."""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh, spsolve

import romdam
from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig, ModelConfig
from romdam.core.errors import ConfigError
from romdam.effects.full_order import assemble_full
from romdam.fem.assembly import assemble
from romdam.fem.loads import static_force
from romdam.fem.sections import (
    gap_section_operator,
    initial_section_forces,
    modal_section_forces,
    observed_section_forces,
    section_operators,
)
from romdam.postprocess.stress.sections import linearised_stress
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.equilibrium import static_equilibrium

RHO, G, P = 2400.0, 9.81, 5e4
B, T, H = 3.0, 2.0, 8.0  # along y, along x, height


def scene_of(sections, loads, element="hex20", size=1.0, **changes):
    raw = {
        "materials": {"c": {"E": "30 GPa", "nu": 0.2, "rho": RHO, "expansion": 1e-5}},
        "blocks": {
            "a": {
                "material": "c",
                "box": {"origin": [0, 0, 0], "size": [T, B, H], "element_size": size, "element": element},
            }
        },
        "supports": [{"block": "a", "face": "zmin"}],
        "records": [{"file": "none.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": 5},
        "transient": {"finest_step": 0.01},
        "loads": loads,
        "outputs": {"stress": {"faces": [{"block": "a", "face": "xmin"}], "sections": sections}},
        **changes,
    }
    return build_scene(parse_config(raw, "s.yaml"), Path("."), "s.yaml")


def displaced(scene):
    """Displacement of the block under the static loads (3 n,)."""
    free = ~scene.fixed["a"].ravel()
    K, u = assemble(scene.blocks["a"])[0], np.zeros(free.size)
    u[free] = spsolve(K[free][:, free].tocsc(), static_force(scene, "a").ravel()[free])
    return u


def forces(scene):
    """(sections, 6)"""
    whole = (section_operators(scene)["a"] @ displaced(scene)).reshape(-1, 6)
    return whole + initial_section_forces(scene, {"a": np.zeros_like(scene.blocks["a"].points)})["a"]


def at(*heights):
    return {f"z{k}": {"blocks": ["a"], "point": [0, 0, z]} for k, z in enumerate(heights)}


HEIGHTS = (0.0, 1.0, 3.0, 3.4, 7.5, 8.0)
LOADS = {
    "gravity": [0, 0, -G],
    "pressure": [{"block": "a", "face": "xmin", "value": P}],
    "hydrostatic": [{"level": H, "faces": [{"block": "a", "face": "xmax"}]}],
    "temperature": [{"change": "-7 K"}],
}


@pytest.mark.parametrize(
    ("element", "size"),
    [("hex8", 1.0), ("hex20", 1.0), ("hex27", 1.0), ("tet10", 1.0), ("hex8", [1.0, 1.0, 0.5])],
)
def test_section_bears_what_is_above_it(element, size):
    """Weight, pressure from the left, water from the right: V = p b h - gamma b h^2 / 2, M its integral."""
    scene = scene_of(at(*HEIGHTS), LOADS, element, size)
    h = H - np.array(HEIGHTS)
    gamma = 1000.0 * G
    expected = np.zeros((len(h), 6))
    expected[:, 0] = -RHO * G * B * T * h
    expected[:, 1] = P * B * h - gamma * B * h**2 / 2
    # about y, the second axis, of a force along x above: positive
    expected[:, 5] = P * B * h**2 / 2 - gamma * B * h**3 / 6
    found, scale = forces(scene), np.abs(expected).max(axis=0).max()
    print(np.abs(found - expected).max() / scale)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * scale)
    for section in scene.stress.sections:
        assert section.area == pytest.approx(B * T, rel=1e-12)
        np.testing.assert_allclose(section.inertia, np.diag([B * T**3, T * B**3]) / 12, atol=1e-12 * 9)
        np.testing.assert_allclose(section.centroid[:2], [T / 2, B / 2], rtol=1e-12)


def test_linearised_stress_is_that_of_beams():
    scene = scene_of(at(0.0), {"pressure": LOADS["pressure"]})
    (section,) = scene.stress.sections
    found = linearised_stress(section, forces(scene))[0]
    bending = 6 * (P * B * H**2 / 2) / (B * T**2)  # M / W; tension on the pressed side
    np.testing.assert_allclose(found, [bending, -bending, 0.0, 0.0], atol=1e-6 * bending)
    np.testing.assert_allclose(section.sides[:, :2], [[0, 1.5], [2, 1.5], [1, 0], [1, 3]], atol=1e-12)


def test_normal_the_other_way_gives_the_same_tension_of_what_hangs():
    """Seen from above, the section bears what is below it: the reaction less its weight."""
    sections = {"down": {"blocks": ["a"], "point": [0, 0, 3], "normal": [0, 0, -2]}} | at(3.0)
    down, up = forces(scene_of(sections, {"gravity": [0, 0, -G]}))
    assert down[0] == pytest.approx(up[0], rel=1e-9) and up[0] == pytest.approx(-RHO * G * B * T * 5)


def test_inclined_section_splits_weight_into_normal_force_and_shear():
    """A plane at 30 degrees through (1, 1.5, 4): half the block stands above it, by symmetry."""
    normal = [0.5, 0.0, np.sqrt(0.75)]
    scene = scene_of(
        {"tilted": {"blocks": ["a"], "point": [1, 1.5, 4], "normal": normal}},
        {"gravity": [0, 0, -G]},
        size=0.5,
    )
    (section,), weight = scene.stress.sections, RHO * G * B * T * H / 2
    found = forces(scene)[0]
    assert section.area == pytest.approx(B * T / np.sqrt(0.75), rel=0.01)
    np.testing.assert_allclose(found[:3] / weight, [-np.sqrt(0.75), 0.5, 0.0], atol=0.005)


def foot_error(size):
    """Of four modes, where K u = omega^2 M u: what the foot bears against omega^2 M u of all nodes."""
    scene = scene_of(at(0.0), {}, "hex20", [1.0, 1.5, size])
    block, free = scene.blocks["a"], ~scene.fixed["a"].ravel()
    K, M = assemble(block)
    omega2, modes = eigsh(K[free][:, free].tocsc(), 4, M[free][:, free].tocsc(), sigma=0.0)
    (section,) = scene.stress.sections
    u = np.zeros((free.size, 4))
    u[free] = modes
    inertia = (M @ u * omega2).T.reshape(4, -1, 3)
    moment = np.cross(block.points - section.centroid, inertia).sum(axis=1)
    expected = np.hstack([inertia.sum(axis=1) @ section.axes.T, moment @ section.axes.T])
    found = (section_operators(scene)["a"] @ u).T
    return (np.abs(found - expected).max(axis=1) / np.abs(expected).max(axis=1)).max()


def test_foot_of_a_vibrating_block_bears_its_inertia():
    """Halving the elements' height leaves a thirteenth of the error."""
    errors = [foot_error(size) for size in (1.0, 0.5)]
    print(errors)
    assert errors[1] < 0.004 and errors[1] < errors[0] / 6


WATER = {"level": 7.0, "model": "westergaard", "faces": [{"block": "a", "face": "xmin"}]}


@pytest.mark.parametrize("modes", [0, 3, 20, "all"])
@pytest.mark.parametrize("beside", [{}, {"b": ([T, 0.7, 2.0], [2.0, B, 4.0])}])
def test_sections_bear_all_that_is_above_whatever_the_number_of_modes(modes, beside):
    """Weight, pressure, a force, and the ground's acceleration with Westergaard's 7/12 rho d^2 b of water.

    Joints open. The block is in Craig and Bampton's form, or in free-interface form beside another one.
    """
    boxes = {"a": ([0, 0, 0], [T, B, H]), **beside}
    elements = {"a": ("hex8", [1.0, 1.5, 1.0]), "b": ("hex8", [1.0, 1.0, 1.0])}
    scene = scene_of(
        at(0.0),
        {
            "gravity": [0, 0, -G],
            "pressure": [{"block": "a", "face": "ymin", "value": P}],
            "force": [{"block": "a", "at": [0, 0, H], "force": [3e5, -2e5, 1e5]}],
        },
        blocks={
            name: {
                "material": "c",
                "box": dict(zip(("element", "element_size"), elements[name], strict=True))
                | {"origin": origin, "size": whole},
            }
            for name, (origin, whole) in boxes.items()
        },
        supports=[{"block": name, "face": "zmin"} for name in boxes],
        joints={"j": {"between": ["a", "b"], "normal_stiffness": 1e9}} if beside else {},
        water=WATER,
    )
    reduced = reduce_scene(scene, ModelConfig(modes=modes), DampingConfig())
    system, basis = reduced.system, reduced.basis["a"]
    k, modal = system.K.diagonal(), modal_section_forces(scene, reduced.basis)["a"][0]
    mass, wet = RHO * B * T * H, 7.0 / 12.0 * 1000.0 * WATER["level"] ** 2 * B
    pushed = np.array([0.0, P * T * H, 0.0])
    wanted = [mass * np.array([0.0, 0.0, -G]) + pushed + [3e5, -2e5, 1e5]]
    wanted += [np.array([mass + wet, 0.0, 0.0]), np.array([0.0, mass, 0.0]), np.array([0.0, 0.0, mass])]
    axes = scene.stress.sections[0].axes
    exact = [1e-9, 1e-3, 1e-9, 1e-9]  # the water's pressure, a root of the depth, is integrated by points
    for force, whole, near in zip([system.force, *system.load.T], wanted, exact, strict=True):
        found = axes.T @ (modal @ (force / k)[basis.columns])[:3]
        assert found == pytest.approx(whole, rel=near, abs=1e-9 * np.abs(whole).max())


JOINT = {"normal_stiffness": 1e9, "shear_stiffness": 1e9, "friction": 0.5, "gaps": "corners"}
BESIDE = (0.0, 2.0, 3.4, 4.0, 4.6, 5.3, 7.0, 7.8)


def pressed_beside(size, traction, element="hex8"):
    """Forces on sections of block a under tractions (n, 3) of joint forces on the upper half of its side."""
    boxes = {"a": ([0, 0, 0], [T, B, H]), "b": ([T, 0, 4], [2, B, 4])}
    mesh = {"element_size": size, "element": element}
    scene = scene_of(
        at(*BESIDE),
        {},
        blocks={
            name: {"material": "c", "box": {"origin": origin, "size": whole, **mesh}}
            for name, (origin, whole) in boxes.items()
        },
        supports=[{"block": "a", "face": "zmin"}, {"block": "b", "face": "xmax"}],
        joints={"j": {"between": ["a", "b"], **JOINT}},
    )
    joint, system = scene.joints["j"], assemble_full(scene, DampingConfig())
    force = np.einsum("nkl,nl->nk", joint.axes, -traction(joint.position)) * joint.area[:, None]
    u = spsolve(system.K.tocsc(), system.B.T @ force.ravel())
    whole = observed_section_forces(scene) @ u + gap_section_operator(scene, 3) @ force.ravel()
    return scene, whole.reshape(-1, 6)


@pytest.mark.parametrize("element", ["hex8", "hex20", "tet4"])
def test_section_beside_a_joint_bears_the_forces_of_its_gaps(element):
    """Uniform traction of x = 2 from z = 4 to 8: resultant and moment of what is above, to round-off."""
    t = np.array([-3e5, 2e4, 5e4])
    scene, found = pressed_beside(1.0, lambda at: np.tile(t, (len(at), 1)), element)
    for section, z, own in zip(scene.stress.sections, BESIDE, found, strict=True):
        low = max(z, 4.0)
        force = t * B * (H - low)
        moment = np.cross([T, B / 2, (low + H) / 2] - section.centroid, force)
        expected = np.concatenate([section.axes @ force, section.axes @ moment])
        # gaps of quadratic faces see means of the face, whose arms are those of linear ones to h^2
        off = 0.02 if element == "hex20" and z > 4.0 else 1e-9
        np.testing.assert_allclose(own, expected, rtol=0, atol=off * np.abs(t).max() * B * H**2 / 2)


def test_uneven_pressure_beside_a_section_converges_with_the_square_of_the_mesh():
    """p = z^2 from z = 4 to 8: V = -B (8^3 - z^3) / 3, M about the second axis by its arm."""
    errors, z = [], np.array(BESIDE)
    low = np.maximum(z, 4.0)
    force = -B * (H**3 - low**3) / 3
    moment = -B * (H**4 - low**4) / 4 - z * force
    for size in (1.0, 0.5, 0.25):
        _, found = pressed_beside([1.0, 1.5, size], lambda at: at[:, 2:] ** 2 * [-1.0, 0.0, 0.0])
        errors.append(
            max(np.abs(found[:, 1] - force).max() / H**3, np.abs(found[:, 5] - moment).max() / H**4)
        )
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    print(errors, order)
    assert errors[-1] < 1e-3 and (np.abs(order - 2.0) < 0.1).all()


KINKED = {"upstream": [[0, 0], [103, 0]], "downstream": [[0, 70], [66.5, 19.25], [103, 14.8]]}


def area_above(z):
    """Area and first moment about y = 0 of that profile above an elevation."""
    xi, weight = np.polynomial.legendre.leggauss(3)
    total = np.zeros(2)
    for low, high in ((min(z, 66.5), 66.5), (max(z, 66.5), 103.0)):
        half = 0.5 * (high - low)
        width = np.interp(low + half * (1.0 + xi), *np.transpose(KINKED["downstream"]))
        total += half * weight @ np.stack([width, 0.5 * width**2], axis=1)
    return total


@pytest.mark.parametrize("up", [6, 12])
def test_weight_above_a_section_near_a_kink_of_the_profile(up):
    """Between kinks the width is linear, so that the step's own moments bear the weight to round-off."""
    heights = (40.0, 60.0, 66.5, 68.0, 75.0)
    dam = {
        **KINKED,
        "monoliths": [10.0],
        "base": [0.0],
        "material": "c",
        "element": "hex20",
        "divisions": {"along": 1, "through": 2, "up": up},
        "joints": {"base": "tied"},
    }
    cuts = {f"z{k}": {"blocks": "all", "point": [0, 0, z]} for k, z in enumerate(heights)}
    stress = {"stress": {"blocks": "all", "sections": cuts}}
    loads = {"gravity": [0, 0, -G]}
    scene = scene_of({}, loads, blocks={}, supports=[], gravity_dam=dam, outputs=stress)
    system = assemble_full(scene, DampingConfig())
    found = (observed_section_forces(scene) @ spsolve(system.K.tocsc(), system.force)).reshape(-1, 6)
    for section, z, own in zip(scene.stress.sections, heights, found, strict=True):
        area, moment = area_above(z)
        weight = -RHO * G * 10.0 * area
        arm = moment / area - section.centroid[1]
        if up == 6 and z > 66.5:
            continue  # two elements between kink and crest, too few to end the step at the kink
        print(z, own[0] / weight - 1.0, own[4] / (weight * arm) - 1.0)
        assert own[0] == pytest.approx(weight, rel=1e-8)
        assert own[4] == pytest.approx(weight * arm, rel=1e-8)


def test_foot_between_joints_bears_what_stands_on_it():
    """What the base gives the middle one of three monoliths at rest, in every component.

    Its foot is beside the contraction joints, whose gaps press unevenly just there.
    """
    joint = {"normal_stiffness": 20e9, "shear_stiffness": 10e9, "friction": 0.6}
    dam = {
        **KINKED,
        "monoliths": [16.0, 16.0, 16.0],
        "base": [20.0, 0.0, 10.0],
        "material": "c",
        "element": "hex20",
        "divisions": {
            "along": 1,
            "through": 2,
            "up": 6,
            "depth": 1,
            "upstream": 1,
            "downstream": 1,
            "banks": 1,
        },
        "rock": {"material": "c", "mass": False} | dict.fromkeys(BESIDE_ROCK, 60.0),
        "joints": {"base": joint, "contraction": joint},
    }
    stress = {
        "stress": {"blocks": "all", "sections": {"foot": {"blocks": ["monolith_2"], "point": [0, 0, 0]}}}
    }
    loads = {"gravity": [0, 0, -G]}
    scene = scene_of({}, loads, blocks={}, supports=[], gravity_dam=dam, outputs=stress)
    system = assemble_full(scene, DampingConfig())
    q, gaps = static_equilibrium(system, 1e-10)
    before = (observed_section_forces(scene) @ q).reshape(6)
    found = before + gap_section_operator(scene, 3) @ gaps.force.ravel()
    base, (section,) = scene.joints["base_2"], scene.stress.sections
    sign = {1: -1.0, 0: 1.0}[base.blocks.index("monolith_2")]
    force = sign * np.einsum("nkl,nk->nl", base.axes, gaps.force[system.law.joints["base_2"]])
    side = base.blocks.index("monolith_2")
    at = base.weights[side] @ scene.blocks["monolith_2"].points[base.nodes[side]]
    moment = np.cross(at - section.centroid, force).sum(axis=0)
    expected = np.concatenate([section.axes @ force.sum(axis=0), section.axes @ moment])
    scale = np.repeat([np.abs(expected[:3]).max(), np.abs(expected[3:]).max()], 3)
    print(np.abs(before - expected) / scale)
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=1e-8)  # of rest
    assert np.abs(expected[1]) > 1e-3 * scale[0] and np.abs(before - expected)[1] > 0.05 * np.abs(expected[1])


BESIDE_ROCK = ("depth", "upstream", "downstream", "left", "right")


def test_plane_beside_the_block_is_refused():
    with pytest.raises(
        ConfigError, match=r"sections.z0: the plane does not meet a, which reach from -9 to -1 m"
    ):
        scene_of(at(9.0), {})
    with pytest.raises(ConfigError, match=r"sections.s.normal: must have a length"):
        scene_of({"s": {"blocks": ["a"], "point": [0, 0, 1], "normal": [0, 0, 0]}}, {})
    with pytest.raises(ConfigError, match=r"sections\.s\.blocks: names no block"):
        scene_of({"s": {"blocks": [], "point": [0, 0, 1]}}, {})
    with pytest.raises(ConfigError, match=r"sections\.s\.blocks"):
        scene_of({"s": {"blocks": ["other"], "point": [0, 0, 1]}}, {})


@pytest.mark.parametrize("height", [0.0, 0.01, 0.5, 2.0])
def test_section_through_rock_and_dam_of_one_area_bears_what_is_above_it(height):
    """Where the dam ends on the rock its loads end too, though the area of all blocks has no kink there.

    N = rho g A (h - z), V = g_w b (H - z)^2 / 2, M = V (H - z) / 3, by hand.
    """
    size, level, b, length = 0.5, 3.0, 1.0, 2.0
    box = {"element": "hex8", "element_size": [1.0, 1.0, size]}
    joint = {"normal_stiffness": 1e10, "shear_stiffness": 5e9, "friction": 2.0}
    dead = {"material": "concrete", "mass": False, "weight": False}
    raw = {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400.0}},
        "blocks": {
            "rock": dead | {"box": box | {"origin": [0, 0, -2], "size": [b, length, 2]}},
            "dam": {"material": "concrete", "box": box | {"origin": [0, 0, 0], "size": [b, length, 4]}},
        },
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {
            "base": joint | {"between": ["rock", "dam"]}
        },
        "model": {"modes": 4},
        "loads": {
            "gravity": [0, 0, -9.81],
            "hydrostatic": [{"level": level, "faces": [{"block": "dam", "face": "ymin"}]}],
        },
        "damping": {"rayleigh": {"frequencies": [5, 50], "ratio": 0.05}},
        "transient": {"finest_step": 0.001},
        "outputs": {
            "plots": False, "error_estimate": False, "mesh_error": False,
            "stress": {"blocks": "all", "sections": {"s": {"point": [0, 0, height], "blocks": "all"}}},
        },
    }  # fmt: skip
    still = romdam.GroundMotion.from_arrays("still", {"y": [0.0] * 5}, 0.01)
    dataset = romdam.run(raw, motions=still).results[0].dataset
    axes = dataset.section_axes.values[0]
    force = dataset.section_force.values[0, 0] @ axes
    moment = dataset.section_moment.values[0, 0] @ axes
    thrust = 9810.0 * b * (level - height) ** 2 / 2.0
    assert force == pytest.approx(
        [0.0, thrust, -2400.0 * 9.81 * b * length * (4.0 - height)], rel=2e-3, abs=1.0
    )
    assert abs(moment[0]) == pytest.approx(thrust * (level - height) / 3.0, rel=5e-3)
