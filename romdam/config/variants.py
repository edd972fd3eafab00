"""The jobs that the variants of a comparison are: its file with some values replaced."""

from __future__ import annotations

import copy
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
    mapping = read_yaml(job.file) if job.given is None else job.given
    raw, _ = with_present_names(mapping, str(job.path))
    assert isinstance(raw, dict)  # it was loaded before
    whole = {key: value for key, value in raw.items() if key not in ("comparison", "pipeline")}
    jobs = {}
    for name, changes in comparison_of(job).variants.items():
        source = f"{job.path}: comparison.variants.{name}"
        changed = copy.deepcopy(whole)
        for path, value in changes.items():
            _put(changed, path, value, source)
        mapping = None if job.given is None else changed
        config = parse_config(changed, source, folder=job.folder)
        places = {path: ("comparison", "variants", name, path) for path in changes}
        jobs[name] = replace(
            job, config=config, renamed=(), given=mapping, replaced=places, scene_warnings=()
        )
    return jobs


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
