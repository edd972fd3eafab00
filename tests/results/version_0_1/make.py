"""Write what `files.tar.xz` holds, with romdam 0.1.0; `suite/cache` and `run/r1.nc` were left out."""

from pathlib import Path

import numpy as np
import yaml

import romdam

CONFIG = {
    "title": "Two cantilevers that romdam 0.1 shook",
    "materials": {"concrete": {"E": "30 GPa", "nu": 0.18, "rho": "2440 kg/m3"}},
    "blocks": {
        name: {
            "material": "concrete",
            "box": {"origin": [0, first, 0], "size": [5, depth, 20], "element_size": "5 m"},
        }
        for name, first, depth in (("left", -5, 5), ("right", 0, 10))
    },
    "supports": [{"block": "left", "face": "zmin"}, {"block": "right", "face": "zmin"}],
    "joints": {
        "gap": {
            "between": ["left", "right"],
            "normal_stiffness": "16 GPa/m",
            "shear_stiffness": "8 GPa/m",
            "friction": 0.5,
        }
    },
    "damping": {"rayleigh": {"frequencies": ["5 Hz", "50 Hz"], "ratio": "5 %"}},
    "records": [{"files": "r*.txt", "unit": "m/s2", "dt": "0.01 s", "components": {"y": 1}}],
    "model": {"order": "reduced", "modes": 8},
    "transient": {"dt": "5 ms"},
    "outputs": {
        "every": "0.02 s",
        "error_estimate": False,
        "plots": False,
        "nodes": {"top": {"block": "right", "at": [0, 0, 20]}},
        "stress": {
            "faces": [{"block": "left", "face": "ymax"}],
            "strength": "2 MPa",
            "nodes": {"foot": {"block": "left", "at": [0, 0, 0]}},
        },
    },
}
SUITE = {
    "pipeline": "suite",
    "suite": {
        "scales": [0.5, 1.0],
        "parameters": {"friction": {"path": "joints.gap.friction", "values": [0.3, 0.6]}},
    },
}

folder = Path()
for number in range(2):
    time = np.arange(60) * 0.01
    np.savetxt(
        folder / f"r{number}.txt",
        8.0 * np.sin(2 * np.pi * (3 + number) * time) * np.exp(-3 * time),
        fmt="%.6f",
    )
(folder / "job.yaml").write_text(yaml.safe_dump(CONFIG, sort_keys=False))
(folder / "suite.yaml").write_text(yaml.safe_dump(CONFIG | SUITE, sort_keys=False))
romdam.run(romdam.load_config(folder / "job.yaml"), folder / "run")
romdam.run_suite(romdam.load_config(folder / "suite.yaml"), folder / "suite")
