"""Compare variants of one job: run each by itself, and show them side by side.

A variant replaces some keys of the configuration. Each variant is run like any other job, into a folder of
its own; one that fails is reported and the others go on, unless it is the variant that all are compared with.
What they have in common is collected in one dataset, with tables, figures and a page.
"""

from __future__ import annotations

import logging
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from romdam.config.load import Job, Source, naming_lines
from romdam.config.sections.comparison import ComparisonConfig
from romdam.config.variants import comparison_of, variant_jobs
from romdam.core.errors import ConfigError, ResultError, RomdamError, listed
from romdam.core.files import prepare_folder, replacing
from romdam.error.variants import comparison_dataset
from romdam.pipelines.input_motions import records_of
from romdam.pipelines.jobs import load_config, looked_up
from romdam.pipelines.run import Clock, Stage, run, silent
from romdam.postprocess.variant_tables import VariantTable, markdown, variant_tables
from romdam.results.dataset import write_dataset
from romdam.results.fields import Result, open_result
from romdam.results.table import write_csv

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class VariantRuns:
    """Variants in one Dataset, its tables, the files, and variant -> message of those that failed."""

    dataset: xr.Dataset
    tables: list[VariantTable]
    paths: tuple[Path, ...]
    failures: dict[str, str]


@naming_lines
def compare(job: Source, out: str | Path, show: Stage = silent, cache: Path | None = None) -> VariantRuns:
    """Run every variant of `comparison:` into `out`/<variant> and set them side by side.

    Parameters
    ----------
    job : a configuration with `comparison:`, as `romdam.load_config` takes one
    out : folder for the variants' folders, comparison.nc, .md and .html, tables (CSV) and figures (PNG)
    show : told of every stage and its progress
    cache : folder of reduced blocks, as `romdam.pipelines.run.run` takes it

    Raises
    ------
    RomdamError
        for bad input of any variant, before the first is run; and where the reference fails.
    """
    job = load_config(job)
    asked, jobs = comparable_variants(job)
    folder, results, failures = prepare_folder(Path(out)), dict[str, Path](), dict[str, str]()
    for name in sorted(jobs, key=lambda name: name != asked.against):  # the rest is of no use without it
        log.info("variant %s", name)
        try:
            results[name] = run(jobs[name], folder / name, show, cache).paths[0]
        except RomdamError as error:
            if name == asked.against:
                raise
            failures[name] = str(error)
    done = [name for name in jobs if name in results]
    with ExitStack() as opened:
        runs = {name: opened.enter_context(open_result(results[name])) for name in done}
        dataset = comparison_dataset({name: result.dataset for name, result in runs.items()}, job, asked)
        paths = _write(folder, dataset, runs, Clock(show))
    return VariantRuns(dataset, variant_tables(dataset), paths, failures)


def comparable_variants(job: Job) -> tuple[ComparisonConfig, dict[str, Job]]:
    """What is compared, and the job of every variant.

    Raises
    ------
    RomdamError
        where a variant's keys are wrong, or it cannot be compared.
    """
    asked = comparison_of(job)
    jobs = {name: looked_up(variant) for name, variant in variant_jobs(job).items()}
    for name, variant in jobs.items():
        where, outputs = f"{variant.path}: comparison.variants.{name}", variant.config.outputs
        if (count := len(records_of(variant))) > 1:
            raise ConfigError(f"{where}: a comparison is of one record, records are {count}; keep one")
        if not outputs.nodes and not variant.config.every_joint:
            raise ConfigError(
                f"{where}: neither joints nor outputs.nodes, so nothing is compared; name nodes"
            )
        missing = {node for pair in asked.relative.values() for node in pair} - set(outputs.nodes)
        if missing:
            raise ConfigError(
                f"{where}: outputs.nodes lacks {listed(sorted(missing))} of comparison.relative; "
                "name it there"
            )
    return asked, jobs


def _write(folder: Path, dataset: xr.Dataset, runs: dict[str, Result], clock: Clock) -> tuple[Path, ...]:
    from romdam.visual.report.comparison import write_comparison

    tables = variant_tables(dataset)
    paths = [folder / "comparison.nc", folder / "comparison.md"]
    write_dataset(dataset, paths[0])
    with replacing(paths[1]) as unfinished:
        unfinished.write_text(markdown(tables), encoding="utf-8")
    paths += [write_csv(table.head, table.rows, folder / f"comparison-{table.name}.csv") for table in tables]
    with clock.stage("figures", "drawing figures"):
        figures = _figures(folder, dataset, runs)
        pictures = {name: path.read_bytes() for name, path in figures.items()}
        return (write_comparison(dataset, pictures, folder), *paths, *figures.values())


def _figures(folder: Path, dataset: xr.Dataset, runs: dict[str, Result]) -> dict[str, Path]:
    """Name -> file of every figure that there are numbers for; fields where this machine draws in 3-D."""
    from romdam.visual.field_views import draw_side_by_side
    from romdam.visual.plots import save_figure
    from romdam.visual.variant_plots import HISTORIES

    figures = {name: draw(dataset) for name, draw in HISTORIES.items()}
    paths = {
        name: save_figure(figure, folder / f"comparison-{name}.png")
        for name, figure in figures.items()
        if figure is not None
    }
    reduced = {
        name: result for name, result in runs.items() if result.dataset.attrs["model_order"] == "reduced"
    }
    try:
        return paths | draw_side_by_side(reduced, dataset.attrs["compared_component"], folder, "comparison")
    except ResultError as error:
        log.warning("no pictures of fields: %s", error)
        return paths
