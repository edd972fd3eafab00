"""Write what `files.tar.xz` holds, with romdam 0.3.0: `python make.py` in an empty folder, then

tar -cJf files.tar.xz --exclude=suite/cache --exclude=run/r1.nc --exclude='*.log' --exclude=.romdam-lock *
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import romdam

CONFIG: dict[str, Any] = {
    "title": "A monolith on rock beside another that romdam 0.3 shook",
    "materials": {"concrete": {"E": "20 GPa", "E_dynamic": "26 GPa", "nu": 0.2, "rho": "2400 kg/m3"}},
    "blocks": {
        "rock": {
            "material": "concrete",
            "mass": False,
            "weight": False,
            "box": {"origin": [0, 0, -4], "size": [8, 8, 4], "element_size": "4 m"},
        },
        "left": {
            "material": "concrete",
            "box": {"origin": [0, 0, 0], "size": [4, 8, 12], "element_size": "4 m"},
        },
        "right": {
            "material": "concrete",
            "box": {"origin": [4, 0, 0], "size": [4, 8, 8], "element_size": "4 m"},
        },
    },
    "supports": [{"block": "rock", "face": "zmin"}],
    "joints": {
        name: {
            "between": blocks,
            "normal_stiffness": "10 GPa/m",
            "shear_stiffness": "5 GPa/m",
            "friction": friction,
        }
        for name, blocks, friction in (
            ("contraction", ["left", "right"], 0.2),
            ("base_left", ["rock", "left"], 0.8),
            ("base_right", ["rock", "right"], 0.8),
        )
    },
    "anchors": {
        "tendon": {
            "head": {"block": "left", "at": [4, 4, 12]},
            "foot": {"block": "rock", "at": [4, 4, 0]},
            "stiffness": "20 MN/m",
            "pretension": "100 kN",
        }
    },
    "dampers": {
        "device": {
            "head": {"block": "left", "at": [4, 0, 8]},
            "foot": {"block": "right", "at": [8, 0, 8]},
            "damping": "100 kN s/m",
        }
    },
    "masses": {"gate": {"block": "left", "at": [0, 0, 12], "mass": "5 t"}},
    "loads": {
        "gravity": [0, 0, -9.81],
        "hydrostatic": [
            {"level": "6 m", "faces": [{"block": "left", "face": "ymin"}, {"block": "right", "face": "ymin"}]}
        ],
        "joint_water": [{"joints": ["base_*"], "level": "6 m", "downstream": [0, 1, 0]}],
    },
    "damping": {"rayleigh": {"frequencies": ["5 Hz", "50 Hz"], "ratio": "5 %"}},
    "records": [{"files": "r*.txt", "unit": "m/s2", "dt": "0.01 s", "components": {"y": 1}}],
    "model": {"order": "reduced", "modes": 6},
    "transient": {"finest_step": "5 ms"},
    "outputs": {
        "output_interval": "0.05 s",
        "plots": False,
        "nodes": {"top": {"block": "left", "at": [0, 0, 12]}},
        "stress": {
            "faces": [{"block": "left", "face": "ymin"}],
            "strength": "2 MPa",
            "nodes": {"foot": {"block": "left", "at": [0, 0, 0]}},
        },
    },
}
SUITE: dict[str, Any] = {
    "pipeline": "suite",
    "outputs": {key: value for key, value in CONFIG["outputs"].items() if key != "stress"},
    "suite": {
        "scales": [0.5, 1.0],
        "parameters": {"friction": {"path": "joints.base_*.friction", "values": [0.6, 0.8]}},
        "weights": {"r0": 2, "r1": 1},
        "hazard": {"table": "hazard.csv", "measure": "pga", "response": "peak_slip"},
    },
}
ROCK = {"material": "concrete", "depth": "20 m", "mass": False}
DAMS: dict[str, dict[str, Any]] = {  # whose joints and blocks are made from a few keys
    "gravity": {
        "gravity_dam": {
            "upstream": [["0 m", "0 m"], ["30 m", "0 m"]],
            "downstream": [["0 m", "24 m"], ["30 m", "4 m"]],
            "monoliths": ["10 m", "10 m", "10 m"],
            "base": ["6 m", "0 m", "6 m"],
            "lifts": ["16 m"],
            "material": "concrete",
            "divisions": {"up": 4, "through": 2, "along": 1},
            "rock": ROCK | dict.fromkeys(("upstream", "downstream", "left", "right"), "20 m"),
            "joints": {
                kind: {"normal_stiffness": "10 GPa/m", "shear_stiffness": "5 GPa/m", "friction": 0.7}
                for kind in ("base", "contraction", "lift")
            },
        },
    },
}


def pulse(number: int) -> np.ndarray:
    """(nt,) decaying sine [m/s2]."""
    time = np.arange(40) * 0.01
    return 9.0 * np.sin(2 * np.pi * (3 + number) * time) * np.exp(-3 * time)


if __name__ == "__main__":
    folder, names = Path(), dict[str, list[str]]()
    for number in range(2):
        np.savetxt(folder / f"r{number}.txt", pulse(number), fmt="%.6f")
    (folder / "hazard.csv").write_text("intensity [g],annual frequency\n0.05,0.1\n0.3,0.01\n2,0.0001\n")
    made = {"job": CONFIG, "suite": CONFIG | SUITE}
    kept = ("materials", "damping", "records", "model", "transient")
    made |= {name: {key: CONFIG[key] for key in kept} | dam for name, dam in DAMS.items()}
    for name, config in made.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
        names[name] = [*romdam.load_config(folder / f"{name}.yaml").config.every_joint]
    outcome = romdam.run(romdam.load_config(folder / "job.yaml"), folder / "run")
    summary = romdam.run_suite(romdam.load_config(folder / "suite.yaml"), folder / "suite").summary
    with romdam.open_result(outcome.paths[0]) as result:
        names["variables"] = sorted(map(str, result.dataset.variables))
        names["attributes"] = sorted(map(str, result.dataset.attrs))
    names["summary"] = sorted(map(str, summary.variables))
    (folder / "names.json").write_text(json.dumps(names, indent=1))
