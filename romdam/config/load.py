"""YAML file -> Config, with errors that name the file and the key."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pydantic import ValidationError

from romdam.config.explain import Location, explain
from romdam.config.renamed import with_present_names
from romdam.config.sections.job import Config
from romdam.config.yaml_text import line_of, read_yaml
from romdam.core.errors import ConfigError, RecordError


@dataclass(frozen=True)
class Job:
    """A configuration and where it came from; relative paths in it start at `path`'s folder.

    Attributes
    ----------
    config : the validated configuration
    path : the YAML file
    renamed : a warning for each key or word that stands in it by a name of before
    """

    config: Config
    path: Path
    renamed: tuple[str, ...] = ()

    @property
    def folder(self) -> Path:
        """The folder that relative paths in the configuration start from."""
        return self.path.parent

    @property
    def digest(self) -> str:
        """SHA-256 of the validated configuration, independent of spelling, order and comments."""
        canonical = json.dumps(self.config.model_dump(mode="json"), sort_keys=True)
        return hashlib.sha256(canonical.encode()).hexdigest()


def located(job: Job, error: Exception | None) -> str:
    """The message of a record's error, with the file and line of the key that is to be mended, if one is."""
    key = error.key if isinstance(error, RecordError) and job.path.is_file() else ""
    if not key:
        return str(error or "")
    parts = (int(part) if part.isdigit() else part for part in re.findall(r"[^.\[\]]+", key))
    return f"{job.path}:{line_of(job.path, tuple(parts))}: {error}"


def load_config(path: str | Path) -> Job:
    """Read and validate a YAML configuration.

    Raises
    ------
    ConfigError
        for a file that cannot be read or is not YAML, and for unknown, missing or wrong keys.
    """
    path = Path(path)
    raw, renamed = with_present_names(read_yaml(path), str(path))
    return Job(parse_config(raw, str(path), partial(line_of, path)), path, renamed)


def parse_config(raw: object, source: str, line: Callable[[Location], int] | None = None) -> Config:
    """Validate a mapping, keys by their names of before too.

    Parameters
    ----------
    source : names it in errors
    line : number of the line of a key, where `source` is a file

    Raises
    ------
    ConfigError
        for unknown, missing or wrong keys.
    """
    if not isinstance(raw, dict):
        raise ConfigError(f"{source}: expected a mapping of keys at the top level, got {type(raw).__name__}")
    raw, _ = with_present_names(raw, source)
    try:
        return Config.model_validate(raw, context={"folder": Path(source).parent})
    except ValidationError as error:
        raise ConfigError(explain(error, source, Config, line)) from None
