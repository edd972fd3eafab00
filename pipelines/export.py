"""A job as a script of another code, or as matrices: `romdam export`.

A script has the mesh of the job, its joints and one record, in words of the other code. The scene becomes a
neutral description, a `Deck` (`romdam.export.build`), and the module of the code turns that into text. What
romdam finds at rest before a run, grouting and the water in cracked joints, is computed here and goes into
the deck with the joints. Matrices are those of the blocks and of the system, as a run takes them.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path

from romdam.config.effects import refuse_unknown_effects
from romdam.config.load import Job, naming_lines, with_lines
from romdam.core.errors import ConfigError, listed, placed
from romdam.core.files import prepare_folder, replacing
from romdam.core.threads import one_thread
from romdam.effects.full_order import assemble_full
from romdam.export import build, matrices
from romdam.export.codes import CODES
from romdam.export.deck import DeckMotion
from romdam.fem.gaps import gap_law
from romdam.pipelines.automatic_spacing import automatic_joints
from romdam.pipelines.input_motions import records_of, usable
from romdam.pipelines.moving_supports import scene_of
from romdam.pipelines.run import Clock, Stage, build_model, choose_mesh_and_modes, silent
from romdam.pipelines.simulation import ground_at_steps
from romdam.records.record_set import load_motions
from romdam.reduction.storage.user_cache import open_store
from romdam.timestepping.grouting import grouted
from romdam.timestepping.uplift import with_uplift_at_rest

log = logging.getLogger(__name__)

_CUTS = 4  # steps to a sample of the record, where no finest step is configured


@dataclass(frozen=True)
class ExportOptions:
    """Options of a script.

    Attributes
    ----------
    code : a key of `romdam.export.codes.CODES`
    record : name of a record; the first one if None
    dt : step [s]; the job's finest one, or a quarter of the record's, if None
    duration : of the record that is kept [s]; that of the configuration, or all, if None
    """

    code: str
    record: str | None = None
    dt: float | None = None
    duration: float | None = None


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes
    ----------
    paths : files
    stated : what in them differs from romdam's model, one sentence each
    said : record, number and length of the steps, for the user
    """

    paths: tuple[Path, ...]
    stated: tuple[str, ...]
    said: str


@one_thread()
@naming_lines
def export_deck(job: Job, out: str | Path, options: ExportOptions, show: Stage = silent) -> Exported:
    """Write a job and one of its records as a script that runs in another code.

    Raises
    ------
    RomdamError
        for a job that cannot be built, and for what the other code has no words for.
    """
    clock = Clock(show)
    with clock.stage("records", "reading records"):
        motions = {motion.name: motion for motion in load_motions(job.config.records, job.folder)}
        if options.record is not None and options.record not in motions:
            raise ConfigError(f"{job.path}: records has no {options.record!r}; it has {listed(motions)}")
        record = motions[options.record or next(iter(motions))]
        # at the steps of the script, rows at the job's interval or the whole step nearest to it
        transient = job.config.transient
        dt = options.dt or transient.finest_step or record.dt / _CUTS
        stride = max(1, round((job.config.outputs.output_interval or dt) / dt))
        acc = ground_at_steps(record, dt, options.duration or transient.duration)
        motion = DeckMotion(record.name, acc, dt, stride)
    with clock.stage("scene", "building the scene"), placed(job.path):
        scene = scene_of(job)
        for line in with_lines(job, scene.remarks):
            log.warning("%s", line)
        config, law = job.config, None
        # grouting and water in cracked joints follow from the state at rest, of the unreduced system
        gaps, tolerance = gap_law(scene), config.transient.tolerance
        if gaps.grout.any() or gaps.uplift:
            rest = with_uplift_at_rest(grouted(assemble_full(scene, config.damping), tolerance), tolerance)
            law = rest.law
            if rest.uplift is not None:
                added = {name: rest.uplift.added[of_joint] for name, of_joint in law.joints.items()}
                joints = {
                    name: replace(joint, water=joint.water + added[name])
                    for name, joint in scene.joints.items()
                }
                scene = replace(scene, joints=joints)
        title = f"{config.title or job.path.stem}, record {motion.name}, by romdam from {job.path.name}"
        static = config.loads.begins == "static"
        refuse_unknown_effects(config, "deck", str(job.path))
        deck = build.build_deck(scene, config.damping, motion, title=title, static=static, grouted=law)
        files, stated = CODES[options.code](deck)
    folder = prepare_folder(Path(out))
    for name, text in files.items():
        with replacing(folder / name) as unfinished:
            unfinished.write_text(text, encoding="utf-8")
    duration = motion.steps * motion.dt
    said = f"{motion.name}: {motion.steps} steps of {1e3 * motion.dt:g} ms, {duration:g} s"
    return Exported(tuple(folder / name for name in files), stated, said)


@one_thread()
@naming_lines
def export_matrices(job: Job, out: Path, show: Stage = silent, cache: Path | None = None) -> list[Path]:
    """Write the matrices of a job's blocks and of its system, reduced or not as its `model.order` says.

    Parameters
    ----------
    out : folder, made if needed
    cache : folder of reduced blocks, as of `romdam.run`

    Raises
    ------
    RomdamError
        for bad input, and where the folder refuses a file.
    """
    clock, store = Clock(show), open_store(cache)
    refuse_unknown_effects(job.config, "matrices", str(job.path))
    total = job.config.transient.total_accuracy
    if job.config.model.modes == "auto" or total is not None or automatic_joints(job):
        job, _ = choose_mesh_and_modes(job, usable(records_of(job)), clock, store)
    model = build_model(job, clock, store)
    with clock.stage("output", "writing matrices"):
        folder = prepare_folder(out)
        return matrices.write(model.scene, model.system, model.reduced, job.config.damping, folder)
