"""Symmetry reduction: merged contacts give the histories of the whole scene, and nothing else is merged."""

import dataclasses

import numpy as np
import pytest
from hand_systems import assert_ledger, gap_law, modal_twin, sparse_system
from scipy.sparse import csr_matrix, issparse
from simulating import simulated

from romdam.core.system import GapLaw, with_parameters
from romdam.error.estimate import start_at
from romdam.timestepping.modal import symmetry
from romdam.timestepping.modal.symmetry import merge_equivalent_contacts


def mirrored(rows=4, K_n=4e4, uneven=0.0, stiffness=3e4, gap=1e-3):
    """Two square frames of masses, one against the other, in x; each has its gaps left and right of a mirror.

    Motions with and against the mirror have the same frequencies, so that eigenvectors mix them. A member
    between the sides parts the frequencies of the right frame.
    """
    chain = 2.0 * np.eye(rows) - np.eye(rows, k=1) - np.eye(rows, k=-1)
    side = stiffness * chain
    K = np.zeros((4 * rows, 4 * rows))
    for frame in range(2):
        tie = 5e3 * frame * np.eye(rows)
        block = np.block([[side + tie, -tie], [-tie, side + tie]])
        K[2 * rows * frame : 2 * rows * (frame + 1), 2 * rows * frame : 2 * rows * (frame + 1)] = block
    K[0, 0] += uneven
    masses = np.tile(1.0 + 0.1 * np.arange(rows), 4) * np.repeat([1.0, 1.7], 2 * rows)
    B = np.hstack([-np.eye(2 * rows), np.eye(2 * rows)])
    C = 0.002 * K + 0.1 * np.diag(masses)
    law = gap_law(2 * rows, K_n=K_n, gap=gap)
    return sparse_system(np.diag(masses), K, B, law, C=C, load=masses)


def in_modes(system):
    """The modal twin, as one part; modes of one frequency turned into each other."""
    twin = modal_twin(system)
    k, Q = twin.K.diagonal(), np.eye(twin.size)
    for i in np.flatnonzero(np.diff(k) < 1e-9 * k[1:]):
        c, s = np.cos(0.7), np.sin(0.7)
        Q[:, [i, i + 1]] = Q[:, [i, i + 1]] @ np.array([[c, -s], [s, c]])
    return dataclasses.replace(
        twin,
        B=csr_matrix(twin.B @ Q),
        load=Q.T @ twin.load,
        force=Q.T @ twin.force,
        observe=csr_matrix(twin.observe @ Q),
    )


def shaken(system, **options):
    dt, t = 0.005, np.arange(401) * 0.005
    acc = np.zeros((3, len(t)))
    acc[0] = 8.0 * np.sin(9.0 * t) * np.sin(1.7 * t)
    return simulated(system, acc, dt, integrator="adaptive", stride=2, **options)


def assert_same(one, other, tolerance):
    for name in ("jump", "traction", "mean_traction", "disp", "vel", "acc", "q", "v"):
        a, b = getattr(one, name), getattr(other, name)
        assert a.shape == b.shape
        assert np.abs(a - b).max() <= tolerance * max(np.abs(b).max(), 1e-300), name
    for name, values in other.peaks.items():
        assert np.abs(one.peaks[name] - values).max() <= tolerance * max(np.abs(values).max(), 1e-300), name
    for name, values in other.energy.items():
        assert np.abs(one.energy[name] - values).max() <= tolerance * np.abs(other.energy["input"]).max()
    assert np.array_equal(one.state, other.state)


@pytest.mark.parametrize("K_n", [4e4, 1e7, np.inf])
@pytest.mark.parametrize("initial_state", ["static", "undeformed"])
def test_the_same_histories(K_n, initial_state):
    system = in_modes(mirrored(K_n=K_n))
    system = dataclasses.replace(system, force=-3e-4 * system.K.diagonal() * system.B.toarray().sum(axis=0))
    one, other = (
        shaken(system, initial_state=initial_state, merge_contacts=merge) for merge in (True, False)
    )
    assert (one.stats["integrated_gaps"], other.stats["integrated_gaps"]) == (4, 8)
    assert one.stats["steps"] == other.stats["steps"]
    assert other.jump.max() > 1.1e-3 and (other.traction > 0.0).any()
    assert_same(one, other, 1e-7)
    assert_ledger(one)


def test_what_moves_differently_is_not_merged():
    x = np.array([0])
    assert len(merge_equivalent_contacts(in_modes(mirrored()), x).system.law) == 4
    assert merge_equivalent_contacts(in_modes(mirrored(uneven=1.0)), x) is None
    system = in_modes(mirrored())
    for name, values in (("K_n", 4e4), ("gap", 1e-3)):
        uneven = np.full(8, values)
        uneven[1] *= 1.001
        law = dataclasses.replace(system.law, **{name: uneven})
        assert merge_equivalent_contacts(dataclasses.replace(system, law=law), x) is None
    pulled = dataclasses.replace(system, force=system.B.toarray()[0])
    assert merge_equivalent_contacts(pulled, x) is None
    twisted = dataclasses.replace(system, load=np.tile(system.B.toarray()[0][:, None], (1, 3)))
    assert merge_equivalent_contacts(twisted, x) is None
    assert merge_equivalent_contacts(dataclasses.replace(system, diagonal=False), x) is None


def test_what_was_found_serves_other_parameters_and_another_damping_to_the_bit(monkeypatch):
    x, found, system = np.array([0]), {}, in_modes(mirrored())
    merge_equivalent_contacts(system, x, found)
    softer = dataclasses.replace(system.law, K_n=np.full(8, 1.7e4), gap=np.full(8, 3e-4))
    other = with_parameters(system, softer, (system.C.diagonal(), 0.13 * np.sqrt(system.K.diagonal())))
    fresh = merge_equivalent_contacts(other, x)
    with monkeypatch.context() as patched:
        patched.setattr(symmetry, "_equivalence", lambda *of: pytest.fail("sought again"))
        shared = merge_equivalent_contacts(other, x, found)
    for one, same in ((shared, fresh), (shared.system, fresh.system), (shared.system.law, fresh.system.law)):
        for name in [field.name for field in dataclasses.fields(one)]:
            a, b = getattr(one, name), getattr(same, name)
            if isinstance(a, np.ndarray):
                assert np.array_equal(a, b), name
            elif issparse(a):
                assert np.array_equal(a.toarray(), b.toarray()), name
    assert shared.system.law.K_n[0] == 2 * 1.7e4 and shared.system.C.diagonal().max() > 0.0


def test_what_was_found_serves_nothing_else():
    x, found, system = np.array([0]), {}, in_modes(mirrored())
    assert merge_equivalent_contacts(system, x, found) is not None
    uneven = dataclasses.replace(system.law, gap=np.where(np.arange(8) == 1, 1.001e-3, 1e-3))
    assert merge_equivalent_contacts(dataclasses.replace(system, law=uneven), x, found) is None
    assert merge_equivalent_contacts(dataclasses.replace(system, diagonal=False), x, found) is None
    merge_equivalent_contacts(system, np.array([0, 1]), found)
    assert len(found) == 3


def test_a_law_uneven_in_one_joint_leaves_what_mirrors_it():
    """Both gaps of one height softer than the others: still four groups, with their own stiffness."""
    system = in_modes(mirrored())
    K_n = np.full(8, 4e4)
    K_n[[2, 6]] = 1e4
    law = dataclasses.replace(system.law, K_n=K_n, joints={"low": slice(0, 5), "high": slice(5, 8)})
    small = merge_equivalent_contacts(dataclasses.replace(system, law=law), np.array([0])).system
    assert isinstance(small.law, GapLaw)
    assert sorted(small.law.K_n) == [2e4, 8e4, 8e4, 8e4]
    assert small.law.joints == {"low": slice(0, 4), "high": slice(4, 4)}


def test_modes_that_no_gap_touches_are_kept_where_the_loads_move_them():
    """One more mode, of a frequency that is there already, driven by a thousandth of the others."""
    system = in_modes(mirrored())
    n = system.size

    load = np.vstack([system.load, 1e-3 * np.abs(system.load).max(axis=0)])
    M, C, K = (np.append(m.diagonal(), m.diagonal()[0]) for m in (system.M, system.C, system.K))
    observe = np.zeros((3, n + 1))
    observe[0, n] = 1.0
    system = dataclasses.replace(
        system,
        M=csr_matrix(np.diag(M)),
        C=csr_matrix(np.diag(C)),
        K=csr_matrix(np.diag(K)),
        B=csr_matrix(np.pad(system.B.toarray(), ((0, 0), (0, 1)))),
        load=load,
        force=np.append(system.force, 0.0),
        observe=csr_matrix(observe),
        parts={"all": slice(0, n), "apart": slice(n, n + 1)},
    )
    one, other = (shaken(system, merge_contacts=merge) for merge in (True, False))
    assert one.stats["integrated_gaps"] == 4
    assert np.abs(other.disp[:, 0]).max() > 1e-7
    assert_same(one, other, 1e-7)


def test_a_start_that_mirrors_itself_is_merged_and_another_is_not():
    """From a row of a run the rest of it, by four gaps for eight, or by all where modes start elsewhere."""
    system = in_modes(mirrored(stiffness=3e5, gap=0.0))
    run = shaken(system)
    row = int(run.traction[:150].sum(axis=(1, 2)).argmax())
    start = start_at(run, system.law, row, run.jump[row])
    one, other = (shaken(system, start=start, merge_contacts=merge) for merge in (True, False))
    assert start.traction.max() > 0.0
    assert (one.stats["integrated_gaps"], other.stats["integrated_gaps"]) == (4, 8)
    assert_same(one, other, 1e-7)
    uneven = start.q + 1e-3 * np.abs(start.q).max() * np.random.default_rng(0).normal(size=len(start.q))
    moved = dataclasses.replace(start, q=uneven)
    one, other = (shaken(system, start=moved, merge_contacts=merge) for merge in (True, False))
    assert one.stats["integrated_gaps"] == 8
    assert np.array_equal(one.jump, other.jump)


def test_groups_that_move_apart_are_not_merged(monkeypatch):
    """Whatever the groups came from, forces on them prove that their gaps move alike."""
    system, classes = in_modes(mirrored()), np.zeros(8, dtype=int)
    gaps, signs = symmetry._partition(system, np.array([0]), classes)
    assert symmetry._equivalence(system, np.array([0]), classes) is not None
    wrong = np.where(gaps == gaps.max(), gaps.max() - 1, gaps)
    monkeypatch.setattr(symmetry, "_partition", lambda *_: (wrong, signs))
    assert symmetry._equivalence(system, np.array([0]), classes) is None
