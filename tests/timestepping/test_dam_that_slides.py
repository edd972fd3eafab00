"""A dam of one mode that slides on its base, against its equations integrated with fifty times as many steps.

    M Y'' + C Y' + K Y = -L (a_g + s''),   m (a_g + s'') + L Y'' = -F,   |F| <= mu m g

s is the slip of the base, Y the fundamental mode with the base fixed: the formulation of the reference,
without water. Its results are figures without tables, so the equations are what is compared with.

References
----------
Chopra, Zhang, Earthquake-induced base sliding of concrete gravity dams, J. Struct. Eng. 117 (1991) 3698.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hand_systems import assert_ledger, gap_law, modal_twin, run, sparse_system
from scipy.linalg import expm

from romdam.core.arrays import Floats

G, DT, FINER, K_S = 9.81, 0.001, 50, 1e13
m, L, M = 0.5e6, 1e6 / 12.0, 1e6 / 30.0  # [kg] a triangular section whose mode is (z / H)^2
RECORD = Path(__file__).parents[2] / "data" / "records" / "northridge_mul009_g_dt0.01.txt"
SLIP, MODE, SLIP_RATE, MODE_RATE, ACC, ACC_RATE, FRICTION = range(7)


def rates(omega: float, xi: float) -> Floats:
    """d/dt of all seven."""
    A = np.zeros((7, 7))
    A[SLIP, SLIP_RATE] = A[MODE, MODE_RATE] = A[ACC, ACC_RATE] = 1.0
    spring, dashpot = M * omega**2, 2.0 * xi * omega * M
    mode = np.array([0.0, -spring, 0.0, -dashpot, -L, 0.0, 0.0])
    base = np.array([0.0, 0.0, 0.0, 0.0, -m, 0.0, -1.0])
    A[[SLIP_RATE, MODE_RATE]] = np.linalg.solve([[m, L], [L, M]], [base, mode])
    return A


def slip_of_two_unknowns(acc: Floats, omega: float, xi: float, limit: float) -> Floats:
    """Slip of the base at every sample, the ground acceleration linear between.

    The base stands on its shear spring, which follows it up to the limit at the end of every small step. On a
    rigid base, without the spring, the slip of the first case is 0.18 % off.
    """
    step = expm(DT / FINER * rates(omega, xi))
    per_force = step[:, FRICTION]
    z, rest, made = np.zeros(7), 0.0, [0.0]
    for a, b in pairwise(acc):
        z[ACC], z[ACC_RATE] = a, (b - a) / DT
        for _ in range(FINER):
            z[FRICTION] = 0.0
            z = step @ z
            force = K_S * (z[SLIP] - rest) / (1.0 - K_S * per_force[SLIP])
            force = min(max(force, -limit), limit)
            z += force * per_force
            rest = z[SLIP] - force / K_S
        made.append(float(z[SLIP]))
    return np.array(made)


@pytest.mark.parametrize(
    ("period", "mu"),
    [
        (0.15, 0.3),
        pytest.param(0.3, 0.5, marks=pytest.mark.slow),
        pytest.param(0.3, 0.8, marks=pytest.mark.slow),
        pytest.param(0.5, 0.5, marks=pytest.mark.slow),
    ],
)
def test_a_flexible_dam_slides_as_its_two_equations_have_it(period, mu):
    omega, xi, factor = 2.0 * np.pi / period, 0.05, 2.0 * G
    record = factor * np.loadtxt(RECORD).ravel()[:1200]
    acc = np.interp(np.arange(10_001) * DT, 0.01 * np.arange(len(record)), record)
    exact = slip_of_two_unknowns(acc, omega, xi, mu * m * G)
    law = gap_law(1, K_n=1e14, K_s=K_S, mu=mu)
    dam = sparse_system(
        M=[[m, L, 0.0], [L, M, 0.0], [0.0, 0.0, m]],
        K=np.diag([0.0, M * omega**2, 0.0]),
        C=np.diag([0.0, 2.0 * xi * omega * M, 0.0]),
        B=[[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
        law=law, force=[0.0, 0.0, -m * G], load=[m, L, 0.0], floating=True,
    )  # fmt: skip
    h = run(modal_twin(dam), acc, DT, initial_state="static", integrator="adaptive")
    slip = h.jump[:, 0, 1] - h.jump[0, 0, 1]
    assert (h.state == 2).any()
    assert np.abs(slip - exact).max() <= 0.001 * np.abs(exact).max()
    assert_ledger(h)
