"""Runs of a suite, the tasks that make them, and what these share.

A run's content is its record's samples, its factor, the sample's parameters and the model: its `key` names
its row and its result. Where it stands in the suite (name of the record, numbers of scale and sample) is the
design's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from romdam.config.load import Job
from romdam.config.parameters import Varied, VariedKey, vary
from romdam.config.sections.suite import SuiteConfig
from romdam.core.fingerprint import fingerprint
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.error.statement import ErrorStatement
from romdam.fem.gaps import gap_law
from romdam.pipelines.simulation import RunModel
from romdam.results.suite.rows import Kept, RunIndex
from romdam.results.variables import Case
from romdam.scene.joints import with_properties
from romdam.scene.varied import vary_scene


@dataclass(frozen=True)
class Samples:
    """Parameters that a suite varies, and their values.

    Attributes
    ----------
    places : name of each parameter -> where it stands
    values : name of each parameter -> its value, for each sample
    contents : SHA-256 of each sample
    also : scenes of some samples, whose loads the basis answers too; None where no sample changes blocks or
        loads
    """

    places: dict[str, VariedKey]
    values: tuple[dict[str, float], ...]
    contents: tuple[str, ...] = ()
    also: tuple[Scene, ...] | None = None

    @property
    def structural(self) -> list[str]:
        """Names of the parameters of materials and levels."""
        return [name for name, key in self.places.items() if key.structure]

    def ranges(self, name: str) -> dict[str, tuple[float, float]]:
        """Each place of a structural parameter -> its least and its largest value, SI."""
        column = [values[name] for values in self.values]
        return dict.fromkeys(self.places[name].structure, (min(column), max(column)))

    def scene(self, job: Job, scene: Scene, number: int) -> tuple[Scene, Varied]:
        """The scene of one sample, and what it varies.

        Raises
        ------
        ConfigError
            for values that do not fit together.
        """
        varied = vary(job.config, self.places, self.values[number], str(job.path))
        if varied.structure:
            scene = vary_scene(scene, varied.config, str(job.path))
        every = varied.config.every_joint
        joints = {
            name: with_properties(joint, every[name], job.folder, str(job.path))
            for name, joint in scene.joints.items()
        }
        return replace(scene, joints=joints), varied


def sample_content(scene: Scene, varied: Varied) -> str:
    """SHA-256 of one sample: its joints and damping, its materials and levels."""
    structure = (varied.structure,) if varied.structure else ()
    return fingerprint((gap_law(scene), varied.config.damping.model_dump_json(), *structure))


@dataclass(frozen=True)
class Suite:
    """A suite as its tasks need it, sent to every worker once.

    Attributes
    ----------
    job : the configuration
    model : scene, reduced once for all samples, with the joints of one sample
    samples : what they vary
    folder : where results that are kept whole are written
    files : what they share: attribute -> file name
    notes : folder where tasks note how far they are; None where nobody asks
    write : writes the result of a run; None where no run is kept whole. Workers load what it needs with it
    """

    job: Job
    model: RunModel
    samples: Samples
    folder: Path
    files: dict[str, str]
    notes: Path | None = None
    write: Callable[[Suite, Run, Case, ErrorStatement | None], Kept] | None = None

    @property
    def config(self) -> SuiteConfig:
        """The `suite:` part of the configuration."""
        assert self.job.config.suite is not None
        return self.job.config.suite

    @property
    def keeps_results(self) -> bool:
        """True where every run is kept as a result file of its own."""
        return self.config.keep != "peaks"


@dataclass(frozen=True)
class Run:
    """One record at one scale with one sample.

    Attributes
    ----------
    index : numbers of record, scale and sample
    record : name
    factor : what the record is multiplied by
    key : SHA-256 of everything the run depends on
    """

    index: RunIndex
    record: str
    factor: float
    key: str

    @property
    def name(self) -> str:
        """Of the run in this design."""
        return f"{self.record}__{self.index[1]}__{self.index[2]}"


@dataclass(frozen=True)
class Task:
    """Runs that are integrated together, and the motions of their records."""

    runs: tuple[Run, ...]
    motions: dict[str, GroundMotion]


def scaled(motion: GroundMotion, run: Run) -> GroundMotion:
    """A record at the scale of a run, under the name of the run."""
    about = motion.provenance | {"suite_scale": run.factor, "suite_record": run.record}
    return replace(motion, name=run.name, acc=run.factor * motion.acc, provenance=about)
