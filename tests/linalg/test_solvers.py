"""Solvers against known answers and each other; which one is taken, and what is said where none can be."""

import logging
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import block_diag, csr_matrix, diags_array
from scipy.sparse.linalg import LinearOperator, eigsh

from romdam.config.sections.job import BoxConfig
from romdam.core.errors import ReductionError
from romdam.core.scene import Material
from romdam.fem.assembly import assemble
from romdam.geometry.boxes import box_block
from romdam.linalg import conjugate, multigrid, solvers
from romdam.linalg.factor import Factor
from romdam.linalg.modes import krylov
from romdam.linalg.modes.eigen import lowest_modes, modes_below
from romdam.linalg.modes.flexibility import Flexibility
from romdam.linalg.modes.lobpcg import Pencil, Wanted, block_modes, missed
from romdam.linalg.multigrid import Motions, Multigrid
from romdam.linalg.solvers import Solving, candidates, make_solver
from romdam.reduction.substructure import FREE_SHIFT
from romdam.scene.supports import rigid_motions

NAMES = ["superlu", "multifrontal", "multigrid", "pardiso", "pardiso_single"]
CUTOFF = 100.0


@pytest.fixture(scope="module")
def block():
    """K, M and motions of a 10 x 10 x 30 m tet10 cantilever, its front held in y alone: half-held nodes."""
    box = BoxConfig(
        origin=(0.0,) * 3, size=(10.0, 10.0, 30.0), element_size=(3.333333, 3.333333, 3.75), element="tet10"
    )
    made = box_block("b", box, Material(30e9, 0.2, 2400.0), "b")
    K, M = assemble(made)
    free = np.ones((len(made.points), 3), dtype=bool)
    free[made.points[:, 2] == 0.0] = False
    free[made.points[:, 1] == 0.0, 1] = False
    free = free.ravel()
    motions = Motions(np.flatnonzero(free), rigid_motions(made).reshape(-1, 6)[free])
    return K[free][:, free], M[free][:, free], motions


def made(name, block):
    if name.startswith("pardiso"):
        pytest.importorskip("pypardiso")
    return make_solver(block[0], block[2], 10, Solving(name), "b")


@pytest.mark.parametrize("name", NAMES)
def test_a_solver_finds_a_known_answer(name, block):
    K = block[0]
    known = np.random.default_rng(1).standard_normal((K.shape[0], 19))
    known[:, 4] = 0.0
    solver = made(name, block)
    assert np.abs(solver.solve(K @ known) - known).max() < 1e-7
    assert np.abs(solver.solve(K @ known[:, 0]) - known[:, 0]).max() < 1e-7
    assert not solver.solve(np.zeros((K.shape[0], 2))).any()


def test_levels_are_the_same_in_threads_and_leave_numpys_generator_alone(monkeypatch):
    drawn, inside, never = [], Event(), Event()

    def levels(*_, **__):
        drawn.append(np.random.random())  # noqa: NPY002
        inside.set()
        never.wait(0.2)  # the other thread may begin meanwhile
        drawn.append(np.random.random())  # noqa: NPY002
        return SimpleNamespace(levels=[SimpleNamespace(A=None)])

    monkeypatch.setattr("pyamg.smoothed_aggregation_solver", levels)
    np.random.seed(7)  # noqa: NPY002
    with ThreadPoolExecutor(2) as threads:
        first = threads.submit(multigrid._aggregated, None, None)
        inside.wait(10.0)
        second = threads.submit(multigrid._aggregated, None, None)
        assert len(first.result()) == len(second.result()) == 2
    assert drawn == [*np.random.RandomState(0).random(2)] * 2
    assert np.random.random() == np.random.RandomState(7).random()  # noqa: NPY002


def test_pardiso_counts_negative_eigenvalues(block):
    pytest.importorskip("pypardiso")
    from romdam.linalg.pardiso import PardisoFactor

    shifted = block[0] - (2.0 * np.pi * CUTOFF) ** 2 * block[1]
    assert PardisoFactor(shifted).negative() == Factor(shifted).negative() > 5


def test_factors_in_single_precision_take_half_the_memory_and_give_the_same_answer(block):
    pytest.importorskip("pypardiso")
    from romdam.linalg.pardiso import _FACTORS, PardisoFactor, PardisoSingle

    K = block[0]
    right = np.random.default_rng(2).standard_normal((K.shape[0], 20))
    half, whole = PardisoSingle(K), PardisoFactor(K)
    assert half._factors.told(_FACTORS) < 0.5 * whole._factors.told(_FACTORS)
    assert half.memory < whole.memory  # the ordering, most of it at this size, is as large in both
    answer, known = half.solve(right), whole.solve(right)
    assert np.abs(half.precondition(right) - known).max() > 1e-7 * np.abs(known).max()
    assert np.abs(answer - known).max() < 1e-7 * np.abs(known).max()
    assert np.array_equal(PardisoSingle(K).solve(right), answer)
    assert np.abs(half.solve(1e-60 * right) - 1e-60 * known).max() < 1e-67 * np.abs(known).max()
    with pytest.raises(ReductionError, match="are allowed"):
        PardisoSingle(K, 1e3)


def reference(block):
    """Modes below the cut-off by ARPACK on SuperLU, their number by Sylvester's inertia."""
    K, M, _ = block
    limit = (2.0 * np.pi * CUTOFF) ** 2
    count = Factor(K - limit * M).negative()
    operator = LinearOperator(K.shape, matvec=Factor(K).solve, dtype=float)
    omega2, modes = eigsh(K, k=count, M=M, sigma=0.0, OPinv=operator, tol=0.0)
    return omega2, modes


@pytest.mark.parametrize("name", NAMES)
def test_modes_below_a_frequency_are_those_of_a_sturm_count(name, block, monkeypatch):
    K, M, _ = block
    monkeypatch.setattr("romdam.linalg.modes.eigen.SMALL", 0)  # the way of large blocks: no count beforehand
    omega2, modes = modes_below(K, M, None, CUTOFF, made(name, block))
    known, known_modes = reference(block)
    assert len(omega2) == len(known)
    assert np.abs(omega2 / known - 1.0).max() < 1e-9
    overlap = np.linalg.svd(known_modes.T @ (M @ modes), compute_uv=False)
    assert 1.0 - overlap.min() < 1e-12  # of the subspaces: 1e-6 of an angle, squared
    assert np.abs(modes.T @ (M @ modes) - np.eye(len(omega2))).max() < 1e-10


@pytest.mark.parametrize("lost", [0, *(pytest.param(lost, marks=pytest.mark.slow) for lost in (3, -1))])
def test_block_lanczos_notices_a_mode_that_was_missed(lost, block):
    K, M, _ = block
    _, modes = reference(block)
    lowest, D = 1.0 / (2.0 * np.pi * CUTOFF) ** 2, Flexibility(M, Factor(K).solve, 0.0)
    assert not krylov._missed(D, modes, lowest)
    assert krylov._missed(D, np.delete(modes, lost, axis=1), lowest)


def test_block_lanczos_finds_modes_that_come_in_numbers_where_half_the_unknowns_have_no_mass():
    """Twenty chains of springs, alike, their masses on every other node: each frequency twenty times.

    That is more often than the sixteen vectors of a block see; the probe notices what they miss.
    """
    size, chains = 60, 20
    chain = diags_array(
        [np.full(size - 1, -1.0), np.full(size, 2.0), np.full(size - 1, -1.0)], offsets=(-1, 0, 1)
    )
    mass = (np.arange(size) % 2).astype(float)
    K = csr_matrix(block_diag([chain] * chains))
    M = csr_matrix(diags_array(np.tile(mass, chains)))
    heavy = mass > 0.0
    flexibility = np.linalg.inv(chain.toarray())[np.ix_(heavy, heavy)]
    known = np.repeat(np.sort(1.0 / np.linalg.eigvalsh(flexibility))[:3], chains)
    D = Flexibility(M, Factor(K).solve, 0.0)
    (count, _), make = krylov.krylov_modes(D, Wanted(None, known[-1] * 1.01))
    omega2, modes = krylov.ritz_vectors(K, M, make(0, count))
    assert len(omega2) == len(known) and np.abs(omega2 / known - 1.0).max() < 1e-12
    assert np.abs(K @ modes - (M @ modes) * omega2).max() < 1e-8 * omega2.max()
    assert np.abs(modes.T @ (M @ modes) - np.eye(len(known))).max() < 1e-12


@pytest.mark.parametrize("lost", [0, 3, -1])
def test_a_mode_that_was_missed_is_noticed(lost, block):
    K, M, _ = block
    pencil = Pencil(K, M, Multigrid(K, block[2]).precondition)
    omega2, modes = block_modes(pencil, Wanted(8))
    everything = Wanted(None, omega2[-1] * (1.0 + 1e-6))
    assert missed(pencil, (omega2, modes), everything) is None
    seen = missed(pencil, (np.delete(omega2, lost), np.delete(modes, lost, axis=1)), everything)
    assert seen is not None and seen >= omega2[lost] * (1.0 - 1e-9)


def test_a_small_matrix_has_the_same_solver_whatever_is_installed():
    assert candidates(solvers.SMALL, 400, Solving(), "b")[0].solver == "superlu"
    assert candidates(solvers.SMALL + 1, 400, Solving(), "b")[0].solver == "multifrontal"
    assert candidates(solvers._OWN, 400, Solving(), "b")[0].solver == "multifrontal"
    assert candidates(solvers._OWN + 1, 400, Solving(memory=8e9), "b")[0].seconds < 60.0


def test_the_choice_and_its_reasons_are_logged(block, caplog):
    with caplog.at_level(logging.INFO, logger="romdam.linalg.solvers"):
        make_solver(block[0], block[2], 10, Solving(), "block 'b'")
    (line,) = [r.getMessage() for r in caplog.records]
    assert line.startswith(f"block 'b': superlu for {block[0].shape[0]} unknowns and 10 right-hand sides")
    assert "estimated" in line and "multigrid" in line


def test_a_solver_that_does_not_converge_gives_way(block, monkeypatch, caplog):
    monkeypatch.setattr(conjugate, "MOST", 2)
    with caplog.at_level(logging.WARNING, logger="romdam.linalg.solvers"):
        solver = make_solver(block[0], block[2], 10, Solving("multigrid"), "b")
    assert not isinstance(solver, Multigrid)
    assert "b: multigrid gives way to superlu: multigrid: 2 iterations" in caplog.text


def test_a_solver_without_memory_gives_way(block, monkeypatch, caplog):
    def full(*_):
        raise MemoryError

    monkeypatch.setattr(solvers, "Factor", full)
    make_solver(block[0], block[2], 10, Solving("superlu"), "b")
    assert "superlu gives way to" in caplog.text


def test_a_solver_that_is_missing_is_named(monkeypatch):
    monkeypatch.setattr(solvers, "find_spec", lambda name: None if name == "pypardiso" else name)
    with pytest.raises(
        ReductionError, match=r"b: model.solver: pardiso needs pypardiso, which is not installed"
    ):
        candidates(100_000, 10, Solving("pardiso"), "b")
    assert "pardiso" not in [e.solver for e in candidates(100_000, 10, Solving(), "b")]


def test_too_little_memory_is_refused_with_what_would_fit():
    with pytest.raises(ReductionError) as refused:
        candidates(400_000, 300, Solving(memory=1e9), "dam")
    text = str(refused.value)
    assert "dam: 400000 unknowns need more than model.memory = 1.0 GB" in text
    assert "multigrid" in text and "give at least" in text and "unknowns" in text.split("at most about")[1]
    enough = float(text.split("give at least ")[1].split(" GB")[0]) * 1e9
    assert candidates(400_000, 300, Solving(memory=enough), "dam")
    fits = int(text.split("at most about ")[1].split(" ")[0])
    assert candidates(fits, 300, Solving(memory=1e9), "dam")


@pytest.mark.parametrize("name", NAMES)
def test_a_singular_matrix_is_refused_by_every_solver(name, block):
    """Without its supports the block floats; a nearly singular factorisation would give noise."""
    if name.startswith("pardiso"):
        pytest.importorskip("pypardiso")
    box = BoxConfig(origin=(0.0,) * 3, size=(4.0, 4.0, 4.0), element_size=2.0, element="tet10")
    loose = box_block("b", box, Material(30e9, 0.2, 2400.0), "b")
    motions = Motions(np.arange(3 * len(loose.points)), rigid_motions(loose).reshape(-1, 6))
    with pytest.raises(ReductionError, match=r"singular|cannot be factored|gives way|iterations"):
        make_solver(csr_matrix(assemble(loose)[0]), motions, 1, Solving(name), "b")


def tower(size, element_size, held):
    """K and M of a box in hex8, its foot held or nothing, and its rigid motions."""
    box = BoxConfig(origin=(0.0,) * 3, size=size, element_size=(element_size,) * 3, element="hex8")
    made = box_block("b", box, Material(30e9, 0.2, 2400.0), "b")
    K, M = assemble(made)
    free = np.repeat(made.points[:, 2] > 0.0, 3) if held else np.ones(K.shape[0], dtype=bool)
    return K[free][:, free], M[free][:, free], rigid_motions(made).reshape(-1, 6)[free]


@pytest.mark.parametrize(
    "count", [5, 16, 25, *(pytest.param(count, marks=pytest.mark.slow) for count in (17, 28, 66))]
)
def test_both_modes_of_a_frequency_of_a_square_tower_are_found(count):
    """Bending has each frequency twice; one vector at a time misses one of them in all counts here but 66."""
    K, M, _ = tower((10.0, 10.0, 30.0), 2.5, held=True)
    known = eigh(K.toarray(), M.toarray(), eigvals_only=True)[:count]
    assert (np.diff(known) < 1e-9 * known[1:]).any()
    omega2, modes = lowest_modes(K, M, count, Factor(K))
    assert np.abs(omega2 / known - 1.0).max() < 1e-10
    assert np.abs(modes.T @ (M @ modes) - np.eye(count)).max() < 1e-12


@pytest.mark.parametrize("small", [True, False])
@pytest.mark.parametrize("by", ["count", "frequency"])
def test_rigid_motions_leave_modes_their_digits(small, by, monkeypatch):
    """A factor of K + s M answers a rigid motion a million times as much as the first mode that strains."""
    K, M, rigid = tower((8.0, 6.0, 12.0), 2.0, held=False)
    rigid = np.linalg.cholesky(np.linalg.inv(rigid.T @ (M @ rigid))).T @ rigid.T
    known = eigh(K.toarray(), M.toarray(), eigvals_only=True)[:20]
    if not small:
        monkeypatch.setattr("romdam.linalg.modes.eigen.SMALL", 0)
    solver, cutoff = Factor(K + FREE_SHIFT * M), np.sqrt(known[-1] * (1 + 1e-6)) / (2.0 * np.pi)
    which = (20, None) if by == "count" else (None, cutoff)
    omega2, modes = modes_below(K, M, *which, solver, -FREE_SHIFT)
    assert len(omega2) == 20 and np.abs(omega2[:6]).max() < 1e-12 * known[-1]
    assert np.abs(omega2[6:] / known[6:] - 1.0).max() < 1e-9
    assert np.abs(rigid @ (M @ modes[:, 6:])).max() < 1e-12
    assert np.abs(modes.T @ (M @ modes) - np.eye(20)).max() < 1e-12


def test_slow_motions_on_springs_are_not_taken_for_rigid_ones():
    """Springs of 1e-4 of the shift hold the block: no more than their round-off may be lost."""
    K, M, _ = tower((8.0, 6.0, 12.0), 2.0, held=False)
    slow = 1e-4 * FREE_SHIFT
    D = Flexibility(M, Factor(K + FREE_SHIFT * M).solve, -FREE_SHIFT, K)
    held = csr_matrix(K + slow * M)
    on_springs = Flexibility(M, Factor(held + FREE_SHIFT * M).solve, -FREE_SHIFT, held)
    assert (
        D.rigid.shape[1] == 6 and np.abs(K @ D.rigid).max() < 1e-12 * np.abs(K).max() * np.abs(D.rigid).max()
    )
    assert on_springs.rigid.shape[1] == 0
    omega2, _ = lowest_modes(held, M, 8, Factor(held + FREE_SHIFT * M), -FREE_SHIFT)
    assert np.abs(omega2[:6] / slow - 1.0).max() < 1e-2
