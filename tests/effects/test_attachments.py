"""Anchors, masses and dashpots on blocks, by closed forms, by hand, and by an integration of their own."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
import yaml
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.sparse import csr_matrix
from simulating import simulated
from suite_jobs import BASE, made, summary, write_job

import romdam
from romdam.config import parse_config
from romdam.config.effects import EFFECTS
from romdam.config.sections.job import DampingConfig
from romdam.core.attachment import Attachment
from romdam.core.errors import ConfigError
from romdam.core.motion import MovingSupports
from romdam.core.scene import Scene
from romdam.effects.full_order import assemble_full
from romdam.geometry.elements import ELEMENTS
from romdam.postprocess.attached import attached_forces
from romdam.records.processing.support_motions import add_support_rows
from romdam.reduction.mode_choice import ALL_MODES
from romdam.reduction.natural_modes import natural_modes, total_mass
from romdam.reduction.refinement import embedding
from romdam.reduction.synthesis import reduce_scene, reduce_scene_twice
from romdam.scene.build import build_scene
from romdam.scene.points import point_weights
from romdam.terminal.tables import attached_tables

E, RHO, L, AREA = 20e9, 2500.0, 40.0, 4.0
BAR = {
    "materials": {"bar": {"E": E, "nu": 0.0, "rho": RHO}},
    "blocks": {
        "bar": {
            "material": "bar",
            "box": {"origin": [0, 0, 0], "size": [L, 2, 2], "element_size": [2, 2, 2], "element": "hex20"},
        }
    },
    "supports": [{"block": "bar", "face": "xmin"}],
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"x": 1}}],
    "model": {"modes": "all"},
    "transient": {"finest_step": 0.01},
    "outputs": {"nodes": {"end": {"block": "bar", "at": [L, 0, 0]}}},
}
LONE = DampingConfig()
IMPEDANCE = AREA * np.sqrt(E * RHO)  # of the bar along its axis [N s/m]


def scene_of(raw: dict[str, Any]) -> Scene:
    return build_scene(parse_config(raw, "s.yaml"), Path(), "s.yaml")


def both(scene: Scene, damping: DampingConfig = LONE) -> list[Any]:
    return [assemble_full(scene, damping), reduce_scene(scene, ALL_MODES, damping).system]


def end_face_dashpot(scene: Scene, c: float) -> Attachment:
    """A dashpot on the mean motion of the bar's end along it."""
    block, none = scene.blocks["bar"], np.zeros(1)
    end = np.flatnonzero(block.points[:, 0] > L - 1e-9)
    # consistent shares of an 8-node facet: -1/12 at corners, 1/3 at middles
    corner = np.isin(block.points[end, 1], (0.0, 2.0)) & np.isin(block.points[end, 2], (0.0, 2.0))
    rows = np.zeros((1, block.points.size))
    rows[0, 3 * end] = np.where(corner, -1.0 / 12.0, 1.0 / 3.0)
    return Attachment("pads", "end", {"bar": csr_matrix(rows)}, none, np.array([c]), none, none, none)


@pytest.mark.parametrize("share", [0.1, 1.0, 8.0])
def test_frequency_of_a_bar_with_a_mass_at_its_end(share):
    """z tan z = m L / M with z = omega L / c, of a bar of mass m L; 1e-4 of the frequency on 20 hex20."""
    raw = BAR | {"masses": {"gate": {"block": "bar", "face": "xmax", "mass": share * RHO * AREA * L}}}
    z = brentq(lambda z: z * np.tan(z) - 1.0 / share, 1e-6, np.pi / 2 - 1e-9)
    exact = z * np.sqrt(E / RHO) / L / (2 * np.pi)
    scene = scene_of(raw)
    modes = natural_modes(scene, LONE, 12)
    along = modes.freq[modes.motion[:, 0] > 0.99]
    assert abs(along[0] / exact - 1.0) < 1e-4
    system = reduce_scene(scene, ALL_MODES, LONE).system
    assert np.abs(np.sqrt(system.K.diagonal()) / (2 * np.pi) / exact - 1.0).min() < 1e-4
    assert modes.total_mass == pytest.approx((1.0 + share) * RHO * AREA * L)


@pytest.mark.parametrize("stiffness", [2e8, 2e9, 4e10])
def test_bar_with_an_anchor_at_its_end_under_its_weight(stiffness):
    """u(L) = (q L^2 / 2 - T L) / (E A + k L); its frequency by tan z = -z E A / (k L)."""
    q, tension = RHO * AREA * 9.81, 0.8 * 3e6
    raw = BAR | {
        "loads": {"gravity": [9.81, 0, 0]},
        "anchors": {
            "A": {
                "head": {"block": "bar", "at": [L, 1, 1]},
                "foot": [L - 25.0, 1, 1],
                "stiffness": stiffness,
                "pretension": 3e6,
                "loss": "20 %",
            }
        },
    }
    raw = json.loads(json.dumps(raw))
    raw["blocks"]["bar"]["box"]["element"] = "hex8"  # whose middle is the mean of its corners
    flexible = L / (E * AREA)
    u = (q * L**2 / (2 * E * AREA) - tension * flexible) / (1.0 + stiffness * flexible)
    z = brentq(lambda z: np.sin(z) * stiffness * L + z * E * AREA * np.cos(z), np.pi / 2, np.pi - 1e-9)
    exact = z * np.sqrt(E / RHO) / L / (2 * np.pi)
    scene = scene_of(raw)
    for system in both(scene):
        history = simulated(system, np.zeros((3, 21)), 0.01, "generalized_alpha", initial_state="static")
        assert history.disp[:, 0] == pytest.approx(u, rel=1e-9)
        assert history.attached[:, 0] == pytest.approx(tension + stiffness * u, rel=1e-9)
        assert history.attached_peaks[:, 0] == pytest.approx(tension + stiffness * u, rel=1e-9)
    modes = natural_modes(scene, LONE, 12)
    assert abs(modes.freq[modes.motion[:, 0] > 0.99][0] / exact - 1.0) < 2e-3  # hex8


def with_end_face_dashpot() -> Scene:
    return scene_of(BAR).with_effects(end_face_dashpot(scene_of(BAR), IMPEDANCE))


def with_damper(foot: float) -> Scene:
    """From the middle of the end, the mean of four nodes, along the bar to a place of the base."""
    raw = json.loads(json.dumps(BAR))
    raw["blocks"]["bar"]["box"] |= {"element": "hex8", "element_size": [1, 2, 2]}
    ends = {"head": {"block": "bar", "at": [L, 1, 1]}, "foot": [foot, 1, 1]}
    return scene_of(raw | {"dampers": {"end": ends | {"damping": IMPEDANCE}}})


@pytest.mark.parametrize(
    "made_scene",
    [with_end_face_dashpot, lambda: with_damper(L + 3.0), lambda: with_damper(-7.0)],
    ids=["face", "damper", "damper from the foot"],
)
@pytest.mark.parametrize("reduced", [False, True])
def test_dashpot_of_the_impedance_lets_a_wave_out(reduced, made_scene):
    """A bar that ends in c = A sqrt(E rho), shaken by a pulse: no wave comes back from its end.

    Relative to the base the solution is that of a half-infinite bar whose mass is shaken over L only; at the
    end u(t) = integral of -a over the paths of waves, here by the method of characteristics.
    """
    scene = made_scene()
    dt, n = 2e-4, 400
    t = dt * np.arange(n)
    pulse = np.where(t < 0.02, 5.0 * np.sin(np.pi * t / 0.02) ** 2, 0.0)
    system = both(scene)[reduced]
    history = simulated(system, np.stack([pulse, 0 * t, 0 * t]), dt, "generalized_alpha")
    # right-going and left-going characteristics: v -+ c e stay but for -a; u = 0 at x = 0, v = -c e at x = L
    c = np.sqrt(E / RHO)
    cells = 400
    h = L / cells / c
    right, left = np.zeros(cells), np.zeros(cells)  # (v - c e) / 2 moves right, (v + c e) / 2 left
    speed, when = [0.0], [0.0]
    for step in range(int(t[-1] / h)):
        a = np.interp((step + 0.5) * h, t, pulse)
        at_foot, at_end = left[0], right[-1]
        right, left = np.append(-at_foot, right[:-1]), np.append(left[1:], 0.0)
        right, left = right - a * h / 2.0, left - a * h / 2.0
        speed.append(at_end - a * h / 2.0)
        when.append((step + 1) * h)
    end = np.concatenate([[0.0], np.cumsum(np.array(speed[1:])) * h])
    exact = np.interp(t, when, end)
    assert np.abs(history.disp[:, 0] - exact).max() < 0.01 * np.abs(exact).max()
    assert history.stats["ledger_imbalance"] < 1e-10
    (pad,) = scene.every(Attachment)
    # positive where its ends go apart: the end moves along x, away from a foot behind it
    moves = pad.rows["bar"].sum()
    np.testing.assert_allclose(history.attached[:, 0], IMPEDANCE * moves * history.vel[:, 0], atol=1.0)
    late = t > 0.02 + 2.2 * L / c
    assert np.abs(history.vel[late, 0]).max() < 0.01 * np.abs(history.vel[:, 0]).max()


def test_anchors_and_masses_against_an_integration_of_their_own():
    """Two blocks apart, tied by an anchor, with a gate: the element matrices and R by hand, steps of 1e-9."""
    raw = {key: value for key, value in BASE.items() if key not in ("pipeline", "damping")} | {
        "joints": {"gap": BASE["joints"]["gap"] | {"gap": "1 m"}},
        "anchors": {
            "A": {
                "head": {"block": "left", "at": [5, -5, 15]},
                "foot": {"block": "right", "at": [0, 10, 20]},
                "stiffness": 3e8,
                "pretension": 4e5,
            }
        },
        "masses": {"gate": {"block": "right", "at": [5, 5, 20], "mass": 2e5}},
        "loads": {"gravity": [0, 0, -9.81]},
    }
    scene = scene_of(raw)
    without = {key: value for key, value in raw.items() if key not in ("anchors", "masses")}
    bare = assemble_full(scene_of(without), LONE)
    system, reduced = both(scene)
    # R by hand: nodes by their position, in the numbering of the bare system
    probes = {"head": ("left", [5, -5, 15]), "foot": ("right", [0, 10, 20]), "gate": ("right", [5, 5, 20])}
    seen = without | {
        "outputs": {"nodes": {name: {"block": b, "at": at} for name, (b, at) in probes.items()}}
    }
    at = assemble_full(scene_of(seen), LONE).observe.toarray().reshape(3, 3, -1)
    axis = np.array([5, -5, 15.0]) - [0, 10, 20]
    axis /= np.linalg.norm(axis)
    R, G = axis @ (at[0] - at[1]), at[2]
    M = bare.M.toarray() + 2e5 * G.T @ G
    K = bare.K.toarray() + 3e8 * np.outer(R, R)
    static = bare.force - 4e5 * R - 2e5 * 9.81 * G[2]
    shaken = bare.load + 2e5 * G.T
    t = 0.01 * np.arange(31)
    ground = np.stack([f * np.sin(w * t) for f, w in ((3.0, 20.0), (4.0, 33.0), (2.0, 41.0))])
    rest, inverse = np.linalg.solve(K, static), np.linalg.inv(M)
    size = len(rest)

    def rate(time, y):
        a = np.array([np.interp(time, t, row) for row in ground])
        return np.concatenate([y[size:], inverse @ (static - K @ y[:size] - shaken @ a)])

    start = np.concatenate([rest, np.zeros(size)])
    exact = solve_ivp(rate, (0.0, t[-1]), start, "DOP853", t_eval=t, rtol=1e-9, atol=1e-12).y[:size].T
    force = 4e5 + 3e8 * exact @ R
    history = simulated(reduced, ground, 0.01, "modal", initial_state="static")
    scale = np.abs(exact - rest).max()
    assert np.abs(history.q @ reduced_probe(reduced).T - exact @ bare.observe.T).max() < 1e-6 * scale
    assert np.abs(history.attached[:, 0] - force).max() < 1e-6 * np.abs(force - force[0]).max()
    least, largest = history.attached_peaks[:, 0]
    assert least <= force.min() + 1e-6 * np.ptp(force) and largest >= force.max() - 1e-6 * np.ptp(force)
    fine = simulated(system, np.stack([np.interp(np.arange(6001) * 5e-5, t, row) for row in ground]), 5e-5,
                     "generalized_alpha", stride=200, initial_state="static")  # fmt: skip
    assert np.abs(fine.attached[:, 0] - force).max() < 5e-3 * np.abs(force - force[0]).max()


def reduced_probe(system: Any) -> np.ndarray:
    return system.observe[system.of_probes].toarray()


@pytest.mark.parametrize("reduced", [False, True])
def test_ends_of_a_moved_bar_feel_what_its_support_displaces(reduced):
    """A chain of rods of its own whose foot moves against the base, with all three attachments at its end.

    Spring and dashpot go from the end to the base, which the support leaves behind by d(t); hex8 without
    lateral strain are rods with their consistent mass. Steps of 1 ms are within 2e-3.
    """
    raw = json.loads(json.dumps(BAR))
    raw["blocks"]["bar"]["box"]["element"] = "hex8"
    raw["supports"][0]["motion"] = {"delay": 0.04, "factor": 1.6}
    k, c, m = 6e8, 4e6, 1.5e5
    raw["anchors"] = {
        "A": {"head": {"block": "bar", "at": [L, 1, 1]}, "foot": [L - 9.0, 1, 1], "stiffness": k}
    }
    raw["masses"] = {"gate": {"block": "bar", "face": "xmax", "mass": m}}
    scene = scene_of(raw)
    rows = scene.every(Attachment)[0].rows
    pad = Attachment("pads", "end", rows, damping=np.array([c]))
    twice = Attachment("twice", "end", {"bar": 2.0 * rows["bar"]}, mass=np.array([m / 4.0]))
    scene = scene.with_effects(*scene.every(Attachment), pad, twice)
    shaken = total_mass(scene.without(MovingSupports), None)
    assert shaken[0] == pytest.approx(RHO * AREA * L + 2.0 * m)
    dt, count = 1e-3, 400
    t = dt * np.arange(count)
    acc = np.where(t < 0.2, 4.0 * np.sin(np.pi * t / 0.1) * np.sin(np.pi * t / 0.2) ** 2, 0.0)
    ground = add_support_rows(np.stack([acc, 0 * acc, 0 * acc]), dt, scene.find(MovingSupports).motions)
    rods, h = 20, L / 20
    K, M = np.zeros((rods + 1, rods + 1)), np.zeros((rods + 1, rods + 1))
    for rod in range(rods):
        at = np.ix_([rod, rod + 1], [rod, rod + 1])
        K[at] += E * AREA / h * np.array([[1, -1], [-1, 1]])
        M[at] += RHO * AREA * h / 6.0 * np.array([[2, 1], [1, 2]])
    K[-1, -1] += k
    M[-1, -1] += 2.0 * m
    inverse = np.linalg.inv(M[1:, 1:])

    def rate(time, y):
        a, of_foot, d = (np.interp(time, t, row) for row in (acc, ground[3], ground[9]))
        u, v = y[:rods], y[rods:]
        force = -M[1:, 1:].sum(axis=1) * a - M[1:, 0] * (a + of_foot) - K[1:, 0] * d - K[1:, 1:] @ u
        force[-1] -= c * v[-1]
        return np.concatenate([v, inverse @ force])

    solved = solve_ivp(rate, (0.0, t[-1]), np.zeros(2 * rods), "DOP853", t_eval=t, rtol=1e-9, atol=1e-12)
    u, v = solved.y[rods - 1], solved.y[-1]
    history = simulated(both(scene)[reduced], ground, dt, "generalized_alpha")
    for found, exact in (
        (history.disp[:, 0], u),
        (history.attached[:, 0], k * u),
        (history.attached[:, 1], c * v),
    ):
        assert np.abs(found - exact).max() < 2e-3 * np.abs(exact).max()
    assert history.stats["ledger_imbalance"] < 1e-10
    if reduced:  # peaks are of every step, whichever are written
        lone = both(scene.with_effects(*scene.every(Attachment)[:2]))[1]
        every, few = (simulated(lone, ground, dt, "generalized_alpha", stride=one) for one in (1, 40))
        assert few.attached_peaks == pytest.approx(every.attached_peaks, rel=1e-9)
        beside = simulated(both(scene)[1], ground, dt, "generalized_alpha", stride=40)  # with a dashpot
        assert beside.attached_peaks[:, 0] == pytest.approx(
            [history.attached[:, 0].min(), history.attached[:, 0].max()], rel=1e-9
        )
        assert beside.attached_peaks[:, 1] == pytest.approx(
            [beside.attached[:, 1].min(), beside.attached[:, 1].max()], rel=1e-12
        )
        assert np.ptp(few.attached) < 0.99 * np.ptp(every.attached)


@pytest.mark.parametrize("element", ["hex8", "hex20", "hex27", "tet4", "tet10", "wedge6", "wedge15"])
def test_a_point_in_an_element_is_the_mean_that_its_functions_make(element):
    """A displacement that is linear in the position is met wherever the point is; so are the weights' sum."""
    raw = {
        "materials": {"m": {"E": 1e9, "nu": 0.2, "rho": 2000}},
        "blocks": {"b": {"material": "m", "box": {
            "origin": [1, 2, 3], "size": [4, 6, 2], "element_size": [2, 2, 1], "element": element}}},
        "supports": [{"block": "b", "face": "zmin"}],
        "records": BAR["records"], "model": {"modes": 3}, "transient": {"finest_step": 0.01},
    }  # fmt: skip
    assert element in ELEMENTS
    block = scene_of(raw).blocks["b"]
    gradient, rng = np.array([[1.0, 2, 3], [-4, 5, 6], [7, -8, 9]]), np.random.default_rng(4)
    for point in rng.uniform([1, 2, 3], [5, 8, 5], (20, 3)):
        nodes, weights = point_weights(block, tuple(point), 1e-6, "here")
        assert weights.sum() == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_allclose(weights @ block.points[nodes] @ gradient, point @ gradient, atol=1e-9)
    # a little outside it goes on; farther it is refused with the place
    nodes, weights = point_weights(block, (5.03, 4.2, 3.9), 0.05, "here")
    np.testing.assert_allclose(weights @ block.points[nodes], (5.03, 4.2, 3.9), atol=1e-9)
    with pytest.raises(
        ConfigError, match=r"here: \(5.2, 4, 4\) is outside its elements, by 0.2 m, limit 0.05 m"
    ):
        point_weights(block, (5.2, 4.0, 4.0), 0.05, "here")


def test_a_spring_holds_what_only_joints_held_before():
    """A block on a frictionless base floats sideways until anchors stop it; reduced as at full order."""
    raw = {
        "materials": {"m": {"E": 2e9, "nu": 0.2, "rho": 2400}},
        "blocks": {
            name: {
                "material": "m",
                "box": {"origin": [0, 0, z], "size": [4, 4, h], "element_size": [2, 2, 2]},
            }
            for name, z, h in (("ground", -2, 2), ("block", 0, 4))
        },
        "supports": [{"block": "ground", "face": "zmin"}],
        "joints": {"base": {"between": ["ground", "block"], "normal_stiffness": "20 GPa/m"}},
        "loads": {"gravity": [0, 0, -9.81]},
        "records": BAR["records"],
        "model": {"modes": "all"},
        "transient": {"finest_step": 0.01},
        "damping": {"rayleigh": {"frequencies": [2.0, 20.0], "ratio": 0.05}},
    }
    places = {
        "a": ([4, 1, 3], [9, 1, 3]), "b": ([1, 4, 3], [1, 9, 3]), "c": ([3, 4, 1], [3, 9, 1]),
        "d": ([1, 1, 4], [1, 1, 9]), "e": ([3, 1, 4], [3, 1, 9]), "f": ([2, 3, 4], [2, 3, 9]),
    }  # fmt: skip
    for count, floats in ((0, True), (3, True), (5, True), (6, False)):
        anchors = {
            name: {"head": {"block": "block", "at": head}, "foot": foot, "stiffness": 5e7}
            for name, (head, foot) in list(places.items())[:count]
        }
        scene = scene_of(raw | {"anchors": anchors})
        damping = parse_config(raw, "s.yaml").damping
        full, reduced = both(scene, damping)
        assert full.floating is reduced.floating is floats
        if floats and not count:
            continue
        t = 0.01 * np.arange(61)
        ground = np.stack([2.0 * np.sin(9 * t), 1.5 * np.sin(11 * t), 0 * t])
        a, b = (simulated(one, ground, 0.01, "generalized_alpha") for one in (full, reduced))
        assert np.abs(a.jump - b.jump).max() < 1e-8 * np.abs(a.jump).max()
        assert np.abs(a.attached - b.attached).max() < 1e-7 * np.abs(a.attached).max()
        for name in ("damping", "strain", "kinetic"):
            np.testing.assert_allclose(a.energy[name], b.energy[name], rtol=1e-6, atol=1e-9)


def test_anchor_to_rock_without_mass():
    """Its foot follows the rock's static answer at once: reduced as at full order."""
    raw = {
        "materials": {"m": {"E": 2e9, "nu": 0.2, "rho": 2400}},
        "blocks": {
            name: {
                "material": "m",
                "mass": name != "ground",
                "box": {"origin": [0, 0, z], "size": [4, 4, h], "element_size": [2, 2, 2]},
            }
            for name, z, h in (("ground", -4, 4), ("block", 0, 4))
        },
        "supports": [{"block": "ground", "face": "zmin"}],
        "joints": {
            "base": {"between": ["ground", "block"], "normal_stiffness": "20 GPa/m", "friction": 0.8,
                     "shear_stiffness": "10 GPa/m"}
        },
        "loads": {"gravity": [0, 0, -9.81]},
        "records": BAR["records"],
        "model": {"modes": "all"},
        "transient": {"finest_step": 0.01},
        "anchors": {
            "down": {
                "head": {"block": "block", "at": [1, 1, 3.7]},
                "foot": {"block": "ground", "at": [2, 1.4, -3]},
                "stiffness": 4e9, "pretension": 3e5,
            }
        },
    }  # fmt: skip
    scene = scene_of(raw)
    full, reduced = both(scene)
    assert (reduced.M.diagonal() == 0.0).any()
    t = 0.005 * np.arange(101)
    ground = np.stack([6.0 * np.sin(19 * t), 3.0 * np.sin(31 * t), 0 * t])
    a, b = (simulated(one, ground, 0.005, "generalized_alpha") for one in (full, reduced))
    assert (a.state == 0).any() and np.ptp(a.attached) > 1e4
    assert np.abs(a.jump - b.jump).max() < 1e-7 * np.abs(a.jump).max()
    assert np.abs(a.attached - b.attached).max() < 1e-7 * np.ptp(a.attached)
    with pytest.raises(ConfigError, match=r"masses.m: block 'ground' has no mass"):
        scene_of(raw | {"masses": {"m": {"block": "ground", "at": [1, 1, -1], "mass": 100.0}}})


@pytest.mark.parametrize("rock", [True, False], ids=["rock with mass", "massless rock"])
@pytest.mark.parametrize("water", [{}, {"model": "westergaard"}], ids=["dry", "water"])
def test_a_motion_is_the_same_in_the_finer_basis(rock, water):
    """Displacements of any motion of the first model, whatever springs, masses and water have turned."""
    raw = {
        "materials": {"m": {"E": 2e9, "nu": 0.2, "rho": 2400}},
        "blocks": {
            name: {"material": "m", "mass": rock or name != "ground",
                   "box": {"origin": [x, 0, z], "size": [4, 4, h], "element_size": [2, 2, 2]}}
            for name, x, z, h in (("ground", 0, -4, 4), ("block", 0, 0, 6), ("other", 4, 0, 6))
        },
        "supports": [{"block": "ground", "face": "zmin"}, {"block": "other", "face": "zmin"}],
        "joints": {
            name: {"between": between, "normal_stiffness": "20 GPa/m", "friction": 0.8,
                   "shear_stiffness": "10 GPa/m"}
            for name, between in (("base", ["ground", "block"]), ("side", ["block", "other"]))
        },
        "damping": {"rayleigh": {"frequencies": [2.0, 20.0], "ratio": 0.05}},
        "records": BAR["records"], "model": {"modes": 3}, "transient": {"finest_step": 0.01},
        "anchors": {
            "down": {"head": {"block": "block", "at": [1, 1, 5.7]},
                     "foot": {"block": "ground", "at": [2, 1.4, -3]}, "stiffness": 4e9},
            "across": {"head": {"block": "block", "at": [1, 1, 3]},
                       "foot": {"block": "other", "at": [7, 3, 4]}, "stiffness": 2e9},
        },
        "masses": {"gate": {"block": "block", "face": "zmax", "mass": 9e4}},
    }  # fmt: skip
    if water:
        faces = [{"block": name, "face": "ymin"} for name in ("block", "other")]
        raw["water"] = water | {"level": 5.0, "faces": faces}
    config = parse_config(raw, "s.yaml")
    scene = build_scene(config, Path(), "s.yaml")
    coarse, fine = reduce_scene_twice(scene, config.model, config.damping)
    assert fine.system.size > coarse.system.size and len(fine.turns) == 1 + bool(water)
    q = np.random.default_rng(5).normal(size=coarse.system.size) / (1.0 + coarse.system.K.diagonal())
    embedded = embedding(scene, coarse, fine) @ q
    for name, basis in coarse.basis.items():
        u, finer = basis.vectors.apply(q[basis.columns]), fine.basis[name]
        np.testing.assert_allclose(
            finer.vectors.apply(embedded[finer.columns]), u, atol=1e-8 * np.abs(u).max()
        )


@pytest.mark.parametrize("side", [1.0, 9.0])
def test_an_anchor_on_one_side_of_a_scene_that_is_alike_on_both(side):
    """Equivalent contacts are merged only where the anchor leaves them so: as generalised-alpha has it."""
    raw = {key: value for key, value in BASE.items() if key not in ("pipeline", "damping")}
    raw = json.loads(json.dumps(raw)) | {"damping": {"rayleigh": {"frequencies": [5, 50], "ratio": 0.05}}}
    for name in ("left", "right"):
        raw["blocks"][name]["box"]["size"][0] = 10
    raw["anchors"] = {
        "A": {"head": {"block": "right", "at": [side, 10, 20]}, "foot": [side, 30, 0], "stiffness": 5e8}
    }
    raw["outputs"]["nodes"] = {"top": {"block": "right", "at": [side - 1.0 if side < 5 else 10, 0, 20]}}
    scene = scene_of(raw)
    config = parse_config(raw, "s.yaml")
    reduced = reduce_scene(scene, ALL_MODES, config.damping).system
    t = 0.01 * np.arange(61)
    ground = np.stack([0 * t, 6 * np.sin(25 * t), 0 * t])
    fine = np.stack([np.interp(np.arange(6001) * 1e-4, t, row) for row in ground])
    found = simulated(reduced, fine, 1e-4, "modal", stride=100)
    exact = simulated(reduced, fine, 1e-4, "generalized_alpha", stride=100)
    assert (exact.state == 0).any()
    for name in ("attached", "jump"):
        own, other = getattr(found, name), getattr(exact, name)
        assert np.abs(own - other).max() < 0.01 * np.abs(other).max(), name


RIGHT = {"head": {"block": "right", "at": [2.5, 5, 20]}, "foot": [2.5, 5, -10], "stiffness": 2e7}


DAMPER = {key: RIGHT[key] for key in ("head", "foot")} | {"damping": 2e6}


def job(tmp_path: Path, **sections: Any) -> Path:
    base = {key: value for key, value in BASE.items() if key not in ("pipeline",)}
    path = write_job(tmp_path, 1)
    path.write_text(yaml.safe_dump(base | {"loads": {"gravity": [0, 0, -9.81]}} | sections))
    return path


def test_a_run_has_the_forces_says_what_is_slack_and_balances(tmp_path):
    """Forces at every row, their peaks, warnings of both limits, and a balance that holds with them."""
    slack = RIGHT | {"pretension": 1e3, "strength": 4e4}
    weak = RIGHT | {"pretension": "2 MN", "strength": "1.9 MN"}
    path = job(tmp_path, anchors={"A": weak, "B": slack})
    result = romdam.run(path, tmp_path / "out").results[0].path
    data = xr.load_dataset(result)
    assert data.anchor.values.tolist() == ["A", "B"] and data.anchor_force.dims == ("time", "anchor")
    force = data.anchor_force.values
    assert (data.anchor_force_least.values <= force.min(axis=0)).all()
    assert (data.anchor_force_largest.values >= force.max(axis=0) - 1e-9).all()  # round-off of 2 MN
    np.testing.assert_allclose(np.diff(force, axis=1), 1e3 - 2e6)  # springs alike
    said = " ".join(json.loads(data.attrs["run_warnings"]))
    assert "anchors.B goes slack: its force falls to" in said and "anchors.A goes slack" not in said
    assert (
        "anchors.A is loaded above its strength: its force reaches 1996 kN" in said
        and "limit 1900 kN" in said
    )
    assert "anchors.B is loaded" not in said
    assert data.imbalance_at_rest.values.max() < 1e-9
    rows = attached_forces(data)
    assert [(one.of, one.name) for one in rows] == [("anchor", "A"), ("anchor", "B")]
    assert [one.rest for one in rows] == force[0].tolist()
    assert rows[1].least == float(data.anchor_force_least[1])
    (table,) = attached_tables({"r0": data})
    assert list(table.columns[3].cells) == [f"{1e-3 * value:.1f}" for value in force[0]]
    assert not attached_tables({"r0": data.drop_dims("anchor")})
    # at rest the right block's supports bear its weight and what the anchors pull down
    k = data.body.values.tolist().index("right")
    weight = 2440.0 * 5 * 10 * 20 * 9.81
    assert (data.supports_at_rest + data.joints_at_rest).values[k, 2] == pytest.approx(
        weight + force[0].sum(), rel=1e-9
    )


@pytest.mark.slow
def test_suite_over_pretension_and_mass_is_the_jobs_with_the_values(tmp_path):
    """Peaks of openings and of anchors' forces, within 1e-9 of the job with the values written in."""
    sections = {
        "anchors": {"A": RIGHT | {"pretension": "2 MN"}},
        "masses": {"gate": {"block": "right", "face": "ymax", "mass": "300 t"}},
        "loads": {"gravity": [0, 0, -9.81]},
    }
    parameters = {
        "T": {"path": "anchors.A.pretension", "values": ["1 MN", "3 MN"]},
        "m": {"path": "masses.*.mass", "values": ["100 t", "500 t"]},
    }
    damped = {"xi": {"path": "damping.rayleigh.ratio", "values": [0.02, 0.08]}}
    made(write_job(tmp_path, 1, {"parameters": damped}, **sections), tmp_path / "damped")
    for k, ratio in enumerate((0.02, 0.08)):
        own = {"rayleigh": BASE["damping"]["rayleigh"] | {"ratio": ratio}}
        path = job(tmp_path, **sections, damping=own)
        single = xr.load_dataset(romdam.run(path, tmp_path / f"xi{k}").results[0].path)
        largest = summary(tmp_path / "damped").anchor_force_largest.isel(sample=k).values.ravel()
        np.testing.assert_allclose(largest, single.anchor_force_largest.values, rtol=1e-9)
    path = write_job(tmp_path, 1, {"parameters": parameters}, **sections)
    made(path, tmp_path / "suite")
    rows = summary(tmp_path / "suite")
    assert rows.anchor_force_largest.dims[-1] == "anchor" and len(rows.sample) == 4
    assert rows.anchor.values.tolist() == ["A"]
    for k in range(4):
        tension, mass = (float(rows[f"parameter_{name}"][k]) for name in "Tm")
        alone = json.loads(json.dumps(sections))
        alone["anchors"]["A"]["pretension"], alone["masses"]["gate"]["mass"] = tension, mass
        single = xr.load_dataset(romdam.run(job(tmp_path, **alone), tmp_path / f"{k}").results[0].path)
        for name in ("peak_opening", "anchor_force_largest", "anchor_force_least"):
            of_suite = rows[name].isel(sample=k).values.ravel()
            np.testing.assert_allclose(of_suite, single[name].values.ravel(), rtol=1e-9)


@pytest.mark.slow
def test_suite_over_damping_is_the_jobs_with_the_values(tmp_path):
    """Peaks of openings and of dampers' forces, within 1e-9 of the job with the values written in."""
    across = {"head": {"block": "right", "at": [2.5, 2, 20]}, "foot": {"block": "left", "at": [2.5, -2, 18]}}
    sections = {
        "dampers": {"A": across | {"damping": "2 MN*s/m"}, "B": across | {"damping": 1e6}},
        "loads": {"gravity": [0, 0, -9.81]},
    }
    parameters = {"c": {"path": "dampers.A.damping", "values": ["0.5 MN*s/m", "9 MN*s/m"]}}
    path = write_job(tmp_path, 1, {"parameters": parameters}, **sections)
    made(path, tmp_path / "suite")
    rows = summary(tmp_path / "suite")
    assert rows.parameter_c.values.tolist() == [5e5, 9e6]
    forces = []
    for k, c in enumerate(rows.parameter_c.values):
        alone = json.loads(json.dumps(sections))
        alone["dampers"]["A"]["damping"] = float(c)
        single = xr.load_dataset(romdam.run(job(tmp_path, **alone), tmp_path / f"{k}").results[0].path)
        for name in ("peak_opening", "damper_force_largest", "damper_force_least"):
            of_suite = rows[name].isel(sample=k).values.ravel()
            np.testing.assert_allclose(of_suite, single[name].values.ravel(), rtol=1e-9)
        np.testing.assert_allclose(single.damper_force[:, 0], c / 1e6 * single.damper_force[:, 1], rtol=1e-9)
        assert np.abs(single.damper_force[0]).max() == 0.0
        forces.append(float(single.damper_force_largest[0]))
    assert forces[1] > 2.0 * forces[0] > 0.0


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ({"anchors": {"A": RIGHT | {"E": 2e11}}}, r"give either `stiffness`, or `E` and `area`"),
        ({"anchors": {"A": RIGHT | {"loss": 1.0}}}, r"anchors.A.loss"),
        ({"anchors": {"A": RIGHT | {"free_length": 3.0}}}, r"`free_length` goes with"),
        ({"anchors": {"A": RIGHT | {"foot": {"block": "rigth", "at": [0, 0, 0]}}}},
         r"anchors.A.foot.block.*'rigth'.*did you mean 'right'"),
        ({"anchors": {"A": RIGHT | {"foot": [2.5, 5, 20]}}}, r"anchors.A: its ends are 0 m apart"),
        ({"anchors": {"A": RIGHT | {"head": {"block": "right", "at": [2.5, 5, 21]}}}},
         r"anchors.A.head: \(2.5, 5, 21\) is outside its elements, .* from its nearest node.*over 0 to 5 by"),
        ({"anchors": {"A": RIGHT | {"head": {"block": "right", "at": [2.5, 5, 0]}}}},
         r"anchors.A: supports hold every node that it acts on"),
        ({"dampers": {"D": DAMPER | {"damping": 0.0}}}, r"dampers.D.damping"),
        ({"dampers": {"D": DAMPER | {"damping": "2 MN/m"}}}, r"dampers.D.damping.*N\*s/m"),
        ({"dampers": {"D": DAMPER | {"foot": {"block": "rigth", "at": [0, 0, 0]}}}},
         r"dampers.D.foot.block.*'rigth'.*did you mean 'right'"),
        ({"dampers": {"D": DAMPER | {"foot": [2.5, 5, 20]}}}, r"dampers.D: its ends are 0 m apart"),
        ({"dampers": {"D": DAMPER}, "transient": {"finest_step": 0.01, "integrator": "modal"}},
         r"transient.integrator: modal needs modes that nothing couples, and dampers \(dampers\)"),
        ({"dampers": {"D": DAMPER}, "linear_stage": {}}, r"linear_stage: dampers couples the modes"),
        ({"masses": {"m": {"block": "right", "mass": 10.0}}}, r"masses.m.*exactly one of `at` and `face`"),
        ({"masses": {"m": {"block": "right", "face": "zmin", "mass": 10.0}}}, r"masses.m: supports hold"),
        ({"masses": {"m": {"block": "right", "face": "top", "mass": 10.0}}}, r"masses.m.face"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused_with_its_key(tmp_path, sections, message):
    with pytest.raises(ConfigError, match=message):
        loaded = romdam.load_config(job(tmp_path, **sections))
        build_scene(loaded.config, tmp_path, "s.yaml")


def test_a_bar_stretches_over_its_free_length_or_the_distance_of_its_ends(tmp_path):
    """E A / L: of 30 m between the ends, and of 12 m that are free."""
    bar = {"head": RIGHT["head"], "foot": RIGHT["foot"], "E": "200 GPa", "area": "15 cm2"}
    raw = yaml.safe_load(job(tmp_path, anchors={"whole": bar, "free": bar | {"free_length": 12}}).read_text())
    made = {one.name: one.stiffness[0] for one in scene_of(raw).every(Attachment)}
    assert made["whole"] == pytest.approx(200e9 * 15e-4 / 30.0)
    assert made["free"] == pytest.approx(200e9 * 15e-4 / 12.0)


def test_exports_refuse_what_they_cannot_write(tmp_path):
    for name in ("anchors", "masses"):
        assert not {"deck", "matrices"} & EFFECTS[name].known_to
        assert {"rest", "certificate", "linear stage"} <= EFFECTS[name].known_to
