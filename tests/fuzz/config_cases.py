"""Configurations with something wrong in them: every key of every model, and the text itself."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

import numpy as np
import yaml
from arch_dams import ROCK, arch_dam
from gravity_dams import FOUNDATION, JOINT, gravity_dam
from pydantic import BaseModel

import romdam
from romdam.config import Config, parse_config
from romdam.config.sections.joint_laws import UserLaw

Rng = np.random.Generator
Place = tuple[str | int, ...]
MISSING = object()

_BOX = {"origin": [0, 0, 0], "size": [5, 10, 20], "element_size": 5.0, "element": "hex8"}
_TWO: dict[str, Any] = {
    "title": "two",
    "materials": {"concrete": {"E": "30 GPa", "nu": 0.18, "rho": "2440 kg/m3", "expansion": 1e-5}},
    "blocks": {
        "left": {"material": "concrete", "box": {**_BOX, "origin": [0, -5, 0], "size": [5, 5, 20]}},
        "right": {"material": "concrete", "mass": True, "weight": True, "box": _BOX},
    },
    "supports": [
        {"block": "left", "face": "zmin", "fix": ["x", "y", "z"]},
        {"block": "right", "face": {"axis": "z", "at": 0.0, "tolerance": 1e-6}},
    ],
    "joints": {
        "gap": {
            "between": ["left", "right"],
            "normal_stiffness": "16 GPa/m",
            "tension_stiffness": {"per_gap": 0.0},
            "shear_stiffness": "8 GPa/m",
            "friction": 0.6,
            "friction_static": 0.7,
            "cohesion": "1 MPa",
            "tensile_strength": "0.5 MPa",
            "viscosity": 1e5,
            "shear_key": {"depth": "1 cm", "directions": ["k"]},
            "gap": 0.0,
            "gaps": "nodes",
            "normal": [0, 1, 0],
            "tolerance": "1 mm",
        }
    },
    "loads": {
        "gravity": [0, 0, -9.81],
        "pressure": [{"block": "left", "face": "ymin", "value": "1440 Pa"}],
        "force": [{"block": "left", "at": [0, -5, 20], "force": [0, 1000, 0], "tolerance": 1e-3}],
        "force_history": [
            {
                "table": "force.csv",
                "unit": "kN",
                "block": "left",
                "at": [0, -5, 20],
                "tolerance": 1e-3,
                "direction": [0, 1, 0],
                "start": "0.1 s",
                "scale": 2.0,
                "after": "hold",
            },
            {"table": "force.csv", "unit": "kPa", "block": "left", "face": "ymin"},
        ],
        "joint_water": [
            {
                "joints": ["gap"],
                "level": "12 m",
                "downstream": [1, 0, 0],
                "tailwater": 2.0,
                "drains": {"at": 1.0, "rule": "usace", "effectiveness": 0.5, "gallery": 3.0},
                "crack": "redrawn",
                "earthquake": "zero",
                "density": 1000.0,
            }
        ],
        "hydrostatic": [{"level": "12 m", "faces": [{"block": "right", "face": "xmin"}]}],
        "ice": [
            {
                "level": "12 m",
                "thickness": "0.5 m",
                "thrust": "150 kN/m",
                "faces": [{"block": "right", "face": "xmin"}],
            }
        ],
        "silt": [
            {
                "level": "3 m",
                "density": "900 kg/m3",
                "pressure_ratio": 0.5,
                "faces": [{"block": "right", "face": "xmin"}],
            }
        ],
        "line": [
            {
                "block": "left",
                "start": [0, -3, 20],
                "end": [5, -3, 20],
                "force": [0, "1 kN/m", "-40 kN/m"],
                "tolerance": 0.05,
            }
        ],
        "initial_state": "static",
    },
    "construction": [
        {
            "name": "winter",
            "pour": ["right"],
            "temperature": [{"change": "-3 K", "blocks": ["left"]}],
            "level": "6 m",
            "grout": [{"joints": ["gap"], "above": 0.0, "below": "30 m"}],
        }
    ],
    "damping": {"rayleigh": {"frequencies": ["5 Hz", "50 Hz"], "ratio": "5 %"}},
    "records": [
        {
            "name": "pulse",
            "file": "pulse.txt",
            "unit": "m/s2",
            "dt": "0.01 s",
            "components": {"y": {"channel": 1, "reverse": False}},
            "correction": [
                {"step": "mean", "until": 0.05},
                {"step": "detrend", "order": 1},
                {"step": "taper", "fraction": 0.05},
                {"step": "corners", "highpass": 1.0, "lowpass": 40.0},
                {"step": "pad", "order": 4},
                {"step": "butterworth", "order": 4},
                {"step": "displacement_baseline", "order": 4},
                {"step": "velocity_baseline", "knots": [0.2]},
            ],
            "scale": {"pga": "0.2 g", "damping": 0.05, "of": "y", "y": 1.5},
            "keep": {"pga": {"min": 0.0, "max": "2 g"}},
            "gaps": "error",
        }
    ],
    "model": {"order": "reduced", "modes": 10, "residual_vectors": 0, "solver": "auto", "memory": "8 GB"},
    "transient": {"finest_step": "2 ms", "duration": "1 s", "rho_inf": 0.9, "tolerance": 1e-8},
    "outputs": {
        "output_interval": "0.01 s",
        "plots": False,
        "error_estimate": False,
        "xlsx": False,
        "nodes": {"top": {"block": "right", "at": [0, 0, 20], "tolerance": 1e-3}},
        "floor_spectra": {
            "places": {"crest": ["top"]},
            "dampings": ["2 %", 0.05],
            "frequencies": ["1 Hz", 5.0, "40 Hz"],
            "broadening": "15 %",
        },
        "stress": {
            "sections": {"foot": {"blocks": ["right"], "point": [0, 0, 5.0], "normal": [0, 0, 1]}},
            "blocks": ["left"],
            "faces": [{"block": "right", "face": "ymax"}],
            "nodes": {"foot": {"block": "right", "at": [0, 0, 0]}},
            "strength": "3 MPa",
        },
    },
    "study": {
        "meshes": ["as_given"],
        "contact_points": ["as_given"],
        "modes": [5],
        "cutoffs": ["90 Hz"],
        "residual_vectors": [0],
        "finest_steps": ["2 ms"],
        "reference_step": "1 ms",
        "duration": 0.2,
        "repeats": 1,
    },
    "comparison": {
        "variants": {"as_is": {}, "softer": {"joints.gap.normal_stiffness": "2 GPa/m"}},
        "reference": "as_is",
        "component": "y",
    },
    "post_earthquake": {
        "changes": {"joints.gap.tensile_strength": 0.0},
        "required_factor": 1.3,
        "joints": ["gap"],
    },
}
_DIVISIONS = {"along": 1, "through": 1, "up": 3, "perimeter": 1, "rock": 2, "upstream": 1, "downstream": 1}
_WET = [{"block": "C1", "face": "upstream"}, {"block": "C2", "face": "upstream"}]


def _arch() -> dict[str, Any]:
    raw = arch_dam(cantilevers=2, divisions={**_DIVISIONS, "growth": 2.0})
    raw["arch_dam"]["joints"] = {
        "normal_stiffness": {"per_gap": 1e12},
        "shear_stiffness": {"per_gap": 5e11},
        "velocity_friction": {"mu_s": 0.7, "mu_d": 0.5, "v_c": "1 cm/s"},
        "gaps": "corners",
    }
    raw["arch_dam"]["crown"]["upstream"] = {"polynomial": [0.0, -0.1]}
    light = {"material": "rock_b", "mass": False, "weight": False}
    left = {**light, "x": [-1000, 0], "y": [-1000, 1000], "z": [-1000, 1000]}
    friction = {"velocity_friction": {"mu_s": 0.6, "mu_d": 0.4, "v_c": "10 mm/s"}}
    joints = {key: value for key, value in raw["arch_dam"]["joints"].items() if "friction" not in key}
    raw["arch_dam"]["joints"] = joints | {"shear_stiffness": "8 GPa/m"} | friction
    raw["arch_dam"]["rock"] = {**ROCK, "zones": {"left": left, "rest": light}}
    return raw | {
        "loads": {
            "gravity": [0, 0, -9.81],
            "weight": "staged",
            "hydrostatic": [{"level": 90.0, "faces": _WET, "density": 1000.0}],
            "temperature": [
                {"change": -4.0, "blocks": ["C1"]},
                {
                    "faces": {
                        "table": "faces.csv",
                        "unit": "degC",
                        "length": "m",
                        "upstream": "upstream",
                        "downstream": "downstream",
                        "through": "equivalent",
                        "diffusivity": "1e-6 m2/s",
                    },
                    "month": 2,
                    "reference": {"C2": "8 degC"},
                    "blocks": ["C2"],
                },
            ],
        },
        "water": {
            "level": 90.0,
            "faces": _WET,
            "rock": [],
            "model": "westergaard",
            "density": 1000.0,
            "bottom": 0.0,
            "upstream": [0, -1, 0],
            "length": 200.0,
        },
        "damping": {"modal": [0.05, 0.06]},
        "records": [
            {
                "file": "pulse.txt",
                "unit": "9.81 m/s2",
                "dt": 0.01,
                "components": {"y": {"channel": 1}},
                "scale": {"to": "target", "factors": [1e-3, 1e3], "mean_at_least": 0.9},
                "target": {
                    "spectrum": {"asce7": {"SDS": "1 g", "SD1": "0.6 g", "TL": "8 s"}},
                    "periods": [0.1, 0.2],
                    "of": "y",
                    "damping": "5 %",
                },
                "select": 1,
            }
        ],
        "model": {"cutoff": "12 Hz"},
        "linear_stage": {
            "spectra": {
                "x": {"points": [["0.01 s", "1 g"], [2.0, "0.1 g"]]},
                "y": {"asce7": {"SDS": "1 g", "SD1": "0.6 g", "TL": "8 s"}},
                "z": {"eurocode8": {"ag": "0.2 g", "type": 1, "ground": "B"}},
                "damping": "5 %",
            },
            "combination": "srss",
            "directions": "100-40-40",
            "cutoff": "12 Hz",
        },
        "transient": {"finest_step": 0.005, "duration": 0.2},
        "outputs": {"error_estimate": False, "plots": False},
    }


_FRACTURE = {
    "tensile_strength": "1.5 MPa",
    "energy": "150 N/m",
    "cohesion": "2 MPa",
    "shear_energy": "1500 N/m",
    "softening": "bilinear",
}


def _gravity() -> dict[str, Any]:
    """Two monoliths with lifts and a gallery."""
    divisions = {"along": 1, "through": 3, "up": 4, "depth": 1, "upstream": 1, "downstream": 1, "banks": 1}
    plain = {key: value for key, value in JOINT.items() if key != "friction"}
    rock = FOUNDATION | {"weight": False, "left": 50.0, "right": 50.0, "banks": [20.0, 20.0]}
    raw = gravity_dam(
        monoliths=[16.0, "16 m"],
        base=[20.0, 0.0],
        lifts=["66.5 m"],
        gallery={"floor": 40.0, "height": "4 m", "upstream": "4 m", "width": 3.0},
        element="hex8",
        divisions=divisions | {"growth": 2.0},
        rock=rock,
        joints={
            "base": plain | {"slip_weakening": {"mu_s": 0.8, "mu_d": 0.6, "d_c": "5 cm"}},
            "contraction": plain | {"barton_bandis": {"JRC": 8.0, "JCS": "50 MPa", "mu_b": 0.6}},
            "lift": plain | {"friction": 0.5, "fracture": dict(_FRACTURE)},
        },
    )
    rest = {key: _TWO[key] for key in ("damping", "records", "model", "transient")}
    raw["loads"] = raw.get("loads", {}) | {"initial_state": "undeformed"}  # nothing presses bonded lifts
    return raw | rest | {"outputs": {"error_estimate": False, "plots": False}}


def _suite() -> dict[str, Any]:
    raw = copy.deepcopy(_TWO)
    raw["records"] = [
        {
            "files": "*.txt",
            "only": ["*"],
            "unit": "m/s2",
            "dt": 0.01,
            "components": {"y": {"channel": "each"}},
            "target": {
                "spectrum": {"eurocode8": {"ag": "1 m/s2", "S": 1.0, "TB": 0.1, "TC": 0.4, "TD": 2.0}},
                "periods": [0.1, 0.2],
                "of": "y",
            },
            "match": {"tolerance": 0.3},
        }
    ]
    raw["damping"] = {"rayleigh": {"alpha": 0.5, "beta": 1e-3}}
    raw["transient"] = {"accuracy": {"openings": 0.05, "slips": 0.1, "residual_slips": 0.2}}
    raw["joints"]["gap"]["gap"] = {"table": "gaps.csv"}
    raw["joints"]["gap"]["field"] = {
        "of": ["friction", "friction_static"],
        "coefficient_of_variation": 0.2,
        "length": "5 m",
    }
    raw["joints"]["gap"] |= {"cohesion": 0.0, "tensile_strength": 0.0}
    del (
        raw["joints"]["gap"]["shear_key"],
        raw["outputs"]["stress"],
        raw["study"],
        raw["comparison"],
        raw["post_earthquake"],
    )
    raw["pipeline"] = "suite"
    raw["suite"] = {
        "intensities": {"measure": "sa", "period": 0.3, "damping": 0.05, "of": "y", "values": ["1 m/s2"]},
        "parameters": {
            "mu": {"path": ["joints.g*.friction"], "low": 0.4, "high": 0.7, "distribution": "uniform"},
            "alpha": {"path": "damping.rayleigh.alpha", "values": [0.5, 1.0]},
            "beta": {"path": "damping.rayleigh.beta", "mean": 1e-3, "cov": 0.1, "distribution": "lognormal"},
            "strength": {
                "path": "joints.gap.cohesion",
                "distribution": "normal",
                "mean": "1 MPa",
                "std": "0.2 MPa",
                "low": "0 MPa",
            },
            "stiffness": {
                "path": "joints.gap.normal_stiffness",
                "distribution": "lognormal",
                "median": "16 GPa/m",
                "beta": 0.2,
            },
        },
        "correlation": {"pairs": [{"between": ["mu", "strength"], "value": "40 %"}], "of": "scores"},
        "design": {"latin_hypercube": 2, "seed": 3},
        "keep": {"output_interval": 0.02, "precision": "single"},
        "period": 0.3,
        "of": "y",
        "batch": 2,
    }
    return raw


def _others() -> dict[str, Any]:
    """What the other bases cannot have at the same time: ties, a mesh file, cuts, a design table, scales."""
    raw = copy.deepcopy(_TWO)
    points = {"table": "points.csv", "unit": "degF", "length": "m", "tolerance": "1 cm"}
    nodes = {"table": "temperatures.csv", "unit": "degC"}
    warm = [
        {"points": points, "reference": "46 degF", "blocks": ["right"]},
        {"nodes": nodes, "month": 1, "reference": "8 degC", "blocks": ["left"]},
    ]
    state = {"result": "state.nc", "take": "joints"}
    raw["joints"], raw["loads"] = {}, {"temperature": warm, "initial_state": state}
    del raw["comparison"], raw["post_earthquake"], raw["construction"]
    raw["ties"] = {"grown": {"between": ["left", "right"], "tolerance": 1e-3}}
    raw["blocks"]["left"] = {
        "material": "concrete",
        "mesh": {"file": "left.msh", "group": "body", "unit": "m"},
    }
    record = {"file": "pulse.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}
    raw["records"] = [record]
    raw["supports"] = [{"block": "right", "face": "zmin", "motion": {"record": copy.deepcopy(record)}}]
    raw["water"] = {
        "model": "incompressible",
        "level": 20.0,
        "faces": [{"block": "right", "face": "xmin"}],
        "mesh": {"file": "reservoir.msh", "group": "water", "unit": "m", "end": {"axis": "x", "at": -20.0}},
    }
    raw["blocks"]["whole"] = {
        "material": "concrete",
        "box": {"origin": [20, 0, 0], "size": [5, 20, 5], "element_size": 2.5, "element": "tet4"},
    }
    raw["cut"] = {
        "whole": {
            "along": [
                {"plane": {"point": [0, 5, 0], "normal": [0, 1, 0]}},
                {"cylinder": {"point": [0, -40, 2.5], "axis": [1, 0, 0], "radius": "50 m"}},
                {"surface": {"file": "surface.stl", "group": None, "unit": "m"}},
            ],
            "into": ["A", "B", "C", "D"],
            "through": "elements",
            "teeth": "10 %",
            "joints": {"normal_stiffness": "16 GPa/m"},
        }
    }
    raw["supports"] += [{"block": name, "face": "zmin"} for name in "ABCD"]
    raw["suite"] = {
        "scales": [1.0],
        "parameters": {"ratio": {"path": "damping.rayleigh.ratio"}},
        "design": {"table": "samples.csv"},
    }
    return raw


def _waves() -> dict[str, Any]:
    """Rock within viscous faces in place of supports."""
    raw = copy.deepcopy(_TWO)
    del raw["comparison"], raw["post_earthquake"], raw["supports"]
    rock = {**_BOX, "origin": [0, -5, -10], "size": [5, 15, 10]}
    raw["blocks"]["rock"] = {"material": "concrete", "weight": False, "box": rock}
    raw["ties"] = {name: {"between": [name, "rock"]} for name in ("left", "right")}
    raw["construction"][0]["pour"] = ["left", "right"]
    sides = {"block": "rock", "faces": ["xmin", "xmax", "ymin", "ymax"], "distance": "20 m"}
    bottom = {"block": "rock", "faces": [{"axis": "z", "at": -10.0}]}
    raw["suite"] = {
        "parameters": {"mu": {"path": "joints.gap.friction", "low": 0.3, "high": 0.7}},
        "design": {"monte_carlo": 3, "seed": 2},
    }
    raw["ground"] = {"input": "free_field", "viscous": [sides, bottom], "rock": ["rock"], "surface": 0.0}
    raw["ground"]["incidence"] = {"angle": "12 deg", "wave": "s", "axis": [0, 1, 0], "at": 1.0}
    return raw


def _matrices() -> dict[str, Any]:
    """A block from matrices, damped by one of them; nothing asks for its stress."""
    raw = copy.deepcopy(_TWO)
    del raw["comparison"], raw["post_earthquake"]
    keys = ("stiffness", "mass", "damping", "unknowns", "inertia", "force")
    files: dict[str, Any] = dict.fromkeys(keys, "right.h5")
    more = {"nodes": "nodes.csv", "units": "m-kg-s", "total_mass": "2440 t", "tolerance": "1 mm"}
    raw["blocks"]["right"]["matrices"] = (
        files | more | {"names": {key: key for key in keys if key != "unknowns"}}
    )
    raw["outputs"]["stress"] = {"blocks": ["left"], "strength": "3 MPa"}
    raw["suite"] = {
        "parameters": {"mu": {"path": "joints.gap.friction", "low": 0.3, "high": 0.7}},
        "design": {"sobol_indices": 16, "seed": 3},
        "hazard": {"table": "hazard.csv", "measure": "pga", "response": "peak_opening", "levels": ["1 mm"]},
        "weights": {"pulse": 2.0},
    }
    return raw


def _total() -> dict[str, Any]:
    raw = {key: copy.deepcopy(_TWO[key]) for key in ("materials", "blocks", "supports", "damping", "records")}
    again = {"name": "again", "after": "pulse", "rest": "0.02 s"}
    raw["records"].append({"file": "pulse.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}} | again)
    return raw | {
        "joints": {"gap": {"between": ["left", "right"], "normal_stiffness": "16 GPa/m"}},
        "anchors": {
            "bar": {
                "head": {"block": "left", "at": [2.5, -2.5, 20], "tolerance": "1 cm"},
                "foot": {"block": "right", "at": [2.5, 2.5, 10]},
                "E": "195 GPa",
                "area": "30 cm2",
                "free_length": "9 m",
                "strength": "4 MN",
            },
            "tendon": {
                "head": {"block": "right", "at": [2.5, 2.5, 20]},
                "foot": [2.5, 2.5, -8],
                "stiffness": "40 MN/m",
                "pretension": "1 MN",
                "loss": "12 %",
            },
        },
        "dampers": {
            "pad": {
                "head": {"block": "left", "at": [2.5, -2.5, 15]},
                "foot": [2.5, 9, 15],
                "damping": "2 MN s/m",
            }
        },
        "masses": {
            "gate": {"block": "right", "face": "ymax", "mass": "80 t"},
            "hoist": {"block": "left", "at": [2.5, -2.5, 20], "mass": "20 t", "tolerance": "1 cm"},
        },
        "combinations": {
            "usual": {"required_factor": 2.0, "changes": {"joints.gap.friction": 0.5}},
            "quake": {"situation": "earthquake", "largest_slip": "10 mm", "joints": ["gap"]},
            "after": {"situation": "after", "after": "quake", "tension": "2 MPa"},
        },
        "model": {"modes": "auto"},
        "transient": {"accuracy": {"total": "50 %", "of": "opening"}},
        "outputs": {"plots": False},
    }


def _along(**along: Any) -> dict[str, Any]:
    """Supports that move by their position, with a record that ends at rest."""
    raw = {key: copy.deepcopy(_TWO[key]) for key in ("materials", "blocks", "supports", "damping")}
    return raw | {
        "records": [{"file": "pulse.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "ground": {"along": {"axis": "y"} | along},
        "joints": {"gap": {"between": ["left", "right"], "normal_stiffness": "16 GPa/m"}},
        "model": {"modes": 2},
        "transient": {"finest_step": 0.01},
        "outputs": {"plots": False},
    }


def _touching() -> dict[str, Any]:
    """The joints between all blocks that touch."""
    raw = {key: copy.deepcopy(_TWO[key]) for key in ("materials", "blocks", "supports", "records")}
    pairs = {"left-right": ["left", "right"]}
    return raw | {
        "joints": {"touching": {"pairs": pairs, "normal_stiffness": "16 GPa/m"}},
        "model": {"modes": 2},
        "transient": {"finest_step": 0.01},
        "outputs": {"plots": False},
    }


def _own_damping() -> dict[str, Any]:
    """Materials with damping of their own, and a linear stage that has it as hysteretic."""
    raw = _touching()
    raw["materials"]["concrete"]["damping"] = {"frequencies": ["4 Hz", "25 Hz"], "ratio": "4 %"}
    return raw | {"linear_stage": {"damping": "hysteretic", "cutoff": "40 Hz"}}


BASES: dict[str, dict[str, Any]] = {
    "two": _TWO,
    "touching": _touching(),
    "own damping": _own_damping(),
    "arch": _arch(),
    "gravity": _gravity(),
    "suite": _suite(),
    "others": _others(),
    "waves": _waves(),
    "matrices": _matrices(),
    "total": _total(),
    "stations": _along(
        stations=[{"at": -4.0, "delay": 0.01}, {"at": 9.0, "factor": [1.0, 1.2, 0.9]}], beyond="hold"
    ),
    "wave": _along(
        velocity="900 m/s",
        start="-5 m",
        cutoff=20.0,
        incoherence={"alpha": 0.2, "shear_velocity": "700 m/s", "seed": 3},
    ),
}


def write_files(folder: Path) -> None:
    """What the bases refer to."""
    shape = np.sin(np.linspace(0.0, np.pi, 60)) ** 6
    acc = np.gradient(np.gradient(shape))
    np.savetxt(folder / "pulse.txt", 5.0 * acc / np.abs(acc).max())
    (folder / "gaps.csv").write_text("x,y,z,gap\n0,0,0,0\n5,0,0,0\n0,0,20,0.001\n5,0,20,0.001\n")
    (folder / "force.csv").write_text("time,force\n0,0\n0.1,2\n0.3,-1\n")
    (folder / "samples.csv").write_text("ratio\n0.05\n")
    months = "".join(f"{k},{z},5,{k}\n" for k in range(1, 13) for z in (-100, 200))
    (folder / "faces.csv").write_text(f"month,elevation,upstream,downstream\n{months}")
    corners = "".join(f"{x},{y},{z},{40 + y}\n" for x in (0, 5) for y in (0, 10) for z in (0, 20))
    (folder / "points.csv").write_text(f"x,y,z,temperature\n{corners}")
    numbers = "".join(f"{k},{k},1\n" for k in range(1, 21))
    (folder / "temperatures.csv").write_text(f"node,temperature,month\n{numbers}")
    vertices = "\n".join(f"vertex {x} 15 {z}" for x, z in ((0, -9), (0, 90), (90, -9)))
    (folder / "surface.stl").write_text(f"solid s\nfacet\n{vertices}\nendfacet\nendsolid\n")
    (folder / "nodes.csv").write_text("node,x,y,z\n1,0,0,0\n")
    _write_matrices(folder)
    _write_column(folder / "left.msh", "body", (0, 5), (-5, 0))
    _write_column(folder / "reservoir.msh", "water", (-20, 0), (0, 10))
    _write_state(folder)


def _write_matrices(folder: Path) -> None:
    """right.h5: the right block of the first base as its own matrices."""
    from romdam.effects.full_order import assemble_full
    from romdam.export.matrices import write
    from romdam.scene.build import build_scene

    at_rest = {key: load for key, load in _TWO["loads"].items() if key != "force_history"}
    config = parse_config(_TWO | {"loads": at_rest, "construction": []}, "two.yaml")
    scene = build_scene(config, folder, "two.yaml")
    write(scene, assemble_full(scene, config.damping), None, config.damping, folder)


def _write_state(folder: Path) -> None:
    """state.nc: the result of the base that begins with it, from rest."""
    raw = _others()
    del raw["loads"]["initial_state"]
    (path,) = romdam.run(romdam.load_config(raw, folder), out=folder).paths
    path.rename(folder / "state.nc")


def _write_column(path: Path, group: str, x: tuple[int, int], y: tuple[int, int]) -> None:
    """Four cells one on the other."""
    around = ((x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]))
    corners = [f"{a} {b} {z}" for z in (0, 5, 10, 15, 20) for a, b in around]
    nodes = "".join(f"{i + 1} {xyz}\n" for i, xyz in enumerate(corners))
    cells = "".join(f"{k + 1} 5 2 1 1 {' '.join(str(4 * k + n) for n in range(1, 9))}\n" for k in range(4))
    path.write_text(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
        f'$PhysicalNames\n1\n3 1 "{group}"\n$EndPhysicalNames\n'
        f"$Nodes\n20\n{nodes}$EndNodes\n$Elements\n4\n{cells}$EndElements\n"
    )


def models_of(kind: Any = Config) -> set[type[BaseModel]]:
    """Every model that a configuration can hold, found through the annotations."""
    if kind is UserLaw:  # is read from a file's name, its own keys are not written
        return set()
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        found = {kind}
        for field in kind.model_fields.values():
            found |= models_of(field.annotation)
        return found
    inner = get_args(kind)[:1] if get_origin(kind) is Annotated else get_args(kind)
    return {model for part in inner for model in models_of(part)}


def keys_of(raw: dict[str, Any]) -> list[tuple[Place, type[BaseModel], str]]:
    """(where it stands, its model, its name) of every key that a base has or could have."""
    return list(_keys(parse_config(raw, "base"), ()))


def _keys(value: object, path: Place) -> Iterator[tuple[Place, type[BaseModel], str]]:
    if isinstance(value, BaseModel):
        for name in type(value).model_fields:
            yield (*path, name), type(value), name
            yield from _keys(getattr(value, name), (*path, name))
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from _keys(inner, (*path, name))
    elif isinstance(value, tuple):
        for i, inner in enumerate(value):
            yield from _keys(inner, (*path, i))


@cache
def every_key() -> list[tuple[str, Place]]:
    """(base, where it stands) of each key of each model, once."""
    seen: dict[tuple[type[BaseModel], str], tuple[str, Place]] = {}
    for base, raw in BASES.items():
        for place, model, name in keys_of(raw):
            known = seen.get((model, name))
            if known is None or (not _has(BASES[known[0]], known[1]) and _has(raw, place)):
                seen[model, name] = (base, place)
    return list(seen.values())


def _has(raw: Any, place: Place) -> bool:
    return value_at(raw, place) is not MISSING


def value_at(raw: Any, place: Place) -> Any:
    """What stands there; MISSING where nothing does."""
    for part in place:
        try:
            raw = raw[part]
        except (KeyError, IndexError, TypeError):
            return MISSING
    return raw


HOSTILE: list[Any] = [
    *(
        float("nan"),
        float("inf"),
        -float("inf"),
        -1,
        0,
        1,
        2,
        0.1,
        0.5,
        1e6,
        1e300,
        1e-300,
        1e-12,
        -1e9,
        10**400,
    ),
    *(
        100000,
        True,
        False,
        None,
        [],
        {},
        [1],
        [1, 2, 3],
        [[1, 2], [3, 4]],
        {"a": 1},
        [[[[1]]]],
        "",
        " ",
        "text",
    ),
    *("30", "1 kg", "5 %%", "30 GPa GPa", "30 gpa", "5 degC", "1 g", "2**9999 m", "1e999 m", "nan m", "0 g"),
    *("-5 m", "1 rad/s", "31 deg", "1e-300 m", "12:30:00", "0o17", "0400", "1e3", "3 dB", "1 ns", "1 Ms"),
    *("m" + " " * 5000 + "!", "x" * 5000, "a" * 240, "\u00e9", "e\u0301", "\x00", "\ud800", "\U0001f4a7"),
    *("a/b", "..", ".", "-x", "../../etc/passwd", "/dev/zero", "/", "CON", "each", "all", "auto", "rigid"),
    *("on", "<<", "2001-13-45"),
]


def mutated(number: int) -> str:
    """The text of case `number`: a key of some base made wrong, and every fifth time the text itself."""
    rng, keys = np.random.default_rng(number), every_key()
    base, place = keys[number % len(keys)]
    raw = copy.deepcopy(BASES[base])
    for _ in range(1 + int(rng.integers(8) == 0)):
        _change(raw, place, rng)
        base, place = keys[int(rng.integers(len(keys)))]
    text = yaml.safe_dump(raw, sort_keys=False)
    return _damaged(text, rng) if number % 5 == 0 else text


def _change(raw: dict[str, Any], place: Place, rng: Rng) -> None:
    *parents, name = place
    owner: Any = value_at(raw, tuple(parents))
    last: Any = name  # of a dict or a list
    if not isinstance(owner, dict | list):
        return
    old = value_at(raw, place)
    kind = int(rng.integers(8))
    if isinstance(owner, dict) and old is not MISSING and kind == 0:
        del owner[last]
    elif isinstance(owner, dict) and old is not MISSING and kind == 1:
        owner[str(HOSTILE[int(rng.integers(len(HOSTILE)))])] = owner.pop(last)
    elif isinstance(old, int | float) and kind in (2, 3):
        owner[last] = old * 10.0 ** int(rng.integers(-12, 13)) * (-1.0) ** int(rng.integers(2))
    elif old is not MISSING and kind == 4:
        owner[last] = [old, {"a": old}, [old, old], str(old)][int(rng.integers(4))]
    elif isinstance(old, dict | list) and old and kind in (2, 3, 5):
        inner = list(old) if isinstance(old, dict) else range(len(old))
        _change(raw, (*place, inner[int(rng.integers(len(inner)))]), rng)
    elif isinstance(owner, dict):
        owner[last] = HOSTILE[int(rng.integers(len(HOSTILE)))]


def _damaged(text: str, rng: Rng) -> str:
    lines = text.splitlines()
    at = int(rng.integers(len(lines)))
    kind = int(rng.integers(8))
    if kind == 0:
        lines.insert(at, lines[at])
    elif kind == 1:
        del lines[at]
    elif kind == 2:
        lines[at] = " " * int(rng.integers(1, 6)) + lines[at]
    elif kind == 3:
        lines[at] += str(
            rng.choice([" !!python/object:os.system x", " &a", " *a", ": :", " [", " }", " \t x", "\x07"])
        )
    elif kind == 4:
        lines.insert(0, "title: " + "[" * int(rng.integers(1, 3000)))
    elif kind == 5:
        bomb = ["x0: &x0 [lol, lol, lol, lol, lol, lol, lol, lol, lol]"]
        bomb += [f"x{k}: &x{k} [{', '.join([f'*x{k - 1}'] * 9)}]" for k in range(1, 10)]
        lines = [line for line in lines if not line.startswith("title")]
        lines = [*bomb, "title: *x9", *lines]
    elif kind == 6:
        lines = lines[:at]
    else:
        where = int(rng.integers(len(text)))
        return (
            text[:where] + str(rng.choice(list("{}[]:&*!|>'\"%@`#,?-\t\ufeff\u2028é0"))) + text[where + 1 :]
        )
    return "\n".join(lines) + "\n"
