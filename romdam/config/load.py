"""YAML file -> Config, with errors that name the file and the key."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import yaml
from pydantic import ValidationError

from romdam.config.explain import explain
from romdam.config.models import Config
from romdam.errors import ConfigError


@dataclass(frozen=True)
class Job:
    """A configuration and where it came from; relative paths in it start at `path`'s folder.

    Attributes
    ----------
    config : the validated configuration
    path : the YAML file
    """

    config: Config
    path: Path

    @property
    def folder(self) -> Path:
        """The folder that relative paths in the configuration start from."""
        return self.path.parent

    @property
    def digest(self) -> str:
        """SHA-256 of the validated configuration, independent of spelling, order and comments."""
        canonical = json.dumps(self.config.model_dump(mode="json"), sort_keys=True)
        return hashlib.sha256(canonical.encode()).hexdigest()


def load_config(path: str | Path) -> Job:
    """Read and validate a YAML configuration.

    Raises
    ------
    ConfigError
        for a file that cannot be read or is not YAML, and for unknown, missing or wrong keys.
    """
    path = Path(path)
    return Job(config=parse_config(_read_yaml(path), str(path)), path=path)


def parse_config(raw: object, source: str) -> Config:
    """Validate a mapping; `source` names it in errors."""
    if not isinstance(raw, dict):
        raise ConfigError(f"{source}: expected a mapping of keys at the top level, got {type(raw).__name__}")
    try:
        return Config.model_validate(raw)
    except ValidationError as error:
        raise ConfigError(explain(error, source, Config)) from None


class _UniqueKeyLoader(yaml.SafeLoader):
    """Safe loader that refuses a key given twice, which YAML would silently overwrite."""


def _mapping(loader: _UniqueKeyLoader, node: yaml.MappingNode) -> dict[object, object]:
    loader.flatten_mapping(node)
    keys = [loader.construct_object(key, deep=True) for key, _ in node.value]
    for key, (key_node, _) in zip(keys, node.value, strict=True):
        if keys.count(key) > 1:
            raise yaml.constructor.ConstructorError(
                None, None, f"key {key!r} is given twice", key_node.start_mark
            )
    return loader.construct_mapping(node, deep=True)


_UniqueKeyLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)


def _read_yaml(path: Path) -> object:
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such configuration file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({error})") from None
    try:
        return yaml.load(text, Loader=_UniqueKeyLoader)
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: not valid YAML: {error}") from None
