"""The two-cantilever job and its distance from the stored reference; used by tests and benchmarks."""

import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).parents[1]))  # what tests share

from simulating import simulated

from romdam.config import load_config, parse_config
from romdam.config.job import Config
from romdam.core.arrays import Floats, Ints
from romdam.core.scene import Scene
from romdam.core.system import History, System
from romdam.error.metrics import relative_l2
from romdam.scene.build import build_scene

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "configs" / "two_cantilevers.yaml"
RECORD = ROOT / "data" / "records" / "northridge_mul009_g_dt0.01.txt"
DATA = Path(__file__).parent / "two_cantilevers"


@dataclass(frozen=True)
class Job:
    """A configuration and its scene."""

    config: Config
    scene: Scene


@cache
def job(**joint: Any) -> Job:
    """The scene of configs/two_cantilevers.yaml, with other values of its joint's keys if wanted."""
    loaded = load_config(CONFIG)
    config = loaded.config
    if joint:
        import yaml

        raw = yaml.safe_load(CONFIG.read_text())
        raw["joints"]["contraction"].update(joint)
        config = parse_config(raw, CONFIG.name)
    return Job(config, build_scene(config, CONFIG.parent, CONFIG.name))


@cache
def reference() -> tuple[Floats, Floats, Floats, Floats]:
    """(time (1001,), top_uy (1001, 6), gap (1001, 100) in the order of `pairs`, positions (100, 3))."""
    stored, model = np.load(DATA / "reference.npz"), np.load(DATA / "model.npz")
    return stored["time"], stored["top_uy"], stored["gap"], model["points"][model["pairs"][:, 0]]


def gap_order(scene: Scene) -> Ints:
    """Number of romdam's gap at each gap of the reference."""
    distance, order = cKDTree(scene.joints["contraction"].position).query(reference()[3])
    assert distance.max() < 1e-6 and len(np.unique(order)) == 100
    return np.asarray(order, dtype=np.int64)


def shaking(dt: float, duration: float | None = None) -> Floats:
    """(3, nt) base acceleration of the record, read here without romdam [m/s2]."""
    acc = 9.81 * np.loadtxt(RECORD)
    t = np.arange(round((len(acc) - 1) * 0.01 / dt) + 1) * dt
    ground = np.zeros((3, len(t)))
    ground[1] = np.interp(t, 0.01 * np.arange(len(acc)), acc)
    return ground if duration is None else ground[:, : round(duration / dt) + 1]


def march(system: System, dt: float, duration: float | None = None, **options: Any) -> History:
    """Integrate from the undeformed state, rows every 0.01 s."""
    usual: dict[str, Any] = {"stride": round(0.01 / dt), "initial_state": "undeformed"}
    return simulated(system, shaking(dt, duration), dt, **(usual | options))


def errors(scene: Scene, history: History) -> tuple[float, float]:
    """Relative errors of the peak opening and, in L2, of all openings, over at most 10 s of the history."""
    found, wanted = history.jump[:1001, gap_order(scene), 0], reference()[2][: len(history.time)]
    assert np.abs(history.time[: len(wanted)] - reference()[0][: len(wanted)]).max() < 1e-9
    peak = found.max() / wanted.max() - 1.0
    return float(peak), relative_l2(found, wanted)
