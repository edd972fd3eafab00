"""Pictures of a scene and of a result: the order of the stages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from romdam.config.load import Job, naming_lines
from romdam.core.files import prepare_folder
from romdam.pipelines.run import Clock, Stage, silent
from romdam.results.fields import Result
from romdam.results.series import Frames
from romdam.scene.build import build_scene


@dataclass(frozen=True)
class PlotOptions:
    """Drawings of a result besides its figures, and the frames of series.

    Attributes
    ----------
    fields, vtu, animation : pictures of fields; a series for ParaView; a GIF
    frames : of a series
    window : first and last second of a series; two seconds around the largest displacement if None
    """

    fields: bool = False
    vtu: bool = False
    animation: bool = False
    frames: int = 40
    window: tuple[float, float] | None = None


@naming_lines
def show_scene(job: Job, out: str | Path, show: Stage = silent) -> Path:
    """Draw the scene of a configuration as `out`/<configuration>-scene.png.

    Raises
    ------
    RomdamError
        for a scene that cannot be built, and where 3-D pictures cannot be drawn.
    """
    from romdam.visual.rendering import refuse_without_renderer
    from romdam.visual.scene_view import draw_scene

    refuse_without_renderer()
    folder, clock = prepare_folder(Path(out)), Clock(show)
    with clock.stage("scene", "building the scene"):
        scene = build_scene(job.config, job.folder, str(job.path))
    with clock.stage("picture", "drawing the scene"):
        return draw_scene(scene, folder / f"{job.stem}-scene.png", job.config.title or job.path.stem)


def plot_result(result: Result, out: str | Path, pictures: PlotOptions, show: Stage = silent) -> list[Path]:
    """Draw a result: its figures, and what else is asked for, into `out`.

    Raises
    ------
    RomdamError
        for a result without fields, and where 3-D pictures cannot be drawn or files not be written.
    """
    from romdam.results.table import write_maxima, write_sliding
    from romdam.visual.plots import write_plots
    from romdam.visual.rendering import refuse_without_renderer

    if pictures.fields or pictures.animation:
        refuse_without_renderer()
    folder, clock, stem = prepare_folder(Path(out)), Clock(show), result.path.stem
    frames = Frames(pictures.frames, pictures.window)
    with clock.stage("figures", "drawing figures"):
        paths = [*write_plots(result.dataset, folder, stem), write_maxima(result.dataset, folder, stem)]
        paths += write_sliding(result.dataset, folder, stem)
    if pictures.fields:
        from romdam.visual.field_views import draw_fields

        with clock.stage("fields", "drawing fields"):
            paths += draw_fields(result, folder, stem)
    if pictures.vtu:
        from romdam.results.export import write_series

        with clock.stage("vtu", "writing the series") as progress:
            paths.append(write_series(result, folder, stem, frames, progress))
    if pictures.animation:
        from romdam.visual.field_views import write_animation

        with clock.stage("animation", "drawing the animation") as progress:
            paths.append(write_animation(result, folder, stem, frames, progress))
    return paths


def view_result(result: Result, page: Path | None, frames: Frames, show: Stage = silent) -> Path | None:
    """Show the motion of a result in a window, or write it as a page for the browser; the page's path.

    Parameters
    ----------
    page : the file; None for a window
    frames : of the motion

    Raises
    ------
    RomdamError
        for a result without fields, for a window without written times, and where no window can be opened
        or the page not be written.
    """
    from romdam.visual.view.moving import moving

    if page is None:
        from romdam.visual.view.window import Window, refuse_without_display

        refuse_without_display(result.path)
    else:
        prepare_folder(page.parent)
    clock = Clock(show)
    with clock.stage("fields", "rebuilding the motion"):
        motion = moving(result, frames)
    if page is None:
        Window(motion).open(result.path)
        return None
    from romdam.visual.view.page import write_page

    with clock.stage("page", "writing the page"):
        return write_page(motion, page)
