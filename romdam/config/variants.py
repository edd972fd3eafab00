"""The jobs that the variants of a comparison are: its file with some values replaced."""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

from romdam.config.load import Job, parse_config
from romdam.config.renamed import with_present_names
from romdam.config.sections.comparison import ComparisonConfig
from romdam.config.yaml_text import read_yaml
from romdam.core.errors import ConfigError, quote


def comparison_of(job: Job) -> ComparisonConfig:
    """The `comparison:` of a job.

    Raises
    ------
    ConfigError
        where it has none.
    """
    if job.config.comparison is None:
        raise ConfigError(f"{job.path}: comparison is missing; name its variants: {{gaps: {{}}, ...}}")
    return job.config.comparison


def variant_jobs(job: Job) -> dict[str, Job]:
    """Name -> job of every variant, in the order of the file.

    Raises
    ------
    ConfigError
        for a path that leads nowhere, and for what makes no valid job.
    """
    return {
        name: changed_job(job, changes, ("comparison", "variants", name), left_out=("comparison", "pipeline"))
        for name, changes in comparison_of(job).variants.items()
    }


def changed_job(
    job: Job, changes: Mapping[str, Any], stands_at: tuple[str, ...], *, left_out: Collection[str] = ()
) -> Job:
    """The job with values put where dotted paths lead.

    Parameters
    ----------
    changes : path -> value
    stands_at : keys of the file under which the changes stand, for messages
    left_out : sections that the changed job does not have

    Raises
    ------
    ConfigError
        for a path that leads nowhere, and for what makes no valid job.
    """
    mapping = read_yaml(job.file) if job.given is None else job.given
    raw, _ = with_present_names(mapping, str(job.path))
    assert isinstance(raw, dict)  # it was loaded before
    source = f"{job.path}: {'.'.join(stands_at)}"
    changed = copy.deepcopy({key: value for key, value in raw.items() if key not in left_out})
    for path, value in changes.items():
        _put(changed, path, value, source)
    config = parse_config(changed, source, folder=job.folder)
    given = None if job.given is None else changed
    places = {path: (*stands_at, path) for path in changes}
    return replace(job, config=config, renamed=(), given=given, replaced=places, scene_warnings=())


def _put(raw: Any, path: str, value: Any, source: str) -> None:
    """Put a value where a dotted path leads, through sections that are made and lists by number."""
    *sections, last = path.split(".")
    target = raw
    for key in sections:
        target = target.setdefault(key, {}) if isinstance(target, dict) else _entry(target, key, path, source)
    if isinstance(target, dict):
        target[last] = value
    else:
        _entry(target, last, path, source)
        target[int(last)] = value


def _entry(target: Any, key: str, path: str, source: str) -> Any:
    size = len(target) if isinstance(target, list) else 0
    if not (key.isdecimal() and int(key) < size):
        what = f"a list of {size}, counted from 0" if isinstance(target, list) else "no section"
        raise ConfigError(f"{source}.{path}: {quote(key)} leads nowhere, it would stand in {what}")
    return target[int(key)]
