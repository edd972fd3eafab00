"""A synthetic case with known numbers: two blocks of one cell, joints of 2 and 3 gaps, friction or not."""

from collections.abc import Iterator
from copy import copy
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_matrix, eye

from romdam import open_result
from romdam.config import load_config
from romdam.config.load import Job
from romdam.core.attachment import Attachment
from romdam.core.basis import BlockBasis
from romdam.core.motion import ForceSignal, GroundMotion, MovingSupports, SupportMotion
from romdam.core.scene import (
    Block,
    ForceHistory,
    Joint,
    Material,
    Probe,
    Scene,
    Section,
    StressFace,
    StressNodes,
    StressSites,
)
from romdam.core.system import ENERGY_TERMS, BuiltStages, Coordinates, History, RestBalance, RestUplift
from romdam.postprocess.floor_spectra import FloorSpectra
from romdam.postprocess.stress.summary import StressHistory, StressSummary, summarise
from romdam.reduction.basis import Dense
from romdam.results.dataset import Timing, build_dataset, write_dataset
from romdam.results.fields import Result, write_model
from romdam.results.variables import Case

EXAMPLE = Path(__file__).parents[2] / "configs" / "two_cantilevers.yaml"
CUBE = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float
)
STEPS = 41


def make_block(name: str, shift: float) -> Block:
    return Block(
        name,
        "hex8",
        CUBE + np.array([0.0, shift, 0.0]),
        np.arange(8)[None, :],
        Material(3e10, 0.2, 2400.0),
        {},
    )


def make_joint(name: str, gaps: int, mu: float) -> Joint:
    ones = np.ones(gaps)
    z = np.linspace(0.0, 1.0, gaps)
    axes = np.tile(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), (gaps, 1, 1))
    position = np.stack([0.0 * z, 0.0 * z, z], axis=1)
    nodes = (np.arange(gaps), np.arange(gaps))
    coefficients = np.full((gaps, 2), mu)
    return Joint(
        name, ("left", "right"), nodes, position, 0.5 * ones, 0 * ones, axes, (eye(gaps).tocsr(),) * 2,
        1e-3 * ones, 1e10 * ones, 0 * ones, 5e9 * ones, coefficients, 0 * ones, 3e4 * ones,
        2e5 * ones,
    )  # fmt: skip


def make_history(gaps: int, directions: int, reduced: bool) -> History:
    rng = np.random.default_rng(1)
    time = np.arange(STEPS) * 0.05
    jump = rng.normal(size=(STEPS, gaps, directions)) * 1e-3
    traction = np.abs(rng.normal(size=(STEPS, gaps, directions))) * 1e6
    slip = np.hypot(jump[..., 1], jump[..., 2]) if directions == 3 else 0.0 * jump[..., 0]
    peaks = {
        "opening": jump[..., 0].max(axis=0),
        "opening_time": time[jump[..., 0].argmax(axis=0)],
        "compression": traction[..., 0].max(axis=0),
        "slip": slip.max(axis=0),
    }
    motion = rng.normal(size=(3, STEPS, 6))
    energy = {term: rng.uniform(size=STEPS) for term in (*ENERGY_TERMS, "numerical")}
    q, v = (rng.normal(size=(STEPS, 7)) for _ in range(2))
    stats = {"steps": 40.0, "loop_cpu_seconds": 0.1, "finest_step": 0.0025}
    state = rng.integers(0, 3, size=(STEPS, gaps)).astype(np.uint8)
    coordinates = Coordinates.of(q, v) if reduced else None
    disp, vel, acc = motion
    mean = 0.5 * traction
    strength = 0.6 * traction[..., :1] * np.ones(2) if directions == 3 else np.zeros((0, gaps, 2))
    bonded = rng.random(size=(len(strength), gaps)) < 0.5
    stages = np.ones((2, gaps))
    built = BuiltStages(("winter", "summer"), 1e-3 * stages, 1e6 * stages, stages > 0.0)
    return History(
        time=time, jump=jump, traction=traction, mean_traction=mean, state=state, disp=disp, vel=vel, acc=acc,
        water=traction[:, :, 0], coordinates=coordinates, energy=energy, peaks=peaks, stats=stats,
        integrator="modal", strength=strength, bonded=bonded, gap=1e-3 * np.ones(gaps),
        supports=1e-3 * rng.normal(size=(STEPS, 3)), ground=rng.normal(size=(STEPS, 3)),
        attached=1e6 * (1.0 + time[:, None] * np.ones(2)),
        attached_peaks=1e6 * np.array([[1.0, 1.0], [1.0 + time[-1], 1.0 + time[-1]]]),
        forces=time[:, None],
        dissipated_energy=rng.random(size=(STEPS, gaps)).cumsum(axis=0),
        uplift=RestUplift(np.zeros(gaps), np.linspace(0.0, 1.0, gaps), 3, 0.0), built=built,
        modes=np.array([np.arange(2.0, 9.0), np.full(7, 0.05)]) if reduced else np.zeros((2, 0)),
        balance=RestBalance(
            ("whole dam", "left"), np.zeros((2, 3)), *np.ones((3, 2, 6)), np.array([1e-12, 2e-12])
        ),
        ground_peak=np.ones(3),
        node_peaks=np.stack([np.abs(disp).max(axis=0), np.ones(disp.shape[1])]),
    )  # fmt: skip


def make_sites() -> StressSites:
    """Every node of the left block, its top as a face, one node with histories."""
    axes = [np.tile(row, (8, 1)) for row in ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0])]
    top = StressFace("left.zmax", "left", np.arange(4, 8), np.full(4, 0.25))
    nodes = {"left": StressNodes(np.arange(8), *axes)}
    return StressSites(nodes, (top,), {"corner": ("left", 6)}, 2e6, (make_section(),))


def make_section() -> Section:
    """The middle of the left block."""
    step, arm = {"left": CUBE[:, 2]}, {"left": np.where(CUBE[:, 2] > 0.0, 0.5, 0.0)}
    axes, middle = np.eye(3)[[2, 0, 1]], np.array([0.5, -0.5, 0.5])
    sides = middle + 0.5 * np.array([[-1.0, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]])
    return Section("middle", step, arm, axes, middle, 1.0, np.eye(2) / 12.0, sides)


def make_stress(sites: StressSites, time: np.ndarray) -> StressSummary:
    """Of random histories of about the strength."""
    stress = 1e6 * np.random.default_rng(3).normal(size=(len(time), 8 * 6))
    forces = 1e6 * np.random.default_rng(4).normal(size=(len(time), 1, 6))
    return summarise(sites, StressHistory({}, {"left": stress}, sections=forces), time)


def make_case(mu: float = 0.6, reduced: bool = True, joints: bool = True) -> Case:
    blocks = {"left": make_block("left", -1.0), "right": make_block("right", 0.0)}
    found = {"J1": make_joint("J1", 2, mu), "J2": make_joint("J2", 3, 0.0)} if joints else {}
    fixed = {name: np.zeros((8, 3), dtype=bool) for name in blocks}
    probes = (Probe("top_left", "left", 6), Probe("top_right", "right", 5))
    moving = MovingSupports(
        (SupportMotion(0, delay=0.1, station=12.5),),
        {name: np.zeros((8, 3), dtype=int) - 1 for name in blocks},
        {name: csr_matrix(np.ones((8, 1))) for name in blocks},
    )
    push = ForceHistory(
        "left", np.zeros((8, 3)), ForceSignal("loads.force_history[0]", np.arange(2.0), np.ones(2))
    )
    zero, one = np.zeros(1), np.ones(1)
    anchor = Attachment("anchors", "A", {"left": csr_matrix((1, 24))}, one, zero, zero, one, zero)
    damper = Attachment("dampers", "D", {"left": csr_matrix((1, 24))}, damping=one)
    scene = Scene(blocks, found, fixed, probes=probes, stress=make_sites())
    scene = scene.with_effects(moving, push, anchor, damper)
    acc = np.zeros((3, 401))
    acc[1] = np.sin(np.arange(401) * 0.05)
    motion = GroundMotion("quake", acc, 0.005, {"sha256": "abc"}, ("a warning",))
    gaps = 5 if joints else 0
    history = make_history(gaps, 3 if mu > 0 and joints else 1, reduced)
    return Case(scene, motion, history, make_stress(scene.stress, history.time), make_floors())


def make_floors() -> FloorSpectra:
    """Of two places, two dampings and five frequencies."""
    rng = np.random.default_rng(5)
    ordinates = rng.uniform(1.0, 9.0, (2, 3, 2, 5))
    return FloorSpectra(
        ("top_left", "top_right"), np.array([0.02, 0.05]), np.array([1.0, 2, 5, 10, 20]), ordinates,
        rng.uniform(1.0, 2.0, (2, 3)), np.zeros(2), 0.1 * rng.uniform(size=ordinates.shape),
        "Halving the steps", 15.0, 1.5 * ordinates,
    )  # fmt: skip


def make_basis() -> dict[str, BlockBasis]:
    rng = np.random.default_rng(2)
    columns = {"left": slice(0, 3), "right": slice(3, 7)}
    return {
        name: BlockBasis(
            Dense(rng.normal(size=(24, c.stop - c.start))), c, np.arange(3.0), np.ones((3, 3)), {}
        )
        for name, c in columns.items()
    }


@pytest.fixture(scope="session")
def job() -> Job:
    return load_config(EXAMPLE)


@pytest.fixture
def case() -> Case:
    return make_case()


@pytest.fixture
def timing() -> Timing:
    return Timing({"scene": 0.5}, {"scene": 0.4})


@pytest.fixture(scope="session")
def opened(job: Job, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Result]:
    """The synthetic case with its model, written and opened once: each takes h5netcdf 1.3 CPU-s."""
    folder, case = tmp_path_factory.mktemp("quake"), make_case()
    name = write_model(folder, case.scene, make_basis())
    timing = Timing({"scene": 0.5}, {"scene": 0.4})
    write_dataset(build_dataset(case, job, timing, name), folder / "quake.nc")
    with open_result(folder / "quake.nc") as result:
        yield result


@pytest.fixture
def result(opened: Result) -> Result:
    """That result; attributes and variables that a test changes are changed for this test alone."""
    mine = copy(opened)
    mine.dataset = opened.dataset.copy()
    return mine
