"""Every entry of a result's and of a suite's registries has a value that was worked out on paper.

The case has two blocks of 2 x 3 x 5 m and two joints. No factor is one: the gaps' areas differ from the areas
they stand for, the last gap is tilted, rows are 0.4 s apart, peaks are of steps between the rows, and one
stress node of five lies in the ring. Lengths below are in mm, forces in MN and stress in MPa.
"""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, eye

from romdam.core.attachment import Attachment
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
from romdam.core.system import BuiltStages, Coordinates, History, RestBalance, RestUplift
from romdam.postprocess.floor_spectra import FloorSpectra
from romdam.postprocess.stress.summary import StressHistory, summarise
from romdam.results.case import Case
from romdam.results.suite.rows import ROWS
from romdam.results.variables import COORDINATES, VARIABLES

MM, MN, MPA = 1e-3, 1e6, 1e6
HOUSE = np.array([[x, y, z] for z in (0.0, 5.0) for x, y in ((0, 0), (2, 0), (2, 3), (0, 3))])
LEVEL = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])  # i = y, j = z, k = x
TILTED = np.array([[0.0, 0.6, 0.8], [0, -0.8, 0.6], [1, 0, 0]])
WHOLE = slice(None)

# row by row: gaps 0 and 1 of joint A, 0 to 2 of joint B
OPENING = np.array(
    [
        [0.5, 0, 1, -2, 0],
        [1, -1, 1, 0, 0],
        [2, 1, 1, 2, 3],
        [1, 4, 1, 5, 0],
        [3, 2, 1, 3, 6],
        [2, 3, 1, 4, 0],
    ]
)
SLIP_J = np.array(
    [
        [0.0, 1, 0, 1, 0],
        [0, 1, 2, 0, 0],
        [1, 1, 2, 0, 0],
        [3, 1, 2, 3, 0],
        [4, 1, 2, 0, 0],
        [5, 1, 2, 3, 9],
    ]
)
SLIP_K = np.array(
    [
        [0.0, 0, 0, 0, 0],
        [1, 0, 0, 4, 0],
        [0, 0, 0, 0, 0],
        [4, 2, 0, 1, 0],
        [3, 2, 0, 2, 0],
        [2, 2, 0, 1.5, 0],
    ]
)
STATE = np.array(  # 0 open, 1 sticks, 2 slides
    [
        [0, 1, 1, 1, 1],
        [1, 1, 1, 2, 1],
        [0, 0, 1, 2, 0],
        [1, 0, 1, 1, 0],
        [2, 2, 1, 0, 0],
        [2, 1, 1, 1, 2],
    ]
)
LOAD = np.array([1.0, 2.0, 0.5, 4.0, 3.0, 1.5])  # factor of the joint forces in each row
HOLD = np.array([1.0, 1.0, 1.0, 2.0, 1.0, 3.0])  # and of the shear strength
LOW = np.array([1.5, 2.0, -0.8, 3.0, 0.5, 2.0])  # factor of the stress of block `low`
HIGH = np.array([0.5, -2.0, 1.0, 1.0, 4.0, 0.0])  # and of block `high`
CUT = np.array([1.0, 2.0, 3.0, -1.0, 0.5, 4.0])  # of the forces on the section
TERMS = {  # of the energy, and a factor of each
    "input": 1, "kinetic": 2, "strain": 3, "joint_stored": 4, "damping": 5, "friction": 6, "contact": 7,
    "residual": 8, "numerical": 9,
}  # fmt: skip
MOVED, BACK = np.array([0.0, 1.0, -3.0, 2.0, 1.0, 0.5]), np.array([1.0, -2.0, 3.0, 0.5, -1.0, 4.0])


def joint(name, area, share, axes, **more):
    n = len(area)
    zero, at = np.zeros(n), np.arange(n)
    position = np.stack([0.5 + at, 3.0 + zero, 2.0 * at], axis=1)
    fields = {
        "gap": zero, "K_n": 1e10 + zero, "K_nz": zero, "K_s": 5e9 + zero, "mu": np.full((n, 2), 0.7),
        "viscosity": zero, "grout": zero, "water": zero,
    }  # fmt: skip
    fields |= {key: np.array(value, dtype=float) for key, value in more.items()}
    return Joint(
        name, ("low", "high"), (at, at), position, np.array(area), np.array(share), np.array(axes),
        (eye(n).tocsr(),) * 2, **fields,
    )  # fmt: skip


def make_scene():
    blocks = {
        name: Block(name, "hex8", HOUSE + shift, np.arange(8)[None], Material(3e10, 0.2, 2400.0), {})
        for name, shift in (("low", [0, 0, 0]), ("high", [0, 3, 1]))
    }
    joints = {
        "A": joint(
            "A", [2.0, 4.0], [0.0, 1.0], [LEVEL] * 2, gap=[2e-3, 3e-3], grout=[4e4, 0], water=[1e5, 8e5]
        ),
        "B": joint(
            "B",
            [0.5, 1.0, 2.5],
            [1.5, 0.0, 0.0],
            [LEVEL, LEVEL, TILTED],
            gap=[0, 1e-3, 0],
            water=[1e5, 0, 5e5],
        ),
    }
    nodes = {
        "low": StressNodes(
            np.array([1, 3]), np.array([[0, 0, 1.0]] * 2), np.array([[1.0, 0, 0], [0.6, 0.8, 0]])
        ),
        "high": StressNodes(
            np.array([0, 2, 3]),
            np.array([[0, 0.6, 0.8], [0, 0, 1], [0, 0, 1]]),
            np.array([[1.0, 0, 0], [1, 0, 0], [0, 0.8, 0.6]]),
            ring=np.array([False, True, False]),
        ),
    }
    faces = (
        StressFace("low.top", "low", np.array([0, 1]), np.array([1.5, 0.5])),
        StressFace("high.top", "high", np.array([0, 1, 2]), np.array([0.1, 2.0, 3.9])),
    )
    middle = np.array([1.0, 2.0, 3.0])
    sides = middle + np.array([[-0.5, 0, 0], [1.5, 0, 0], [0, -2, 0], [0, 1, 0]])
    cut = Section("cut", {}, {}, np.eye(3)[[2, 0, 1]], middle, 4.0, np.array([[2.0, 1], [1, 3]]), sides)
    sites = StressSites(nodes, faces, {"heel": ("high", 0), "toe": ("low", 1)}, 2.5 * MPA, (cut,))
    moving = MovingSupports(
        (SupportMotion(3, delay=0.1, station=12.5),),
        {name: -np.ones((8, 3), int) for name in blocks},
        {name: csr_matrix(np.ones((8, 1))) for name in blocks},
    )
    held = {name: np.zeros((8, 3), bool) for name in blocks}
    probes = (Probe("crest", "high", 5), Probe("foot", "low", 6))
    push = ForceHistory(
        "low", np.zeros((8, 3)), ForceSignal("loads.force_history[0]", np.ones(2), np.ones(2))
    )
    # a gate has no force of its own; the damper stands between two anchors
    none, one = np.zeros(1), np.ones(1)
    rows = {"low": csr_matrix((1, 24))}
    attachments = (
        Attachment("masses", "gate", rows, none, none, one, none, none),
        Attachment("anchors", "north", rows, one, none, none, none, none),
        Attachment("dampers", "pad", rows, none, one, none, none, none),
        Attachment("anchors", "south", rows, none, none, none, one, none),
    )
    scene = Scene(blocks, joints, held, probes=probes, stress=sites)
    return scene.with_effects(moving, push, *attachments)


def rows_of(factor, values):
    """(nt, ...) of a factor for every row."""
    return np.multiply.outer(factor, np.array(values, dtype=float))


def make_history():
    shear = [[0.3, 0.2], [0.5, 0.4], [0.1, 0], [0.2, 0.3], [0.3, 0.5]]  # A 0.8 and 0.6, B 0.6 and 0.8
    traction = MN * rows_of(LOAD, np.column_stack([[3, 5, 1, 2, 4], shear]))
    strength = MN * rows_of(HOLD, [[2, 2], [3, 3], [1, 1], [2, 1], [3, 1.2]])  # A 5 and 5, B 6 and 3.2
    strength[2, 3, 1] = np.inf  # a key holds along k
    mean = MN * np.array(  # 0 before the first row
        [[0] * 5, [1, 10, 0.5, 2, 1], [4, 2, 1.5, 1, 2], [1, 1, 1, 1, 2.5], [2, 1, 0, 0, 1], [1] * 5]
    )
    bonded = np.zeros((6, 5), bool)
    bonded[:, 0], bonded[:4, 1], bonded[:2, 4] = True, True, True
    peaks = {
        "opening": MM * np.array([3.5, 4.5, 1.5, 5.5, 6.5]),
        "opening_time": np.array([1.7, 1.1, 1.9, 1.3, 1.65]),
        "compression": MN * np.array([6, 14, 2, 3.5, 5]),
        "slip": MM * np.array([6, 4, 2.5, 3.5, 9.5]),
    }
    energy = {term: number * np.array([0, 3, 1, 4, 2, 2.5]) for term, number in TERMS.items()}
    uplift = RestUplift(
        1e5 * np.array([2.0, 0, 0, 3, 0]), np.array([1.5, 0, np.nan, np.nan, np.nan]), 7, 1e-10
    )
    stats = {"ledger_imbalance": 1e-9, "estimated_time_error": 0.02, "finest_step": 0.0025, "steps": 321.0}
    built = BuiltStages(
        ("winter", "lake"),
        MM * np.array([[2, 1, 0, np.nan, np.nan], [3, 1, 0, 5, 4]]),
        MN * np.array([[0, 0, 3, 0, 0], [0, 0, 2, 1, 0]]),
        np.array([[True, True, False, False, False], [False, False, False, True, True]]),
    )
    resultants = np.arange(1.0, 7) * np.array([[1.0], [10.0]])
    balance = RestBalance(
        ("whole dam", "high"), np.array([[1.0, 2, 3], [4, 5, 6]]), resultants, -3.0 * resultants,
        2.0 * resultants, np.array([1e-9, 2e-9]),
    )  # fmt: skip
    return History(
        time=0.4 * np.arange(6), jump=MM * np.stack([OPENING, SLIP_J, SLIP_K], axis=2), traction=traction,
        mean_traction=np.stack([mean, 0.2 * mean, 0.3 * mean], axis=2), state=STATE.astype(np.uint8),
        water=1e3 * rows_of(np.arange(6), [1, 2, 3, 4, 5]), strength=strength, bonded=bonded,
        dissipated_energy=rows_of([0, 0.1, 0.2, 0.5, 0.8, 1.0], [10, 20, 1, 2, 4]),
        disp=MM * rows_of(MOVED, BACK), vel=rows_of(10 * MOVED, BACK), acc=rows_of(200 * MOVED, BACK),
        coordinates=Coordinates.of(rows_of(MOVED, [3, 7]), rows_of(MOVED, [5, 11])), energy=energy,
        modes=np.array([[2.5, 4.0], [0.05, 0.03]]),
        peaks=peaks, stats=stats, integrator="modal", supports=rows_of(LOAD, [7, 8, 9]),
        gap=MM * np.array([1, 3, 0, 1, 0]), ground=rows_of(LOAD, [0.2, 0.3, 0.5]),
        forces=rows_of(LOAD, [6e3]), attached=rows_of(LOAD, [2e3, 3e3, 5e3]),
        attached_peaks=np.array([[1e3, 2e3, 3e3], [9e3, 13e3, 21e3]]),
        uplift=uplift, built=built, balance=balance, ground_peak=np.array([1.5, 2.5, 3.5]),
        node_peaks=np.array([MM * np.array([3, 6, 9, 1.5, 3, 12]), [0.2, 0.3, 0.5, 0.7, 1.1, 1.3]]),
    )  # fmt: skip


def make_stress(scene, time):
    """Components xx yy zz xy yz xz of (1 0 2), of shear 1, of (0 1 2), (3 0 0) and (0 0 1)."""
    low = MPA * rows_of(LOW, [1, 0, 2, 0, 0, 0, 0, 0, 0, 1, 0, 0])
    high = MPA * rows_of(HIGH, [0, 1, 2, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0])
    forces = MN * rows_of(CUT, [[8, 1, 2, 3, 6, 12]])
    return summarise(scene.stress, StressHistory({}, {"low": low, "high": high}, sections=forces), time)


def make_floors():
    """One place, two ratios of damping, two frequencies."""
    ordinates = np.arange(1.0, 13).reshape(1, 3, 2, 2)
    peak = np.array([[4.0, 5.0, 6.0]])
    return FloorSpectra(
        ("gate",), np.array([0.02, 0.1]), np.array([2.0, 7.0]), ordinates, peak, np.zeros(1),
        0.1 * ordinates, "More steps", 5.0, 2.0 * ordinates,
    )  # fmt: skip


@pytest.fixture(scope="module")
def case():
    scene, history = make_scene(), make_history()
    motion = GroundMotion("quake", np.zeros((3, 9)), 0.25, {}, ())
    return Case(scene, motion, history, make_stress(scene, history.time), make_floors())


# name -> (which of it, value)
EXPECTED_COORDINATES = {
    "time": (WHOLE, [0, 0.4, 0.8, 1.2, 1.6, 2.0]),
    "gap": (WHOLE, [0, 1, 2, 3, 4]),
    "joint": (WHOLE, ["A", "B"]),
    "node": (WHOLE, ["crest", "foot"]),
    "component": (WHOLE, ["x", "y", "z"]),
    "tangent": (WHOLE, ["j", "k"]),
    "joint_blocks": (WHOLE, [["low", "high"]] * 2),
    "gap_joint": (WHOLE, ["A", "A", "B", "B", "B"]),
    "gap_position": (WHOLE, [[0.5, 3, 0], [1.5, 3, 2], [0.5, 3, 0], [1.5, 3, 2], [2.5, 3, 4]]),
    "joint_middle": (WHOLE, [[8.5 / 7, 3, 10 / 7], [8.75 / 5.5, 3, 12 / 5.5]]),
    "gap_normal": (slice(3, 5), [[0, 1, 0], [0, 0.6, 0.8]]),
    "gap_tangent": (slice(3, 5), [[[0, 0, 1], [1, 0, 0]], [[0, -0.8, 0.6], [1, 0, 0]]]),
    "gap_area": (WHOLE, [2, 5, 2, 1, 2.5]),  # with what is held nearby
    "initial_gap": (WHOLE, [2e-3, 3e-3, 0, 1e-3, 0]),
    "construction_stage": (WHOLE, ["winter", "lake"]),
    "grouted_gap": (WHOLE, [1e-3, 3e-3, 0, 1e-3, 0]),
    "support": (WHOLE, ["station 3"]),
    "station_coordinate": (WHOLE, [12.5]),
    "body": (WHOLE, ["whole dam", "high"]),
    "resultant": (WHOLE, ["F_x", "F_y", "F_z", "M_x", "M_y", "M_z"]),
    "body_middle": (WHOLE, [[1, 2, 3], [4, 5, 6]]),
    "support_delay": (WHOLE, [0.1]),
    "force_history": (WHOLE, ["loads.force_history[0]"]),
    "anchor": (WHOLE, ["north", "south"]),
    "damper": (WHOLE, ["pad"]),
    "node_block": (WHOLE, ["high", "low"]),
    "node_position": (WHOLE, [[2, 3, 6], [2, 3, 5]]),
    "floor_place": (WHOLE, ["gate"]),
    "floor_damping": (WHOLE, [0.02, 0.1]),
    "floor_frequency": (WHOLE, [2, 7]),
    "stress_block": (WHOLE, ["low", "low", "high", "high", "high"]),
    "stress_node_number": (WHOLE, [1, 3, 0, 2, 3]),
    "stress_position": (WHOLE, [[2, 0, 0], [0, 3, 0], [0, 3, 1], [2, 6, 1], [0, 6, 1]]),
    "stress_up": (slice(1, 3), [[0, 0, 1], [0, 0.6, 0.8]]),
    "stress_arch": (slice(1, 3), [[0.6, 0.8, 0], [1, 0, 0]]),
    "stress_component": (WHOLE, ["xx", "yy", "zz", "xy", "yz", "xz"]),
    "dcr_level": (WHOLE, [1, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9, 2]),
    "stress_face": (WHOLE, ["low.top", "high.top"]),
    "stress_probe": (WHOLE, ["heel", "toe"]),
    "area_percentile": (WHOLE, [50, 90, 95, 98, 99, 100]),
    "stress_basis": (WHOLE, ["total", "change"]),
    "dam_kind": (WHOLE, ["arch dam", "gravity dam"]),
    "criterion": (WHOLE, ["ratio", "duration", "area"]),
    "section": (WHOLE, ["cut"]),
    "section_axis": (WHOLE, ["normal", "first", "second"]),
    "section_side": (WHOLE, ["first low", "first high", "second low", "second high"]),
    "section_axes": (WHOLE, [[[0, 0, 1], [1, 0, 0], [0, 1, 0]]]),
    "section_centroid": (WHOLE, [[1, 2, 3]]),
    "section_area": (WHOLE, [4]),
    "section_side_position": (WHOLE, [[[0.5, 2, 3], [2.5, 2, 3], [1, 0, 3], [1, 3, 3]]]),
}

# of joint A the mean over areas of 2 and 5, less the first row: opening 1.5 and 3, j 5 and 0, k 2 and 2; of B
# over 2, 1 and 2.5: opening 0, 6 and 0, j 2, 2 and 9, k 0, 1.5 and 0, and 9 along (0, -0.8, 0.6) at the last
DISPLACED = [[2, 18 / 7, 10 / 7], [1.5 / 5.5, (6 - 18) / 5.5, (4 + 2 + 13.5) / 5.5]]
# strength over the resultant of (0.8, 0.6): 5; of B the lesser of 6/0.6 and 3.2/0.8; with a key 6/0.6
FACTOR = np.array([[5, 4], [5, 4], [5, 10], [5, 4], [5, 4], [5, 4]]) * (HOLD / LOAD)[:, None]
EXPECTED_OF_JOINTS = {
    "opening": (4, [3e-3, 2e-3, 1e-3, 3e-3, 6e-3]),
    "slip": ((5, slice(2, 5)), [[2e-3, 0], [3e-3, 1.5e-3], [9e-3, 0]]),
    "normal_force": (3, [-12e6, -20e6, -4e6, -8e6, -16e6]),
    "shear_force": ((3, slice(0, 2)), [[1.2e6, 0.8e6], [2e6, 1.6e6]]),
    "mean_normal_force": (1, [-1e6, -10e6, -0.5e6, -2e6, -1e6]),
    "mean_shear_force": ((1, 1), [2e6, 3e6]),
    "crack_water_force": (2, [2e3, 4e3, 6e3, 8e3, 10e3]),
    "joint_state": (4, [2, 2, 1, 0, 0]),
    "dissipated_energy": (3, [5, 10, 0.5, 1, 2]),
    "water_pressure": (WHOLE, [1.5e5, 2e5, 2e5, 3e5, 2e5]),  # over areas of 2, 4, 0.5, 1 and 2.5
    "water_force": (WHOLE, [[0, 11e5, 0], [0, 7e5, 4e5]]),  # 4e5 along y and 5e5 along (0, 0.6, 0.8)
    # contact and shear of row 3, water_force, and what entered: 9e3 on A, 21e3 and 15e3 on B
    "joint_force": (3, [[2.4e6, 33.109e6, 3.2e6], [3.2e6, 21.37e6, 15.132e6]]),
    # A: arms (-5, 0, -10)/7 and (2, 0, 4)/7 times (0.8, 12.303, 1.2) and (1.6, 20.806, 2) MN; B: arms
    # (-12, 0, -24)/11, (-1, 0, -2)/11, (10, 0, 20)/11 times (0, 4.109, 0.4), (1.2, 8.312, 0.8),
    # (2, 8.949, 13.932)
    "joint_moment": (
        3,
        [[39.806e6 / 7, 4e5 / 7, -19.903e6 / 7], [-63.74e6 / 11, -96.12e6 / 11, 31.87e6 / 11]],
    ),
    "joint_water_force": (3, [[0, 1.109e6, 0], [0, 0.73e6, 0.412e6]]),  # 21e3 + 0.6 15e3 entered B
    "loads_at_rest": (1, [10, 20, 30, 40, 50, 60]),
    "joints_at_rest": (1, [-30, -60, -90, -120, -150, -180]),
    "supports_at_rest": (0, [2, 4, 6, 8, 10, 12]),
    "imbalance_at_rest": (WHOLE, [1e-9, 2e-9]),
    "peak_ground_acceleration": (WHOLE, [1.5, 2.5, 3.5]),
    "construction_opening": (WHOLE, [[2e-3, 1e-3, 0, np.nan, np.nan], [3e-3, 1e-3, 0, 5e-3, 4e-3]]),
    "construction_normal_force": (WHOLE, [[0, 0, -3e6, 0, 0], [0, 0, -2e6, -1e6, 0]]),
    "construction_grouted": (WHOLE, [[1, 1, 0, 0, 0], [0, 0, 0, 1, 1]]),
    "crack_at_rest": (WHOLE, [1.5, 0, np.nan, np.nan, np.nan]),
    "peak_opening": (WHOLE, [4.5e-3, 6.5e-3]),
    "peak_opening_time": (WHOLE, [1.1, 1.65]),  # not the last of a joint
    "peak_compression": (WHOLE, [-14e6, -5e6]),
    "peak_compressive_stress": (WHOLE, [-3.5e6, -4e6]),  # 6/2 and 14/4; 2/0.5, 3.5/1 and 5/2.5
    "peak_mean_compressive_stress": (WHOLE, [-2.5e6, -3e6]),  # 4/2 and 10/4; 1.5/0.5, 2/1 and 2.5/2.5
    "peak_slip": (WHOLE, [6e-3, 9.5e-3]),
    "gap_peak_opening": (WHOLE, [3.5e-3, 4.5e-3, 1.5e-3, 5.5e-3, 6.5e-3]),
    "gap_peak_compression": (WHOLE, [-6e6, -14e6, -2e6, -3.5e6, -5e6]),
    "joint_normal_force": (3, [-32e6, -28e6]),  # 4 (3 + 5) and 4 (1 + 2 + 4)
    "joint_shear_force": (3, [[3.2e6, 2.4e6], [2.4e6, 3.2e6]]),
    "joint_shear_strength": (slice(2, 4), [[[5e6, 5e6], [6e6, np.nan]], [[10e6, 10e6], [12e6, 6.4e6]]]),
    "sliding_safety_factor": (WHOLE, FACTOR),
    "bonded_area": (WHOLE, [[6, 2.5], [6, 2.5], [6, 0], [6, 0], [2, 0], [2, 0]]),  # without what is held
    "joint_displacement": (5, MM * np.array(DISPLACED)),
}
EXPECTED_OF_MOTION = {
    "displacement": (2, MM * np.array([[-3, 6, -9], [-1.5, 3, -12]])),
    "peak_displacement": (WHOLE, MM * np.array([[3, 6, 9], [1.5, 3, 12]])),
    "peak_displacement_time": (WHOLE, [[0.2, 0.3, 0.5], [0.7, 1.1, 1.3]]),
    "velocity": (2, [[-30, 60, -90], [-15, 30, -120]]),
    "acceleration": (2, [[-600, 1200, -1800], [-300, 600, -2400]]),
    "applied_force": (3, [24e3]),
    "anchor_force": (3, [8e3, 20e3]),
    "damper_force": (3, [12e3]),
    "anchor_force_least": (WHOLE, [1e3, 3e3]),
    "anchor_force_largest": (WHOLE, [9e3, 21e3]),
    "damper_force_least": (WHOLE, [2e3]),
    "damper_force_largest": (WHOLE, [13e3]),
    "ground_acceleration": (3, [0.8, 1.2, 2.0]),
    "support_displacement": (3, [[28, 32, 36]]),
    **{f"energy_{term}": (slice(3, 6), number * np.array([4, 2, 2.5])) for term, number in TERMS.items()},
    "reduced_coordinates": (2, [-9, -21]),
    "mode_frequency": (WHOLE, [2.5, 4.0]),
    "mode_damping_ratio": (WHOLE, [0.05, 0.03]),
}
EXPECTED_OF_FLOORS = {  # the second damping along y
    "floor_spectrum": ((0, 1, 1), [7, 8]),
    "floor_spectrum_broadened": ((0, 1, 1), [14, 16]),
    "floor_spectrum_error": ((0, 1, 1), [0.7, 0.8]),
    "floor_peak_acceleration": (WHOLE, [[4, 5, 6]]),
}
# Principal stresses of (1 0 2) p are 2 p and 0, and 0 and 2 p for p < 0; of shear p they are |p| and -|p|.
# Up is z, but 0.36 yy + 0.64 zz = 1.64 r at the third node; arch is 2 0.6 0.8 xy at the second and 0.36 zz at
# the last. Outside the ring the largest are 8 in row 4, 1.64 4 in row 4 and 3 in row 3.
EXPECTED_STRESS = {
    "max_principal_stress": (WHOLE, [6e6, 3e6, 8e6, 12e6, 4e6]),
    "min_principal_stress": (WHOLE, [-1.6e6, -3e6, -4e6, -6e6, -2e6]),
    "max_principal_stress_time": (WHOLE, [1.2, 1.2, 1.6, 1.6, 1.6]),
    "worst_principal_stress": (WHOLE, [1e6, 0.5e6, 8e6, 12e6, 4e6]),
    "worst_principal_time": ((), 1.6),
    "max_vertical_stress": (WHOLE, [6e6, 0, 6.56e6, 0, 4e6]),
    "min_vertical_stress": (WHOLE, [-1.6e6, 0, -3.28e6, 0, -2e6]),
    "max_vertical_stress_time": (WHOLE, [1.2, 0, 1.6, 0, 1.6]),
    "worst_vertical_stress": (WHOLE, [1e6, 0, 6.56e6, 0, 4e6]),
    "worst_vertical_time": ((), 1.6),
    "max_arch_stress": (WHOLE, [3e6, 2.88e6, 0, 12e6, 1.44e6]),
    "min_arch_stress": (WHOLE, [-0.8e6, -0.768e6, 0, -6e6, -0.72e6]),
    "max_arch_stress_time": (WHOLE, [1.2, 1.2, 0, 1.6, 1.6]),
    "worst_arch_stress": (WHOLE, [3e6, 2.88e6, 0, 3e6, 0.36e6]),
    "worst_arch_time": ((), 1.2),
    "worst_stress": (
        slice(0, 4),
        MPA * np.array([[0.5, 0, 1, 0, 0, 0], [0, 0, 0, 0.5, 0, 0], [0, 4, 8, 0, 0, 0], [12, 0, 0, 0, 0, 0]]),
    ),
    "tensile_strength": ((), 2.5e6),
    "demand_capacity_ratio": (WHOLE, [2.4, 1.2, 3.2, 4.8, 1.6]),
    # of 3 4 0 6 1 4 less 2.5: whole, 1.5/4, 3.5/6, 3.5/5, 1.5/3 of 0.4 s; less 5: 1/6 and 1/5; and so on
    "cumulative_inelastic_duration": (
        (WHOLE, [0, 10]),
        0.4
        * np.array(
            [
                [1 + 1.5 / 4 + 3.5 / 6 + 3.5 / 5 + 1.5 / 3, 1 / 6 + 1 / 5],
                [0.5 / 2.2 + 0.5 / 2.5, 0],  # 1.5 2 0.8 3 0.5 2
                [5.5 / 6 + 5.5 / 8, 3 / 6 + 3 / 8],  # 1 0 2 2 8 0
                [0.5 / 3 + 2 + 9.5 / 12, 7 / 9 + 7 / 12],  # 1.5 0 3 3 12 0
                [1.5 / 3 + 1.5 / 4, 0],  # 0.5 0 1 1 4 0
            ]
        ),
    ),
    "stress_face_area": (WHOLE, [2, 6]),
    "overstressed_area": ((WHOLE, [0, 5, 10]), [[2, 1.5, 1.5], [6, 6, 2.1]]),  # above 1, 1.5 and 2
    "stress": (4, MPA * np.array([[0, 4, 8, 0, 0, 0], [0, 0, 0, 0.5, 0, 0]])),
    "principal_stress": (4, MPA * np.array([[8, 4, 0], [0.5, 0, -0.5]])),
    "vertical_stress": (4, [6.56e6, 0]),
    "arch_stress": (4, [0, 0.48e6]),
}
# the faces are nodes of 1.5 and 0.5 m2, and outside the ring of 0.1 and 3.9 m2: up to 95 % of the second face
# the larger area decides, and beyond it the larger stress
EXPECTED_OF_FACES = {
    "stress_ring": (WHOLE, [0, 0, 0, 1, 0]),
    "start_principal_stress": (WHOLE, [3e6, 1.5e6, 1e6, 1.5e6, 0.5e6]),
    "ring_share": (WHOLE, [0, 100 / 3]),
    "face_principal_stress": (WHOLE, MPA * np.array([[6] * 6, [4, 4, 4, 8, 8, 8]])),
    "face_worst_principal_stress": (WHOLE, MPA * np.array([[1] * 6, [4, 4, 4, 8, 8, 8]])),
    "face_vertical_stress": (WHOLE, MPA * np.array([[6] * 6, [4, 4, 4, 6.56, 6.56, 6.56]])),
    "face_worst_vertical_stress": (WHOLE, MPA * np.array([[1] * 6, [4, 4, 4, 6.56, 6.56, 6.56]])),
    "face_arch_stress": (WHOLE, MPA * np.array([[3] * 6, [1.44] * 6])),
    "face_worst_arch_stress": (WHOLE, MPA * np.array([[3] * 6, [0.36] * 6])),
    "face_start_principal_stress": (WHOLE, MPA * np.array([[3] * 6, [0.5, 0.5, 0.5, 1, 1, 1]])),
    "face_peak_position": (WHOLE, [[2, 0, 0], [0, 3, 1]]),
    "face_start_overstressed_share": (WHOLE, [75, 0]),
    # of factors less the first row's: 0 0.5 -2.3 1.5 -1 0.5 and 0 -2.5 0.5 0.5 3.5 -0.5
    "change_demand_capacity_ratio": (WHOLE, [1.2, 0.92, 2.8, 4.2, 1.4]),
    "change_inelastic_duration": (
        (WHOLE, [0, 10]),
        0.4
        * np.array(
            [
                [0.5 / 3 + 0.5 / 3, 0],  # 0 1 0 3 0 1
                [0, 0],  # 0 0.5 2.3 1.5 1 0.5
                [4.5 / 6 + 4.5 / 7, 2 / 6 + 2 / 7],  # 0 0 1 1 7 0
                [8 / 9 + 8 / 10.5, 5.5 / 9 + 5.5 / 10.5],  # 0 0 1.5 1.5 10.5 0
                [1 / 3 + 1 / 3.5, 0],  # 0 0 0.5 0.5 3.5 0
            ]
        ),
    ),
    "face_demand_capacity_ratio": (WHOLE, [[2.4, 1.2], [3.2, 2.8]]),
    "face_inelastic_duration": (
        (WHOLE, WHOLE, 0),
        0.4
        * np.array(
            [
                [1 + 1.5 / 4 + 3.5 / 6 + 3.5 / 5 + 1.5 / 3, 0.5 / 3 + 0.5 / 3],
                [5.5 / 6 + 5.5 / 8, 4.5 / 6 + 4.5 / 7],
            ]
        ),
    ),
    "face_overstressed_share": ((WHOLE, WHOLE, [0, 10]), [[[100, 75], [75, 0]], [[100, 2.5], [100, 2.5]]]),
    # only the change on the first face: 1.2 at most 2, 0.13 s of 0.3 and 0.4 s; but 75 % of its area
    "acceptance": (WHOLE, [[[[0, 0, 0]] * 2, [[1, 1, 0]] * 2], [[[0, 0, 0]] * 2, [[0, 0, 0]] * 2]]),
}
# J k = (-12, 6) with J = [[2, 1], [1, 3]]: k = (-42, 24)/5; 8/4 + k y at -0.5 and 1.5, at -2 and 1
EXPECTED_OF_SECTIONS = {
    "section_force": (3, MN * np.array([[-8, -1, -2]])),
    "section_moment": (3, MN * np.array([[-3, -6, -12]])),
    "section_stress": (1, 2 * MPA * np.array([[6.2, -10.6, -7.6, 6.8]])),
}
EXPECTED = EXPECTED_OF_JOINTS | EXPECTED_OF_MOTION | EXPECTED_STRESS | EXPECTED_OF_FACES
EXPECTED |= EXPECTED_OF_SECTIONS | EXPECTED_OF_FLOORS

# rows are at rest from 1 s on: the last three, and stand for 0.2, 0.4, 0.4, 0.4, 0.4 and 0.2 s
EXPECTED_ROWS = {
    **{
        name: EXPECTED[name]
        for name in (
            "peak_opening", "peak_slip", "peak_mean_compressive_stress", "peak_compression",
            "peak_compressive_stress", "gap_peak_opening",
        )
    },
    "residual_opening": (WHOLE, [3e-3, 4e-3]),  # means 2 and 3; 1, 4 and 2
    "residual_slip": (WHOLE, [5e-3, 3e-3]),  # means (4, 3) and (1, 2); (2, 0), (2, 1.5) and (3, 0)
    "any_gap_open_duration": (WHOLE, [1.0, 1.2]),  # rows 0, 2, 3; rows 2, 3, 4
    "half_open_duration": (WHOLE, [0.8, 0.4]),  # 2, 7, 5 of 7 m2; 2.5, 2.5, 3.5 of 5.5 m2
    "mean_open_share": (WHOLE, [14 / 7 / 6, 8.5 / 5.5 / 6]),
    "any_gap_sliding_duration": (WHOLE, [0.6, 1.0]),  # rows 4, 5; rows 1, 2, 5
    "sliding_demand_ratio": (WHOLE, [3 / 5, 3 / 4]),  # row 4
    # A along its plane: x (2 3 + 5 2)/7, z 2 4/7. B: (1.5, 3, 13.5)/5.5 less its part along the mean normal,
    # that of 3 (0, 1, 0) + 2.5 (0, 0.6, 0.8) = (0, 4.5, 2)
    "residual_sliding": (WHOLE, [MM * 320**0.5 / 7, MM * (193.5 - 40.5**2 / 24.25) ** 0.5 / 5.5]),
    "anchor_force_least": (WHOLE, [1e3, 3e3]),
    "anchor_force_largest": (WHOLE, [9e3, 21e3]),
    "damper_force_least": (WHOLE, [2e3]),
    "damper_force_largest": (WHOLE, [13e3]),
    "peak_displacement": (WHOLE, MM * np.array([[3, 6, 9], [1.5, 3, 12]])),
    **{
        name: EXPECTED_OF_FLOORS[name]
        for name in ("floor_spectrum", "floor_spectrum_error", "floor_peak_acceleration")
    },
    "peak_stress": (WHOLE, [12e6, 6.56e6, 12e6]),  # in the ring too
    # 98 % of 6 m2: of 3 6 4 8 on 0.5 1.5 3.9 0.1 m2; of 0 6 4 6.56; of 2.88 3 1.44 0
    "face_stress": (WHOLE, [6e6, 6e6, 3e6]),
    "dissipated_energy": (WHOLE, [30, 7]),
    **{f"energy_{term}": ((), 2.5 * number) for term, number in TERMS.items() if term != "numerical"},
    "ledger_imbalance": ((), 1e-9),
    "estimated_time_error": ((), 0.02),
    "finest_step": ((), 0.0025),
    "steps": ((), 321),
}  # fmt: skip


@pytest.mark.parametrize(
    ("registry", "expected"),
    [(COORDINATES, EXPECTED_COORDINATES), (VARIABLES, EXPECTED), (ROWS, EXPECTED_ROWS)],
    ids=["coordinates", "variables", "rows"],
)
def test_every_entry_has_a_value_and_the_case_has_every_entry(registry, expected, case):
    """A new entry needs a value here, worked out from the tables above."""
    assert set(expected) == set(registry)
    assert [name for name, entry in registry.items() if not entry.when(case)] == []


@pytest.mark.parametrize("name", COORDINATES)
def test_coordinates(name, case):
    check(COORDINATES[name], EXPECTED_COORDINATES[name], case)


@pytest.mark.parametrize("name", VARIABLES)
def test_variables(name, case):
    check(VARIABLES[name], EXPECTED[name], case)


@pytest.mark.parametrize("name", ROWS)
def test_rows_of_a_suite(name, case):
    check(ROWS[name], EXPECTED_ROWS[name], case)


def check(entry, expected, case):
    """Compare one entry; zeros to round-off of its unit."""
    where, value = expected
    found, value = np.asarray(entry.get(case))[where], np.asarray(value)
    assert found.shape == value.shape
    if value.dtype.kind == "U":
        np.testing.assert_array_equal(found, value)
    else:
        least = np.nanmax(np.abs(value), initial=0.0)
        np.testing.assert_allclose(found, value, rtol=1e-9, atol=1e-9 * least)
