"""Natural modes of a job, as a vibration test finds them: `romdam modes`."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import xarray as xr

from romdam.config.load import Job, Source, naming_lines, with_lines
from romdam.core.attachment import Attachment
from romdam.core.errors import ConfigError, ResultError, placed
from romdam.core.files import prepare_folder
from romdam.core.scene import Scene
from romdam.core.threads import one_thread
from romdam.linalg.solvers import Solving
from romdam.pipelines.jobs import load_config
from romdam.pipelines.run import Clock, Stage, silent
from romdam.postprocess.measured_modes import match_modes
from romdam.reduction.natural_modes import natural_modes
from romdam.results.dataset import write_dataset
from romdam.results.modes import add_measured, modes_dataset, read_measured, write_shapes
from romdam.scene.build import build_scene
from romdam.scene.ties import tie_joints

log = logging.getLogger(__name__)

_CLASSICAL = 1e-3  # coupling of modes by damping below which it is not mentioned

Joints = Literal["tied", "bonded", "open"]


@dataclass(frozen=True)
class ModesOptions:
    """Options of a job's natural modes.

    Attributes
    ----------
    joints : tied (their faces are one), bonded (K_n and K_s act in every gap, rigid joints are tied) or open
    count : how many modes
    measured : CSV file of measured frequencies, if any
    vtu : whether the shapes are written for ParaView
    """

    joints: Joints = "tied"
    count: int = 10
    measured: Path | None = None
    vtu: bool = False


@dataclass(frozen=True)
class ModesOutcome:
    """The modes, and the files that were written."""

    dataset: xr.Dataset
    paths: tuple[Path, ...]


@one_thread()
@naming_lines
def modes(
    job: Source, out: str | Path, options: ModesOptions = ModesOptions(), show: Stage = silent
) -> ModesOutcome:
    """Find a job's natural modes on the unreduced mesh; they land as `out`/<configuration>-modes-<joints>.nc.

    Raises
    ------
    RomdamError
        for a scene that cannot be built or solved, and a wrong file of measured modes.
    """
    job = load_config(job)
    if job.config.water is not None and job.config.water.has_waves:
        raise ConfigError(
            f"{job.path}: water.model: compressible has waves of its own that couple with the dam's motion, "
            "and undamped modes have none; set water.model: incompressible"
        )
    clock = Clock(show)
    measured = [] if options.measured is None else read_measured(options.measured, options.count)
    folder = prepare_folder(Path(out))
    with clock.stage("scene", "building the scene"), placed(job.path):
        built = build_scene(job.config, job.folder, str(job.path))
        for line in with_lines(job, built.remarks):
            log.warning("%s", line)
        scene = _with_joints(job, built, options.joints)
    with clock.stage("modes", "finding the modes"), placed(job.path):
        solving = Solving(job.config.model.solver, job.config.model.memory)
        bonded = options.joints == "bonded" and bool(scene.joints)
        computed = natural_modes(scene, job.config.damping, options.count, bonded, solving)
        values = {
            "frequency": computed.freq,
            "dry_frequency": computed.dry_freq,
            "damping_ratio": computed.damping_ratio,
            "modal_mass": computed.modal_mass,
            "participation_factor": computed.participation,
            "effective_mass": computed.effective_mass,
            "motion_share": computed.motion,
            "total_mass": computed.total_mass,
            "shape": computed.shapes,
        }
        dataset = modes_dataset(scene, values, job, options.joints)
        dataset.attrs["damping_coupling"] = computed.damping_coupling
    if computed.damping_coupling > _CLASSICAL:
        log.warning(
            "%s: damping is not classical: it couples modes by up to %.2g of their own; ratios are "
            "phi^T C phi / (2 omega phi^T M phi) of the undamped modes",
            job.path, computed.damping_coupling,
        )  # fmt: skip
    if measured:
        numbers = match_modes(measured, dataset.frequency.values, dataset.motion_share.values)
        dataset = add_measured(dataset, measured, numbers)
    dataset.attrs |= {f"cpu_seconds_{name}": seconds for name, seconds in clock.cpu.items()}
    stem = f"{job.stem}-modes-{options.joints}"
    write_dataset(dataset, folder / f"{stem}.nc")
    paths = [folder / f"{stem}.nc"]
    if options.vtu:
        paths.append(write_shapes(scene, dataset, folder / f"{stem}.vtu"))
    with clock.stage("figures", "drawing the modes"):
        from romdam.visual.mode_views import draw_measured, draw_modes  # here: matplotlib

        try:
            paths.append(draw_modes(built, dataset, folder / f"{stem}.png"))
        except ResultError as error:
            log.warning("the shapes are not drawn: %s", error)
        if "measured" in dataset.dims:
            paths.append(draw_measured(dataset, folder / f"{stem}-measured.png"))
    return ModesOutcome(dataset, tuple(paths))


def _with_joints(job: Job, scene: Scene, joints: Joints) -> Scene:
    """The scene with all joints tied, only the rigid ones, or none."""
    rigid = [name for name, joint in scene.joints.items() if joint.is_rigid]
    names = {"tied": list(scene.joints), "bonded": rigid, "open": []}[joints]
    if joints == "bonded" and rigid:
        log.info("%s: joints %s are rigid and tied", job.path, ", ".join(rigid))
    wide = max((float(joint.gap.max()) for joint in scene.joints.values()), default=0.0)
    if joints != "open" and wide > 0.0:
        log.warning("%s: initial gaps of up to %.3g mm are taken as closed", job.path, 1e3 * wide)
    if any(block.absorbing for block in scene.blocks.values()):
        log.warning("%s: modes are undamped: the dashpots of the viscous boundary are left out", job.path)
    dashpots = sorted({one.effect for one in scene.every(Attachment) if one.damping.any()})
    if dashpots:
        whose = ", ".join(dashpots)
        log.warning("%s: modes are undamped: the dashpots of %s are left out", job.path, whose)
    return tie_joints(scene, names, job.config.every_joint, str(job.path))
