"""Every effect by hand on a scene with nothing symmetric, equal or one.

Three blocks of unequal sizes, materials and feet stand beside each other; the middle one is held at its foot,
the others slide on rollers, so that each effect has a closed form. Gravity is 9.7 m/s2.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from simulating import simulated

from romdam.config import parse_config
from romdam.core.motion import MovingSupports
from romdam.core.scene import ConstructionStage, ForceHistory, Scene
from romdam.core.system import System
from romdam.effects.added_mass import added_mass
from romdam.effects.construction import construction
from romdam.effects.full_order import assemble_full
from romdam.fem.loads import static_force, surface_force
from romdam.records.processing.support_motions import add_support_rows
from romdam.reduction.mode_choice import ALL_MODES
from romdam.reduction.synthesis import reduce_scene
from romdam.results.joint_traction import joint_sites, joint_traction
from romdam.results.stress.file import StressFields
from romdam.scene.build import build_scene
from romdam.scene.ground.motion_along import _along_line
from romdam.timestepping.construction import constructed
from romdam.timestepping.equilibrium import GapState, static_equilibrium
from romdam.timestepping.grouting import grouted

G = 9.7  # m/s2
EXPANSION = {"left": 0.9e-5, "middle": 1.3e-5, "right": 1.1e-5}  # 1/K
RHO = {"left": 2310.0, "middle": 2570.0, "right": 2430.0}
SIZE = {"left": (3.0, 2.5, 6.0), "middle": (4.0, 3.0, 10.5), "right": (2.0, 1.5, 4.5)}
ORIGIN = {"left": (0.0, 0.0, 0.0), "middle": (3.0, 0.0, -1.5), "right": (7.0, 0.0, 1.5)}
EDGE = {"left": (1.5, 1.25, 2.0), "middle": (2.0, 0.5, 1.5), "right": (1.0, 0.75, 2.25)}
GAP = {"lm": 5e-3, "mr": 2e-3}  # m; wide enough that the joints stay open
STRESSLESS: dict[str, Any] = {
    "lm": {"between": ["left", "middle"], "normal_stiffness": 2e9, "shear_stiffness": 1e9, "friction": 0.5},
    "mr": {"between": ["middle", "right"], "normal_stiffness": 3e9, "shear_stiffness": 7e8, "friction": 0.8},
}
PROBES = {
    "corner of left": ("left", (3.0, 2.5, 6.0)),
    "corner of right": ("right", (7.0, 1.5, 6.0)),
    "foot of left": ("left", (1.5, 0.0, 0.0)),
    "foot of middle": ("middle", (5.0, 1.0, -1.5)),
    "foot of right": ("right", (9.0, 0.0, 1.5)),
}


def job(**sections: Any) -> dict[str, Any]:
    joints = sections.pop("joints", {name: keys | {"gap": GAP[name]} for name, keys in STRESSLESS.items()})
    young = {"left": 21e9, "middle": 33e9, "right": 27e9}
    nu = {"left": 0.17, "middle": 0.22, "right": 0.19}
    rollers = {
        "left": {"zmin": "z", "ymin": "y", "xmin": "x"},
        "right": {"zmin": "z", "ymin": "y", "xmax": "x"},
    }
    supports = [
        {"block": block, "face": face, "fix": [axis]}
        for block, faces in rollers.items()
        for face, axis in faces.items()
    ]
    return {
        "materials": {
            name: {"E": young[name], "nu": nu[name], "rho": RHO[name], "expansion": EXPANSION[name]}
            for name in SIZE
        },
        "blocks": {
            name: {
                "material": name,
                "box": {"origin": ORIGIN[name], "size": SIZE[name], "element_size": EDGE[name]},
            }
            for name in SIZE
        },
        "supports": [*supports, {"block": "middle", "face": "zmin"}],
        "joints": joints,
        "damping": {"rayleigh": {"frequencies": [13.0, 170.0], "ratio": 0.04}},
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": "all"},
        "transient": {"finest_step": 0.01},
        "outputs": {"nodes": {name: {"block": block, "at": at} for name, (block, at) in PROBES.items()}},
    } | sections


def built(**sections: Any) -> tuple[Any, Scene]:
    config = parse_config(job(**sections), "ugly.yaml")
    return config, build_scene(config, Path(__file__).parent, "ugly.yaml")


def systems(**sections: Any) -> tuple[Scene, tuple[System, System]]:
    """The scene, at full order and reduced with all modes."""
    config, scene = built(**sections)
    full = assemble_full(scene, config.damping)
    return scene, (full, reduce_scene(scene, ALL_MODES, config.damping).system)


def at_rest(system: System) -> tuple[np.ndarray, GapState, dict[str, np.ndarray]]:
    """Unknowns, gaps and displacements (3,) of the probes."""
    q, gaps = static_equilibrium(system, 1e-13)
    return q, gaps, dict(zip(PROBES, np.asarray(system.observe @ q).reshape(-1, 3), strict=True))


def moments(force: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(3,) about the origin."""
    return np.cross(points, force).sum(axis=0)


def test_joints_have_the_areas_of_what_the_faces_share():
    scene = built()[1]
    assert {name: joint.area.sum() for name, joint in scene.joints.items()} == pytest.approx(
        {"lm": 2.5 * 6.0, "mr": 1.5 * 4.5}
    )
    for joint, centre in ((scene.joints["lm"], (3, 1.25, 3)), (scene.joints["mr"], (7, 0.75, 3.75))):
        assert joint.area @ joint.position / joint.area.sum() == pytest.approx(centre, abs=1e-12)


def test_weight_follows_gravity_density_and_volume():
    scene = built(loads={"gravity": [0.3, -0.7, -G]})[1]
    for name, size in SIZE.items():
        force = static_force(scene, name)
        weight = RHO[name] * np.prod(size) * np.array([0.3, -0.7, -G])
        assert force.sum(axis=0) == pytest.approx(weight, rel=1e-12)
        middle = np.array(ORIGIN[name]) + np.array(size) / 2.0
        assert moments(force, scene.blocks[name].points) == pytest.approx(np.cross(middle, weight))


WET = [{"block": "left", "face": "ymin"}, {"block": "middle", "face": "ymin"}]


@pytest.mark.parametrize(("gravity", "g"), [([0.0, 0.0, -G], G), (None, 9.81), ([1.0, 0.0, 0.0], 9.81)])
def test_still_water_weighs_with_the_jobs_gravity(gravity, g):
    """Its level cuts an element of either face: rho g h^2 / 2 a metre, a third of h above the foot."""
    loads = {"hydrostatic": [{"level": 5.0, "density": 1025.0, "faces": WET}]}
    scene = built(loads=loads | ({} if gravity is None else {"gravity": gravity}))[1]
    for name, foot in (("left", 0.0), ("middle", -1.5)):
        force = surface_force(scene, name)
        head = 5.0 - foot
        push = 1025.0 * g * head**2 / 2.0 * SIZE[name][0]
        assert force.sum(axis=0) == pytest.approx([0.0, push, 0.0], rel=1e-12, abs=1e-6)
        about = moments(force, scene.blocks[name].points)
        centre = ORIGIN[name][0] + SIZE[name][0] / 2.0, foot + head / 3.0
        assert about == pytest.approx([-push * centre[1], 0.0, push * centre[0]], rel=1e-12, abs=1e-5)


def test_water_in_a_joint_weighs_with_the_jobs_gravity():
    """Gaps stand 1.5 m apart: the water's edge in the highest of them is within 2 % of the whole."""
    water = [{"joints": ["lm"], "level": 4.5}]
    scene = built(loads={"gravity": [0.0, 0.0, -G], "joint_water": water})[1]
    joint = scene.joints["lm"]
    assert joint.water.sum() == pytest.approx(1000.0 * G * 4.5**2 / 2.0 * 2.5, rel=0.02)
    assert joint.water @ joint.position[:, 2] / joint.water.sum() == pytest.approx(1.5, rel=0.05)
    assert not scene.joints["mr"].water.any()


def test_temperature_of_the_last_stage_acts_in_the_runs():
    """Rollers let left and right expand freely; joints are open and do not hold them."""
    temperature = [{"change": -10.0, "blocks": ["left"]}, {"change": 7.0, "blocks": ["right"]}]
    for system in systems(loads={"temperature": temperature})[1]:
        _, gaps, moved = at_rest(system)
        grown = -10.0 * EXPANSION["left"], 7.0 * EXPANSION["right"]
        assert moved["corner of left"] == pytest.approx(grown[0] * np.array([3.0, 2.5, 6.0]), rel=1e-8)
        assert moved["corner of right"] == pytest.approx(grown[1] * np.array([-2.0, 1.5, 4.5]), rel=1e-8)
        opening, of = gaps.jump[:, 0], system.law.joints
        assert opening[of["lm"]] == pytest.approx(GAP["lm"] - 3.0 * grown[0], rel=1e-9)
        assert opening[of["mr"]] == pytest.approx(GAP["mr"] - 2.0 * grown[1], rel=1e-9)
        assert not gaps.force.any()


JUMP = [
    {"name": "cold left", "pour": ["left"], "temperature": [{"change": -10.0, "blocks": ["left"]}]},
    {"name": "against it", "pour": ["middle"]},
    {"name": "warm left", "temperature": [{"change": 4.0, "blocks": ["left"]}]},
    {"name": "right", "pour": ["right"], "temperature": [{"change": -3.0, "blocks": ["right"]}]},
]


@pytest.mark.parametrize("last", [None, [{"change": 6.0, "blocks": ["left"]}]])
def test_slip_and_opening_count_from_the_pouring(last):
    """The middle is poured against a left that has shrunk by 10 K; `loads.temperature` comes last of all.

    Slip along the joint's axes j and k is that of the middle less that of the left: since the pouring the
    left has grown by (change + 10 K) alpha times the distance from its rollers.
    """
    loads = {} if last is None else {"temperature": last}
    scene, both = systems(construction=JUMP, loads=loads)
    final = 4.0 if last is None else 6.0
    if last is not None:
        assert scene.loads.warmed["left"] == final
    joint = scene.joints["lm"]
    since = EXPANSION["left"] * (final + 10.0)
    grown = since * (joint.position - np.array(ORIGIN["left"]))  # of the left, (n, 3)
    other = scene.joints["mr"]
    held = np.array([9.0, 0.0, 1.5])
    shrunk = -3.0 * EXPANSION["right"] * (other.position - held)  # poured warm, which it never shows
    for system in both:
        built_up = constructed(system, 1e-13)
        _, gaps, moved = at_rest(built_up)
        of = built_up.law.joints
        slip = np.einsum("gax,gx->ga", joint.axes, -grown)
        assert gaps.jump[of["lm"], 1:] == pytest.approx(slip[:, 1:], rel=1e-8, abs=1e-12)
        assert np.abs(slip[:, 1:]).max() > 5e-4
        assert gaps.jump[of["lm"], 0] == pytest.approx(GAP["lm"] - 3.0 * since, rel=1e-8)
        assert gaps.jump[of["mr"], 0] == pytest.approx(GAP["mr"] + shrunk[:, 0], rel=1e-8)
        assert built_up.built is not None
        by_stage = built_up.built.opening[:, of["lm"]]  # at the gaps' positions, since the pouring
        assert np.isnan(by_stage[0]).all() and by_stage[1] == pytest.approx(GAP["lm"], rel=1e-10)
        assert by_stage[3] == pytest.approx(GAP["lm"] - 3.0 * EXPANSION["left"] * 14.0, rel=1e-8)
        assert moved["corner of left"] == pytest.approx(
            final * EXPANSION["left"] * np.array([3.0, 2.5, 6.0]), rel=1e-8
        )
    stages = both[0].construction
    assert stages is not None and stages.names[-4:] == tuple(stage["name"] for stage in JUMP)


def test_openings_at_points_count_from_a_strained_neighbour():
    """The left is strained by its weight before the middle is poured: what opens since is the middle's."""
    stages = [{"name": "middle", "pour": ["middle"]}, {"name": "right", "pour": ["right"]}]
    full = systems(construction=stages, loads={"gravity": [3.0, 0.0, -G]})[1][0]
    plan, of = full.construction, full.law.joints["lm"]
    assert plan is not None and full.at_point is not None
    before, after = spsolve(full.K.tocsc(), plan.force[:, :2]).T
    at_points = (full.B + full.at_point)[::3]
    built_up = constructed(full, 1e-13).built
    assert built_up is not None
    wanted = GAP["lm"] + (at_points @ (after - before))[of]
    assert built_up.opening[1, of] == pytest.approx(wanted, rel=1e-9)
    assert np.abs((full.at_point[::3] @ before)[of]).max() > 1e-9  # which means around the gaps are not


def test_grout_bonds_what_was_open_before():
    """An initial gap has no bond; filled with grout it holds the left, which cools by 10 K."""
    bond = {"tensile_strength": "50 MPa", "cohesion": "45 MPa"}
    joints = {name: keys | bond | {"gap": GAP[name]} for name, keys in STRESSLESS.items()}
    stages = [{"name": "grout", "grout": [{"joints": ["lm"]}]}]
    cold = [{"change": -10.0, "blocks": ["left"]}]
    scene, both = systems(construction=stages, joints=joints, loads={"temperature": cold})
    for system in both:
        built_up = constructed(system, 1e-13)
        of = built_up.law.joints
        _, gaps, _ = at_rest(built_up)
        opening, spring = gaps.jump[of["lm"], 0], 2e9 * scene.joints["lm"].area
        assert gaps.force[of["lm"], 0] == pytest.approx(-spring * opening, rel=1e-6)  # in tension too
        assert 1e-5 < opening.max() < 30.0 * EXPANSION["left"]  # what it would be without the bond
        assert not gaps.force[of["mr"]].any()


def test_a_gap_on_the_level_of_two_zones_belongs_to_the_upper_one():
    level = 3.0  # m, at which gaps of the joint stand
    stages = [
        {"name": "lower", "grout": [{"joints": ["lm"], "below": level}, {"joints": ["mr"]}]},
        {"name": "upper", "grout": [{"joints": ["lm"], "above": level}]},
    ]
    scene = built(construction=stages, joints=STRESSLESS)[1]
    z = scene.joints["lm"].position[:, 2]
    assert (z == level).any()
    lower, upper = (stage.grouted[: len(z)] for stage in scene.every(ConstructionStage)[-2:])
    assert (lower == (z < level)).all() and (upper == (z >= level)).all()


STATIONS = [
    {"at": -2.0, "factor": 0.7, "delay": 0.0},
    {"at": 4.0, "factor": 1.6, "delay": 0.05},
    {"at": 12.0, "factor": 0.4, "delay": 0.11},
]


def test_supports_move_by_the_factors_and_delays_of_stations_around_them():
    """At x what the stations around it do, by the distance: u(t) = factor * ground(t - delay)."""
    scene, both = systems(ground={"along": {"axis": "x", "stations": STATIONS}}, damping={})
    dt, rows = 0.01, 121
    time = np.arange(rows) * dt

    def pulse(t: np.ndarray) -> np.ndarray:
        """Acceleration, piecewise linear, whose velocity and displacement end at zero."""
        return np.interp(t, [0.0, 0.1, 0.2, 0.4, 0.6, 0.7, 0.8], [0, 2.0, 0, -2.0, 0, 2.0, 0])

    fine = np.linspace(-0.2, 1.2, 140_001)
    step = fine[1] - fine[0]
    velocity = np.concatenate([[0.0], np.cumsum(0.5 * step * (pulse(fine)[1:] + pulse(fine)[:-1]))])
    place = np.concatenate([[0.0], np.cumsum(0.5 * step * (velocity[1:] + velocity[:-1]))])

    def ground(t: np.ndarray) -> np.ndarray:
        return np.interp(t, fine, place)

    assert scene.find(MovingSupports) is not None
    shaken = np.stack([0.0 * time, pulse(time), 0.5 * pulse(time)])
    moving = add_support_rows(shaken, dt, scene.find(MovingSupports).motions)
    for system in both:
        disp = simulated(system, moving, dt, "generalized_alpha").disp.reshape(rows, -1, 3)
        for probe, (axes, x) in {
            "foot of left": ((1, 2), 1.5), "foot of middle": ((1, 2), 5.0), "foot of right": ((1, 2), 9.0),
        }.items():  # fmt: skip
            k = 0 if x < 4.0 else 1
            share = (x - STATIONS[k]["at"]) / (STATIONS[k + 1]["at"] - STATIONS[k]["at"])
            wanted = sum(
                part * station["factor"] * ground(time - station["delay"])
                for part, station in zip((1.0 - share, share), STATIONS[k : k + 2], strict=True)
            )
            at = [*PROBES].index(probe)
            for axis in axes:
                size = {1: 1.0, 2: 0.5}[axis]
                relative = size * (wanted - ground(time))
                assert np.abs(disp[:, at, axis] - relative).max() < 2e-5 * np.abs(ground(time)).max()


def test_a_wave_starts_where_the_job_says():
    """Supports are at x = 0 to 9 m; from -12 m on at 400 m/s each moves later by its distance from there."""
    wave = {"axis": "x", "velocity": 400.0, "cutoff": 30.0, "start": -12.0}
    scene = built(ground={"along": wave})[1]
    assert scene.find(MovingSupports) is not None and len(scene.find(MovingSupports).motions) > 1
    for motion in scene.find(MovingSupports).motions:
        assert motion.delay == pytest.approx((motion.station + 12.0) / 400.0, rel=1e-12)
    assert min(motion.station for motion in scene.find(MovingSupports).motions) == 0.0


def test_westergaards_pressure_grows_downwards():
    """7/8 rho sqrt(H y) a over each face: force and moment about its foot, to what few elements leave."""
    scene = built(water={"model": "westergaard", "level": 6.0, "faces": WET, "density": 1030.0})[1]
    water = added_mass(scene)
    assert water is not None
    H = 7.5  # the level above the lowest foot
    for name, foot in (("left", 0.0), ("middle", -1.5)):
        force = (water.coupling[name].T @ water.ground[:, 1]).reshape(-1, 3)
        h, factor = 6.0 - foot, 7.0 / 8.0 * 1030.0 * np.sqrt(H) * SIZE[name][0]
        assert force[:, 1].sum() == pytest.approx(factor * 2.0 / 3.0 * h**1.5, rel=0.01)
        about_foot = force[:, 1] @ (scene.blocks[name].points[:, 2] - foot)
        assert about_foot == pytest.approx(factor * (2.0 / 3.0 - 2.0 / 5.0) * h**2.5, rel=0.02)
        assert not force[:, [0, 2]].any()


def test_incompressible_water_that_is_lifted_presses_as_if_gravity_were_more():
    scene = built(
        water={"model": "incompressible", "level": 6.0, "faces": WET, "density": 1030.0, "length": 7.0}
    )[1]
    water = added_mass(scene)
    assert water is not None
    for name, foot in (("left", 0.0), ("middle", -1.5)):
        force = (water.coupling[name].T @ water.ground[:, 2]).reshape(-1, 3)
        h = 6.0 - foot
        lifted = 1030.0 * h**2 / 2.0 * SIZE[name][0]
        assert -force.sum(axis=0) == pytest.approx([0.0, lifted, 0.0], rel=1e-10, abs=1e-6)
        arm = -force[:, 1] @ (scene.blocks[name].points[:, 2] - foot)
        assert arm == pytest.approx(lifted * h / 3.0, rel=1e-10)


def test_grout_keeps_its_pressure_where_nothing_else_loads_the_joint():
    joints = {
        "lm": STRESSLESS["lm"] | {"grouting_pressure": 2e5},
        "mr": STRESSLESS["mr"] | {"grouting_pressure": 3.5e5},
    }
    for system in systems(joints=joints)[1]:
        _, gaps, _ = at_rest(grouted(system, 1e-13))
        for name, pressure, area in (("lm", 2e5, 15.0), ("mr", 3.5e5, 6.75)):
            of = system.law.joints[name]
            assert gaps.force[of, 0].sum() == pytest.approx(pressure * area, rel=1e-6)


def test_weight_in_stages_leaves_the_joints_alone():
    for system in systems(loads={"gravity": [0.0, 0.0, -G], "weight": "staged"}, joints=STRESSLESS)[1]:
        assert not system.force.any()
        assert not at_rest(system)[1].force.any()


def test_damping_has_the_ratios_that_are_asked_for():
    """Rayleigh's in the two frequencies and the hyperbola between; modal ones mode by mode, the last on."""
    rayleigh = systems()[1][1]
    omega = np.sqrt(rayleigh.K.diagonal())
    w1, w2 = 2.0 * np.pi * 13.0, 2.0 * np.pi * 170.0
    ratio = 0.04 * (w1 * w2 / omega + omega) / (w1 + w2)  # is 0.04 in both
    assert rayleigh.C.diagonal() / (2.0 * omega) == pytest.approx(ratio, rel=1e-9)
    config, scene = built(damping={"modal": [0.031, 0.052, 0.013]})
    modal = reduce_scene(scene, ALL_MODES, config.damping).system
    order = np.argsort(modal.K.diagonal())
    found = (modal.C.diagonal() / (2.0 * np.sqrt(modal.K.diagonal())))[order]
    assert found[:2] == pytest.approx([0.031, 0.052]) and found[2:] == pytest.approx(0.013)


def test_a_force_in_time_has_its_unit_scale_and_area(tmp_path):
    """5 kPa times 3 on the left's face at x = 3 m, 15 m2, push against x."""
    table = tmp_path / "force.csv"
    table.write_text("time,force\n0,0\n0.1,5\n0.3,-2\n0.4,0\n")
    entry = {"table": str(table), "unit": "kPa", "block": "left", "face": "xmax", "scale": 3.0, "start": 0.2}
    scene = built(loads={"force_history": [entry]})[1]
    (history,) = scene.every(ForceHistory)
    sizes = history.signal.at(0.2 + np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.5]))
    pushed = history.nodal.sum(axis=0)[:, None] * sizes
    assert pushed[0] == pytest.approx(-15.0 * 3.0 * 1e3 * np.array([0.0, 2.5, 5.0, 1.5, -2.0, 0.0]))
    assert pushed[1:] == pytest.approx(0.0, abs=1e-9)


def test_traction_across_a_tied_joint_is_the_mean_of_its_sides():
    """Uniform stress on either side of the joints: of the left's, the middle's and the right's by hand."""
    scene = built()[1]
    stress = {  # xx, yy, zz, xy, yz, xz [Pa]
        "left": np.array([3e5, 1e5, -2e5, 4e4, 7e4, -9e4]),
        "middle": np.array([-1e5, 5e5, 6e5, 8e4, -3e4, 2e4]),
        "right": np.array([7e5, -4e5, 1e5, -6e4, 5e4, 1e4]),
    }
    fields, first = {}, 0
    for name, sites in joint_sites(scene).blocks.items():
        k = len(sites.nodes)
        columns = slice(first, first := first + 1)
        of_one = np.broadcast_to(2.0 * stress[name][:, None], (k, 6, 1)).copy()
        offset = np.broadcast_to(stress[name], (k, 6)).copy()
        fields[name] = StressFields(sites.nodes, of_one, np.array([[1.5]]), offset, columns, "")
    found = joint_traction(scene, fields, first)
    number = {name: k for k, name in enumerate(fields)}
    begin = 0
    for joint in scene.joints.values():
        gaps = slice(begin, begin := begin + len(joint.gap))
        for side in joint.blocks:
            xx, _, _, xy, _, xz = stress[side]
            of_side = 0.5 * joint.axes @ np.array([xx, xy, xz])  # of the normal x
            assert found.rows[gaps, :, number[side]] == pytest.approx(3.0 * of_side)
        both = 0.5 * sum(stress[side][[0, 3, 5]] for side in joint.blocks)
        assert found.offset[gaps] == pytest.approx(joint.axes @ both)


def test_places_along_a_line_that_turns_back():
    """From (0, 0) over (10, 0) and (10, 10) to (6, 10) m: its ends go on, but win nothing by that.

    (1, 5.2) is 5.2 m from the first piece, and 4.8 m from what the last one would be further on.
    """
    line = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [6, 10, 0]])
    at = np.array([0.0, 10.0, 20.0, 24.0])
    points = np.array([[1, 5.2, 0], [-3, 0.5, 0], [4, 11, 0], [11, 4, 2], [12, -1, 0]])
    assert _along_line(line, at, points) == pytest.approx([1.0, -3.0, 26.0, 14.0, 10.0])


def test_still_water_of_a_stage_stays_and_is_no_higher_than_its_load():
    """Loads up to 3 m on the left and 5 m on the middle; from the first stage on the reservoir is at 4 m."""
    faces = dict(zip(("left", "middle"), WET, strict=True))
    water = [{"level": level, "faces": [faces[name]]} for name, level in (("left", 3.0), ("middle", 5.0))]
    stages = [{"name": "filling", "level": 4.0}, {"name": "grout", "grout": [{"joints": ["lm", "mr"]}]}]
    loads = {"hydrostatic": water, "gravity": [0.0, 0.0, -G]}
    scene = built(construction=stages, joints=STRESSLESS, loads=loads)[1]
    effect = construction(scene)
    assert effect is not None
    for name, head in (("left", 3.0), ("middle", 5.5)):
        pushed = effect.surface[name].reshape(-1, 3, len(scene.every(ConstructionStage))).sum(axis=0)[1]
        whole = 1000.0 * G * head**2 / 2.0 * SIZE[name][0]
        assert pushed[-2:] == pytest.approx(whole, rel=1e-12) and pushed[0] == 0.0
