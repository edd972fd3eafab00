"""Runs by which an accuracy judges joints that remember: their steps, how many they are, what is compared."""

import itertools
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hand_systems import gap_law, modal_twin, sparse_system
from simulating import prepared_for

from romdam.contact.laws import Bond
from romdam.contact.laws.catalogue import source_of
from romdam.core.system import LawRows
from romdam.timestepping import step_control
from romdam.timestepping.settings import Settings
from romdam.timestepping.step_control import jump_differences, simulate_to
from romdam.timestepping.steps import Steps

COARSE = 0.01
RIGHT = np.ones((5, 2, 3)) * (np.arange(5) > 0)[:, None, None]
WRONG = 0.3 * RIGHT


@dataclass(frozen=True)
class Run:
    """What is read of a history."""

    jump: np.ndarray
    bonded: np.ndarray
    traction: np.ndarray = field(default_factory=lambda: np.zeros((5, 2, 3)))
    stats: dict = field(default_factory=lambda: {"loop_cpu_seconds": 1.0})


def judged(monkeypatch, jumps, bonded=None):
    """The outcome of runs with these jumps, one after the other, and their steps."""
    law = gap_law(2, K_n=1e4, K_s=1e4, mu=0.5)
    bond = LawRows(source_of(Bond), np.array([[10.0, 20.0]] * 2), np.array([True, True]), shear=True)
    system = sparse_system(1.0, 40.0, np.ones((6, 1)), replace(law, laws=(bond,)), C=0.2, load=[1.0])
    prepared, steps = prepared_for(modal_twin(system), "adaptive"), []

    def simulated(prepared, grounds, settings, progress):
        if settings.only_jumps:  # the base step is tried, and does not matter
            rows = (grounds[0].shape[1] - 1) // settings.steps.stride + 1
            return [Run(jumps[len(steps) - 2][:rows], np.zeros((rows, 2), bool))]
        steps.append(settings.steps)
        i = len(steps) - 1
        return [Run(jumps[i], np.zeros((5, 2), bool) if bonded is None else bonded[i])]

    monkeypatch.setattr(step_control, "simulate", simulated)
    ground = lambda dt: np.zeros((3, round(1.0 / dt) + 1))  # noqa: E731
    found = simulate_to([prepared], [ground], Settings(Steps(COARSE)), 0.01)[0]
    return found, steps


def test_steps_of_successive_runs_are_no_multiples(monkeypatch):
    found, steps = judged(monkeypatch, [RIGHT] * 3)
    assert len(steps) == 3 and found.stats["runs"] == 3.0
    assert [COARSE / one.finest for one in steps] == pytest.approx([8.0, 18.0, 32.0])
    assert [COARSE / one.base for one in steps] == pytest.approx([1.0, 2.0, 1.0])
    for coarse, fine in itertools.pairwise(steps):
        ratio = coarse.finest / fine.finest
        assert 1.5 < ratio < 2.5 and abs(ratio - round(ratio)) > 0.1


def test_two_runs_that_agree_after_one_that_did_not_are_not_believed(monkeypatch):
    """Three blocks with bonds broke them in the right order, the wrong one and the right one again, in runs
    whose steps halve: the second and third of these differences are 69 %."""
    found, steps = judged(monkeypatch, [WRONG, RIGHT, RIGHT, RIGHT])
    assert len(steps) == 4
    assert found.stats["estimated_time_error"] <= 0.01
    found, steps = judged(monkeypatch, [WRONG, RIGHT, WRONG, RIGHT, RIGHT, RIGHT])
    assert len(steps) == 6


def test_bonds_that_break_otherwise_count_though_jumps_agree(monkeypatch):
    """Of two gaps broken for five rows one is not in the second run: a half, then nothing."""
    whole, half = np.zeros((5, 2), bool), np.zeros((5, 2), bool)
    half[:, 0] = True
    _, steps = judged(monkeypatch, [RIGHT] * 6, [whole, half, whole, whole, whole, whole])
    assert len(steps) == 5


def test_the_slip_that_is_left_counts():
    """Slips of 1 that leave 0.1: the difference of what is left is a tenth of it; in L2 hardly any."""
    slips = np.zeros((1001, 1, 3))
    slips[1:, 0, 0], slips[1:-1, 0, 1], slips[-1, 0, 1] = 1.0, 1.0, 0.1
    other = slips.copy()
    other[-1, 0, 1] = 0.11
    assert jump_differences(other, slips) == pytest.approx([0.0, 0.0, 0.01 / 1000**0.5, 0.1], rel=1e-3)
    slips[-1, 0, 1], other[-1, 0, 1] = 0.01, 0.02  # a twentieth of the largest is the least to measure by
    assert jump_differences(other, slips)[3] == pytest.approx(0.01 / 0.05)
