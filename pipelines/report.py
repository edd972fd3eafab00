"""The report of one run, or of several: one page, and a PDF of the same where one is asked for."""

from __future__ import annotations

import json
import logging
import shlex
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import xarray as xr

from romdam.config.load import Job, parse_config
from romdam.config.other_mesh import with_spacing
from romdam.config.quantities import to_si
from romdam.core.display_units import SI, US, DisplayUnits
from romdam.core.errors import ConfigError, ResultError, RomdamError
from romdam.core.files import replacing
from romdam.core.scene import Scene
from romdam.error.statement import opening_errors, sentences
from romdam.pipelines.automatic_spacing import automatic_joints
from romdam.pipelines.input_motions import records_of, usable
from romdam.pipelines.run import Clock, Stage, silent
from romdam.pipelines.suites.plan import read_records
from romdam.postprocess.record_measures import analysed
from romdam.postprocess.responses import intensity_of, response_of, responses
from romdam.results.dataset import write_dataset
from romdam.results.fields import open_result
from romdam.results.stored_run import FOLDER
from romdam.results.suite.hazard_table import read_hazard
from romdam.results.suite.report_data import DATA, read_report_data, report_data
from romdam.results.suite.rows import RunIndex
from romdam.results.suite.summary import SUMMARY, kept_results, open_summary
from romdam.scene.build import build_scene
from romdam.visual.report.document import A4, LETTER, write_document
from romdam.visual.report.one_run import RunSubject, run_report
from romdam.visual.report.page import page
from romdam.visual.report.parts import Report
from romdam.visual.report.sections import suite_report
from romdam.visual.report.subject import Subject, Topic

log = logging.getLogger(__name__)

_HAZARD_UNITS = {"m s-2": "m/s^2", "m s-1": "m/s"}  # as files and as quantities spell them
_BESIDE = {"outputs", "suite", "pipeline", "title", "study"}  # what changes neither scene nor records


@dataclass(frozen=True)
class ReportOptions:
    """The subject of a report of several runs.

    Attributes
    ----------
    response : of the curves, fragility, correlation and sensitivity; the suite's first if None
    intensity : measure that curves and fragility are a function of
    thresholds : of the fragilities, as text with a unit or SI numbers; round numbers from the data if empty
    hazard : table of the intensity's hazard, which makes annual frequencies of the fragilities
    """

    response: str | None = None
    intensity: str = "sa"
    thresholds: Sequence[str | float] = ()
    hazard: Path | None = None


def report_run(
    path: Path, system: DisplayUnits = SI, *, pdf: bool = False, show: Stage = silent
) -> list[Path]:
    """Write the report of one run beside its result, as <result>-report.html.

    Parameters
    ----------
    path : of the result
    system : units of the report
    pdf : whether the same is written as <result>-report.pdf too; with US customary units its paper is letter
    show : told of every stage

    Raises
    ------
    RomdamError
        where the file is no result, its joint laws are of a file that is gone, or the folder refuses a file.
    """
    clock, name = Clock(show), path.with_name(f"{path.stem}-report")
    subject = run_subject(path, system, report_command(path, system, pdf=pdf), clock)
    with clock.stage("report", "writing the report"):
        return write_report(run_report(subject), name, LETTER if system is US else A4, pdf=pdf)


def run_subject(path: Path, system: DisplayUnits, command: Sequence[str], clock: Clock) -> RunSubject:
    """Read a run for its reports, with a picture of its scene where that can be drawn.

    Parameters
    ----------
    path : of the result
    command : that asks for the report

    Raises
    ------
    RomdamError
        where the file is no result, or its joint laws are of a file that is gone.
    """
    with open_result(path) as result:
        attrs = result.dataset.attrs
        folder = path.parent / str(attrs[FOLDER]) if FOLDER in attrs else path.parent
        stated = json.loads(str(attrs["configuration"]))
        records = stated["records"] or [{"file": "motion given in Python", "components": {"x": 1}}]
        source = f"{path}: configuration"
        config = parse_config(stated | {"records": records}, source, folder=folder, si=True)
        with clock.stage("scene", "drawing the scene"):
            try:
                drawn = _picture(build_scene(config, folder, str(path)), system)
            except RomdamError as error:  # a mesh file that is gone, for example
                log.info("no picture of the scene: %s", error)
                drawn = None
        said = {str(kind): sentence for kind, sentence in sentences(attrs).items()}
        dataset, errors = result.dataset.load(), opening_errors(attrs)
        return RunSubject(dataset, config, errors, said, system, drawn, shlex.join(command))


def report_command(path: Path, system: DisplayUnits, *more: str, pdf: bool) -> list[str]:
    """The command that asks for a report of one run."""
    units = ["--units", "us"] if system is US else []
    return ["romdam", "report", path.name, *more, *units, *(["--pdf"] if pdf else [])]


def write_report(made: Report, name: Path, paper: tuple[float, float], *, pdf: bool) -> list[Path]:
    """Write a page, and a PDF where asked for, whole or not at all."""
    path = name.with_name(f"{name.name}.html")
    text = page(made)
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")
    return [path, *([write_document(made, name.with_name(f"{name.name}.pdf"), paper)] if pdf else [])]


def report(
    folder: str | Path,
    options: ReportOptions | None = None,
    job: Job | None = None,
    show: Stage = silent,
    *,
    pdf: bool = False,
) -> list[Path]:
    """Write `report.html` beside the summary of a suite, or of a plain job's records.

    Parameters
    ----------
    folder : that the runs were written to
    options : its subject
    job : their configuration, for the records' spectra and a picture of the scene; without it those
        that an earlier report left in the folder are shown, if there are any
    show : told of every stage
    pdf : whether `report.pdf` is written too

    Raises
    ------
    RomdamError
        where the folder holds no summary, for names that the suite does not have, thresholds that are no
        quantity, a configuration that is not the suite's, and where the folder refuses a file.
    """
    folder, options, clock = Path(folder), options or ReportOptions(), Clock(show)
    if not (folder / SUMMARY).is_file():
        raise ResultError(
            f"{folder}: holds no {SUMMARY}, so there is nothing to report; "
            "`romdam run CONFIG --out DIR` of several records makes it"
        )
    with open_summary(folder) as summary:
        topic = _topic(summary, options, folder)
        if job is not None:
            _same(job, summary, folder)
            with clock.stage("records", "reading records"):
                if job.config.pipeline == "suite":
                    motions = {r.name: r.motion for r in read_records(job) if r.motion is not None}
                else:
                    motions = {motion.name: motion for motion in usable(records_of(job))}
                duration = job.config.transient.duration
                cut = {name: analysed(motion, duration) for name, motion in motions.items()}
            with clock.stage("scene", "drawing the scene"):
                drawn = _picture(build_scene(job.config, job.folder, str(job.path)))
            with clock.stage("spectra", "computing spectra"):
                write_dataset(report_data(summary, cut, drawn), folder / DATA)
        data = read_report_data(summary, folder)
        picture = bytes(data.picture.values.tobytes()) if data is not None else b""
        with clock.stage("report", "writing the report"):
            subject = Subject(summary, topic, data, picture or None, _files(summary, folder))
            return write_report(suite_report(subject), folder / "report", A4, pdf=pdf)


def _files(summary: xr.Dataset, folder: Path) -> dict[RunIndex, list[tuple[str, str]]]:
    """Index of a run -> text and address, from the folder, of its result and figures."""
    results = {at: path for at, path in kept_results(summary, folder).items() if path.is_file()}
    figures: dict[Path, list[tuple[str, Path]]] = {}
    for inside in {path.parent for path in results.values()}:
        for path in sorted(inside.glob("*.png")):
            stem, _, name = path.stem.rpartition("-")
            figures.setdefault(inside / f"{stem}.nc", []).append((name.replace("_", " "), path))
    return {
        at: [
            (text, quote(path.relative_to(folder).as_posix()))
            for text, path in (("NetCDF", result), *figures.get(result, ()))
        ]
        for at, result in results.items()
    }


def _topic(summary: xr.Dataset, options: ReportOptions, folder: Path) -> Topic:
    """The options in SI, and the command that asks for them again."""
    command = ["romdam", "report", folder.name]
    if options.response:
        command += ["--response", options.response]
    if options.intensity != "sa":
        command += ["--intensity", options.intensity]
    thresholds = []
    response = options.response or next(iter(responses(summary)), "")
    for threshold in options.thresholds:
        units = str(response_of(summary, response).attrs.get("units", "1"))
        try:
            value = to_si(threshold, units)
        except ValueError as error:
            raise ResultError(f"threshold {threshold}: {error}") from None
        if value <= 0.0:
            raise ResultError(f"threshold {threshold}: must be above 0, as every response is")
        if isinstance(threshold, str) and units != "1" and not threshold.strip("+0123456789.eE- "):
            raise ResultError(f"threshold {threshold}: has no unit; write {threshold} {units}, for example")
        thresholds.append(value)
        command += ["--threshold", str(threshold)]
    hazard = None
    if options.hazard is not None:
        measured = intensity_of(summary, options.intensity)
        wanted = _HAZARD_UNITS.get(str(measured.attrs.get("units", "1")))
        if wanted is None:
            raise ResultError(
                f"--hazard: {options.intensity} is no acceleration or velocity, so no hazard is known of it; "
                "give --intensity sa, pga or pgv"
            )
        hazard = read_hazard(options.hazard, wanted)
        command += ["--hazard", str(options.hazard)]
    return Topic(options.response, options.intensity, tuple(thresholds), shlex.join(command), hazard)


def _same(job: Job, summary: xr.Dataset, folder: Path) -> None:
    """Refuse a configuration with another scene, model or records than the suite's."""
    stated = json.loads(str(summary.attrs["configuration"]))
    its = parse_config(stated, f"{folder / SUMMARY}: configuration", si=True)
    stated_spacing = {  # the distance that those of `spacing: auto` came to
        name: length
        for name in automatic_joints(job)
        if (joint := its.every_joint.get(name)) is not None
        and ((length := joint.spacing_of(name)) is None or isinstance(length, float))
    }
    if stated_spacing:
        job = with_spacing(job, stated_spacing)
    created, now = (config.model_dump(mode="json", exclude=_BESIDE) for config in (its, job.config))
    if now["model"]["modes"] == "auto":  # the summary states the number that it came to
        now["model"]["modes"] = created["model"]["modes"]
    other = [key for key in now if created[key] != now[key]]
    if other:
        raise ConfigError(
            f"{job.path}: is not the configuration of {folder / SUMMARY}, which has another "
            f"{', '.join(other)}; give the one that made it, or none"
        )


def _picture(scene: Scene, system: DisplayUnits = SI) -> bytes | None:
    """A PNG of the scene; None where this machine draws no 3-D pictures."""
    from romdam.visual.rendering import refuse_without_renderer
    from romdam.visual.scene_view import draw_scene

    try:
        refuse_without_renderer()
    except ResultError:
        return None
    with tempfile.TemporaryDirectory() as temporary:
        return draw_scene(scene, Path(temporary) / "scene.png", system=system).read_bytes()
