"""What builders of a scene's effects see beside the scene so far: the job, and what its keys have named."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from romdam.config.job import Config
from romdam.core.arrays import Bools
from romdam.geometry.meshes.files import MeshFiles


@dataclass(frozen=True)
class Draft:
    """A job whose scene is being built.

    Attributes
    ----------
    config : of the job
    supported : block name -> (n, 3) True where `supports` hold the component, and not its matrices alone
    rock : names of the blocks that take waves up
    folder : where relative paths of the configuration start
    files : mesh files that have been read
    source : name of the configuration file, for messages
    remarks : sentences on what may not be meant, which builders add to
    """

    config: Config
    supported: Mapping[str, Bools]
    rock: frozenset[str]
    folder: Path
    files: MeshFiles
    source: str
    remarks: list[str] = field(default_factory=list)
