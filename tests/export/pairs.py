"""Every pair of effects that an OpenSees deck can hold, beside romdam's full order with the same masses.

`python tests/export/pairs.py` runs them all and prints the table of `docs/export.md`; it takes the Python of
`.venv-peers`, or its own, where openseespy is.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from decks import OPENSEES, boxes, built, full_order, ran, written
from scipy.sparse import block_diag, csr_matrix

from romdam.core.system import System
from romdam.export.deck import Deck, DeckMotion
from romdam.export.opensees import write_opensees
from romdam.timestepping.integrators.generalized_alpha import GeneralizedAlpha
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one

STEPS = (1e-4, 2.5e-5)  # of the deck; the second where the first has not converged [s]
SECONDS, ROW, CUTS = 0.1, 1e-3, 8
LIMIT = 1e-3  # of openings and of forces, in L2
LAW = {"between": ["left", "right"], "normal_stiffness": "1 GPa/m"}  # so soft that impacts converge at these
SHEAR = "0.5 GPa/m"


def _joint(**keys: object) -> Callable[[dict[str, Any]], None]:
    return lambda raw: raw["joints"]["gap"].update(keys)


def _load(**keys: object) -> Callable[[dict[str, Any]], None]:
    return lambda raw: raw["loads"].update(keys)


def _box(origin: list[float], size: list[float]) -> dict[str, object]:
    return {"material": "concrete", "box": {"origin": origin, "size": size, "element_size": 5}}


def _cap(raw: dict[str, Any]) -> None:
    raw["blocks"]["cap"] = _box([0, -5, 20], [5, 5, 5])
    raw["ties"]["cap"] = {"between": ["left", "cap"]}


def _rock(raw: dict[str, Any]) -> None:
    raw["blocks"]["rock"] = _box([0, -5, -5], [5, 15, 5]) | {"mass": False}
    raw["ties"] |= {name: {"between": ["rock", name]} for name in ("left", "right")}
    raw["supports"] = [{"block": "rock", "face": "zmin"}]


def _water(raw: dict[str, Any]) -> None:
    faces = [{"block": name, "face": "xmin"} for name in ("left", "right")]
    raw["water"] = {"level": "18 m", "faces": faces, "model": "westergaard"}


def _own_damping(raw: dict[str, Any]) -> None:
    own = {"frequencies": ["5 Hz", "50 Hz"], "ratio": "12 %"}
    raw["materials"]["other"] = raw["materials"]["concrete"] | {"damping": own}
    raw["blocks"]["right"]["material"] = "other"


def _temperature(raw: dict[str, Any]) -> None:
    raw["materials"]["concrete"]["expansion"] = "1e-5 1/K"
    raw["loads"]["temperature"] = [{"change": "3 K", "blocks": ["left"]}]


WET = [{"block": "left", "face": "xmin"}, {"block": "right", "face": "xmin"}]
EFFECTS: dict[str, Callable[[dict[str, Any]], None]] = {
    "friction": _joint(friction=0.5, shear_stiffness=SHEAR),
    "elastic joint": _joint(tension_stiffness=LAW["normal_stiffness"], shear_stiffness=SHEAR),
    "tension stiffness": _joint(tension_stiffness="0.3 GPa/m"),
    "initial gap": _joint(gap="0.02 mm"),
    "grouting pressure": _joint(grouting_pressure="50 kPa"),
    "weight": _load(gravity=[0, 0, -9.81]),
    "still water": _load(hydrostatic=[{"level": "18 m", "faces": WET}]),
    "pressure": _load(pressure=[{"block": "left", "face": "ymin", "value": "100 kPa"}]),
    "point force": _load(
        force=[{"block": "right", "at": [0, 10, 20], "force": ["10 kN", "-300 kN", "50 kN"]}]),
    "water in the joint": _load(joint_water=[{"joints": ["gap"], "level": "15 m"}]),
    "temperature": _temperature,
    "added mass": _water,
    "tie": _cap,
    "massless rock": _rock,
    "no damping": lambda raw: raw.pop("damping"),
    "damping of a material": _own_damping,
    "three components": lambda raw: raw.update(components=3),
}  # fmt: skip
APART = {  # laws of one joint that exclude each other, and what decks refuse
    frozenset(("friction", "elastic joint")),
    frozenset(("friction", "grouting pressure")),
    frozenset(("elastic joint", "grouting pressure")),
    frozenset(("elastic joint", "tension stiffness")),
}
PAIRS = [pair for pair in combinations(EFFECTS, 2) if frozenset(pair) not in APART]


def job(pair: tuple[str, ...]) -> tuple[dict[str, Any], int]:
    """Keys of a job with some effects, and the number of components of its record."""
    raw: dict[str, Any] = boxes(
        joints={"gap": dict(LAW)}, ties={}, loads={"initial_state": "static", "order": "together"}
    )
    for effect in pair:
        EFFECTS[effect](raw)
    return raw, raw.pop("components", 1)


def ground(dt: float, components: int) -> np.ndarray:
    """(3, nt) sines that open and close the joint several times, from rest [m/s2]."""
    time = np.arange(round(SECONDS / dt) + 1) * dt
    x, y, z = (size * np.sin(2.0 * np.pi * freq * time) for size, freq in ((3, 11), (8, 13), (2, 17)))
    return np.stack([x, y, z] if components == 3 else [0.0 * x, y, 0.0 * z])


def lumped(raw: dict[str, Any], deck: Deck) -> System:
    """The full order of a job whose water is the deck's nodal masses, in three directions of each point."""
    system = full_order({key: value for key, value in raw.items() if key != "water"})
    free = np.flatnonzero(~deck.fixed.ravel())[: system.size]
    diagonal = deck.added_mass * np.eye(3)
    mass = csr_matrix(block_diag(diagonal, format="csr")[free][:, free])
    along = np.tile(np.eye(3), (len(deck.points), 1))[free]
    return replace(
        system,
        M=csr_matrix(system.M + mass),
        C=csr_matrix(system.C + deck.alpha * mass),
        load=np.asarray(system.load) + mass @ along,
    )


def differences(pair: tuple[str, ...], folder: Path) -> tuple[float, float]:
    """L2 differences of openings and joint forces of OpenSees from romdam, relative to romdam's.

    Those of the second step where the first leaves more than the limit.
    """
    for step in STEPS:
        opening, force = differences_at(step, pair, folder)
        if max(opening, force) < LIMIT:
            break
    return opening, force


def differences_at(step: float, pair: tuple[str, ...], folder: Path) -> tuple[float, float]:
    """The same at one step of the deck; romdam's is an eighth of it."""
    raw, components = job(pair)
    motion = DeckMotion("r", ground(step, components), step, round(ROW / step))
    deck = replace(built(raw, step, static=True)[1], motion=motion)
    ran([str(OPENSEES), "deck.py"], written(write_opensees(deck)[0], folder))
    openings, forces = (
        np.loadtxt(folder / f"{name}.csv", delimiter=",", skiprows=1)[:, 1:]
        for name in ("openings", "forces")
    )
    system = lumped(raw, deck) if "water" in raw else full_order(raw)
    prepared = Prepared(system, GeneralizedAlpha(0.9))
    settings = Settings(prepared.integrator.steps(step / CUTS, ROW, ROW), initial_state="static")
    history = simulate_one(prepared, ground(step / CUTS, components), settings)
    wanted = history.jump[:, :, 0]
    traction = history.traction
    own = -forces.reshape(*wanted.shape, 3)[..., : traction.shape[2]]  # compression is negative there
    assert np.abs(wanted).max() > 0.0 and np.abs(traction).max() > 0.0, "nothing happens"
    return relative_l2(openings[:, : wanted.shape[1]], wanted), relative_l2(own, traction)


def relative_l2(values: np.ndarray, wanted: np.ndarray) -> float:
    """Difference over all rows, gaps and directions."""
    return float(np.linalg.norm(values - wanted) / np.linalg.norm(wanted))


def main() -> None:
    """Print the table: for every effect its largest differences over all pairs that it is in."""
    worst: dict[str, list[tuple[float, float, str]]] = {effect: [] for effect in EFFECTS}
    for number, pair in enumerate(PAIRS, 1):
        with tempfile.TemporaryDirectory() as folder:
            opening, force = differences(pair, Path(folder))
        print(
            f"{number}/{len(PAIRS)} {' + '.join(pair)}: {opening:.1e} {force:.1e}",
            file=sys.stderr,
            flush=True,
        )
        for effect, other in (pair, pair[::-1]):
            worst[effect].append((opening, force, other))
    print("| effect | pairs | openings, at most | joint forces, at most | with |\n|---|---|---|---|---|")
    for effect, rows in worst.items():
        opening = max(row[0] for row in rows)
        _, force, other = max(rows, key=lambda row: row[1])
        print(f"| {effect} | {len(rows)} | {100 * opening:.1g} % | {100 * force:.1g} % | {other} |")


if __name__ == "__main__":
    main()
