"""The import rule: data flows one way, so nothing imports what comes after it.

`romdam` itself is the facade (lazy names only), `terminal` belongs to `cli`. The modules in TYPES
define what passes between rooms; a room may import the types of any room.
"""

import ast
import os
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MAIN_JOB = ROOT / "configs" / "two_cantilevers.yaml"
EVERY_ROOM = {
    "config", "records", "geometry", "scene", "fem", "effects", "linalg", "reduction", "contact",
    "timestepping", "error", "postprocess", "results", "visual", "export",
}  # fmt: skip
ALLOWED = {
    "core": set(),
    "surroundings": set(),
    "config": set(),
    "examples": set(),
    "records": set(),
    "geometry": {"linalg"},
    "scene": {"geometry", "linalg"},
    "linalg": set(),
    "contact": set(),
    "postprocess": {"records"},
    "fem": {"geometry", "linalg", "scene"},
    "timestepping": {"contact", "linalg"},
    "effects": {"fem", "geometry", "linalg", "scene"},
    "reduction": {"effects", "fem", "geometry", "linalg", "scene"},
    "results": {"postprocess"},
    "error": {"contact", "geometry", "linalg", "postprocess", "results", "scene", "timestepping"},
    "visual": {"postprocess", "results"},
    "export": {"contact", "effects", "fem", "geometry", "reduction", "scene"},
    "pipelines": EVERY_ROOM | {"surroundings"},  # of the process that workers are forked from
    # cases run whole jobs as a user does, and some parts of them alone
    "benchmarks": EVERY_ROOM | {"examples", "pipelines"},
    "terminal": {"benchmarks", "error", "pipelines", "postprocess"},
    "commands": {
        "benchmarks",
        "examples",
        "pipelines",
        "records",
        "results",
        "surroundings",
        "terminal",
        "visual",
    },
    "cli": {"commands", "surroundings"},
    "__main__": {"cli"},
    "__init__": {"pipelines", "results"},
}
LAWS = {"config", "fem", "scene"}  # what a joint may say follows from its laws
TYPES = {
    "romdam.contact.laws": LAWS,
    "romdam.contact.laws.catalogue": LAWS,
    "romdam.contact.laws.coulomb": LAWS,
    "romdam.contact.laws.crack_water": LAWS,
    "romdam.contact.laws.law": LAWS,
    "romdam.reduction.basis": {"effects"},
    "romdam.reduction.storage.model_file": {"results"},
    "romdam.reduction.storage.user_cache": {"__init__", "commands", "terminal"},  # listed, cleared by command
    "romdam.geometry.elements": {"results", "visual"},
    "romdam.geometry.meshes.kinds": {"results", "visual"},
}
ANYWHERE = {"core", "config"}
ONLY_IN = {
    "xarray": {"benchmarks", "core", "error", "pipelines", "postprocess", "results", "terminal", "visual"},
    "matplotlib": {"visual"},
    "obspy": {"records"},
    "h5py": {"core", "export", "geometry", "reduction", "results"},
    "h5netcdf": {"results"},
    "PIL": {"visual"},
    "jinja2": {"visual"},
    "markupsafe": {"visual"},
    "xlsxwriter": {"results"},
    "pyarrow": {"results"},
    "zarr": {"results"},
    "dask": {"pipelines"},
    "distributed": {"pipelines"},
    "yaml": {"config"},
    "typer": {"cli", "commands"},
    "rich": {"terminal"},
    "pydantic": {"config"},
    "pint": {"config"},
    "pyvista": {"visual"},
}


def modules() -> list[tuple[str, Path]]:
    """(room, file) of every module of the package; `pipelines` is installed as romdam.pipelines."""
    found = [("pipelines", path) for path in sorted((ROOT / "pipelines").rglob("*.py"))]
    for path in sorted((ROOT / "romdam").rglob("*.py")):
        first = path.relative_to(ROOT / "romdam").parts[0]
        found.append((first.removesuffix(".py"), path))
    return found


@cache
def nodes(path: Path) -> list[ast.AST]:
    """Syntax tree of a file, flat; each file is parsed once."""
    return list(ast.walk(ast.parse(path.read_text())))


@cache
def imports(path: Path) -> list[tuple[str, int]]:
    """Every absolute module name imported anywhere in a file, with its line."""
    found = []
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found += [(alias.name, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            found.append((node.module, node.lineno))
    return found


def is_type_only(path: Path, line: int) -> bool:
    """Whether a line stands in an `if TYPE_CHECKING:` block, which never runs."""
    blocks = [n for n in nodes(path) if isinstance(n, ast.If)]
    return any(
        isinstance(n.test, ast.Name) and n.test.id == "TYPE_CHECKING" and n.lineno <= line <= n.end_lineno
        for n in blocks
    )


def breaks_rule(room: str, name: str) -> bool:
    parts = name.split(".")
    if parts[0] != "romdam" or len(parts) == 1:
        return False
    target = parts[1]
    if target == room or target in ANYWHERE:
        return room == "core" and target != "core"
    return target not in ALLOWED[room] and room not in TYPES.get(name, set())


def test_module_imports_only_what_comes_before_it():
    assert {room for room, _ in modules()} <= set(ALLOWED), (
        "a new room: state in this test what it may import"
    )
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}; {room} may import {sorted(ALLOWED[room])}"
        for room, path in modules()
        for name, line in imports(path)
        if breaks_rule(room, name)
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("library", ONLY_IN)
def test_library_is_imported_only_in_its_room(library):
    wrong = [
        f"{path.relative_to(ROOT)}:{line}"
        for room, path in modules()
        for name, line in imports(path)
        if name.split(".")[0] == library and room not in ONLY_IN[library] and not is_type_only(path, line)
    ]
    assert not wrong, f"{library} belongs to {ONLY_IN[library]}"


def test_what_is_computed_opens_no_file():
    files = {"pathlib", "os", "io", "csv", "tempfile", "h5py", "h5netcdf"}
    wrong = [
        f"{path.name}:{line} imports {name}"
        for room, path in modules()
        for name, line in imports(path)
        if room == "postprocess" and name.split(".")[0] in files
    ]
    assert not wrong, "what reads or writes files stands in `results`"


def test_every_command_takes_jobs_with_what_is_looked_up_in_meshes():
    """`romdam.pipelines.jobs` alone reads a configuration for what runs it; `records` needs no meshes."""
    wrong = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for room, path in modules()
        for node in nodes(path)
        if room in ("pipelines", "commands", "benchmarks", "terminal", "error") and path.name != "jobs.py"
        if isinstance(node, ast.ImportFrom) and node.module == "romdam.config.load"
        if any(name.name == "load_config" for name in node.names)
    ]
    assert not wrong, "take load_config of romdam.pipelines.jobs"


def test_rule_would_catch_a_step_back():
    assert breaks_rule("timestepping", "romdam.results.dataset")
    assert breaks_rule("contact", "romdam.timestepping.simulate")
    assert breaks_rule("scene", "romdam.fem.assembly")
    assert breaks_rule("config", "romdam.scene.build")
    assert breaks_rule("results", "romdam.timestepping.simulate")
    assert breaks_rule("core", "romdam.config.load")
    assert not breaks_rule("results", "romdam.core.system")
    assert not breaks_rule("timestepping", "romdam.config.load")


def test_library_neither_prints_nor_exits_nor_configures_logging():
    forbidden = {"print", "exit", "quit"}
    for room, path in modules():
        if room in ("cli", "terminal"):
            continue
        for node in nodes(path):
            if isinstance(node, ast.Call):
                name = ast.unparse(node.func)
                assert name not in forbidden | {"sys.exit", "logging.basicConfig"}, f"{path}:{node.lineno}"


def test_import_is_quick_and_loads_no_heavy_library():
    heavy = ("numpy", "scipy", "obspy", "numba", "matplotlib", "xarray", "pint", "pydantic", "h5py")
    heavy += ("threadpoolctl",)
    code = (
        "import time, sys; start = time.perf_counter(); import romdam; took = time.perf_counter() - start;"
        f"print(took, *[m for m in {heavy!r} if m in sys.modules])"
    )
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert out[1:] == [], "loaded by `import romdam`"
    assert float(out[0]) < 0.5


def test_run_loads_no_library_that_few_scenes_need():
    """Imports are much of the smallest job's CPU; these are for limit analysis, free fields and the like."""
    rare = ("scipy.optimize", "scipy.fft", "scipy.stats", "obspy", "meshio", "matplotlib", "distributed")
    code = f"import romdam.pipelines.run, sys; print(*[m for m in {rare!r} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.split() == []


@pytest.mark.slow
def test_workers_of_a_suite_that_keeps_peaks_load_nothing_that_writes_files():
    heavy = ("xarray", "pandas", "h5netcdf", "matplotlib")
    code = f"import romdam.pipelines.suites.runs, sys; print(*[m for m in {heavy!r} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.split() == []


@pytest.mark.slow
def test_main_job_from_records_to_figures_loads_what_it_needs(tmp_path):
    """Where dask is installed, pint and xarray load it, and it loads scipy.special."""
    rare = ("scipy.fft", "scipy.interpolate", "scipy.io", "scipy.optimize", "scipy.signal", "scipy.spatial")
    rare += ("scipy.special", "scipy.stats", "obspy", "meshio", "distributed", "jinja2", "matplotlib.pyplot")
    code = (
        "import atexit, sys; sys.modules['dask'] = None;"
        f"atexit.register(lambda: print('loaded:', *[m for m in {rare!r} if m in sys.modules]));"
        f"sys.argv = ['romdam', 'run', {str(MAIN_JOB)!r}, '--out', {str(tmp_path)!r}, '--no-cache'];"
        "from romdam.cli import main; main()"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert len(list(tmp_path.glob("*.png"))) == 5
    assert out.splitlines()[-1].strip() == "loaded:"


def test_commands_search_for_cycles_what_comes_after_loading():
    code = (
        "import gc; from romdam.surroundings import load_unsearched, search_what_comes as search;"
        "load_unsearched(); before = gc.get_threshold()[0]; search();"
        "print(before, gc.get_threshold()[0], gc.get_freeze_count() > 10_000)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.split() == ["500000", "50000", "True"]


def test_command_searches_for_cycles_rarely_and_not_as_it_ends():
    code = (
        "import atexit, gc, sys; sys.argv = ['romdam', '--version'];"
        "atexit.register(lambda: print(gc.get_threshold()[0], gc.get_freeze_count() > 10_000));"
        "from romdam.cli import main; main()"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.split()[-2:] == ["500000", "True"]


def test_command_loads_libraries_whose_threads_wait_asleep():
    """0.2 CPU-s with two cores and OpenBLAS' own way of waiting, 0.0006 so; what a user has set stays."""
    code = (
        "import os, sys, time; from romdam.surroundings import check_surroundings;"
        "check_surroundings(); others = lambda: time.process_time() - time.thread_time(); before = others();"
        "import numpy, scipy.linalg; time.sleep(0.2);"
        "print(others() - before, os.environ['OPENBLAS_THREAD_TIMEOUT'])"
    )
    for given, expected in ((None, "18"), ("26", "26")):
        surroundings = {k: v for k, v in os.environ.items() if k != "OPENBLAS_THREAD_TIMEOUT"}
        surroundings |= {} if given is None else {"OPENBLAS_THREAD_TIMEOUT": given}
        command = [sys.executable, "-c", code]
        out = subprocess.run(command, capture_output=True, text=True, check=True, env=surroundings).stdout
        seconds, kept = out.split()
        assert kept == expected
        assert given is not None or float(seconds) < 0.02


def test_lazy_names_exist_and_unknown_ones_do_not():
    import romdam

    for name in romdam.__all__:
        assert getattr(romdam, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = romdam.nothing


def test_every_room_is_packaged():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    folders = {path.parent.relative_to(ROOT) for path in (ROOT / "romdam").rglob("*.py")}
    folders |= {Path("romdam") / path.parent.relative_to(ROOT) for path in (ROOT / "pipelines").rglob("*.py")}
    expected = {".".join(folder.parts) for folder in folders}
    elsewhere = {f"romdam.examples.{one}": one for one in ("configs", "data")}
    elsewhere["romdam.pipelines"] = "pipelines"
    assert set(settings["packages"]) == expected | elsewhere.keys(), "a wheel would lack what is not listed"
    assert settings["package-dir"] == elsewhere


NUMERICAL = {"numpy", "scipy", "numba"}


def numerics(path: Path) -> list[str]:
    """Imports of numerical libraries and matrix products in a file."""
    found = []
    for node in nodes(path):
        names = []
        if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult):
            found.append(f"{path.name}:{node.lineno}: {ast.unparse(node)}")
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        found += [f"{path.name}: {n}" for n in names if n.split(".")[0] in NUMERICAL]
    return found


def test_pipelines_hold_no_numerics():
    """They keep the order of the stages: an array is made, computed with and measured in a room."""
    found = [line for path in (ROOT / "pipelines").rglob("*.py") for line in numerics(path)]
    assert not found, "numerics belong into a room of romdam"


def test_numerics_in_a_pipeline_would_be_told(tmp_path):
    (tmp_path / "a.py").write_text("import numpy as np\nfrom scipy.sparse import vstack\nc = a @ b\n")
    assert len(numerics(tmp_path / "a.py")) == 3
