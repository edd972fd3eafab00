"""The runs of a suite: what they are, which of them are done, and the tasks that make the others.

A run is a record at one scale on one sample of the parameters. Parameters of joints and damping leave the
blocks as they are, so that one basis serves all samples; it needs the gaps' tangential directions if any
sample has shear. Structural parameters (materials, levels of water) change blocks or loads. The basis then
answers the loads at the extremes of all samples too (`Samples.also`), and the matrices of each sample are
taken over it.

Every run has a key, the digest of all that its numbers depend on. Rows of the journal with the key of a run
are not made again. Runs of one time step are integrated together, in tasks.

Everything that can be wrong with a suite is found here, before anything is reduced or run.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import xarray as xr

from romdam.config.load import Job, located
from romdam.config.parameters import VariedKey, vary
from romdam.config.sections.suite import MOST_RUNS, KeepConfig, SuiteConfig
from romdam.core.arrays import Floats
from romdam.core.counted import Counted
from romdam.core.errors import ConfigError, Faults, RecordError
from romdam.core.fingerprint import code_digest, fingerprint
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.scene_digest import scene_content
from romdam.error.statement import ErrorStatement
from romdam.fem.gaps import gap_law
from romdam.pipelines.floor_spectra import refuse_fast_oscillators
from romdam.pipelines.job_warnings import log_scene_warnings, log_warnings
from romdam.pipelines.moving_supports import refuse_drifting, scene_of
from romdam.pipelines.run import Clock, Progress, choose_mesh_and_modes
from romdam.pipelines.sizes import refuse_lengths
from romdam.pipelines.suites.kept import KeptResults
from romdam.pipelines.suites.sizes import history_bytes, refuse_many
from romdam.pipelines.suites.tasks import Run, Samples, Suite, Task, sample_content
from romdam.postprocess.responses import PARAMETER
from romdam.records.components import check_components
from romdam.records.record_set import Loaded, usable_apart
from romdam.results.suite.design import (
    design_dataset,
    no_factors,
    samples_dataset,
    scale_count,
    scale_factors,
    some_samples,
    varied_keys,
)
from romdam.results.suite.hazard_table import suite_hazard
from romdam.results.suite.journal import JOURNAL, append_rows, read_rows
from romdam.results.suite.record_weights import record_weights
from romdam.results.suite.rows import SuiteRow, source_of_rows
from romdam.results.suite.summary import SuiteRecord, summary_dataset, write_summary
from romdam.scene.build import build_scene
from romdam.scene.varied import part_factors, vary_scene

log = logging.getLogger(__name__)

LAYOUT = "romdam-suite-2"
TASK_BYTES = 300e6  # of histories in memory, for the runs that are integrated together
MOST_TOGETHER = 32

# what samples may vary of a joint: it is in the content of each sample, and so not in the model's key
_OF_SAMPLES = {"gap", "K_n", "K_nz", "K_s", "mu", "viscosity", "grout", "laws"}


@dataclass(frozen=True)
class Plan:
    """A suite before anything is reduced.

    Attributes
    ----------
    job : the configuration, with what its suite implies for the single runs
    scene : with the joints of a sample with shear, if there is one: its basis serves all samples
    records : all of them, in order
    samples, design : what the samples vary, and their values; the same as a Dataset
    runs : of the records that can be used, in the order of the design
    distinct : how many samples of the whole design differ, where `samples` are some of them; None where they
        are all
    considered : records of entries with a target, those that were passed over too
    mesh_statement : of the error of the mesh that `transient.accuracy.total` has chosen
    """

    job: Job
    scene: Scene
    records: list[SuiteRecord]
    samples: Samples
    design: xr.Dataset
    runs: list[Run]
    distinct: int | None = None
    considered: tuple[Loaded, ...] = ()
    mesh_statement: ErrorStatement | None = None

    @cached_property
    def first(self) -> dict[str, Run]:
        """Key -> run; of several runs of one content the first."""
        return {run.key: run for run in reversed(self.runs)}

    @property
    def count(self) -> int:
        """Count the runs that differ, of all samples of the design."""
        if self.distinct is None:
            return len(self.first)
        return self.distinct * sum(
            len(record.factors) for record in self.records if record.motion is not None
        )

    @property
    def motions(self) -> dict[str, GroundMotion]:
        """Record -> its motion, of those that can be used."""
        return {record.name: record.motion for record in self.records if record.motion is not None}


def make_plan(job: Job, clock: Clock, most: int | None = None) -> Plan:
    """Read everything that a suite needs, and find what is wrong with it.

    Parameters
    ----------
    most : samples that are built, those with the least and the largest values first; all if not given

    Raises
    ------
    RomdamError
        for bad input.
    """
    config, suite = job.config, _suite(job)
    if config.model.order == "full":
        raise ConfigError(
            f"{job.path}: model.order: a suite needs a reduced model, got full; set order: reduced, "
            "or use pipeline: run"
        )
    # what the suite implies for the single runs
    outputs = config.outputs
    if isinstance(suite.keep, KeepConfig):
        outputs = outputs.model_copy(update={"output_interval": suite.keep.output_interval})
    implied = {"pipeline": "suite", "suite": suite, "outputs": outputs}
    job = replace(job, config=config.model_copy(update=implied))
    faults = Faults()
    with clock.stage("design", "reading the samples"), faults.gathered():
        places = varied_keys(job, suite)
        design = design_dataset(job, suite, places)
        if suite.hazard is not None:
            suite_hazard(suite.hazard, job.folder, str(job.path))
    with clock.stage("records", "reading records"), faults.gathered():
        considered: list[Loaded] = []
        records = read_records(job, considered.append)
        if suite.weights is not None:
            record_weights(suite.weights, [record.name for record in records], str(job.path))
    if faults.errors:  # what is wrong with the scene is told too
        with faults.gathered():
            scene_of(job)
    faults.raise_together()
    scales, sample_count = scale_count(suite), design.sizes["sample"]
    count = len(records) * scales * sample_count
    if count > MOST_RUNS:
        raise ConfigError(
            f"{job.path}: suite: {len(records)} records at {scales} scales with {sample_count} samples are "
            f"{count} runs, limit {MOST_RUNS}; split it into several suites"
        )
    motions = [record.motion for record in records if record.motion is not None]
    log_warnings(job, ())  # of the records there may be hundreds
    job, choice = choose_mesh_and_modes(job, motions, clock)
    distinct = None
    if most is not None and sample_count > most:
        design, distinct = some_samples(design, most)
    columns = {name: design[PARAMETER + name].values for name in places}
    samples = _samples(places, columns, design.sizes["sample"])

    with clock.stage("scene", "building the scene"):
        scene = scene_of(job)
        job = log_scene_warnings(scene, job)
        refuse_many(job, scene, len(motions) * scales * sample_count)
        _refuse_kept_stress(job, scene, samples)
        if samples.structural:
            samples = replace(samples, also=extreme_scenes(job, samples, columns))
    with clock.stage("samples", Counted(len(samples.values), "samples")) as progress:
        samples, scene = built_samples(job, scene, samples, progress)
    runs = _runs(records, _model_key(job, scene, samples.also or ()), samples.contents)

    # a summary without runs, written to nowhere: a name that it cannot hold is found before the first run
    unmeasured = [replace(record, motion=None) for record in records]
    with TemporaryDirectory() as folder:
        try:
            write_summary(summary_dataset(job, scene, design.isel(sample=[0]), unmeasured, {}), Path(folder))
        except (ValueError, TypeError) as error:
            raise ConfigError(
                f"{job.path}: the title or a name cannot be written to a NetCDF file ({error}); use "
                "plain letters"
            ) from error
    statement = None if choice is None else choice.statement
    return Plan(job, scene, records, samples, design, runs, distinct, tuple(considered), statement)


def plan_of_samples(plan: Plan, places: dict[str, VariedKey], columns: Mapping[str, Floats]) -> Plan:
    """The plan of the same records and scales with other samples; nothing is read again.

    Its scene, of which the basis is made, stays that of `plan` where that has the directions of the joints
    that the samples need; and the basis answers the loads of `plan`, where these reach those of the samples.

    Parameters
    ----------
    places, columns : of what varies, and (samples,) its values, SI

    Raises
    ------
    ConfigError
        as `built_samples` and `extreme_scenes`.
    """
    design = samples_dataset(places, columns)
    samples = replace(_samples(places, columns, design.sizes["sample"]), also=plan.samples.also or ())
    if not _reaches(plan.job, plan.samples, samples):
        samples = replace(samples, also=extreme_scenes(plan.job, samples, columns))
    samples, scene = built_samples(plan.job, plan.scene, samples, lambda done, total: None)
    if gap_law(scene).directions == gap_law(plan.scene).directions:
        scene = plan.scene
    runs = _runs(plan.records, "", samples.contents)  # nothing is kept by their keys
    return replace(plan, scene=scene, samples=samples, design=design, runs=runs, distinct=None)


def _samples(places: dict[str, VariedKey], columns: Mapping[str, Floats], count: int) -> Samples:
    """Samples of so many rows of columns of values; without contents yet."""
    return Samples(places, tuple({n: float(v[i]) for n, v in columns.items()} for i in range(count)))


def _reaches(job: Job, samples: Samples, others: Samples) -> bool:
    """Tell whether a basis for the extremes of some samples answers the loads of others."""
    ranges = {place: values for name in samples.structural for place, values in samples.ranges(name).items()}
    return all(
        place in ranges and ranges[place][0] <= least and largest <= ranges[place][1]
        for name in others.structural
        if _loads_follow(job, others.places[name])
        for place, (least, largest) in others.ranges(name).items()
    )


def _loads_follow(job: Job, key: VariedKey) -> bool:
    """Tell whether loads change with what is varied: the modulus scales those by temperature."""
    return key.is_load or (key.keys == ("E",) and bool(job.config.loads.temperature))


def built_samples(job: Job, scene: Scene, samples: Samples, progress: Progress) -> tuple[Samples, Scene]:
    """Build every sample: the samples with their contents, and the scene of which the basis is made.

    That scene has the joints of the first sample with shear, if there is one: its basis serves all samples.

    Raises
    ------
    ConfigError
        for values that do not fit together, and parts that do not change as a whole.
    """
    basis, contents = None if samples.places else scene, list[str]()
    count = len(samples.values)
    for number in range(count):
        sample_scene, varied = samples.scene(job, scene, number)
        if varied.structure:
            part_factors(scene, sample_scene, str(job.path))
        if basis is None and gap_law(sample_scene).directions == 3:
            basis = vary_scene(sample_scene, job.config, str(job.path)) if varied.structure else sample_scene
        contents.append(sample_content(sample_scene, varied))
        progress(number + 1, count)
    return replace(samples, contents=tuple(contents)), basis or scene


def _refuse_kept_stress(job: Job, scene: Scene, samples: Samples) -> None:
    """Refuse kept results whose stress file is of the state at rest of another sample."""
    suite = _suite(job)
    if samples.places and suite.keep != "peaks" and scene.stress is not None and scene.sustained_ratios:
        raise ConfigError(
            f"{job.path}: suite.keep: with materials.<name>.E_dynamic the stress of kept results goes with "
            f"one state at rest, and {', '.join(samples.places)} may change it; set keep: peaks, or leave "
            "outputs.stress out"
        )


def extreme_scenes(job: Job, samples: Samples, columns: Mapping[str, Floats]) -> tuple[Scene, ...]:
    """The scenes of the samples with the lowest and the highest level and temperature, built anew.

    What a run would refuse is refused here, and the basis answers the loads of all these scenes. Where a
    modulus scales loads by temperature, that of its largest value is among them.

    Raises
    ------
    ConfigError
        for what a run with the sample would refuse, and for results that would be kept.
    """
    suite, source = _suite(job), str(job.path)
    if suite.keep != "peaks":
        raise ConfigError(
            f"{source}: suite.keep: a kept result goes with the basis of the suite, which is not that of "
            f"other materials and levels ({', '.join(samples.structural)}); set keep: peaks, or run those "
            "samples alone"
        )
    numbers = list[int]()
    for name in samples.structural:
        if samples.places[name].is_load:
            numbers.append(int(columns[name].argmin()))
        if _loads_follow(job, samples.places[name]):
            numbers.append(int(columns[name].argmax()))
    scenes = list[Scene]()
    for number in dict.fromkeys(numbers):
        varied = vary(job.config, samples.places, samples.values[number], source)
        values = ", ".join(f"{name} = {samples.values[number][name]:g}" for name in samples.structural)
        try:
            scenes.append(build_scene(varied.config, job.folder, source))
        except ConfigError as error:
            raise ConfigError(f"{error} (suite.parameters: sample {number}, {values})") from None
    return tuple(scenes)


def _suite(job: Job) -> SuiteConfig:
    return job.config.suite or SuiteConfig()


def read_records(job: Job, tell: Callable[[Loaded], None] | None = None) -> list[SuiteRecord]:
    """Every record of a suite with its scale factors, those that cannot be used too.

    `tell` is told of records as `load_records` tells of them.

    Raises
    ------
    RecordError
        where no record can be used.
    """
    suite = _suite(job)
    records = []
    for loaded in usable_apart(job.config.records, job.folder, tell):
        factors, message = no_factors(suite), located(job, loaded.error)
        if loaded.motion is not None:
            factors, message = scale_factors(suite, loaded.motion)
        if loaded.motion is not None and not message:  # what a run, or the summary, would find
            try:
                refuse_lengths(job, [loaded.motion])
                refuse_fast_oscillators(job, [loaded.motion])
                refuse_drifting(job, [loaded.motion])
            except (ConfigError, RecordError) as error:
                message = str(error)
        if loaded.motion is not None and not message:
            try:
                check_components(loaded.motion.acc, suite.of)
            except RecordError as error:
                message = f"{loaded.motion.name}: suite.{error}"
        records.append(SuiteRecord(loaded.name, None if message else loaded.motion, message, factors))
    if all(record.motion is None for record in records):
        raise RecordError("\n".join(f"{record.name}: {record.message}" for record in records))
    return records


def _runs(records: Sequence[SuiteRecord], about: str, samples: Sequence[str]) -> list[Run]:
    """Every record that can be used at every scale on every sample, with its key.

    Parameters
    ----------
    about : key of the model, see `_model_key`
    samples : contents of the samples
    """
    runs = []
    for i, record in enumerate(records):
        if record.motion is None:
            continue
        motion = record.motion
        key = fingerprint((about, motion.acc, motion.dt, str(motion.provenance.get("resampling"))))
        runs += [
            Run((i, k, s), record.name, float(factor), fingerprint((key, float(factor), sample)))
            for k, factor in enumerate(record.factors)
            for s, sample in enumerate(samples)
        ]
    return runs


def _model_key(job: Job, scene: Scene, also: Sequence[Scene] = ()) -> str:
    """Digest of everything that runs depend on but the records and what the samples vary.

    The directions of the gaps are in it, because the numbers of a sample without friction depend on whether
    the basis has the tangential ones.
    """
    config, suite = job.config, job.config.suite
    parts = {"nodes", "floor_spectra", "output_interval", "stress", "error_estimate"}
    asked = {
        "model": config.model.model_dump_json(),
        "transient": config.transient.model_dump_json(),
        "initial": config.loads.begins,
        "outputs": config.outputs.model_dump_json(include=parts),
        "keep": "" if suite is None else str(suite.keep),
        "directions": gap_law(scene).directions,
    }
    more = (basis_content(scene, also),) if also else ()
    return fingerprint((LAYOUT, code_digest(), asked, *scene_content(scene, _OF_SAMPLES), *more))


def basis_content(scene: Scene, also: Sequence[Scene]) -> tuple[object, ...]:
    """What a basis of one scene depends on beside it: the directions of the gaps, other loads it answers."""
    return gap_law(scene).directions, [scene_content(other, _OF_SAMPLES) for other in also]


def finished(suite: Suite, folder: Path, plan: Plan) -> dict[str, SuiteRow]:
    """Key -> row of the runs that are done: nothing they depend on has changed, and what they keep is there.

    Results that are kept get the names and labels of this design.

    Raises
    ------
    ResultError
        where the folder or the disk refuses a file.
    """
    known = read_rows(folder / JOURNAL)
    done = {key: known[key] for key in plan.first if key in known}
    if len(done) < len(plan.first):
        now = source_of_rows()  # the numbers of one suite are those of one code
        for source, count in Counter(row.source for row in known.values() if row.source != now).items():
            log.warning(
                "%s: %d rows are of %s, this is %s; their runs are made again, for a suite has the numbers "
                "of one code (to go on with theirs, install %s)",
                folder / JOURNAL, count, source, now, source,
            )  # fmt: skip
    if not suite.keeps_results:
        return done
    results, rows = KeptResults(suite, plan.motions), dict[str, SuiteRow]()
    for key, row in done.items():
        placed = results.placed(plan.first[key], row)
        if placed is None:
            continue
        rows[key] = placed
        if placed is not row:
            append_rows(folder / JOURNAL, [placed])
            results.remove_former(row, placed)
    return rows


def tasks_of(suite: Suite, plan: Plan, done: dict[str, SuiteRow]) -> list[Task]:
    """The tasks that are still to be made: runs that are integrated together, the longest first.

    Those of one task have one time step and like lengths. Which run goes with which changes no bit of it.
    """
    motions, most = plan.motions, suite.config.batch or MOST_TOGETHER
    groups: list[list[Run]] = []
    room = 0.0  # bytes of histories that the last group may still take

    def order(run: Run) -> tuple[float, int, int, str, int]:
        motion = motions[run.record]
        return (-motion.dt, run.index[2], -motion.acc.shape[1], run.record, run.index[1])

    missing = [run for key, run in plan.first.items() if key not in done]
    for run in sorted(missing, key=order):
        motion = motions[run.record]
        size = history_bytes(suite.job, suite.model.system, motion)
        fresh = not groups or motions[groups[-1][0].record].dt != motion.dt
        if fresh or len(groups[-1]) >= most or (suite.config.batch is None and size > room):
            groups.append([])
            room = TASK_BYTES
        groups[-1].append(run)
        room -= size
    groups.sort(key=lambda group: -sum(motions[run.record].acc.shape[1] for run in group))
    return [Task(tuple(group), {run.record: motions[run.record] for run in group}) for group in groups]
