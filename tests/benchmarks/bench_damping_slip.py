"""What damping and steps do to slip: a block, a coarser Koyna, and one monolith of it.

    python tests/benchmarks/bench_damping_slip.py [--block | --monolith | --dam]

The block is of 4 x 4 x 1 m on massless rock, friction 0.1, under Northridge, Mulholland 009 x 1.5; Newmark's
rigid block has no damping. The dam is configs/koyna.yaml with one element along each monolith, two through
and seven up, a cutoff of 25 Hz and 20 s of the record, without stress. The monolith is of hex8, 1 by 4 by 12,
on rock as wide, 10 s of the record: reduced at accuracies, given steps and cutoffs, and at full order.
`--dam` is the dam's slips by steps: 12 s of the above, and 10.5 s in hex8, 1 by 4 by 10, with 50 Hz, of the
record as it is and a ten-thousandth larger. Prints Markdown tables; nothing here passes or fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import romdam
from romdam.config.sections.job import DampingConfig
from romdam.fem.damping import rayleigh_coefficients
from romdam.postprocess.sliding import mean_slip, sliding

sys.path.insert(0, str(Path(__file__).parents[1]))
from rigid_block import rigid_slip

CONFIG = Path(__file__).parents[2] / "configs" / "koyna.yaml"
RECORD = Path(__file__).parents[2] / "data" / "records" / "northridge_mul009_g_dt0.01.txt"
BASES = ("base_2", "base_3", "base_4")
MU, G = 0.1, 9.81
DIVISIONS = {"along": 1, "through": 2, "up": 7, "depth": 2, "upstream": 1, "downstream": 1, "banks": 1}


def rayleigh(low: float, high: float) -> dict[str, Any]:
    return {"rayleigh": {"frequencies": [low, high], "ratio": 0.05}}


def without_alpha(damping: dict[str, Any]) -> dict[str, Any]:
    """The same beta alone."""
    beta = rayleigh_coefficients(DampingConfig.model_validate(damping).rayleigh)[1]
    return {"rayleigh": {"alpha": 0.0, "beta": beta}}


CASES = {
    "`rayleigh` of 3 and 20 Hz, 5 %": rayleigh(3.0, 20.0),
    "`rayleigh` of 20 and 200 Hz, 5 %": rayleigh(20.0, 200.0),
    "its $\\beta$ alone, of 3 and 20 Hz": without_alpha(rayleigh(3.0, 20.0)),
    "`modal: 5 %`": {"modal": 0.05},
}


def block(damping: dict[str, Any]) -> dict[str, Any]:
    box = {"origin": [0, 0, 0], "size": [4, 4, 1], "element_size": [2, 2, 1]}
    stiff = {"E": 3e12, "nu": 0.2, "rho": 2400}
    return {
        "materials": {"stiff": stiff},
        "blocks": {
            "rock": {"material": "stiff", "mass": False, "box": box | {"origin": [0, 0, -1]}},
            "block": {"material": "stiff", "box": box},
        },
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {
            "base": {
                "between": ["rock", "block"],
                "normal_stiffness": 50e9,
                "shear_stiffness": 50e9,
                "friction": MU,
            }
        },
        "loads": {"gravity": [0, 0, -G]},
        "damping": damping,
        "records": [
            {
                "name": "r",
                "scale": 1.5,
                "file": str(RECORD),
                "unit": "9.81 m/s2",
                "dt": 0.01,
                "components": {"x": 1},
            }
        ],
        "model": {"modes": "all"},
        "transient": {"finest_step": 1.25e-3},
        "outputs": {"plots": False, "error_estimate": False, "output_interval": 0.01},
    }


def koyna(damping: dict[str, Any]) -> dict[str, Any]:
    raw: dict[str, Any] = yaml.safe_load(CONFIG.read_text())
    raw["records"][0]["components"]["y"]["file"] = str(RECORD)
    raw["outputs"] = {"plots": False, "error_estimate": False, "output_interval": 0.01}
    raw["gravity_dam"]["divisions"] = DIVISIONS | {"growth": 1.7}
    raw["model"] = {"order": "reduced", "cutoff": 25.0}
    raw["transient"] = {"finest_step": 2.5e-3, "duration": 20.0}
    return raw | {"damping": damping}


def monolith(order: str, **transient: str) -> dict[str, Any]:
    """One monolith on its base, friction 1.0; the record along the stream."""
    raw = koyna(rayleigh(3.0, 20.0))
    dam, wet = raw["gravity_dam"], [{"block": "monolith_1", "face": "upstream"}]
    dam |= {"monoliths": ["15.24 m"], "base": "0 m", "element": "hex8"}
    dam["divisions"] = {"along": 1, "through": 4, "up": 12, "depth": 3, "upstream": 2, "downstream": 2}
    dam["divisions"] |= {"banks": 2, "growth": 1.7}
    dam["rock"] |= {"left": "0 m", "right": "0 m"}
    del dam["joints"]["contraction"]
    raw["loads"]["hydrostatic"][0]["faces"] = raw["water"]["faces"] = wet
    raw["loads"]["joint_water"][0]["joints"] = ["base_1"]
    raw["model"] = {"order": "full"} if order == "full" else {"order": "reduced", "cutoff": "50 Hz"}
    raw["transient"] = {"duration": 10.0} | transient
    return raw


def of_monolith() -> None:
    """Print the residual slip of one monolith, its estimated error of the steps, and the largest slip."""
    print("| | slip, mean of the last second [mm] | stated: steps, modes | slip at the end [mm] |")
    print("|---|---|---|---|")
    asked = [("50 Hz", {"accuracy": value}) for value in ("2 %", "1 %", "0.5 %")]
    asked += [("50 Hz", {"finest_step": f"{2.5 / 2**k} ms"}) for k in range(5)]
    asked += [(cutoff, {"accuracy": "1 %"}) for cutoff in ("25 Hz", "100 Hz", "200 Hz", "all")]
    asked += [("full", {"finest_step": f"{2.5 / 2**k} ms"}) for k in (2, 3)]
    for order, transient in asked:
        raw = monolith("full" if order == "full" else "reduced", **transient)
        if order != "full":
            raw["model"] = {"modes": "all"} if order == "all" else {"cutoff": order}
            raw["outputs"]["error_estimate"] = True
        dataset = romdam.run(romdam.load_config(raw)).results[0].dataset
        (own,), (key, value) = sliding(dataset), next(iter(transient.items()))
        names = "solver_estimated_time_error", "error_estimate_opening_l2"
        stated = [f"{100 * dataset.attrs[name]:.2g} %" for name in names if name in dataset.attrs]
        print(
            f"| {order}, {key} {value} | {1e3 * own.residual_slip:.1f} | {', '.join(stated)} "
            f"| {1e3 * mean_slip(dataset).values[-1, 0]:.0f} |",
            flush=True,
        )


def dam_by_steps() -> None:
    """Print residual slips of the five monoliths by steps."""
    print("| | bases 1 to 5 [mm] | stated error of the steps |")
    print("|---|---|---|")
    coarse = koyna(rayleigh(3.0, 20.0))
    fine = koyna(rayleigh(3.0, 20.0))
    fine["gravity_dam"] |= {"element": "hex8"}
    fine["gravity_dam"]["divisions"] = {"along": 1, "through": 4, "up": 10, "depth": 3, "growth": 1.7}
    fine["gravity_dam"]["divisions"] |= {"upstream": 2, "downstream": 2, "banks": 2}
    fine["model"] = {"order": "reduced", "cutoff": "50 Hz"}
    asked = [("coarse, 12 s", coarse, 12.0, 1.0, {"finest_step": 2.5e-3 / 2**k}) for k in range(5)]
    asked += [("coarse, 12 s", coarse, 12.0, 1.0, {"accuracy": 0.02})]
    asked += [("hex8, 10.5 s", fine, 10.5, 1.0, {"finest_step": 2.5e-3 / 2**k}) for k in range(2)]
    asked += [("hex8, 10.5 s, ground 1.0001", fine, 10.5, 1.0001, {"finest_step": 2.5e-3})]
    for name, raw, seconds, scale, transient in asked:
        raw["transient"] = transient | {"duration": seconds}
        raw["records"][0]["scale"] = {"pga": f"{0.47 * scale:.8g} g"}
        dataset = romdam.run(romdam.load_config(raw)).results[0].dataset
        bases = [one for one in sliding(dataset) if one.joint.startswith("base")]
        stated = dataset.attrs.get("solver_estimated_time_error")
        (key, value), error = next(iter(transient.items())), "" if stated is None else f"{100 * stated:.2g} %"
        left = ", ".join(f"{1e3 * one.residual_slip:.0f}" for one in bases)
        print(f"| {name}, {key} {value:g} | {left} | {error} |", flush=True)


def slips(raw: dict[str, Any]) -> dict[str, float]:
    """Residual slip of every joint [mm]."""
    dataset = romdam.run(romdam.load_config(raw)).results[0].dataset
    return {one.joint: 1e3 * one.residual_slip for one in sliding(dataset)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--block", action="store_true", help="the block alone")
    parser.add_argument("--monolith", action="store_true", help="one monolith by steps")
    parser.add_argument("--dam", action="store_true", help="the dam by steps")
    arguments = parser.parse_args()
    if arguments.dam:
        dam_by_steps()
        return
    if arguments.monolith:
        of_monolith()
        return
    dam = not arguments.block
    exact = rigid_slip(1.5 * G * np.loadtxt(RECORD).ravel(), 0.01, 0.0, MU * G)[-1]
    print("| damping | $\\alpha$ [1/s] | block [mm] | Koyna, bases 2, 3, 4 [mm] |")
    print("|---|---|---|---|")
    print(f"| none: Newmark's rigid block | 0 | {1e3 * abs(exact):.1f} | |")
    for name, damping in CASES.items():
        alpha = rayleigh_coefficients(DampingConfig.model_validate(damping).rayleigh)[0]
        own, of_dam = slips(block(damping))["base"], ""
        if dam and "200" not in name:
            found = slips(koyna(damping))
            of_dam = " ".join(f"{found[base]:.0f}" for base in BASES)
        print(f"| {name} | {alpha:.3g} | {own:.1f} | {of_dam} |", flush=True)


if __name__ == "__main__":
    main()
