"""Small scenes of every way in which blocks meet, on which the estimate of the reduction error is tried.

Cantilevers of 250 to 800 unknowns, no two of a scene alike, so that all modes of the mesh are the truth: tied
to rock and to each other, in mortar joints that overlap in part, bonded, keyed, rubbing, and wet.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from reference_run import RECORD

from romdam.config.load import Job, parse_config

_RECORD = {"name": "mul009", "file": str(RECORD), "unit": "9.81 m/s2", "dt": 0.01, "components": {"y": 1}}
_SPRING = {"normal_stiffness": "16 GPa/m"}
_RUBS = _SPRING | {"shear_stiffness": "8 GPa/m", "friction": 0.6}
_BONDED = _RUBS | {"cohesion": "0.8 MPa", "tensile_strength": "0.4 MPa"}
_HELD = _RUBS | {"cohesion": "100 MPa", "tensile_strength": "50 MPa"}  # never breaks
_KEYED = _RUBS | {"shear_key": {"depth": "4 mm"}}
_BASE = ([0, -10, -10], [10, 30, 10], 5.0)


def _box(origin: list[float], size: list[float], element_size: Any, element: str = "hex8") -> dict[str, Any]:
    box = {"origin": origin, "size": size, "element_size": element_size, "element": element}
    return {"material": "concrete", "box": box}


def _between(a: str, b: str, **keys: Any) -> dict[str, Any]:
    return {"between": [a, b]} | keys


_PAIR = {"a": _box([0, -10, 0], [10, 10, 50], 5.0), "b": _box([0, 0, 0], [10, 20, 40], 5.0)}
_TRIO = {
    "a": _box([0, -10, 0], [10, 10, 25], 5.0),
    "b": _box([0, 0, 0], [10, 10, 40], 5.0),
    "c": _box([0, 10, 0], [10, 15, 30], 5.0),
}
_STANDING = [{"block": "a", "face": "zmin"}, {"block": "b", "face": "zmin"}]
_ON_ROCK = [{"block": "base", "face": "zmin"}]


def _tied(law: dict[str, Any], base: dict[str, Any]) -> dict[str, Any]:
    """Two blocks tied to one base."""
    ties = {"ta": _between("a", "base"), "tb": _between("b", "base")}
    joints = {"j": _between("a", "b", **law)}
    return {"blocks": _PAIR | {"base": base}, "ties": ties, "joints": joints, "supports": _ON_ROCK}


def _stacked(law: dict[str, Any]) -> dict[str, Any]:
    """A block of two that are tied, beside another one."""
    low, high = _box([0, -10, 0], [10, 10, 25], 5.0), _box([0, -10, 25], [10, 10, 25], 5.0)
    blocks = {"a": low, "top": high, "b": _PAIR["b"]}
    joints = {"j": _between("a", "b", **law), "k": _between("top", "b", **law)}
    return {"blocks": blocks, "ties": {"t": _between("a", "top")}, "joints": joints, "supports": _STANDING}


def _shifted(law: dict[str, Any], shift: float) -> dict[str, Any]:
    """Two blocks of meshes that do not match, whose faces overlap in part."""
    a, b = _box([0, -10, 0], [10, 10, 50], 5.0), _box([shift, 0, 0], [10, 20, 40], [5.0, 5.0, 4.0])
    joints = {"j": _between("a", "b", **law)}
    return {"blocks": {"a": a, "b": b}, "joints": joints, "supports": _STANDING}


def _two(law: dict[str, Any]) -> dict[str, Any]:
    return {"blocks": _PAIR, "joints": {"j": _between("a", "b", **law)}, "supports": _STANDING}


def _three(law: dict[str, Any]) -> dict[str, Any]:
    joints = {"j1": _between("a", "b", **law), "j2": _between("b", "c", **law)}
    supports = [*_STANDING, {"block": "c", "face": "zmin"}]
    return {"blocks": _TRIO, "joints": joints, "supports": supports}


_ROCK = _box([0, -10, -10], [10, 30, 10], 5.0)
_LIGHT = _ROCK | {"mass": False}
_WET = {"water": {"level": "35 m", "model": "westergaard", "faces": [{"block": "a", "face": "ymin"}]}}
SCENES: dict[str, dict[str, Any]] = {
    "tied": _tied(_SPRING, _ROCK),
    "tied_rubs": _tied(_RUBS, _ROCK),
    "tied_bonded": _tied(_BONDED, _ROCK),
    "light_rock": _tied(_SPRING, _LIGHT),
    "stacked": _stacked(_SPRING),
    "stacked_rubs": _stacked(_RUBS),
    "shifted": _shifted(_SPRING, 5.0),
    "shifted_rubs": _shifted(_RUBS, 5.0),
    "shifted_bonded": _shifted(_BONDED, 3.0),
    "two": _two(_SPRING),
    "three": _three(_SPRING),
    "rubs": _three(_RUBS),
    "bonded": _three(_BONDED),
    "held": _three(_HELD),
    "keyed": _three(_KEYED),
    "tied_keyed": _tied(_KEYED, _ROCK),
    "wet": _two(_SPRING) | _WET,
    "tied_wet": _tied(_SPRING, _ROCK) | _WET,
}
CASES: list[tuple[str, dict[str, Any]]] = [
    ("tied", {"modes": 4}),
    ("tied", {"modes": 6}),
    ("tied", {"modes": 25}),
    ("tied", {"cutoff": 50.0}),
    ("tied_rubs", {"modes": 4}),
    ("tied_rubs", {"modes": 30}),
    ("tied_bonded", {"modes": 12}),
    ("light_rock", {"modes": 4}),
    ("light_rock", {"modes": 20}),
    ("stacked", {"modes": 4}),
    ("stacked_rubs", {"modes": 12}),
    ("shifted", {"modes": 4}),
    ("shifted", {"modes": 20}),
    ("shifted_rubs", {"cutoff": 40.0}),
    ("shifted_bonded", {"modes": 8}),
    ("two", {"modes": 4}),
    ("two", {"modes": 20, "residual_vectors": 10}),
    ("three", {"modes": 4}),
    ("rubs", {"modes": 10}),
    ("bonded", {"modes": 4}),
    ("bonded", {"modes": 30}),
    ("held", {"modes": 4}),
    ("keyed", {"modes": 6}),
    ("tied_keyed", {"modes": 12}),
    ("wet", {"modes": 6}),
    ("tied_wet", {"modes": 10}),
    ("tied", {"modes": "auto"}),
    ("shifted_rubs", {"modes": "auto"}),
    ("keyed", {"modes": "auto"}),
]


def scene_job(scene: str, base: dict[str, Any], seconds: float = 4.0) -> Job:
    """A scene with a basis, in the main job's record; an accuracy of 1 % chooses `modes: auto`."""
    stepping = {"accuracy": 0.01} if base.get("modes") == "auto" else {"finest_step": 0.001}
    raw = SCENES[scene] | {
        "materials": {"concrete": {"E": 30e9, "nu": 0.18, "rho": 2440.0}},
        "loads": {"initial_state": "undeformed"},
        "damping": {"rayleigh": {"frequencies": [2.2, 20.0], "ratio": 0.05}},
        "records": [_RECORD],
        "model": {"order": "reduced"} | base,
        "transient": stepping | {"duration": seconds},
        "outputs": {"output_interval": 0.01, "plots": False},
    }
    name = f"{scene}.yaml"
    return Job(parse_config(raw, name), Path(name))


def scene_cases(seconds: float) -> Iterator[tuple[str, Job]]:
    """All cases by name."""
    for scene, base in CASES:
        text = ", ".join(f"{key} {value}" for key, value in base.items())
        yield f"{scene}, {text}", scene_job(scene, base, seconds)
