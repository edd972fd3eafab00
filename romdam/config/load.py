"""A YAML file, a mapping or a Config -> Job, with errors that name the place and the key."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial, wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from pydantic import ValidationError

from romdam.config.explain import Location, explain, key_at
from romdam.config.job import Config
from romdam.config.parameters import refuse_unvaried
from romdam.config.renamed import with_present_names
from romdam.config.yaml_text import line_of, plain, read_yaml, write_yaml
from romdam.core.errors import ConfigError, RecordError, RomdamError, quote
from romdam.core.html.card import card

Params = ParamSpec("Params")
Returned = TypeVar("Returned")
MADE = "the configuration"  # names in messages what comes from no file


def _here() -> Path:
    """The current folder; that of a process whose folder was removed has no name."""
    try:
        return Path.cwd()
    except FileNotFoundError:
        return Path()


@dataclass(frozen=True)
class Job:
    """A configuration and where it came from.

    Attributes
    ----------
    config : the validated configuration
    path : the YAML file, or what messages call a configuration that was made in Python
    renamed : a warning for each key or word that stands in it by a name of before
    given : the mapping that it was made of; None where `path` is a file
    base : folder that relative paths start from, where it is not that of `path`
    replaced : dotted keys whose values stand elsewhere in the file -> where, of the variants of a comparison
    scene_warnings : what its scene, once that is built, may hardly be meant to have
    start : the current folder when the job was made; paths stay as they were typed while it is that
    """

    config: Config
    path: Path
    renamed: tuple[str, ...] = ()
    given: Mapping[str, Any] | None = field(default=None, repr=False)
    base: Path | None = None
    replaced: Mapping[str, Location] = field(default_factory=dict, repr=False)
    scene_warnings: tuple[str, ...] = ()
    start: Path = field(default_factory=_here, repr=False)

    @property
    def folder(self) -> Path:
        """The folder that relative paths in the configuration start from."""
        return self._now(self.path.parent if self.base is None else self.base)

    @property
    def file(self) -> Path:
        """The YAML file, to be read; `path` is its name in messages."""
        return self._now(self.path)

    def _now(self, typed: Path) -> Path:
        """A path as it leads where it did when the job was made, as typed where that still does."""
        return typed if _here() == self.start else self.start / typed

    @property
    def stem(self) -> str:
        """Stem of the names of this job's files, where they have no other name."""
        return self.path.stem if self.given is None else "configuration"

    @property
    def digest(self) -> str:
        """SHA-256 of the validated configuration, independent of spelling, order and comments."""
        canonical = json.dumps(self.config.model_dump(mode="json"), sort_keys=True)
        return hashlib.sha256(canonical.encode()).hexdigest()

    def to_dict(self) -> dict[str, Any]:
        """The given keys in SI, as plain values; `romdam.load_config` makes the same job of them."""
        return self.config.model_dump(mode="json", exclude_unset=True)

    def to_yaml(self) -> str:
        """`to_dict` as the text of a YAML file; relative paths in it start from `folder`."""
        return write_yaml(self.to_dict())

    def __repr__(self) -> str:
        blocks, joints = len(self.config.block_names), len(self.config.every_joint)
        return f"Job({str(self.path)!r}): {blocks} blocks, {joints} joints, SHA-256 {self.digest[:12]}"

    def _repr_html_(self) -> str:
        config = self.config
        model, what = config.model, "full order"
        if model.order == "reduced":
            what = f"cut off at {model.cutoff:g} Hz" if model.cutoff else f"{model.modes} modes a block"
        rows = {
            "blocks": ", ".join(config.block_names),
            "joints": ", ".join(config.every_joint) or "none",
            "records": ", ".join(
                str(record.name or record.file or record.files or record.suite or "components")
                for record in config.records
            ),
            "model": what,
            "paths start from": str(self.folder.absolute()),
        }
        return card(config.title or self.stem, f"Job, {self.path}, SHA-256 {self.digest[:12]}", rows)


Source = str | Path | Mapping[str, Any] | Config | Job


def located(job: Job, error: Exception | None) -> str:
    """The message of a record's error, with the file and line of the key that is to be mended, if one is."""
    key = error.key if isinstance(error, RecordError) and job.file.is_file() else ""
    if not key:
        return str(error or "")
    return f"{job.path}:{line_of(job.file, key_at(key)[0])}: {error}"


def naming_lines(function: Callable[Params, Returned]) -> Callable[Params, Returned]:
    """Wrap a function of a job, its first argument: errors name the line of a key of the job's file."""

    @wraps(function)
    def wrapped(*args: Params.args, **kwargs: Params.kwargs) -> Returned:
        try:
            return function(*args, **kwargs)
        except RomdamError as error:
            job = args[0] if args else kwargs.get("job")
            if isinstance(job, str | Path):
                with suppress(RomdamError):  # what keeps a file from being read names its line already
                    job = load_config(job)
            if not isinstance(job, Job):
                raise  # a mapping or a Config has no lines
            if job.file.is_file():
                if isinstance(error, RecordError) and error.key and str(error).startswith(error.key):
                    error.args = (f"{job.path}: {error}",)
                rows = (_with_line(row, job) for row in str(error).split("\n"))
                error.args = ("\n".join(rows), *error.args[1:])
            raise

    return wrapped


def _with_line(message: str, job: Job) -> str:
    """A message that begins with a job's path and a key of it, with the key's line between them."""
    text = message.removeprefix(f"{job.path}: ")
    if text == message:
        return message
    return f"{line_named(job, text) or f'{job.path}: '}{text}"


def with_lines(job: Job, messages: Iterable[str]) -> tuple[str, ...]:
    """Warnings, each that begins with a key of a job with the job's file and the key's line before it."""
    texts = (message.removeprefix(f"{job.path}: ") for message in messages)
    return tuple(f"{line_named(job, text)}{text}" for text in texts)


def line_named(job: Job, message: str) -> str:
    """File and line of the key that a message begins with, `file:line: `; empty where it has none.

    What a dam of a few keys or a cut makes has the line of the section that makes it.
    """
    key, written = key_at(message)
    key = _with_whole_name(job.config, key, written)
    if not key or key[0] not in Config.model_fields or job.given is not None or not job.file.is_file():
        return ""
    dotted = written.replace("[", ".").replace("]", "")
    changed = [at for name, at in job.replaced.items() if f"{dotted}.".startswith(f"{name}.")]
    line = line_of(job.file, next(iter(changed), _written_at(job.config, key)), missing=0)
    return f"{job.path}:{line}: " if line else ""


def _with_whole_name(config: Config, key: Location, written: str) -> Location:
    """The key with the name of a joint or block, which may have points, as one word."""
    group = str(key[0]) if key else ""
    names = {"joints": config.every_joint, "blocks": config.block_names}.get(group, ())
    for name in sorted(names, key=len, reverse=True):
        rest = f"{written}.".removeprefix(f"{group}.{name}.")
        if rest != f"{written}." and "." in name:
            return group, name, *(word for word in rest.split(".") if word)
    return key


def _written_at(config: Config, key: Location) -> Location:
    """The key that stands in the file for one that names a block or a joint which other sections make."""
    group, *rest = key
    dam = "gravity_dam" if config.gravity_dam else "arch_dam"
    name = rest[0] if rest else ""
    if group == "joints" and rest and name not in config.joints:
        for path, names in config.joint_places.items():
            if name in names and path != f"joints.{name}":
                kind, *where = path.split(".")
                if kind == "cut":  # a block's name may have a point
                    where = [path.removeprefix("cut.").removesuffix(".joints"), "joints"]
                return (kind, *where, *rest[1:])
    if group == "blocks" and name not in config.blocks:
        whole = next((cut for cut, section in config.cut.items() if name in section.into), None)
        if whole is not None:
            return "cut", whole, "into"
        section = next((section for section in config.blocks if name in config.made_of(section)), None)
        if section is not None:
            return "blocks", section, *rest[1:]
        if config.dam:
            return (dam, "rock") if str(name).startswith("rock_") else (dam,)
    if group == "ties" and name not in config.ties and config.dam:
        return (dam,)
    return key


def load_config(source: Source, folder: str | Path | None = None) -> Job:
    """Read and validate a configuration; what it says in general is not looked up in its meshes yet.

    Parameters, and the ConfigError that is raised, are those of `romdam.load_config`, which commands take.
    """
    if isinstance(source, Mapping | Config):
        content = source
        if isinstance(source, Config):
            content = source.model_dump(mode="json", exclude_unset=True)
        raw, renamed = with_present_names(plain(content, MADE), MADE)
        assert isinstance(raw, dict)
        base = Path(folder or ".")
        return _sound(Job(parse_config(raw, MADE, folder=base), Path(MADE), renamed, raw, base))
    if folder is not None:
        name = source.path if isinstance(source, Job) else source
        raise ConfigError(f"folder: is for a mapping or a Config; paths in {name} start where it is")
    if isinstance(source, Job):
        return source
    if not isinstance(source, str | Path):
        raise ConfigError(f"a job is a path, a mapping of keys, a Config or a Job, got {quote(source)}")
    path = Path(source)
    raw, renamed = with_present_names(read_yaml(path), str(path))
    return _sound(Job(parse_config(raw, str(path), partial(line_of, path)), path, renamed))


def with_found(job: Job, fill: Callable[[dict[str, Any]], None]) -> Job:
    """The job with what its meshes say in the place of keys that say "all that is there" (`Config.unfound`).

    Parameters
    ----------
    fill : puts it into the mapping of the configuration, in SI

    Raises
    ------
    ConfigError
        for names that are then wrong.
    """
    raw = job.to_dict()
    fill(raw)
    line = partial(line_of, job.file) if job.given is None and job.file.is_file() else None
    return _sound(replace(job, config=parse_config(raw, str(job.path), line, job.folder, si=True)))


def _sound(job: Job) -> Job:
    """The job, once its suite is known to vary what can be varied, whether its pipeline is a suite or not.

    That of joints and blocks that are not found yet is judged once they are.
    """
    if job.config.suite is not None and not job.config.unfound:
        try:
            refuse_unvaried(job.config, str(job.path))
        except ConfigError as error:
            raise ConfigError(_with_line(str(error), job)) from None
    return job


def parse_config(
    raw: object,
    source: str,
    line: Callable[[Location], int] | None = None,
    folder: Path | None = None,
    si: bool = False,
) -> Config:
    """Validate a mapping, keys by their names of before too.

    Parameters
    ----------
    source : names it in errors
    line : number of the line of a key, where `source` is a file
    folder : of laws that the configuration names, that of `source` if not given
    si : whether every number without a unit is in SI, as results hold them, also where a unit is asked for

    Raises
    ------
    ConfigError
        for unknown, missing or wrong keys.
    """
    if not isinstance(raw, dict):
        raise ConfigError(f"{source}: expected a mapping of keys at the top level, got {type(raw).__name__}")
    raw, _ = with_present_names(raw, source)
    try:
        return Config.model_validate(raw, context={"folder": folder or Path(source).parent, "si": si})
    except ValidationError as error:
        raise ConfigError(explain(error, source, Config, line)) from None
