"""A job as every command takes it: with the bodies, the joints and the blocks that it names in general."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from romdam.config.load import Job, Source, naming_lines, with_found
from romdam.config.load import load_config as read_config
from romdam.core.errors import ConfigError
from romdam.scene.found import Found, named_bodies


def load_config(source: Source, folder: str | Path | None = None) -> Job:
    """Read and validate a configuration, and look up in its meshes what it says by "all that is there".

    Parameters
    ----------
    source : a YAML file; a mapping with the keys of one, numbers and texts as there; a `Config`; a `Job`
        stays as it is
    folder : that relative paths in a mapping or a `Config` start from, the current one if not given; those
        in a file start from the file's own

    Raises
    ------
    ConfigError
        for a file that cannot be read or is not YAML, for unknown, missing or wrong keys, a suite that varies
        what cannot be varied, and `joints.touching` where nothing touches.
    MeshError
        for mesh files in which bodies or blocks that touch are to be looked up.
    """
    return looked_up(read_config(source, folder))


@naming_lines
def looked_up(job: Job) -> Job:
    """The job with the names of bodies, of joints between all that touches, and of blocks for patterns.

    Raises
    ------
    ConfigError, MeshError
        as `load_config`.
    """
    if not job.config.unfound:
        return job
    source = str(job.path)
    every = named_bodies(job.config, job.folder, source)

    def bodies(raw: dict[str, Any]) -> None:
        for of_section in every:
            raw["blocks"][of_section.section]["mesh"]["bodies"] = of_section.names

    try:
        job = with_found(job, bodies) if every else job
        return job if not job.config.unfound else with_found(job, Found(job.config, job.folder, source).fill)
    except ConfigError as error:
        for of_section in every:
            error.args = (of_section.explained(str(error)), *error.args[1:])
        raise
