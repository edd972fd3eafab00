"""Small jobs that are exported, and how their decks are run where another code is there."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

from romdam.config.load import parse_config
from romdam.core.scene import Scene
from romdam.core.system import System
from romdam.effects.full_order import assemble_full
from romdam.export.build import build_deck
from romdam.export.deck import Deck, DeckMotion
from romdam.scene.build import build_scene

ROOT = Path(__file__).parents[2]
CCX = shutil.which("ccx")
_OWN = ROOT / ".venv-peers" / "bin" / "python"
OPENSEES = str(_OWN) if _OWN.exists() else sys.executable if importlib.util.find_spec("openseespy") else None
DT = 0.001


def boxes(element: str = "hex8", other: float = 5.0, **sections: object) -> dict[str, object]:
    """Two cantilevers beside each other; the right one's mesh may be another."""
    size = {"left": 5.0, "right": other}
    blocks = {
        name: {
            "material": "concrete",
            "box": {
                "origin": [0, y, 0],
                "size": [5, w, 20],
                "element_size": [5, 5, size[name]],
                "element": element,
            },
        }
        for name, y, w in (("left", -5, 5), ("right", 0, 10))
    }
    return {
        "materials": {"concrete": {"E": "30 GPa", "nu": 0.18, "rho": "2440 kg/m3"}},
        "blocks": blocks,
        "supports": [{"block": name, "face": "zmin"} for name in blocks],
        "joints": {"gap": {"between": ["left", "right"], "normal_stiffness": "16 GPa/m"}},
        "loads": {"initial_state": "undeformed"},
        "damping": {"rayleigh": {"frequencies": ["5 Hz", "50 Hz"], "ratio": "5 %"}},
        "records": [
            {"name": "pulse", "file": "pulse.txt", "unit": "m/s2", "dt": "0.01 s", "components": {"y": 1}}
        ],
        "model": {"order": "full"},
        "transient": {"finest_step": "0.25 ms"},
        "outputs": {"nodes": {"top": {"block": "right", "at": [0, 0, 20]}}},
    } | sections  # fmt: skip


def pulse(dt: float, seconds: float = 0.6) -> np.ndarray:
    """(3, nt) ground acceleration along y."""
    time = np.arange(round(seconds / dt) + 1) * dt
    return np.stack([0.0 * time, 5.0 * np.sin(2.0 * np.pi * 5.0 * time), 0.0 * time])


def built(raw: dict[str, object], dt: float = DT, static: bool = False) -> tuple[Scene, Deck]:
    config = parse_config(raw, "job.yaml")
    scene = build_scene(config, ROOT, "job.yaml")
    motion = DeckMotion("pulse", pulse(dt), dt, 1)
    return scene, build_deck(scene, config.damping, motion, title="a job", static=static)


def full_order(raw: dict[str, object]) -> System:
    config = parse_config(raw, "job.yaml")
    return assemble_full(build_scene(config, ROOT, "job.yaml"), config.damping)


def written(files: dict[str, str], folder: Path) -> Path:
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


def ran(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


def columns(path: Path) -> dict[str, np.ndarray]:
    """A CSV of numbers by its head."""
    head, *rows = path.read_text().splitlines()
    table = np.array([[float(word) for word in row.split(",")] for row in rows])
    return dict(zip(head.split(","), table.T, strict=True))
