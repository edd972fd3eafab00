"""Rotation, motion at the place, water by time and permanent displacement of rock wedges, by hand."""

import copy
import itertools
import json

import numpy as np
import pytest
import yaml
from rock_wedges import SLAB, hoek_and_bray, loads_of, only, random_wedge
from scipy.integrate import solve_ivp
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from test_cli import call

import romdam
from romdam.core.errors import ConfigError
from romdam.pipelines.wedges import assess_wedges
from romdam.postprocess.wedge_displacement import permanent_displacement
from romdam.postprocess.wedge_loads import WedgeLoads
from romdam.postprocess.wedge_rotation import overturning_axes, overturning_moments, turning_factor
from romdam.postprocess.wedges import slide

G, WATER = 9.81, 9810.0
WEIGHT = 2500 * G * 400  # of the slab, 10 by 10 by 4 m [N]


def slab(**more):
    """The slab, its sides changed by name."""
    raw = copy.deepcopy(SLAB)
    for name in list(more):
        for kind in ("planes", "surfaces"):
            if name in raw[kind]:
                raw[kind][name] |= more.pop(name)
    return raw | more


def dataset_of(raw, folder, run=None):
    path = folder / "w.yaml"
    path.write_text(yaml.safe_dump({"wedges": {"w": raw}}))
    return assess_wedges(path, run)


# overturning


def test_a_slab_overturns_about_its_toe(tmp_path):
    """W 5 m against water of 3 m behind it, at 1 m above the base, and uplift in the middle of the base."""
    raw = slab(x0={"water": {"level": 3.0}}, base={"water": {"level": 3.0, "share": 0.5}})
    found = dataset_of(raw, tmp_path)
    thrust, uplift = WATER * 4.5 * 10, 0.5 * WATER * 3.0 * 100
    factor = WEIGHT * 5.0 / (thrust * 1.0 + uplift * 5.0)
    assert float(found.dataset.wedge_overturning_factor[0, 0]) == pytest.approx(factor, rel=1e-12)
    assert found.rotations[0] == (
        *("w", "overturns", f"{factor:.4g}", "edge of base and x10"),
        *(f"{factor:.4g}", "0.000", "edge of base and x10", "-"),
    )
    at_rest = dataset_of(slab(), tmp_path).rotations  # nothing pushes it
    assert at_rest[0] == ("w", "overturns", "held", "-", "held", "0.000", "-", "-")
    edges = set(found.dataset.wedge_edge.values[0])
    assert edges == {f"edge of base and {side}" for side in ("x0", "x10", "y0", "y10")}


def test_a_force_turns_by_its_line_of_action(tmp_path):
    push = {"force": [0.0, 2e6, 0.0], "at": [5.0, -7.0, 3.0]}
    found = dataset_of(slab(thrust=push), tmp_path)
    assert float(found.dataset.wedge_overturning_factor[0, 0]) == pytest.approx(WEIGHT * 5.0 / (2e6 * 3.0))
    assert not found.warnings
    high = dataset_of(slab(thrust={"force": [0.0, 2e6, 0.0]}), tmp_path)
    assert "thrust.force acts in the wedge's centroid" in high.warnings[0]
    assert float(high.dataset.wedge_overturning_factor[0, 0]) == pytest.approx(WEIGHT * 5.0 / (2e6 * 2.0))
    code, out, err = call("wedges", tmp_path / "w.yaml")
    assert code == 0 and "overturns" in out and "thrust.force acts in the wedge's centroid" in err


def test_no_corner_moves_into_the_rock():
    """A turn by 1e-6 about every line that is found lifts all corners; about the others one goes down."""
    rng, several = np.random.default_rng(11), 0
    for trial in range(60):
        raw, _ = random_wedge(rng, 1 + trial % 3)
        _, wedge, geometry = only(raw)
        count = len(wedge.planes)
        axes = overturning_axes(geometry, count)
        several += len(axes) > 1

        def lowest(point, direction, count=count, geometry=geometry):
            turn = Rotation.from_rotvec(1e-6 * direction / np.linalg.norm(direction))
            moved = [turn.apply(p - point) + point - p for p in geometry.polygons[:count]]
            return min(float((m @ geometry.normals[k]).min()) for k, m in enumerate(moved)) / 1e-6

        for axis in axes:
            assert lowest(axis.point, axis.direction) > -1e-4
        corners = np.unique(np.round(np.concatenate(geometry.polygons[:count]), 6), axis=0)
        lines = [(a, b - a) for a in corners for b in corners if np.linalg.norm(b - a) > 1e-3]
        free = [line for line in lines if lowest(*line) > -1e-4]
        assert len(free) == len(axes)
    assert several > 10


def test_a_wedge_on_two_planes_stays_where_its_weight_holds_it():
    """Moments of Hoek and Bray's wedge about each line, from its corners: W times the arm of its centroid."""
    config, wedge, geometry = only(hoek_and_bray())
    loads, axes = loads_of(config, geometry), overturning_axes(geometry, 2)
    driving, resisting = overturning_moments(axes, loads, geometry.centroid)
    weight = wedge.density * G * geometry.volume
    for k, axis in enumerate(axes):
        arm = geometry.centroid - axis.point
        moment = -weight * (axis.direction[0] * arm[1] - axis.direction[1] * arm[0])
        assert driving[0, k] - resisting[0, k] == pytest.approx(moment, rel=1e-9)
    assert (driving[0] == 0.0).all()


# sliding that turns


def test_a_narrow_strip_turns_about_the_pole_of_its_closed_form(tmp_path):
    """Strength q a metre: P = 2 q x and P e = q (L^2 / 4 - x^2), x the pole from the middle."""
    length, wide, e = 10.0, 0.02, 3.0
    raw = slab(thrust={"force": [2e3, 0.0, 0.0], "at": [0.0, 5.0 + e, 0.0]})
    raw["surfaces"]["x10"]["through"] = [wide, 0, 0]
    raw["inside"] = [wide / 2, 5.0, 1.0]
    found = dataset_of(raw, tmp_path).dataset
    q = (0.5 * 2500 * G * 4.0 + 2e4) * wide
    pole = -e + np.sqrt(e**2 + length**2 / 4)
    assert float(found.wedge_turning_factor[0, 0]) == pytest.approx(2 * q * pole / 2e3, rel=2e-3)
    assert float(found.wedge_factor_of_safety[0, 0]) == pytest.approx(q * length / 2e3, rel=1e-9)


def test_a_square_under_a_torque_has_its_polar_strength():
    """int |x| dA over a square of side a: a^3 (sqrt 2 + ln(1 + sqrt 2)) / 6."""
    _, wedge, geometry = only(slab())
    torque = 4e6
    loads = WedgeLoads(
        ("weight", "couple"),
        np.array([[[0.0, 0.0, -WEIGHT], [0.0, 0.0, 0.0]]]),
        np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, torque]]]),
        np.zeros((1, 6)),
    )
    sliding = slide(geometry, wedge, np.array([[0.0, 1.0, -WEIGHT]]))
    strength = (0.5 * WEIGHT + 2e4 * 100) / 100
    polar = 10.0**3 * (np.sqrt(2) + np.log(1 + np.sqrt(2))) / 6
    found = turning_factor(geometry, wedge, loads, sliding)
    assert found[0] == pytest.approx(strength * polar / torque, rel=1e-3)


def least_by_search(force, at, friction, cohesion):
    """The least factor of the slab under its weight and a force at a point, on a grid of 200 by 200."""
    side = (np.arange(200) + 0.5) * 0.05
    x, y = (v.ravel() for v in np.meshgrid(side, side))
    area = 0.05**2
    push = WEIGHT - force[2]
    # the resultant on the base: moments of the weight and of the force about the origin
    moment = np.array([WEIGHT * 5.0 - force[2] * at[0] + force[0] * at[2],
                       WEIGHT * 5.0 - force[2] * at[1] + force[1] * at[2]]) / push  # fmt: skip
    a = push / 100.0
    pressure = a * (1 + 12 * (moment[0] - 5) * (x - 5) / 100 + 12 * (moment[1] - 5) * (y - 5) / 100)
    assert pressure.min() >= 0.0
    strength = (friction * pressure + cohesion) * area
    torque = (at[0] - 5) * force[1] - (at[1] - 5) * force[0]

    def factor(v):
        speed = np.hypot(v[0] - v[2] * (y - 5) / 5, v[1] + v[2] * (x - 5) / 5)
        power = force[0] * v[0] + force[1] * v[1] + torque * v[2] / 5
        return strength @ speed / power if power > 0 else 1e9

    starts = [(force[0], force[1], w) for w in (-1e5, 0.0, 1e5)]
    return min(
        minimize(factor, np.array(v) / np.linalg.norm(v), method="Nelder-Mead",
                 options={"xatol": 1e-7, "fatol": 1e-9, "maxiter": 4000}).fun
        for v in starts
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
def test_the_least_factor_is_that_of_a_search_over_all_motions(seed, tmp_path):
    rng = np.random.default_rng(seed)
    force = rng.uniform(-1, 1, 3) * [2e6, 2e6, 5e5]
    at = [rng.uniform(1, 9), rng.uniform(1, 9), rng.uniform(0, 1)]
    found = dataset_of(slab(thrust={"force": force.tolist(), "at": at}), tmp_path).dataset
    expected = least_by_search(force, at, 0.5, 2e4)
    assert float(found.wedge_turning_factor[0, 0]) == pytest.approx(expected, rel=1e-3)
    assert float(found.wedge_turning_factor[0, 0]) < float(found.wedge_factor_of_safety[0, 0])


def test_pressure_without_tension_stands_on_what_is_pressed():
    """The resultant at a sixth of the length from the edge: half is pressed, and slides as a whole."""
    _, wedge, geometry = only(slab())
    e = 10.0 / 2 - 10.0 / 6
    loads = WedgeLoads(
        ("weight", "push"),
        np.array([[[0.0, 0.0, -WEIGHT], [3e6, 0.0, 0.0]]]),
        np.array([[[0.0, 0.0, 0.0], [0.0, WEIGHT * e, 0.0]]]),
        np.zeros((1, 6)),
    )
    # the push acts in the centroid, 2 m above the base, and its moment about the base adds to the couple
    loads.moment[0, 1, 1] -= 3e6 * 2.0
    sliding = slide(geometry, wedge, loads.force.sum(axis=1))
    found = turning_factor(geometry, wedge, loads, sliding)
    assert found[0] == pytest.approx((0.5 * WEIGHT + 2e4 * 100) / 3e6, rel=1e-6)
    off = loads.moment.copy()
    off[0, 1, 1] += WEIGHT * 2.0  # beyond the edge
    assert np.isnan(
        turning_factor(geometry, wedge, WedgeLoads(loads.names, loads.force, off, loads.water), sliding)
    )


# permanent displacement


def pulses(*spans, step=0.001, until=3.0):
    """Times, and accelerations that are constant in spans (from, to, value)."""
    time = np.arange(0.0, until + step / 2, step)
    return time, sum(value * ((time >= a) & (time < b)) for a, b, value in spans)


def slid(raw, time, inertia):
    """Displacement of a wedge under its weight and inertia (nt, 3) over its mass."""
    config, wedge, geometry = only(raw)
    loads = loads_of(config, geometry, time)
    force = loads.force.sum(axis=1) + wedge.density * geometry.volume * inertia
    return permanent_displacement(slide(geometry, wedge, force), geometry, wedge, force, time)


def test_a_slab_slides_as_newmarks_block_in_a_rectangular_pulse():
    """V^2 / (2 y) (1 - y / A): pulse A for t_0, yield acceleration y, V = A t_0."""
    A, y, t_0 = 9.0, 0.5 * G + 2e4 * 100 / (2500 * 400), 0.4
    time, push = pulses((0.5, 0.5 + t_0, A))
    moved = slid(slab(), time, push[:, None] * [0.6, 0.8, 0.0])
    speed = A * t_0
    expected = speed**2 / (2 * y) * (1 - y / A)
    assert np.linalg.norm(moved[-1]) == pytest.approx(expected, rel=2e-3)
    assert moved[-1] / np.linalg.norm(moved[-1]) == pytest.approx([0.6, 0.8, 0.0], abs=1e-9)
    assert not moved[:500].any() and not np.diff(moved[-500:], axis=0).any()


def test_a_pulse_that_turns_round_brakes_and_then_moves_it_back():
    """A forwards and A backwards, t_0 each: braked with A + y, back with A - y, and stopped with y."""
    A, y, t_0 = 12.0, 0.5 * G + 2.0, 0.3
    time, push = pulses((0.5, 0.5 + t_0, A), (0.5 + t_0, 0.5 + 2 * t_0, -A))
    moved = slid(slab(), time, push[:, None] * [1.0, 0.0, 0.0])
    v = (A - y) * t_0
    ahead = v * t_0 / 2 + v**2 / (2 * (A + y))
    u = (A - y) * (t_0 - v / (A + y))
    back = u**2 / (2 * (A - y)) + u**2 / (2 * y)
    assert moved[:, 0].max() == pytest.approx(ahead, rel=3e-3)
    assert moved[-1, 0] == pytest.approx(ahead - back, rel=1e-2)


def test_a_slope_slides_down_and_not_up():
    """On 20 degrees with tan phi 0.5: down with A - g (0.5 cos - sin), and A does not push it up."""
    angle, A, t_0 = np.radians(20.0), 5.0, 0.3
    raw = slab(base={"dip": 20.0, "dip_direction": 90.0, "through": [5.0, 0.0, 0.0], "cohesion": 0.0})
    raw["inside"] = [5.0, 5.0, 2.0]
    down = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    y = G * (0.5 * np.cos(angle) - np.sin(angle))
    assert G * (0.5 * np.cos(angle) + np.sin(angle)) > A
    time, push = pulses((0.5, 0.5 + t_0, A), (2.5, 2.8, -A))
    moved = slid(raw, time, push[:, None] * down)
    assert moved[-1] @ down == pytest.approx(A * (A - y) * t_0**2 / (2 * y), rel=3e-3)
    assert abs(moved[-1] @ [0.0, 1.0, 0.0]) < 1e-12


def test_what_lifts_off_lands():
    """Weight turned round for t_0: it rises by g t_0^2, and is back after t_0 (2 + sqrt 2)."""
    t_0 = 0.2
    time, push = pulses((0.5, 0.5 + t_0, 2 * G), until=1.5)
    moved = slid(slab(), time, push[:, None] * [0.0, 0.0, 1.0])
    assert moved[:, 2].max() == pytest.approx(G * t_0**2, rel=5e-3)
    down = time[np.flatnonzero(moved[:, 2] > 1e-6)[-1]] - 0.5
    assert down == pytest.approx(t_0 * (2 + np.sqrt(2)), abs=4e-3)
    assert np.abs(moved[-1]).max() < 1e-6


def test_a_wedge_on_two_planes_slides_along_their_line():
    """An independent integration along the line, the normal forces from the equilibrium across it."""
    raw = hoek_and_bray()
    for plane in raw["planes"].values():
        plane["cohesion"] = 0.0
    _, wedge, geometry = only(raw)
    time = np.arange(0.0, 2.0005, 0.002)
    rng = np.random.default_rng(2)
    shake = np.stack([np.interp(time, np.linspace(0, 2, 30), rng.normal(size=30)) for _ in range(3)], axis=1)
    mass = wedge.density * geometry.volume
    force = np.array([0.0, 0.0, -G]) * mass + 2.0 * shake * mass
    sliding = slide(geometry, wedge, force)
    first, second = geometry.normals[:2]
    line = np.cross(first, second)
    line *= -np.sign(line[2]) / np.linalg.norm(line)
    friction = [plane.friction for plane in wedge.planes.values()]

    def rate(t, state):
        F = np.array([np.interp(t, time, force[:, k]) for k in range(3)])
        N = np.linalg.solve(np.column_stack([first, second, line]), -F)[:2]
        assert N.min() > 0.0
        excess = (F @ line - N @ friction) / mass
        return [state[1], excess if state[1] > 0.0 or excess > 0.0 else 0.0]

    # interval by interval, since it stops for good only until it is pushed again
    state, along = np.zeros(2), [0.0]
    for a, b in itertools.pairwise(time):
        state = solve_ivp(rate, (a, b), state, max_step=(b - a) / 8, rtol=1e-7).y[:, -1]
        state[1] = max(state[1], 0.0)
        along.append(state[0])
    moved = permanent_displacement(sliding, geometry, wedge, force, time)
    assert along[-1] > 0.05 and (sliding.factor < 1).any() and (sliding.factor > 1).any()
    assert moved[-1] @ line == pytest.approx(along[-1], rel=5e-3)
    assert np.linalg.norm(moved[-1] - (moved[-1] @ line) * line) < 1e-6 * along[-1]


# water by time, and the motion at the place


def test_water_that_rises_by_a_table(tmp_path):
    """A level from 0 to 3 m behind the slab: W and cohesion over rho g H^2 / 2, overturning by its third."""
    (tmp_path / "levels.csv").write_text("time,level\n0,0\n10,300\n20,300\n")
    raw = slab(x0={"water": {"table": "levels.csv", "unit": "cm", "share": 0.9}})
    found = dataset_of(raw, tmp_path).dataset
    assert found.time.values.tolist() == [0.0, 10.0, 20.0]
    thrust = 0.9 * WATER * 4.5 * 10
    assert found.wedge_driving_force.values[:, 0] == pytest.approx([0.0, thrust, thrust])
    assert found.wedge_overturning_factor.values[1:, 0] == pytest.approx([WEIGHT * 5 / thrust] * 2)
    (tmp_path / "levels.csv").write_text("time,level\n0,0\n10,300\n10,100\n")
    with pytest.raises(ConfigError, match=r"planes|surfaces\.x0\.water\.table.*does not rise over 10 s"):
        dataset_of(raw, tmp_path)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A block on two feet of rock, of which one moves later, with water that cracks let in."""
    folder = tmp_path_factory.mktemp("shaken")
    time = np.arange(200) * 0.01
    tau = ((time - 0.6) / 0.1) ** 2  # of a displacement like exp(-tau / 2), at rest before and after
    np.savetxt(folder / "pulse.txt", 3.0 * (1.0 - tau) * np.exp(-0.5 * tau))
    box = lambda x, z, width, depth: {  # noqa: E731
        "origin": [x, 0, z], "size": [width, 4, depth], "element_size": 2
    }  # fmt: skip
    joint = {"normal_stiffness": "20 GPa/m", "shear_stiffness": "10 GPa/m", "friction": 2.0}
    raw = {
        "materials": {"c": {"E": 30e9, "nu": 0.2, "rho": 2400}},
        "blocks": {
            "left": {"material": "c", "box": box(0, -2, 4, 2)},
            "right": {"material": "c", "box": box(4, -2, 4, 2)},
            "dam": {"material": "c", "box": box(0, 0, 8, 6)},
        },
        "supports": [
            {"block": "left", "face": "zmin"},
            {"block": "right", "face": "zmin", "motion": {"delay": 0.05}},
        ],
        "joints": {name: joint | {"between": [name, "dam"]} for name in ("left", "right")},
        "loads": {
            "gravity": [0, 0, -G],
            "joint_water": [{"joints": ["left"], "level": 2.0}],
            "force": [{"block": "dam", "at": [8, 4, 6], "force": [3e5, 1e5, 0]}],
        },
        "damping": {"rayleigh": {"frequencies": [5, 50], "ratio": 0.05}},
        "records": [{"name": "pulse", "unit": "m/s2", "dt": 0.01, "components": {
            "x": {"file": str(folder / "pulse.txt")}}}],
        "model": {"order": "full"},
        "transient": {"finest_step": 0.0025},
        "outputs": {
            "plots": False, "error_estimate": False,
            "nodes": {
                "foot": {"block": "right", "at": [6, 2, -2]},
                "side": {"block": "right", "at": [8, 2, 0]},
            },
            "stress": {"blocks": ["dam"], "sections": {"cut": {"blocks": ["dam"], "point": [0, 0, 1]}}},
        },
    }  # fmt: skip
    path = folder / "job.yaml"
    path.write_text(yaml.safe_dump(raw))
    return romdam.run(romdam.load_config(path), folder / "out").paths[0]


def test_a_wedge_is_shaken_by_the_motion_at_its_place(run, tmp_path):
    """The foot that moves later has the record 0.05 s later; the mean of two nodes is that of both."""
    mass = 2500 * 400.0
    of_base = dataset_of(slab(), tmp_path, run)
    assert "wedges.w is shaken by the base, but supports of the run move" in of_base.warnings[0]
    later = dataset_of(slab(inertia={"nodes": ["foot"]}), tmp_path, run)
    assert not later.warnings
    with romdam.open_result(run) as opened:
        ground = opened.dataset.ground_acceleration.values
        moves = opened.dataset.acceleration.values
    np.testing.assert_allclose(
        of_base.dataset.wedge_driving_force.values[:, 0],
        mass * np.linalg.norm(ground, axis=1),
        rtol=1e-9,
        atol=1.0,
    )
    np.testing.assert_allclose(
        later.dataset.wedge_driving_force.values[20:, 0],
        mass * np.linalg.norm(ground[:-20], axis=1),
        rtol=1e-6,
        atol=1e-6 * mass,
    )
    both = dataset_of(slab(inertia={"nodes": ["foot", "side"]}), tmp_path, run).dataset
    at_place = ground + moves.mean(axis=1)
    stays = at_place[:, 2] > -G  # impacts of the block lift the slab off at times
    assert stays.mean() > 0.9
    np.testing.assert_allclose(
        both.wedge_driving_force.values[stays, 0],
        mass * np.hypot(*at_place[stays, :2].T),
        rtol=1e-9,
        atol=1.0,
    )
    with pytest.raises(ConfigError, match=r"inertia\.nodes: the result has no node 'bank'; it has foot"):
        dataset_of(slab(inertia={"nodes": ["bank"]}), tmp_path, run)
    with pytest.raises(ConfigError, match="nodes have their motion from a result"):
        dataset_of(slab(inertia={"nodes": ["foot"]}), tmp_path)


def test_water_on_a_plane_is_that_in_a_joint_of_the_run(run, tmp_path):
    raw = slab(base={"water": {"joint": "left", "share": 0.5}}, inertia=False)
    found = dataset_of(raw, tmp_path, run).dataset
    with romdam.open_result(run) as opened:
        force = opened.dataset.joint_water_force.sel(joint="left").values
    assert force[0] == pytest.approx([0.0, 0.0, WATER * 2.0 * 16], rel=1e-9)
    expected = 0.5 * np.linalg.norm(force, axis=1) / 16 * 100
    assert found.wedge_plane_water.values[:, 0, 0] == pytest.approx(expected)
    with pytest.raises(ConfigError, match=r"no water in a joint 'middle'; it has it in left"):
        dataset_of(slab(base={"water": {"joint": "middle"}}), tmp_path, run)


def test_moments_of_joints_are_those_of_the_balance(run):
    """About the middle of the dam, whatever passes through its two joints at rest."""
    with romdam.open_result(run) as opened:
        dataset = opened.dataset.load()
    body = dataset.sel(body="dam")
    force, moment = dataset.joint_force.values[0], dataset.joint_moment.values[0]
    arm = dataset.joint_middle.values - body.body_middle.values
    total = np.concatenate([force.sum(axis=0), (moment + np.cross(arm, force)).sum(axis=0)])
    size = np.abs(total).max()
    assert total == pytest.approx(body.joints_at_rest.values, abs=1e-8 * size)
    # by hand: weight in the middle, and the force at (8, 4, 6), 3 m above the middle
    push = np.array([3e5, 1e5, 0.0])
    assert total[3:] == pytest.approx(-np.cross([4.0, 2.0, 3.0], push), abs=1e-6 * size)


def test_a_section_overturns_as_the_joints_beneath_it_do(run, tmp_path):
    """Moments about the slab's edges differ by the metre of the block between them."""
    of_joints = dataset_of(slab(thrust={"joints": ["left"], "on": "left"}, inertia=False), tmp_path, run)
    more = dataset_of(slab(thrust={"joints": ["right"], "on": "right"}, inertia=False), tmp_path, run)
    of_section = dataset_of(slab(thrust={"sections": ["cut"]}, inertia=False), tmp_path, run)
    none = dataset_of(slab(inertia=False), tmp_path, run)

    def net(found):
        d = found.dataset
        return dict(
            zip(
                d.wedge_edge.values[0],
                (d.wedge_edge_driving_moment - d.wedge_edge_resisting_moment).values[0, 0],
                strict=True,
            )
        )

    metre = 2400 * G * 8 * 4 * 1.0
    arms = {"x0": 4.0, "x10": 6.0, "y0": 2.0, "y10": 8.0}  # of (4, 2) from each edge
    for side, arm in arms.items():
        edge = f"edge of base and {side}"
        joints = net(of_joints)[edge] + net(more)[edge] - net(none)[edge]
        assert joints - net(of_section)[edge] == pytest.approx(-metre * arm, rel=1e-4)


def test_few_rows_are_said(run, tmp_path):
    """Rows every 0.05 s of a record of 0.01 s are told; the result's own are not."""
    assert json.loads(dataset_of(slab(inertia=False), tmp_path, run).dataset.attrs["wedge_warnings"]) == []
    from romdam.config.sections.wedges import read_wedges
    from romdam.postprocess.wedge_histories import wedge_dataset

    with romdam.open_result(run) as opened:
        few = wedge_dataset(
            read_wedges(tmp_path / "w.yaml"), opened.dataset.isel(time=slice(None, None, 20)), "w"
        )
    assert "of the written rows, every 0.05 s" in few.attrs["wedge_warnings"]
