"""The main job against `two_cantilevers/reference.npz` (its README says what made it).

Limits: the baseline (modal), 60 modes per block and no corrections, dt 0.0025 s: peak opening within 0.5 %,
L2 of all openings over 10 s at most 3 % (1.2 % at 0.00125 s); adaptive, with corrections, at 0.0025, 0.00125,
0.000625 s: 1.5, 0.9 and 0.4 %; full order, dt 0.000625 s: peak within 0.3 %, L2 at most 1.5 %.
"""

import dataclasses

import numpy as np
import pytest
from reference_run import RECORD, errors, job, march, reference, shaking

from romdam.effects.full_order import assemble_full
from romdam.reduction.methods.residual_vectors import FINER_VECTORS
from romdam.reduction.synthesis import reduce_scene, reduce_scene_twice
from romdam.timestepping.modal.symmetry import merge_equivalent_contacts
from romdam.timestepping.steps import cut_steps


@pytest.fixture(scope="module")
def model():
    return reduce_scene(job().scene, job().config.model, job().config.damping)


@pytest.fixture(scope="module")
def plain():
    """The model without corrections."""
    kept = job().config.model.model_copy(update={"residual_vectors": 0})
    return reduce_scene(job().scene, kept, job().config.damping)


def test_sizes_and_frequencies(plain):
    """Block frequencies of the mesh by CalculiX 2.20 (C3D8), five digits.

    The reduced blocks are Ritz approximations of it: never below, and with 60 modes at most 0.06 % above
    (the lowest to all digits).
    """
    wanted = {
        "left": [2.2454, 2.2454, 10.792, 12.301, 12.301, 17.579, 29.790, 29.790],
        "right": [2.2504, 4.1265, 8.9162, 12.319, 17.589, 17.818],
    }
    for name, given in wanted.items():
        frequencies = np.array(given)
        report = plain.report[name]
        assert (report["retained_dofs"], report["fixed_interface_modes"]) == (100, 60)
        found = np.array(report["frequencies_hz"][: len(frequencies)])
        last_digit = 10.0 ** (np.floor(np.log10(frequencies)) - 4)
        assert (found >= frequencies - 0.51 * last_digit).all()
        assert (found <= frequencies * (1.0 + 6e-4)).all()
        assert abs(found[0] - frequencies[0]) <= 0.51 * last_digit[0]
    assert plain.system.size == 328  # four static vectors a block: inertia along x, y and z, and the pressure
    assert not plain.system.floating


@pytest.mark.parametrize(("dt", "peak", "L2"), [(0.0025, 0.005, 0.036), (0.00125, 0.005, 0.013)])
def test_baseline(plain, dt, peak, L2):
    """The reference has 60 modes, no static vectors; all modes of the mesh are 1.7 % from it at 1.25 ms."""
    _assert_close(march(plain.system, dt, integrator="modal"), peak, L2)


@pytest.mark.parametrize("joint", [{}, {"friction": 0.6, "shear_stiffness": 8e9}])
def test_gaps_that_move_alike(joint):
    """100 gaps in five columns, two of which mirror two others; the left block's section is square."""
    the_job = job(**joint)
    system = reduce_scene(the_job.scene, the_job.config.model, the_job.config.damping).system
    options = {"integrator": "adaptive", "cuts": (4,), "duration": 6.0}
    one, other = (march(system, 0.005, merge_contacts=merge, **options) for merge in (True, False))
    assert (one.stats["integrated_gaps"], other.stats["integrated_gaps"]) == (60, 100)
    assert one.stats["dynamic_modes"] < 0.6 * other.stats["dynamic_modes"]
    assert one.stats["steps"] == other.stats["steps"]
    for name in ("jump", "traction", "mean_traction", "disp", "vel", "q", "v"):
        a, b = getattr(one, name), getattr(other, name)
        assert np.abs(a - b).max() <= 1e-7 * np.abs(b).max(), name
    assert np.array_equal(one.state, other.state)
    for name, values in other.peaks.items():
        assert np.abs(one.peaks[name] - values).max() <= 1e-7 * np.abs(values).max(initial=1e-9), name
    for name, values in other.energy.items():
        assert np.abs(one.energy[name] - values).max() <= 1e-9 * np.abs(other.energy["input"]).max(), name


def test_what_moves_differently_is_not_merged(model):
    system = job(friction=0.6, shear_stiffness=8e9)
    system = reduce_scene(system.scene, system.config.model, system.config.damping).system
    along = np.array([1])
    assert len(merge_equivalent_contacts(system, along).system.law) == 60
    assert merge_equivalent_contacts(system, np.array([0, 1])) is None  # shaken across the mirror
    assert merge_equivalent_contacts(model.system, np.array([0, 1])) is None
    rigid = dataclasses.replace(system.law, K_s=np.full(100, np.inf))  # in the mirror's plane nothing resists
    assert merge_equivalent_contacts(dataclasses.replace(system, law=rigid), along) is None
    uneven = system.law.mu.copy()
    uneven[0, 1] = 0.5
    rough = dataclasses.replace(system.law, mu=uneven)
    assert merge_equivalent_contacts(dataclasses.replace(system, law=rough), along) is None


@pytest.mark.parametrize("joint", [{}, {"friction": 0.6, "shear_stiffness": 8e9}])
def test_both_models_mirror_themselves_a_good_deal_better_than_is_asked(joint, monkeypatch):
    """Residual vectors of modes that are exact already are round-off, and would mirror nothing."""
    monkeypatch.setattr("romdam.timestepping.modal.symmetry._EXACT", 5e-8)
    the_job = job(**joint)
    models = reduce_scene_twice(the_job.scene, the_job.config.model, the_job.config.damping)
    for one in models:
        assert len(merge_equivalent_contacts(one.system, np.array([1])).system.law) == 60
    more = models[1].system.size - models[0].system.size
    assert FINER_VECTORS < more < 2 * FINER_VECTORS  # of both blocks, without those that are round-off


@pytest.mark.parametrize(("finest", "L2"), [(0.0025, 0.015), (0.00125, 0.009), (0.000625, 0.004)])
def test_adaptive(model, finest, L2):
    """The record's step is the base step."""
    steps = cut_steps(finest, 0.01, 0.01)
    _assert_close(march(model.system, steps.base, integrator="adaptive", cuts=steps.cuts), 0.005, L2)


def _assert_close(h, peak, L2):
    found = errors(job().scene, h)
    assert abs(found[0]) <= peak
    assert found[1] <= L2
    size = np.abs(h.energy["input"]).max()
    assert np.abs(h.energy["residual"]).max() <= 1e-9 * size
    assert np.diff(h.energy["contact"]).min() >= -1e-9 * size
    assert h.traction.min() >= 0.0
    assert h.stats["largest_residual"] <= 1e-8
    assert h.peaks["opening"].max() == pytest.approx(0.05609, rel=peak)  # the limit stated in the design


def test_top_displacements(plain):
    """The probes are at x = 5, z = 50: columns 1 (left) and 4 (right) of `top_uy`."""
    h = march(plain.system, 0.00125, 10.0)
    for probe, column in ((0, 1), (1, 4)):
        found, wanted = h.disp[:, 3 * probe + 1], reference()[1][:, column]
        assert np.linalg.norm(found - wanted) <= 0.012 * np.linalg.norm(wanted)
    assert np.abs(reference()[1][:, :3]).max() == pytest.approx(0.05242, rel=1e-3)
    assert np.abs(reference()[1][:, 3:]).max() == pytest.approx(0.02060, rel=1e-3)
    # shaken along y in a scene symmetric about x = 5: nothing goes sideways
    assert np.abs(h.disp[:, [0, 3]]).max() <= 1e-8 * np.abs(h.disp).max()


def test_the_record_of_the_configuration_is_the_one_read_by_hand():
    assert job().config.records[0].file.name == RECORD.name
    # in m/s2 at 9.81 per g: 4.078 m/s2 for the component 009 of Beverly Hills - Mulholland (0.4158 g)
    assert np.abs(shaking(0.01)[1]).max() == pytest.approx(4.08, rel=0.01)


@pytest.mark.parametrize("joint", [{"normal_stiffness": 1.6e13}, {"normal_stiffness": "rigid"}], ids=str)
def test_stiff_and_rigid_joints_lie_close_to_the_penalty_one(joint):
    """Penetration of 1.6e10 N/m3 under the peak pressure is small: the openings differ by a few percent."""
    stiff = job(**joint)
    model = reduce_scene(stiff.scene, stiff.config.model, stiff.config.damping)
    h = march(model.system, 0.00125, 10.0)
    peak, L2 = errors(stiff.scene, h)
    assert abs(peak) <= 0.02
    assert L2 <= 0.1
    assert h.jump[:, :, 0].min() >= -1e-5


@pytest.mark.parametrize("normal", [1.6e10, "rigid"])
@pytest.mark.parametrize("mu", [0.6, 2.0])
def test_friction_converges_at_every_step(normal, mu):
    rough = job(friction=mu, shear_stiffness=8e9, normal_stiffness=normal)
    model = reduce_scene(rough.scene, rough.config.model, rough.config.damping)
    h = march(model.system, 0.0025, 10.0)
    assert h.stats["largest_residual"] <= 1e-8
    energy, size = h.energy, np.abs(h.energy["input"]).max()
    assert np.abs(energy["residual"]).max() <= 1e-9 * size
    assert np.diff(energy["friction"]).min() >= -1e-9 * size
    assert np.diff(energy["contact"]).min() >= -1e-7 * size
    assert energy["friction"][-1] > 1e-3 * size
    p_n, t = h.traction[:, :, 0], np.linalg.norm(h.traction[:, :, 1:], axis=2)
    assert p_n.min() >= 0.0
    assert (t <= mu * p_n * (1 + 1e-6) + 1e-7 * p_n.max()).all()


@pytest.mark.slow
def test_full_order():
    full = assemble_full(job().scene, job().config.damping)
    assert full.size == 4200
    h = march(full, 0.000625, 10.0, integrator="generalized_alpha")
    peak, L2 = errors(job().scene, h)
    assert abs(peak) <= 0.001
    assert L2 <= 0.004


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, 0.6])
def test_all_modes_are_the_full_order(friction):
    """2 s of the record with the blocks in contact, same integrator on both: 1e-8 of the peak."""
    from romdam.config.sections.job import ModelConfig

    scene = job(friction=friction, shear_stiffness=8e9).scene
    damping = job().config.damping
    reduced = reduce_scene(scene, ModelConfig(modes="all"), damping).system
    options = {"integrator": "generalized_alpha", "tolerance": 1e-12}
    a, b = (march(s, 0.005, 2.0, **options) for s in (reduced, assemble_full(scene, damping)))
    assert b.traction.max() > 0.0
    for name in ("jump", "disp"):
        wanted = getattr(b, name)
        assert np.abs(getattr(a, name) - wanted).max() <= 1e-8 * np.abs(wanted).max()
