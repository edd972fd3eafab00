"""Going on from a written state, and jumps added from outside."""

from dataclasses import replace

import numpy as np
import pytest
from reference_run import job, shaking

from romdam.error.estimate import start_at
from romdam.reduction.synthesis import reduce_scene
from romdam.timestepping.options import TransientOptions
from romdam.timestepping.simulate import integrate


@pytest.fixture(scope="module", params=[0.0, 0.6], ids=["frictionless", "friction"])
def pounding(request):
    """A coarse reduced model of the two cantilevers, 2 s of strong shaking at every base step."""
    friction = {"friction": request.param, "shear_stiffness": "8 GPa/m"} if request.param else {}
    made = job(**friction)
    modes = made.config.model.model_copy(update={"modes": 5})
    system = reduce_scene(made.scene, modes, made.config.damping).system
    return system, shaking(0.0025, 6.0)[:, 1600:]


OPTIONS = TransientOptions(dt=0.0025, initial_state="from_start", tolerance=1e-10)


def test_run_from_a_written_state_goes_on_as_if_never_stopped(pounding):
    system, ground = pounding
    whole = integrate(system, ground, OPTIONS)
    row = 400
    start = start_at(whole, system.law, row)
    rest = integrate(system, ground[:, row:], replace(OPTIONS, start=start))
    assert whole.jump[..., 0].max() > 0.005, "nothing opened"
    assert np.abs(rest.jump - whole.jump[row:]).max() < 1e-7 * np.abs(whole.jump).max()


def test_a_start_knows_what_the_gaps_have_lost(pounding):
    """Bonds break between 4 and 5 s; forgotten, they would hold again."""
    system, ground = pounding
    n = len(system.law)
    laws = {"tensile_strength": np.linspace(0.0, 1e8, n)}
    if system.law.directions == 3:
        laws["cohesion"], laws["friction_static"] = laws["tensile_strength"], np.full((n, 2), 0.7)
        laws["shear_key"] = np.tile([0.004, 1.0, 0.0], (n, 1))
    system = replace(system, law=replace(system.law, laws=laws))
    whole, row = integrate(system, ground, OPTIONS), 400
    start = start_at(whole, system.law, row)
    rest = integrate(system, ground[:, row:], replace(OPTIONS, start=start))
    assert 0 < start.weak[:, 0].sum() < n
    assert np.abs(rest.jump - whole.jump[row:]).max() < 1e-6 * np.abs(whole.jump).max()
    naive = integrate(system, ground[:, row:], replace(OPTIONS, start=replace(start, weak=None)))
    assert np.abs(naive.jump - whole.jump[row:]).max() > 1e-3 * np.abs(whole.jump).max()


def test_no_added_jump_changes_nothing_and_a_constant_one_is_an_initial_gap(pounding):
    system, ground = pounding
    plain = integrate(system, ground, OPTIONS)
    shift = np.zeros((ground.shape[1], system.B.shape[0]))
    none = integrate(system, ground, replace(OPTIONS, shift=shift))
    assert np.array_equal(none.jump, plain.jump)
    shift[:, :: system.law.directions] = 0.002
    law = replace(system.law, gap=system.law.gap + 0.002)
    wider = integrate(replace(system, law=law), ground, OPTIONS)
    shifted = integrate(system, ground, replace(OPTIONS, shift=shift))
    assert np.abs(shifted.jump - wider.jump)[1:].max() < 1e-9 * np.abs(wider.jump).max()
