"""What samples of modulus and level cost a suite, beside the same suite that samples friction alone.

    python tests/benchmarks/bench_uncertain.py [samples] [repeats]

Two cantilevers with friction between them and a reservoir, shaken by 5 s of a real record. Both suites run
in turn, with one worker; CPU of this process and its children, reduction included. Errors are not estimated:
that would cost both suites as much again. Prints the median of the repeats' ratios.
"""

from __future__ import annotations

import platform
import resource
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

import yaml

import romdam
from romdam.pipelines.suites.run import SuiteOptions, run_suite

ROOT = Path(__file__).parents[2]
FRICTION = {"path": "joints.contraction.friction", "low": 0.4, "high": 0.9}
MODULUS = {"path": "materials.concrete.E", "distribution": "lognormal", "mean": "30 GPa", "cov": "15 %"}
LEVEL = {
    "path": ["water.level", "loads.hydrostatic.0.level"],
    "distribution": "normal",
    "mean": "42 m",
    "std": "3 m",
    "low": "30 m",
    "high": "49 m",
}


def job(parameters: dict[str, Any], samples: int) -> dict[str, Any]:
    """The keys of a suite over some parameters."""
    raw: dict[str, Any] = yaml.safe_load((ROOT / "configs" / "suite.yaml").read_text())
    wet = [{"block": "left", "face": "ymin"}]
    raw["joints"]["contraction"] |= {"shear_stiffness": "8 GPa/m", "friction": 0.6}
    raw["water"] = {"level": "42 m", "faces": wet, "model": "westergaard"}
    raw["loads"] = {"hydrostatic": [{"level": "42 m", "faces": wet}]}
    raw["records"][0]["file"] = str(ROOT / "data" / "records" / "northridge_mul009_g_dt0.01.txt")
    raw["transient"] = {"finest_step": "2.5 ms", "duration": "5 s"}
    raw["outputs"] |= {"mesh_error": False, "error_estimate": False}
    raw["suite"] = {"parameters": parameters, "design": {"latin_hypercube": samples, "seed": 1}}
    return raw


def cpu(parameters: dict[str, Any], samples: int) -> float:
    """CPU seconds of a suite in a folder of its own."""

    def spent() -> float:
        usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(each.ru_utime + each.ru_stime for each in usage)

    before = spent()
    with tempfile.TemporaryDirectory() as folder:
        outcome = run_suite(romdam.load_config(job(parameters, samples)), folder, SuiteOptions(workers=1))
    assert not outcome.failures, outcome.failures
    return spent() - before


def main() -> None:
    """Print the ratio."""
    asked = [int(text) for text in sys.argv[1:3]]
    samples, repeats = (*asked, 1000, 3)[0], ([*asked, 3][1] if asked else 3)
    ratios = []
    for _ in range(repeats):
        alone = cpu({"mu": FRICTION}, samples)
        with_both = cpu({"mu": FRICTION, "E": MODULUS, "level": LEVEL}, samples)
        ratios.append(with_both / alone)
        print(
            f"{samples} samples: friction {alone:.1f} s, with modulus and level {with_both:.1f} s, "
            f"ratio {ratios[-1]:.3f}",
            flush=True,
        )
    print(f"median ratio {statistics.median(ratios):.3f} ({platform.processor() or platform.machine()})")


if __name__ == "__main__":
    main()
