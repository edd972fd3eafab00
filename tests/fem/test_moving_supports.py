"""Supports of their own motion: against one motion of all, linear fields, absolute coordinates, the mesh."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from simulating import simulated

from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.core.motion import GroundMotion, MovingSupports, SupportMotion
from romdam.effects.full_order import assemble_full
from romdam.fem.stress import observing_stress
from romdam.records.processing.integrate import displacement, velocity
from romdam.records.processing.support_motions import add_support_rows
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

DAMPED = DampingConfig(rayleigh=RayleighConfig(frequencies=(3.0, 30.0), ratio=0.03))
MATERIALS = {
    "concrete": {"E": 25e9, "nu": 0.2, "rho": 2400.0},
    "bar": {"E": 20e9, "nu": 0.0, "rho": 2500.0},
}
REST = {
    "materials": MATERIALS,
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"order": "full"},
    "transient": {"finest_step": 0.01},
}
DT = 0.01


def make(raw):
    return build_scene(parse_config(REST | raw, "s.yaml"), Path(), "s.yaml")


def box(origin, size, edge, material="concrete", element="hex8"):
    return {
        "material": material,
        "box": {"origin": origin, "size": size, "element_size": edge, "element": element},
    }


def valley(left=None, right=None, middle=None, **joints):
    """Three monoliths: two hang on the banks, one stands on the valley's floor; joints between them."""
    motions = {"left": ("xmin", left), "middle": ("zmin", middle), "right": ("xmax", right)}
    law = {"normal_stiffness": "20 GPa/m", "shear_stiffness": "10 GPa/m", "friction": 0.6} | joints
    return {
        "blocks": {
            name: box([10.0 * k, 0, 0], [10, 5, 20], 5.0)
            for k, name in enumerate(("left", "middle", "right"))
        },
        "supports": [
            {"block": name, "face": face} | ({"motion": motion} if motion else {})
            for name, (face, motion) in motions.items()
        ],
        "joints": {
            f"J{k}": {"between": pair} | law
            for k, pair in enumerate((["left", "middle"], ["middle", "right"]))
        },
        "loads": {"gravity": [0, 0, -9.81]},
        "outputs": {
            "nodes": {
                "bank": {"block": "left", "at": [0, 0, 20]},
                "crest": {"block": "middle", "at": [15, 0, 20]},
            },
            "stress": {"blocks": ["left"]},
        },
    }


def on_rock(left=None, right=None, middle=None):
    """The same, the left one tied to rock without mass, the right one of a finer mesh: a mortar joint."""
    raw = valley(None, right, middle, discretization="mortar")
    raw["blocks"]["rock"] = box([-10, 0, 0], [10, 5, 20], 5.0) | {"mass": False}
    raw["blocks"]["right"] = box([20, 0, 0], [10, 5, 20], [5.0, 5.0, 4.0])
    raw["supports"][0] = {"block": "rock", "face": "xmin"} | ({"motion": left} if left else {})
    return raw | {"ties": {"bank": {"between": ["left", "rock"]}}}


def pulses(seconds=3.0, dt=DT):
    """Along all axes, each ends at rest: velocity and displacement are zero at the end (3, nt) [m/s2]."""
    time = np.arange(round(seconds / dt) + 1) * dt
    found = []
    for peak, freq in ((6.0, 1.7), (9.0, 2.3), (3.0, 3.1)):
        window = np.where(time < 2.0, np.sin(np.pi * time / 2.0) ** 4, 0.0)
        found.append(
            peak
            * np.gradient(np.gradient(window * np.sin(2 * np.pi * freq * time), dt), dt)
            / (2 * np.pi * freq) ** 2
        )
    return np.stack(found)


def systems(scene, modes=20):
    full = assemble_full(scene, DAMPED)
    return full, reduce_scene(scene, ModeChoice(count=modes), DAMPED).system


def l2(values, reference):
    return np.linalg.norm(values - reference) / np.linalg.norm(reference)


SHIFTED = {"delay": 0.06, "factor": 1.4}


@pytest.mark.parametrize("integrator", ["generalized_alpha", "modal"])
@pytest.mark.parametrize("scene", [valley, on_rock])
def test_one_motion_of_all_supports_is_that_motion_of_the_base(scene, integrator):
    """Openings, slips and forces are those of the record that the supports follow; displacement is u + d."""
    acc = pulses()
    moving, still = make(scene(SHIFTED, SHIFTED, SHIFTED)), make(scene())
    ground = add_support_rows(acc, DT, moving.find(MovingSupports).motions)
    k = 0 if integrator == "generalized_alpha" else 1
    own, base = (
        simulated(systems(one)[k], motion, DT, integrator)
        for one, motion in ((moving, ground), (still, acc + ground[3:6]))
    )
    assert np.abs(base.jump).max() > 1e-3
    np.testing.assert_allclose(own.jump, base.jump, atol=1e-10 * np.abs(base.jump).max())
    np.testing.assert_allclose(own.traction, base.traction, atol=1e-7 * np.abs(base.traction).max())
    follows = np.tile(ground[9:12].T, 2)
    np.testing.assert_allclose(own.disp, base.disp + follows, atol=1e-10 * np.abs(follows).max())
    assert own.stats["ledger_imbalance"] < 1e-10


def bar(length=200.0, edge=10.0, motion=None, probe=100.0):
    """A bar without lateral strain between two supports; the right one has the motion."""
    return {
        "blocks": {"bar": box([0, 0, 0], [length, edge, edge], edge, "bar")},
        "supports": [
            {"block": "bar", "face": "xmin"},
            {"block": "bar", "face": "xmax", "motion": motion or {"delay": 0.05}},
        ],
        "outputs": {
            "nodes": {"in": {"block": "bar", "at": [probe, 0, 0]}},
            "stress": {
                "blocks": ["bar"],
                "sections": {"cut": {"blocks": ["bar"], "normal": [1, 0, 0], "point": [55, 0, 0]}},
            },
        },
    }


def test_supports_that_move_apart_strain_a_bar_evenly():
    """Displacement x/L, stress E/L, stiffness E A/L; held energy and input are E A/L d^2/2 in slow motion."""
    scene = make(bar())
    full = observing_stress(scene, assemble_full(scene, DampingConfig()))
    by, x = full.pseudo_static, scene.blocks["bar"].points[:, 0]
    np.testing.assert_allclose(by.shapes["bar"][0::3, 0], x / 200.0, atol=1e-13)
    np.testing.assert_allclose(by.shapes["bar"][1::3, 0], 0.0, atol=1e-13)
    nodes = len(scene.stress.blocks["bar"].nodes)
    stress = by.observe[3 : 3 + 6 * nodes, 0].reshape(nodes, 6)
    np.testing.assert_allclose(stress, np.tile([20e9 / 200.0, 0, 0, 0, 0, 0], (nodes, 1)), atol=1e-3)
    assert by.observe[3 + 6 * nodes, 0] == pytest.approx(20e9 * 100.0 / 200.0, rel=1e-12)
    assert by.stiffness[0, 0] == pytest.approx(20e9 * 100.0 / 200.0, rel=1e-12)
    time = np.arange(2001) * 0.01
    acc = np.zeros((3, 2001))
    apart = 1e-3 * (1.0 - np.cos(2 * np.pi * time / 20.0)) * (2 * np.pi / 20.0) ** 2
    motion = SupportMotion(1, record=GroundMotion("apart", np.stack([apart, 0 * apart, 0 * apart]), 0.01))
    ground = add_support_rows(acc, 0.01, (motion,))
    history = simulated(full, ground, 0.01, "generalized_alpha")
    d = history.supports[:, 0]
    held = 0.5 * by.stiffness[0, 0] * d**2
    np.testing.assert_allclose(d, displacement(apart, 0.01), rtol=1e-13)
    np.testing.assert_allclose(history.disp[:, 0], d / 2.0, atol=1e-5 * d.max())
    np.testing.assert_allclose(history.energy["strain"], held, atol=1e-5 * held.max())
    np.testing.assert_allclose(history.energy["input"], held, atol=1e-5 * held.max())
    assert history.stats["ledger_imbalance"] < 1e-10


def in_absolute_coordinates(acc, alpha, beta):
    """The bar's middle (nt,) by an independent integration of M x'' + C x' + K x = 0 with ends that move."""
    n, h = 20, 10.0
    k, m = 20e9 * 100.0 / h, 2500.0 * 100.0 * h / 6.0
    K, M = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    for e in range(n):
        K[e : e + 2, e : e + 2] += k * np.array([[1, -1], [-1, 1]])
        M[e : e + 2, e : e + 2] += m * np.array([[2, 1], [1, 2]])
    free, ends = slice(1, n), [0, n]
    inverse = np.linalg.inv(M[free, free])
    carried = -np.linalg.solve(K[free, free], K[free][:, ends])
    later = np.concatenate([np.zeros(5), acc[:-5]])
    time, a = np.arange(len(acc)) * DT, np.stack([acc, later])
    v, d = velocity(a, DT), displacement(a, DT)

    def rate(t, state):
        i = min(int(t / DT), len(acc) - 2)
        s, slope = t - time[i], (a[:, i + 1] - a[:, i]) / DT
        end_a, end_v = a[:, i] + s * slope, v[:, i] + s * a[:, i] + s**2 * slope / 2
        end_d = d[:, i] + s * v[:, i] + s**2 * a[:, i] / 2 + s**3 * slope / 6
        x, w = np.split(state, 2)
        force = K[free, free] @ x + K[free][:, ends] @ end_d + M[free][:, ends] @ end_a
        force += beta * (K[free, free] @ w + K[free][:, ends] @ end_v)
        force += alpha * M[free, free] @ (w - carried @ end_v)
        return np.concatenate([w, -inverse @ force])

    made = solve_ivp(
        rate, (0.0, time[-1]), np.zeros(2 * (n - 1)), "DOP853", time, rtol=1e-9, atol=1e-13, max_step=DT / 2
    )
    return made.y[n // 2 - 1]


@pytest.mark.slow
def test_waves_from_two_ends_meet_as_absolute_coordinates_say():
    """One end moves 0.05 s later: the middle's motion against a code of its own, at its own step."""
    scene, acc = make(bar()), pulses(1.5) * [[1.0], [0.0], [0.0]]
    damping = DampingConfig(rayleigh=RayleighConfig(alpha=0.5, beta=2e-4))
    made = reduce_scene(scene, ModeChoice(count=2**62), damping).system
    history = simulated(made, add_support_rows(acc, DT, scene.find(MovingSupports).motions), DT, "modal")
    absolute = history.disp[:, 0] + displacement(acc[0], DT)
    expected = in_absolute_coordinates(acc[0], 0.5, 2e-4)
    assert np.abs(history.disp[:, 0]).max() > 0.1 * np.abs(expected).max()
    np.testing.assert_allclose(absolute, expected, atol=1e-6 * np.abs(expected).max())
    assert history.stats["ledger_imbalance"] < 1e-10


@pytest.mark.parametrize("integrator", ["modal", "adaptive"])
@pytest.mark.parametrize("scene", [valley, on_rock])
def test_reduced_model_moves_as_its_mesh_does(scene, integrator):
    """Wave passage from bank to bank through three monoliths with friction: openings, probes, ledger."""
    scene, dt = make(scene(right={"delay": 0.08, "factor": 1.2}, middle={"delay": 0.04})), 0.001
    full, reduced = systems(scene)
    fine = add_support_rows(pulses(2.2, dt), dt, scene.find(MovingSupports).motions)
    own = simulated(reduced, fine, dt, integrator, stride=10)
    mesh = simulated(full, fine, dt, "generalized_alpha", stride=10)
    assert mesh.jump[..., 0].max() > 5e-3
    assert l2(own.jump[..., 0], mesh.jump[..., 0]) < 0.02
    assert l2(own.disp, mesh.disp) < 0.02
    assert l2(own.vel, mesh.vel) < 0.06
    for history in (own, mesh):
        assert history.stats["ledger_imbalance"] < 1e-10
        assert np.diff(history.energy["damping"]).min() >= 0.0


def test_steps_within_a_base_step_follow_the_support():
    """The carried opening is exact at any step: steps cut to a tenth agree with steps of that size."""
    soft = {"normal_stiffness": "1 MPa/m", "shear_stiffness": "1 kPa/m", "friction": 0.0}
    scene, acc = make(valley(right={"delay": 0.08}, **soft)), pulses(2.0)
    reduced = reduce_scene(scene, ModeChoice(count=20), DAMPED).system
    fine = np.stack([np.interp(np.arange(2001) * 0.001, np.arange(201) * DT, row) for row in acc])
    motions = scene.find(MovingSupports).motions
    every = {"integrator": "adaptive", "force_change": 0.0}
    cut = simulated(reduced, add_support_rows(acc, DT, motions), DT, cuts=(10,), **every)
    small = simulated(reduced, add_support_rows(fine, 0.001, motions), 0.001, stride=10, cuts=(), **every)
    np.testing.assert_allclose(cut.jump, small.jump, atol=1e-4 * np.abs(small.jump).max())
