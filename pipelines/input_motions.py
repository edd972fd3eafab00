"""Input of a job from Python: the records of its configuration, or ground motions in their place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from romdam.config.load import Job, Source, located
from romdam.config.sections.motions.records import LONGEST_DT, SHORTEST_DT
from romdam.core.errors import RecordError, quote
from romdam.core.motion import GroundMotion
from romdam.pipelines.jobs import load_config
from romdam.records.plausible import too_strong
from romdam.records.processing.offset import doubt_drift
from romdam.records.record_set import Loaded, check_names, load_motions, load_records, write_choice

Motions = GroundMotion | Sequence[GroundMotion]
Read = Mapping[str, GroundMotion | str]  # record -> its motion, or why it cannot be used, in their order


def read_motions(job: Source, folder: str | Path | None = None) -> list[GroundMotion]:
    """Read the records of a job: corrected, turned to the model's axes and scaled, as a run takes them.

    Parameters
    ----------
    job, folder : as `romdam.load_config` takes them

    Raises
    ------
    ConfigError
        for a wrong configuration.
    RecordError
        for a record that cannot be used.
    """
    job = load_config(job, folder)
    return load_motions(job.config.records, job.folder)


def records_of(job: Job, folder: Path | None = None) -> Read:
    """Read the records of a job, in their order: the motion, or why it cannot be used.

    Parameters
    ----------
    folder : of the results, where what was held against a target is written; None writes nothing

    Raises
    ------
    RecordError
        where no record can be read, or two share a name.
    """
    considered: list[Loaded] = []
    loaded = list(load_records(job.config.records, job.folder, considered.append))
    motions = [record.motion for record in loaded if record.motion is not None]
    if not motions:
        failed = "\n".join(located(job, record.error) for record in loaded)
        raise RecordError(failed or "records: none passes `keep`")
    check_names(motions)
    taken, read = {motion.name for motion in motions}, dict[str, GroundMotion | str]()
    for record in loaded:
        if record.motion is not None:
            read[record.motion.name] = record.motion
            continue
        names = (record.name, *(f"{record.name} ({number})" for number in range(2, len(loaded) + 2)))
        read[next(name for name in names if name not in taken and name not in read)] = located(
            job, record.error
        )
    if folder is not None:
        write_choice(considered, folder)
    return read


def usable(read: Read) -> list[GroundMotion]:
    """The motions among records that were read."""
    return [motion for motion in read.values() if isinstance(motion, GroundMotion)]


def job_and_motions(source: Source, motions: Motions | None) -> tuple[Job, list[GroundMotion] | None]:
    """The job, and the motions that it is run with; None where they are its own records.

    A job that is run with motions has no records any more: its results do not name what was not run.

    Raises
    ------
    RecordError
        for motions that nothing can be run with, naming which.
    """
    if motions is None:
        return load_config(source), None
    checked_motions = checked(motions)
    if isinstance(source, Mapping):
        entry = {"file": "given in Python", "components": {"x": 1}}  # stands for a motion in checks
        source = {**source, "records": [entry | {"name": f"motion{k}"} for k in range(len(checked_motions))]}
    job = load_config(source)
    return replace(job, config=job.config.model_copy(update={"records": ()})), checked_motions


def checked(motions: Motions) -> list[GroundMotion]:
    """Motions with an account of where they are from, refused where nothing can be run with them.

    Raises
    ------
    RecordError
        naming which.
    """
    several = [motions] if isinstance(motions, GroundMotion) else list(motions)
    if not several:
        raise RecordError("motions: there is none; give one or more, or leave them out to run `records`")
    complete = []
    for k, motion in enumerate(several):
        location = f"motions[{k}]"
        if not isinstance(motion, GroundMotion):
            raise RecordError(
                f"{location}: expected a romdam.GroundMotion, got {quote(motion)}; from_arrays makes one"
            )
        again = GroundMotion.from_arrays(motion.name, motion.acc, motion.dt, place=location)
        if not SHORTEST_DT <= again.dt <= LONGEST_DT:
            raise RecordError(
                f"{location}, {motion.name}: dt must be from {SHORTEST_DT:g} to {LONGEST_DT:g} s, got "
                f"{again.dt:g} s"
            )
        remarks = too_strong(again.acc, f"{location}, {motion.name}")
        if drifts := doubt_drift(again.acc, again.dt):
            remarks += (drifts,)
        warnings = tuple(dict.fromkeys((*motion.warnings, *remarks)))
        provenance = {"place": location, **motion.provenance, **again.provenance_of_arrays}
        complete.append(replace(again, provenance=provenance, warnings=warnings))
    check_names(complete)
    return complete
