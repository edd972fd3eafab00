"""The replay of joint forces and the defect-corrected run, where the answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from hand_systems import gap_law, sparse_system
from scipy.linalg import eigh
from scipy.sparse import csr_matrix
from simulating import prepared_for
from small_scenes import DAMPING, full, march, raw, reduced, scene, shaking

from romdam.error.estimate import FinerModel, run_window
from romdam.error.metrics import relative_l2
from romdam.error.replay import (
    Forces,
    Replayed,
    corrected_run,
    measure_defect,
    replay,
    replay_start,
)
from romdam.reduction.basis import Dense
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.refinement import embedding, much_finer
from romdam.reduction.synthesis import reduce_scene, reduce_scene_twice
from romdam.timestepping.settings import Settings
from romdam.timestepping.steps import Steps

DT = 0.0025
LAWS = {"penalty": {}, "rigid": {"normal_stiffness": "rigid"}, "friction": {"friction": 0.6}}


def expansion(built, model):
    """(n_full, m) basis over the free DOFs."""
    rows = [np.zeros((int((~built.fixed[name]).sum()), model.system.size)) for name in built.blocks]
    for part, (name, basis) in zip(rows, model.basis.items(), strict=True):
        part[:, basis.columns] = basis.vectors.rows()[~built.fixed[name].ravel()]
    return np.vstack(rows)


def forces(history, ground, interval):
    mean = history.mean_traction.reshape(len(history.time), -1)
    return Forces(ground, mean, mean[0], interval, (ground.shape[1] - 1) // (len(mean) - 1))


def test_replay_is_of_second_order_and_repeats_the_exact_modes():
    system = reduced(scene(raw()), modes=3).system
    free = replace(system, B=csr_matrix(system.B * 0.0))
    exact = march(free, 0.01, _smooth(0.01)).q
    errors = []
    for substeps in (16, 32, 64):
        mean = np.zeros((201, system.B.shape[0]))
        what = Forces(_smooth(0.01 / substeps), mean, mean[0], 0.01, substeps)
        found = np.array(list(replay(Replayed(free, np.zeros(system.size)), what)))
        errors.append(relative_l2(found, exact))
    assert errors[-1] < 1e-3
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx(2.0, abs=0.1)


def _smooth(dt):
    """(3, nt) ground motion of 1 and 2 Hz, linear between corners every 0.01 s as the exact modes see it."""
    corners = np.arange(201) * 0.01
    values = np.sin(2.0 * np.pi * corners) + 0.5 * np.sin(4.0 * np.pi * corners)
    t = np.arange(round(2.0 / dt) + 1) * dt
    acc = np.interp(t, corners, values)
    return np.stack([0.0 * acc, acc, 0.0 * acc])


@pytest.mark.parametrize("initial_state", ["undeformed", "static"])
@pytest.mark.parametrize("law", LAWS)
def test_a_complete_basis_has_no_defect(law, initial_state):
    built = scene(raw(**LAWS[law]))
    model, whole = reduced(built), full(built)
    history = march(model.system, DT, initial_state=initial_state)
    basis, first = expansion(built, model), history.traction[0].ravel()
    static = initial_state == "static"
    starts = [
        replay_start(system, guess, first, static)
        for system, guess in ((whole, basis @ history.q[0]), (model.system, history.q[0]))
    ]
    reduced_model = Replayed(model.system, starts[1], basis)
    found = measure_defect(
        (Replayed(whole, starts[0]), reduced_model, reduced_model), forces(history, shaking(DT), DT)
    )
    size = np.abs(found.jump_full).max()
    assert size > 1e-4
    assert np.abs(found.jump).max() < 1e-7 * size and np.abs(found.disp).max() < 1e-7 * size
    assert found.energy.max() < 1e-10 * found.energy_full.max()


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("modes", [4, 10])
def test_corrected_run_is_much_nearer_to_the_full_order(law, modes):
    built = scene(raw(**LAWS[law]))
    coarse, every_mode = reduced(built, modes=modes), reduced(built)
    fine = reduce_scene(built, much_finer(ModeChoice(count=modes)), DAMPING)
    settings = Settings(Steps(DT), initial_state="undeformed")
    history, truth = march(coarse.system, DT), march(every_mode.system, DT)
    basis = expansion(built, coarse)
    models = (
        Replayed(full(built), np.zeros(len(basis))),
        Replayed(coarse.system, np.zeros(coarse.system.size), basis),
        Replayed(fine.system, np.zeros(fine.system.size)),
    )
    found = measure_defect(models, forces(history, shaking(DT), DT))
    corrected = corrected_run(prepared_for(fine.system), shaking(DT), settings, found.jump_fine)
    true = np.linalg.norm(history.jump - truth.jump)
    assert true > 1e-4 * np.linalg.norm(truth.jump)
    assert np.linalg.norm(corrected.jump - history.jump) == pytest.approx(true, rel=0.3)


def test_window_of_the_same_model_repeats_the_run():
    built = scene(raw(friction=0.6))
    model = reduced(built, modes=8)
    history = march(model.system, DT, tolerance=1e-10)
    settings = Settings(Steps(DT), initial_state="undeformed", tolerance=1e-10)
    into = embedding(built, model, model)
    assert np.abs(into - np.eye(model.system.size)).max() < 1e-9
    finer = FinerModel(prepared_for(model.system), into)
    peak = int(history.jump[..., 0].max(axis=1).argmax())
    rows = slice(peak - 183, peak + 18)
    again = run_window(finer, history, shaking(DT), settings, rows)
    part = history.jump[rows]
    assert np.abs(again.jump - part).max() < 1e-6 * np.abs(part).max()


CHOICES = [ModeChoice(count=5), ModeChoice(count=5, residual_vectors=4), ModeChoice(cutoff=200.0)]


def lost(built, coarse, fine):
    """Of every motion of the coarse basis, the share that the fine one cannot follow."""
    return 1.0 - (embedding(built, coarse, fine).toarray() ** 2).sum(axis=0)


@pytest.mark.parametrize("choice", CHOICES)
def test_much_finer_models_are_finer_and_hold_the_coarse_motion(choice):
    built = scene(raw())
    coarse, fine = reduce_scene(built, choice, DAMPING), reduce_scene(built, much_finer(choice), DAMPING)
    assert fine.system.size > coarse.system.size
    assert lost(built, coarse, fine)[:20].max() < (1e-4 if choice.residual_vectors else 1e-9)


@pytest.mark.parametrize("choice", CHOICES)
def test_finer_basis_of_the_same_factors_contains_the_coarse_one(choice):
    built = scene(raw())
    coarse, fine = reduce_scene_twice(built, choice, DAMPING)
    alone = reduce_scene(built, choice, DAMPING)
    assert np.array_equal(alone.system.K.diagonal(), coarse.system.K.diagonal())
    assert np.array_equal(alone.system.B.toarray(), coarse.system.B.toarray())
    assert fine.system.size > coarse.system.size
    assert np.abs(lost(built, coarse, fine)).max() < 1e-9
    frequencies = [model.system.K.diagonal()[model.system.parts["left"]][:15] for model in (fine, coarse)]
    assert (frequencies[0] <= frequencies[1] * (1.0 + 1e-9)).all()


def wet(model):
    """The two blocks with heavy water against one of them."""
    upstream = {"upstream": [0, 1, 0]} if model == "incompressible" else {}
    faces = [{"block": "right", "face": "ymax"}]
    return raw() | {"water": {"level": 8.0, "density": 1e4, "faces": faces, "model": model} | upstream}


@pytest.mark.parametrize("water", [None, "westergaard"])
@pytest.mark.parametrize("choice", CHOICES)
def test_what_embeds_the_coarse_basis_is_the_product_with_the_mass(choice, water):
    built = scene(wet(water) if water else raw())
    coarse, fine = reduce_scene_twice(built, choice, DAMPING)
    formed = {name: replace(own, vectors=Dense(own.vectors.rows())) for name, own in fine.basis.items()}
    by_mass = embedding(built, coarse, replace(fine, basis=formed)).toarray()
    assert np.abs(embedding(built, coarse, fine).toarray() - by_mass).max() < 1e-12


def test_another_reduction_than_the_one_within_is_embedded_by_the_mass():
    built = scene(raw())
    coarse, fine = reduce_scene_twice(built, CHOICES[1], DAMPING)
    name, own = next(iter(coarse.basis.items()))
    signs = np.where(np.arange(len(own.omega2)) == 3, -1.0, 1.0)
    turned = replace(own, vectors=Dense(own.vectors.rows() * signs))
    other = replace(coarse, before=coarse.before | {name: turned})
    expected = embedding(built, coarse, fine).toarray()
    expected[:, own.columns] *= signs
    assert np.abs(embedding(built, other, fine).toarray() - expected).max() < 1e-12


@pytest.mark.parametrize("model", ["westergaard", "incompressible"])
def test_finer_basis_answers_the_inertia_of_the_water(model):
    """The lowest frequency is then the mesh's, and the estimate the true error.

    The coarse basis knows the water that the ground shakes, and not that which its modes move.
    """
    built = scene(wet(model))
    coarse, fine = reduce_scene_twice(built, ModeChoice(count=5), DAMPING)
    models = [one.system for one in (coarse, fine, reduced(built))]
    lowest = [one.K.diagonal().min() for one in models]
    assert lowest[0] / lowest[2] - 1.0 > 5e-5 and 0.0 <= lowest[1] / lowest[2] - 1.0 < 1e-5
    own, finer, true = (march(one).jump[..., 0] for one in models)
    assert relative_l2(own, finer) == pytest.approx(relative_l2(own, true), rel=0.1)


def test_replay_follows_what_shakes_near_resonance():
    """u'' + a^2 u = -sin(b t) at 2 and 3 Hz: (b/a sin(a t) - sin(b t)) / (a^2 - b^2), to second order."""
    omega_0, omega = 4.0 * np.pi, 6.0 * np.pi
    system = sparse_system(1.0, omega_0**2, [[0.0]], gap_law(1), load=1.0)
    time = 0.05 * np.arange(41)
    exact = (omega / omega_0 * np.sin(omega_0 * time) - np.sin(omega * time)) / (omega_0**2 - omega**2)
    errors = []
    for substeps in (10, 20, 40):
        t = 0.05 / substeps * np.arange(40 * substeps + 1)
        what = Forces(
            np.outer([1.0, 0, 0], np.sin(omega * t)), np.zeros((41, 1)), np.zeros(1), 0.05, substeps
        )
        found = np.array(list(replay(Replayed(system, np.zeros(1)), what)))[:, 0]
        errors.append(relative_l2(found, exact))
    assert errors[-1] < 1e-3
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.1)


def test_jumps_at_points_are_defects_of_the_finer_model():
    """Two masses: all of their modes have no defect at the gap's very position, one has some."""
    mesh = sparse_system(
        np.diag([3.0, 5.0]), [[700.0, -200.0], [-200.0, 900.0]], [[1.0, -1.0]], gap_law(1), load=[3.0, 5.0]
    )
    more = np.array([[0.3, -0.2]])
    mesh = replace(mesh, at_point=csr_matrix(more))
    k, V = eigh(mesh.K.toarray(), mesh.M.toarray())

    def in_modes(count):
        some = V[:, :count]
        small = sparse_system(np.eye(count), np.diag(k[:count]), mesh.B @ some, gap_law(1))
        return replace(
            small, load=some.T @ mesh.load, observe=csr_matrix(some), at_point=csr_matrix(more @ some)
        )

    ground = np.outer([1.0, 0, 0], np.sin(40.0 * 0.005 * np.arange(101)))
    what = Forces(ground, np.full((11, 1), 2.0), np.full(1, 2.0), 0.05, 10)
    models = [Replayed(system, np.zeros(system.size)) for system in (mesh, in_modes(1), in_modes(2))]
    models[1] = replace(models[1], basis=V[:, :1])
    defect = measure_defect(tuple(models), what)
    size = np.abs(defect.jump_full).max()
    assert np.abs(defect.jump).max() > 1e-3 * size and np.abs(defect.jump_fine).max() < 1e-9 * size
    assert np.abs(defect.point_fine).max() < 1e-9 * size
