"""Going on from a written state, and jumps added from outside."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference_run import job, shaking
from simulating import simulated

from romdam.error.estimate import start_at
from romdam.reduction.synthesis import reduce_scene

sys.path += [str(Path(__file__).parents[1] / "contact"), str(Path(__file__).parents[1] / "timestepping")]

from further_laws import lost, with_laws
from hand_systems import gap_law, modal_twin, sparse_system


@pytest.fixture(scope="module", params=[0.0, 0.6], ids=["frictionless", "friction"])
def pounding(request):
    """A coarse reduced model of the two cantilevers, 2 s of strong shaking at every base step."""
    friction = {"friction": request.param, "shear_stiffness": "8 GPa/m"} if request.param else {}
    made = job(**friction)
    modes = made.config.model.model_copy(update={"modes": 5})
    system = reduce_scene(made.scene, modes, made.config.damping).system
    return system, shaking(0.0025, 6.0)[:, 1600:]


OPTIONS = {"initial_state": "undeformed", "tolerance": 1e-10}


def test_run_from_a_written_state_goes_on_as_if_never_stopped(pounding):
    system, ground = pounding
    whole = simulated(system, ground, 0.0025, **OPTIONS)
    row = 400
    start = start_at(whole, system.law, row, whole.jump[row])
    rest = simulated(system, ground[:, row:], 0.0025, start=start, **OPTIONS)
    assert whole.jump[..., 0].max() > 0.005, "nothing opened"
    assert np.abs(rest.jump - whole.jump[row:]).max() < 1e-7 * np.abs(whole.jump).max()


@pytest.mark.slow
def test_a_start_knows_what_the_gaps_have_lost(pounding):
    """Bonds break between 4 and 5 s; forgotten, they would hold again."""
    system, ground = pounding
    n = len(system.law)
    laws = {"tensile_strength": np.linspace(0.0, 1e8, n)}
    if system.law.directions == 3:
        laws["cohesion"], laws["friction_static"] = laws["tensile_strength"], np.full((n, 2), 0.7)
        laws["shear_key"] = np.tile([0.004, 1.0, 0.0], (n, 1))
    system = replace(system, law=with_laws(system.law, **laws))
    whole, row = simulated(system, ground, 0.0025, **OPTIONS), 400
    start = start_at(whole, system.law, row, whole.jump[row])
    rest = simulated(system, ground[:, row:], 0.0025, start=start, **OPTIONS)
    assert 0 < lost(system.law, start.memory)[:, 0].sum() < n
    assert np.abs(rest.jump - whole.jump[row:]).max() < 1e-6 * np.abs(whole.jump).max()
    naive = simulated(system, ground[:, row:], 0.0025, start=replace(start, memory=None), **OPTIONS)
    assert np.abs(naive.jump - whole.jump[row:]).max() > 1e-3 * np.abs(whole.jump).max()


def test_no_added_jump_changes_nothing_and_a_constant_one_is_an_initial_gap(pounding):
    system, ground = pounding
    plain = simulated(system, ground, 0.0025, **OPTIONS)
    shift = np.zeros((ground.shape[1], system.B.shape[0]))
    none = simulated(system, ground, 0.0025, shift=shift, **OPTIONS)
    assert np.array_equal(none.jump, plain.jump)
    shift[:, :: system.law.directions] = 0.002
    law = replace(system.law, gap=system.law.gap + 0.002)
    wider = simulated(replace(system, law=law), ground, 0.0025, **OPTIONS)
    shifted = simulated(system, ground, 0.0025, shift=shift, **OPTIONS)
    assert np.abs(shifted.jump - wider.jump)[1:].max() < 1e-9 * np.abs(wider.jump).max()


@pytest.mark.parametrize("initial_state", ["static", "undeformed"])
def test_a_first_row_at_rest_says_what_was_lost_and_an_unloaded_one_does_not(initial_state):
    """2 kN on 1e4 N/m and a bond of 50 N: broken at rest, it stays so; undeformed it is still whole."""
    law = with_laws(gap_law(1, K_n=1e6), tensile_strength=[50.0])
    system = sparse_system([[1.0]], [[1e4]], [[1.0]], law, force=[2e3], C=[[20.0]], load=[0.0])
    system = replace(modal_twin(system), reduced=True)
    whole = simulated(system, np.zeros((3, 200)), 1e-4, initial_state=initial_state)
    at_rest = initial_state == "static"
    start = start_at(whole, law, 0, whole.jump[0], at_rest)
    assert lost(law, start.memory)[0, 0] == at_rest
    rest = simulated(system, np.zeros((3, 200)), 1e-4, start=start, initial_state=initial_state)
    assert np.abs(rest.jump - whole.jump).max() < 1e-9 * np.abs(whole.jump).max()
