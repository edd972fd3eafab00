"""What a prepared system keeps between runs: the same histories, bit for bit, and nothing that grows."""

import dataclasses
import pickle

import numpy as np
import pytest
from hand_systems import gap_law, modal_twin, sparse_system
from simulating import prepared_for

from romdam.timestepping import equilibrium, operator_cache
from romdam.timestepping.modal import runs
from romdam.timestepping.operator_cache import OperatorCache
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one
from romdam.timestepping.steps import Steps


def _system(**law):
    """Two masses of 1 and 2 kg, the one hung, the other pressed against it, with a gap between them."""
    K, M = np.array([[3e3, -5e2], [-5e2, 2e3]]), np.diag([1.0, 2.0])
    given = gap_law(1, **({"K_n": 1e5, "gap": 1e-3} | law))
    return modal_twin(
        sparse_system(M, K, np.array([[-1.0, 1.0]]), given, C=0.002 * K, load=[1.0, 2.0], force=[3.0, -5.0])
    )


def _shaken(prepared, amplitude=9.0, dt=0.005, cuts=(4, 4), **options):
    acc = np.zeros((3, 201))
    acc[0] = amplitude * np.sin(40.0 * dt * np.arange(201))
    cuts = cuts if prepared.integrator.name == "adaptive" else ()
    return simulate_one(prepared, acc, Settings(Steps(dt, cuts=cuts), **options))


CHANGES = [
    {"amplitude": -4.0},
    {"dt": 0.0025},
    {"cuts": (2,)},
    {"initial_state": "undeformed"},
    {"tolerance": 1e-11},
]


INTEGRATORS = [
    ("adaptive", {}),
    ("adaptive", {"midpoint": False}),
    ("generalized_alpha", {"rho_inf": 0.5}),
]


def test_a_history_for_a_comparison_has_the_bits_of_the_jumps():
    whole, jumps = (_shaken(prepared_for(_system(), "adaptive"), only_jumps=only) for only in (False, True))
    assert np.array_equal(jumps.jump, whole.jump) and np.array_equal(jumps.time, whole.time)
    assert all(np.array_equal(jumps.peaks[name], whole.peaks[name]) for name in whole.peaks)
    assert jumps.disp.shape == (0, *whole.disp.shape[1:]) and jumps.coordinates is None


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: next(iter(change)))
@pytest.mark.parametrize("integrator", INTEGRATORS, ids=str)
def test_a_run_after_others_has_the_bits_of_the_first(integrator, change):
    name, options = integrator
    used, fresh = (prepared_for(_system(), name, **options) for _ in range(2))
    for other in CHANGES:
        _shaken(used, **other)
    one, first = _shaken(used, **change), _shaken(fresh, **change)
    for name in ("jump", "traction", "mean_traction", "disp", "vel", "q", "v"):
        assert np.array_equal(getattr(one, name), getattr(first, name)), name
    assert np.abs(first.jump).max() > 1e-3


def test_nothing_is_made_twice(monkeypatch):
    made = []
    for module, name in ((runs, "modal_model"), (runs, "step_levels"), (equilibrium, "static_equilibrium")):
        make = getattr(module, name)

        def counted(*given, make=make, name=name):
            made.append(name)
            return make(*given)

        monkeypatch.setattr(module, name, counted)
    system = prepared_for(_system(), "adaptive")
    for amplitude in (1.0, 2.0, 3.0):
        _shaken(system, amplitude)
    assert sorted(made) == ["modal_model", "static_equilibrium", "step_levels"]
    _shaken(system, dt=0.0025)
    assert sorted(made)[1:] == ["modal_model", "static_equilibrium", "step_levels", "step_levels"]


def test_other_joints_or_damping_are_another_system():
    system = _system()
    soft = dataclasses.replace(system, law=gap_law(1, K_n=1e3, gap=1e-3))
    damped = dataclasses.replace(system, C=10.0 * system.C)
    histories = [_shaken(prepared_for(one, "adaptive")).jump for one in (system, soft, damped)]
    for a, b in ((0, 1), (0, 2), (1, 2)):
        assert np.abs(histories[a] - histories[b]).max() > 1e-4


def test_a_prepared_system_is_pickled_without_what_it_keeps():
    system = prepared_for(_system(), "adaptive")
    before = len(pickle.dumps(system))
    history = _shaken(system)
    again = pickle.loads(pickle.dumps(system))
    assert len(pickle.dumps(system)) < before + 500
    assert np.array_equal(_shaken(again).jump, history.jump)


def test_the_oldest_goes_where_there_is_too_much(monkeypatch):
    monkeypatch.setattr(operator_cache, "_MOST", 3 * 800)
    values, made = OperatorCache(), []

    def get(key, size=100):
        return values.get_or_compute(key, lambda: made.append(key) or (np.zeros(size), key))[1]

    for key in "abcabcadcb":
        assert get(key) == key
    assert made == ["a", "b", "c", "d", "b"]  # d took b's place, the longest unused; then b took a's
    assert get("large", 1000) == "large"
    get("a"), get("large", 1000)
    assert made[5:] == ["large", "a", "large"]  # what is too much by itself stays until the next comes
