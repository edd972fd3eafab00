"""Reduced-order seismic analysis of concrete dams cut by contraction joints.

import romdam

job = romdam.load_config("configs/two_cantilevers.yaml")
outcome = romdam.run(job, out="results")  # without `out` the results are in memory only
print(outcome.results[0].dataset.peak_opening)
"""

from importlib import import_module
from typing import TYPE_CHECKING

from romdam.core.version import VERSION as __version__

if TYPE_CHECKING:
    from romdam.config.job import Config
    from romdam.config.load import Job
    from romdam.core.errors import (
        ConfigError,
        ConvergenceError,
        MeshError,
        RecordError,
        ReductionError,
        ResultError,
        RomdamError,
        WorkerError,
        WriteError,
    )
    from romdam.core.motion import GroundMotion
    from romdam.pipelines.check import check
    from romdam.pipelines.error.certify import certify
    from romdam.pipelines.error.comparison import compare
    from romdam.pipelines.error.study import study
    from romdam.pipelines.error.two_results import compare_results
    from romdam.pipelines.error.verify import verify, verify_mesh
    from romdam.pipelines.input_motions import read_motions
    from romdam.pipelines.jobs import load_config
    from romdam.pipelines.modes import ModesOptions, modes
    from romdam.pipelines.run import Outcome, run
    from romdam.pipelines.suites.prepared_model import PreparedModel, prepare
    from romdam.pipelines.suites.run import SuiteOptions, SuiteOutcome, run_suite
    from romdam.reduction.storage.user_cache import cache_folder
    from romdam.results.fields import Result, open_result
    from romdam.results.suite.summary import open_suite

__all__ = [
    "Config", "ConfigError", "ConvergenceError", "GroundMotion", "Job", "MeshError", "ModesOptions",
    "Outcome", "PreparedModel", "RecordError", "ReductionError", "Result", "ResultError", "RomdamError",
    "SuiteOptions", "SuiteOutcome", "WorkerError", "WriteError", "__version__", "cache_folder", "certify",
    "check", "compare", "compare_results", "load_config", "modes", "open_result", "open_suite", "prepare",
    "read_motions", "run", "run_suite", "study", "verify", "verify_mesh",
]  # fmt: skip

# Looked up on first use, so that `import romdam` and `romdam --help` load no numerical library.
_LAZY = {
    name: module
    for module, names in {
        "romdam.config.load": ("Job",),
        "romdam.config.job": ("Config",),
        "romdam.core.errors": (
            "ConfigError", "ConvergenceError", "MeshError", "RecordError", "ReductionError", "ResultError",
            "RomdamError", "WorkerError", "WriteError",
        ),
        "romdam.core.motion": ("GroundMotion",),
        "romdam.pipelines.check": ("check",),
        "romdam.pipelines.error.certify": ("certify",),
        "romdam.pipelines.error.comparison": ("compare",),
        "romdam.pipelines.error.study": ("study",),
        "romdam.pipelines.error.two_results": ("compare_results",),
        "romdam.pipelines.error.verify": ("verify", "verify_mesh"),
        "romdam.pipelines.input_motions": ("read_motions",),
        "romdam.pipelines.jobs": ("load_config",),
        "romdam.pipelines.modes": ("ModesOptions", "modes"),
        "romdam.pipelines.run": ("Outcome", "run"),
        "romdam.pipelines.suites.prepared_model": ("PreparedModel", "prepare"),
        "romdam.pipelines.suites.run": ("SuiteOptions", "SuiteOutcome", "run_suite"),
        "romdam.reduction.storage.user_cache": ("cache_folder",),
        "romdam.results.fields": ("Result", "open_result"),
        "romdam.results.suite.summary": ("open_suite",),
    }.items()
    for name in names
}  # fmt: skip


def __getattr__(name: str) -> object:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_LAZY[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
