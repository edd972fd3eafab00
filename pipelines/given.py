"""What a job is run with from Python: the records of its configuration, or ground motions in their place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from romdam.config.load import Job, Source, load_config
from romdam.config.sections.motions.records import LONGEST_DT, SHORTEST_DT
from romdam.core.errors import RecordError, shown
from romdam.core.motion import GroundMotion
from romdam.records.plausible import too_strong
from romdam.records.record_set import check_names, load_motions

Motions = GroundMotion | Sequence[GroundMotion]


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
    given = checked(motions)
    if isinstance(source, Mapping):
        entry = {"file": "given in Python", "components": {"x": 1}}  # stands for a motion in checks
        source = {**source, "records": [entry | {"name": f"motion{k}"} for k in range(len(given))]}
    job = load_config(source)
    return replace(job, config=job.config.model_copy(update={"records": ()})), given


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
    found = [_checked(motion, f"motions[{k}]") for k, motion in enumerate(several)]
    check_names(found)
    return found


def _checked(motion: GroundMotion, place: str) -> GroundMotion:
    if not isinstance(motion, GroundMotion):
        raise RecordError(
            f"{place}: expected a romdam.GroundMotion, got {shown(motion)}; from_arrays makes one"
        )
    again = GroundMotion.from_arrays(motion.name, motion.acc, motion.dt, place=place)
    if not SHORTEST_DT <= again.dt <= LONGEST_DT:
        raise RecordError(
            f"{place}, {motion.name}: dt must be from {SHORTEST_DT:g} to {LONGEST_DT:g} s, got {again.dt:g} s"
        )
    doubts = too_strong(again.acc, f"{place}, {motion.name}")
    about = {"place": place, **motion.provenance, **again.provenance_of_arrays}
    return replace(again, provenance=about, warnings=tuple(dict.fromkeys((*motion.warnings, *doubts))))
