"""The integrator of docs/extending/integrator.md on a mass that pounds against a stop, written by hand."""

import re
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.system import GapLaw, System
from romdam.timestepping.integrators.modal import Modal
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one

PAGE = Path(__file__).parents[2] / "docs" / "extending" / "integrator.md"
OMEGA, XI = 2.0 * np.pi * 2.0, 0.05  # rad/s and damping ratio of the mass, 1 kg
STEP = 0.005  # s

SYSTEM = System(
    M=csr_matrix([[1.0]]),
    C=csr_matrix([[2.0 * XI * OMEGA]]),
    K=csr_matrix([[OMEGA**2]]),
    B=csr_matrix([[1.0]]),
    load=np.array([[1.0, 0.0, 0.0]]),
    force=np.zeros(1),
    observe=csr_matrix((0, 1)),
    law=GapLaw(
        np.full(1, 1e4), np.zeros(1), np.zeros(1), np.zeros((1, 2)), np.full(1, 0.01), {"stop": slice(0, 1)}
    ),
    parts={"mass": slice(0, 1)},
    diagonal=True,
    floating=False,
    reduced=True,
)


def openings(integrator, step):
    """Openings (nt, 1) of the stop at every 0.01 s; the ledger must close."""
    steps = integrator.steps(step, step, 0.01)
    time = np.arange(round(2.0 / steps.base) + 1) * steps.base
    ground = np.zeros((3, time.size))
    ground[0] = 2.0 * np.sin(OMEGA * time)
    history = simulate_one(Prepared(SYSTEM, integrator), ground, Settings(steps))
    assert history.stats["ledger_imbalance"] < 1e-9
    assert history.peaks["compression"].max() > 0.0
    return history.jump[..., 0]


def test_the_theta_rule_has_less_than_half_of_the_error():
    names = {"__name__": PAGE.stem}
    for code in re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.M | re.S):
        exec(compile(code, str(PAGE), "exec"), names)
    limit = openings(Modal(), STEP / 64)
    theta, fixed = (
        np.linalg.norm(openings(integrator, STEP) - limit) / np.linalg.norm(limit)
        for integrator in (names["ModalTheta"](), Modal())
    )
    assert theta < 0.5 * fixed < 0.25, (theta, fixed)
