"""Reduced-order seismic analysis of concrete dams cut by contraction joints.

import romdam

job = romdam.load_config("configs/two_cantilevers.yaml")
outcome = romdam.run(job, out="results")
result = romdam.open_result(outcome.paths[0])
print(result.dataset.peak_opening)
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from romdam.config.load import load_config
    from romdam.pipelines.error.comparison import compare
    from romdam.pipelines.error.two_results import compare_results
    from romdam.pipelines.modes import modes
    from romdam.pipelines.run import run
    from romdam.pipelines.suites.run import run_suite
    from romdam.reduction.storage.user_cache import cache_folder
    from romdam.results.fields import Result, open_result
    from romdam.results.suite.summary import open_suite

__version__ = "0.2.0.dev0"
__all__ = [
    "Result", "__version__", "cache_folder", "compare", "compare_results", "load_config", "modes",
    "open_result", "open_suite", "run", "run_suite",
]  # fmt: skip

# Looked up on first use, so that `import romdam` and `romdam --help` load no numerical library.
_LAZY = {
    "compare": "romdam.pipelines.error.comparison",
    "compare_results": "romdam.pipelines.error.two_results",
    "load_config": "romdam.config.load",
    "modes": "romdam.pipelines.modes",
    "open_result": "romdam.results.fields",
    "open_suite": "romdam.results.suite.summary",
    "Result": "romdam.results.fields",
    "cache_folder": "romdam.reduction.storage.user_cache",
    "run": "romdam.pipelines.run",
    "run_suite": "romdam.pipelines.suites.run",
}


def __getattr__(name: str) -> object:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_LAZY[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
