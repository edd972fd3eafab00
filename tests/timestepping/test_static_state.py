"""The static state before the shaking, against equilibria solved by hand."""

import dataclasses

import numpy as np
import pytest
from hand_systems import gap_law, modal_twin, run, sparse_system, still
from simulating import simulated

from romdam.core.errors import ConfigError, ConvergenceError
from romdam.core.integrators import INTEGRATORS
from romdam.timestepping import equilibrium
from romdam.timestepping.equilibrium import static_equilibrium, system_gap_problem
from romdam.timestepping.limit_analysis import find_collapse

# `conserving` is for scenes without damping, below a step of its own
MODAL = [name for name in INTEGRATORS if name not in ("generalized_alpha", "conserving")]


def _static(system):
    q, gaps = static_equilibrium(system, 1e-10)
    return system.observe @ q, gaps


def _two_springs(F, law):
    """Springs 2e6 and 1e6 N/m to the left and right ground, a gap between their ends, F on the left one."""
    return sparse_system(np.eye(2), np.diag([2e6, 1e6]), [[-1.0, 1.0]], law, force=[F, 0.0])


@pytest.mark.parametrize("twin", [lambda s: s, modal_twin], ids=["sparse", "modal"])
@pytest.mark.parametrize("K_n", [1e6, np.inf])
def test_two_springs_and_a_gap(twin, K_n):
    """Open below 2e6 * 1 mm; closed at 5 kN: p = (F/k1 - gap) / (1/k1 + 1/k2 + 1/K_n)."""
    law = gap_law(1, K_n=K_n, gap=1e-3)
    u, gaps = _static(twin(_two_springs(1000.0, law)))
    assert u == pytest.approx([0.5e-3, 0.0], abs=1e-15)
    assert gaps.jump[0, 0] == pytest.approx(0.5e-3)
    assert (gaps.force[0, 0], gaps.state[0], gaps.stored) == (0.0, 0, 0.0)
    u, gaps = _static(twin(_two_springs(5000.0, law)))
    p = 1.5e-3 / (0.5e-6 + 1e-6 + 1.0 / K_n)
    assert gaps.force[0, 0] == pytest.approx(p, rel=1e-9)
    assert u == pytest.approx([(5000.0 - p) / 2e6, p / 1e6], rel=1e-9)
    assert gaps.jump[0, 0] == pytest.approx(-p / K_n, rel=1e-9, abs=1e-15)
    assert gaps.stored == pytest.approx(0.5 * p**2 / K_n, rel=1e-9, abs=1e-15)


def test_sap2000_hook():
    """SAP2000 verification 6-004: L 100 in, A 10 in2, E 29000 ksi, 6.5e-6 /F, -100 F, opening 0.04 in,
    K 5000 kip/in: 0.04918 in, 45.886 kip. The cooling as its equivalent force E A alpha dT."""
    kip, inch = 4448.2216152605, 0.0254
    k = 29000.0 * 10.0 / 100.0 * kip / inch
    law = gap_law(1, K_n=5000.0 * kip / inch, gap=0.04 * inch)
    hook = sparse_system([[1.0]], [[k]], [[-1.0]], law, force=[k * 6.5e-6 * 100.0 * 100.0 * inch])
    for system in (hook, modal_twin(hook)):
        u, gaps = _static(system)
        assert u[0] / inch == pytest.approx(0.04918, abs=0.5e-5)
        assert gaps.force[0, 0] / kip == pytest.approx(45.886, abs=0.5e-3)


def test_tension_stiffness_pulls():
    law = gap_law(1, K_n=1e7, K_nz=1e6)
    u, gaps = _static(sparse_system([[1.0]], [[1e6]], [[1.0]], law, force=[1000.0]))
    assert u[0] == pytest.approx(0.5e-3)
    assert gaps.force[0, 0] == pytest.approx(-500.0)
    assert gaps.state[0] == 0


def _loose_block(force, **law):
    """Mass 2000 kg loose in x, y and z, on a table (normal +z)."""
    B = [[0, 0, 1], [1, 0, 0], [0, 1, 0]] if law.get("mu") else [[0, 0, 1]]
    system = sparse_system(
        2000.0 * np.eye(3), np.zeros((3, 3)), B, gap_law(1, **law), force=force, floating=True
    )
    return dataclasses.replace(system, load=2000.0 * np.eye(3))


@pytest.mark.parametrize("twin", [lambda s: s, modal_twin], ids=["sparse", "modal"])
@pytest.mark.parametrize(
    ("K_n", "K_s"),
    [
        (1e9, 5e8),
        (np.inf, 5e8),
        (np.inf, np.inf),
    ],
)
def test_loose_block_rests_on_friction(twin, K_n, K_s):
    """Weight 20 kN, 6 kN and 8 kN sideways: 10 kN on the resultant, below 0.6 * 20 kN."""
    system = twin(_loose_block([6e3, -8e3, -20e3], K_n=K_n, K_s=K_s, mu=0.6))
    u, gaps = _static(system)
    assert gaps.force[0] == pytest.approx([20e3, -6e3, 8e3], rel=1e-6)
    assert gaps.state[0] == 1
    assert u == pytest.approx([6e3 / K_s, -8e3 / K_s, -20e3 / K_n], rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("failures", [1, 2, 5])
@pytest.mark.parametrize("system", ["loose", "held"])
def test_where_the_gaps_do_not_converge_a_larger_proximal_term_does(failures, system, monkeypatch):
    """The first attempts fail; the equilibrium, which is the only one, is the same."""
    solve, shifts = equilibrium._solve, []

    def failing(problem, memory, w_free, tolerance, hasty):
        shifts.append(1.0 / problem.self_flexibility[0])
        if len(shifts) <= failures:
            memory.force[:] = np.nan
            raise ConvergenceError("not yet")
        return solve(problem, memory, w_free, tolerance, hasty)

    monkeypatch.setattr(equilibrium, "_solve", failing)
    if system == "loose":
        u, gaps = _static(_loose_block([6e3, -8e3, -20e3], K_n=1e9, K_s=5e8, mu=0.6))
        assert gaps.force[0] == pytest.approx([20e3, -6e3, 8e3], rel=1e-6)
        assert u == pytest.approx([6e3 / 5e8, -8e3 / 5e8, -20e3 / 1e9], rel=1e-6)
    else:
        u, gaps = _static(_two_springs(5000.0, gap_law(1, K_n=1e6, gap=1e-3)))
        p = 1.5e-3 / (0.5e-6 + 1e-6 + 1e-6)
        assert gaps.force[0, 0] == pytest.approx(p, rel=1e-6)
        assert u == pytest.approx([(5000.0 - p) / 2e6, p / 1e6], rel=1e-6)
    assert shifts[failures] > shifts[0]


def test_loose_block_rests_on_a_smooth_table_if_nothing_pushes_it():
    u, gaps = _static(_loose_block([0.0, 0.0, -20e3], K_n=1e9))
    assert gaps.force[0, 0] == pytest.approx(20e3, rel=1e-9)
    assert u == pytest.approx([0.0, 0.0, -2e-5], rel=1e-6, abs=1e-15)


@pytest.mark.parametrize(
    ("force", "law"),
    [
        ([6e3, -8e3, -10e3], {"K_n": 1e9, "K_s": 5e8, "mu": 0.6}),  # 10 kN against 6 kN of friction
        ([1.0, 0.0, -20e3], {"K_n": 1e9}),  # nothing holds it sideways
        ([0.0, 0.0, 5e3], {"K_n": np.inf}),  # lifted
    ],
    ids=["slides", "smooth", "lifted"],
)
def test_no_equilibrium_is_an_error_with_a_remedy(force, law):
    with pytest.raises(
        ConvergenceError, match=r"no static equilibrium can be: .* joints alone, (slides|lifts off)"
    ):
        _static(_loose_block(force, **law))


@pytest.mark.parametrize("integrator", [*MODAL, "generalized_alpha"])
@pytest.mark.parametrize("mu", [0.0, 0.6])
def test_a_run_from_equilibrium_stays_there(integrator, mu):
    force = [6e3, -8e3, -20e3] if mu else [0.0, 0.0, -20e3]
    system = _loose_block(force, K_n=1e9, K_s=5e8, mu=mu)
    system = modal_twin(system) if integrator in MODAL else system
    h = run(system, still(1.0, 0.005), 0.005, initial_state="static", integrator=integrator)
    assert np.abs(h.disp - h.disp[0]).max() <= 1e-8 * np.abs(h.disp[0]).max()
    assert np.abs(h.traction - h.traction[0]).max() <= 1e-6 * 20e3
    assert (h.state == 1).all()


@pytest.mark.parametrize("integrator", MODAL)
def test_a_load_from_the_start_overshoots_by_two(integrator):
    """Held spring, sudden load: u = F/k (1 - cos wt); from equilibrium nothing moves."""
    system = modal_twin(sparse_system([[1.0]], [[100.0]], [[1.0]], gap_law(1, gap=1.0), force=[5.0]))
    dt = np.pi / 10 / 100
    sudden = run(system, still(100 * dt, dt), dt, integrator=integrator)
    assert sudden.disp[-1, 0] == pytest.approx(0.1, rel=1e-12)
    settled = run(system, still(100 * dt, dt), dt, initial_state="static", integrator=integrator)
    assert settled.disp[:, 0] == pytest.approx(0.05, rel=1e-9)


def test_what_does_not_suit_is_refused():
    system = _two_springs(0.0, gap_law(1))
    with pytest.raises(ConfigError, match="modal needs a reduced model"):
        simulated(system, np.zeros((3, 2)), 0.01)
    with pytest.raises(ConfigError, match="no integrator 'euler'"):
        simulated(system, np.zeros((3, 2)), 0.01, integrator="euler")


def _pushed(push, mu):
    """A loose block of 20 kN on two gaps, pushed along x."""
    law = gap_law(2, K_n=1e9, K_s=5e8, mu=mu)
    B = np.kron([[1.0], [1.0]], [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    force = [push, 0.0, -20e3]
    return modal_twin(sparse_system(2000.0 * np.eye(3), np.zeros((3, 3)), B, law, force=force, floating=True))


@pytest.mark.parametrize("needs", [1.2, 3.0])
def test_limit_analysis_finds_the_strength_that_holds(needs):
    """20 kN with friction 0.3 hold 6 kN; a push of so many times that needs as much more."""
    system = _pushed(needs * 6e3, 0.3)
    problem = system_gap_problem(system, np.eye(6))
    collapse = find_collapse(system, problem)
    assert collapse.kind == "slides" and collapse.strength == pytest.approx(needs, rel=0.02)
    assert find_collapse(_pushed(5.9e3, 0.3), problem) is None
    with pytest.raises(
        ConvergenceError, match=r"no static equilibrium can be: all, .* slides: .* times the shear strength"
    ):
        _static(system)


def test_no_strength_holds_what_is_lifted():
    system = _loose_block([0.0, 0.0, 5e3], K_n=1e9, K_s=5e8, mu=0.5)
    for either in (system, modal_twin(system)):
        assert find_collapse(either, system_gap_problem(system, np.eye(3))).kind == "lifts off"


def _wall(force, mu, base=4.0, height=10.0):
    """A rigid wall on two gaps at its heel and toe; unknowns x, z and its turn about y, in metres at the toe.

    `force` is (push along x at mid height, vertical).
    """
    m, arm = 1000.0, base / 2.0
    law = gap_law(2, K_n=1e9, K_s=5e8, mu=mu)
    # jumps n, j, k: z -+ turn, x, nothing along y
    B = np.array([[0, 1, -1], [1, 0, 0], [0, 0, 0], [0, 1, 1], [1, 0, 0], [0, 0, 0]])
    B = B if mu else B[::3]
    moment = -force[0] * (height / 2.0) / arm
    M = np.diag([m, m, m * (base**2 + height**2) / 12.0 / arm**2])
    loads = [force[0], force[1], moment]
    system = sparse_system(M, np.zeros((3, 3)), B, law, force=loads, floating=True)
    return dataclasses.replace(system, load=np.column_stack([M[:, 0], np.zeros(3), M[:, 1]]))


@pytest.mark.parametrize("twin", [lambda system: system, modal_twin])
@pytest.mark.parametrize(
    ("force", "mu", "kind"),
    [
        ([7.9e3, -20e3], 1.0, None),  # tips from push h/2 = weight b/2, 8 kN
        ([8.1e3, -20e3], 1.0, "overturns"),
        ([7.9e3, -20e3], 0.3, "slides"),  # needs 1.32 times
        ([0.0, 1e3], 1.0, "lifts off"),
        ([1.0, -20e3], 0.0, "slides"),
        ([0.0, 1e3], 0.0, "lifts off"),
        ([30e3, -20e3], 1.0, "overturns"),  # slides as well: no strength would do
    ],
)
def test_limit_analysis_names_what_fails(force, mu, kind, twin):
    system = twin(_wall(force, mu))
    collapse = find_collapse(system, system_gap_problem(system, np.eye(system.B.shape[0])))
    assert (None if collapse is None else collapse.kind) == kind
    if kind is not None:
        with pytest.raises(
            ConvergenceError, match=rf"no static equilibrium can be: all, .* {kind}: "
        ) as error:
            _static(system)
        assert ("add friction" in str(error.value)) == (kind == "slides")


def test_gaps_that_are_rigid_in_meeting_planes_find_rest():
    """Two columns beside each other on a table, one point for all three joints: two jumps give the third.

    Column 1 is pushed with 1 kN against column 2; nothing but shear holds them.
    """
    m, g, push = 1000.0, 10.0, 1e3
    table, between = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    none = np.zeros((3, 3))
    B = np.block([[table, none], [none, table], [-between, between]])
    law = gap_law(3, K_n=np.inf, K_s=np.inf, mu=0.5)
    K = np.zeros((6, 6))
    force = [push, 0.0, -m * g, 0.0, 0.0, -m * g]
    system = sparse_system(m * np.eye(6), K, B, law, force=force, floating=True)
    assert np.linalg.matrix_rank(B) < len(B)
    _, gaps = static_equilibrium(modal_twin(system), 1e-10)
    assert gaps.force[:2, 0].sum() == pytest.approx(2.0 * m * g, rel=1e-6)
    assert gaps.force[:2, 1].sum() == pytest.approx(-push, rel=1e-6)
    assert (np.linalg.norm(gaps.force[:, 1:], axis=1) <= 0.5 * gaps.force[:, 0] * (1.0 + 1e-9)).all()
    alone = push / (m * (2.0 * np.pi * 0.5) ** 2)  # how far the push moves a column in one proximal step
    assert np.abs(gaps.jump).max() <= 2e-4 * alone
    assert np.abs(gaps.jump[:, 0]).max() <= 1e-9 * alone
