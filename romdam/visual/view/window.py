"""A window that shows the motion of a dam in 3-D, by PyVista (extra `view`)."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from romdam.core.errors import ResultError
from romdam.visual.rendering import EDGES, refuse_without_renderer
from romdam.visual.view.moving import Moving

_SIZE = (1200, 860)
_BLIND = ("EGL", "OSOpenGL")  # of the names of VTK's windows that no screen shows
_HELP = "f: next field   u/d: from upstream/downstream   r: whole dam   w/s: mesh/surface   q: end"


def refuse_without_display(path: Path) -> None:
    """Raise where no window can be opened.

    Raises
    ------
    ResultError
        with what to do instead.
    """
    refuse_without_renderer()
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        raise _no_display(path, "DISPLAY is not set")


def _no_display(path: Path, why: str) -> ResultError:
    return ResultError(
        f"{path}: a window needs a display, and there is none ({why}); write a page for the browser with "
        "--html FILE, or log in with ssh -X, or run under xvfb-run"
    )


class Window:
    """The window, with a slider for the time and keys for the rest.

    Parameters
    ----------
    motion : what the window shows
    off_screen : draw without a screen
    """

    def __init__(self, motion: Moving, *, off_screen: bool = False) -> None:
        import pyvista

        self.motion, self.frame, self.field = motion, int(np.argmax(np.abs(motion.moved).max(axis=(1, 2)))), 0
        self.plotter: Any = pyvista.Plotter(
            off_screen=off_screen, window_size=list(_SIZE), title=f"{motion.title}: {motion.record}"
        )
        self.plotter.set_background("white")
        numbered = list(motion.numbered())
        triangles, edges = (np.concatenate([surface[k] for surface in numbered]) for k in (1, 2))
        self.surface = pyvista.PolyData.from_regular_faces(motion.points, triangles)
        self.edges = pyvista.PolyData(motion.points)
        self.edges.lines = np.column_stack([np.full(len(edges), 2), edges]).ravel()
        self._add_field()
        lines = self.plotter.add_mesh(self.edges, color=EDGES, line_width=1, opacity=0.35, pickable=False)
        lines.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        lines.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-2.0, -2.0)
        self.plotter.add_axes(color="black")
        self.plotter.add_text(_HELP, position="lower_left", font_size=8, color="black")
        self._add_controls()
        self.look(1.0)

    def open(self, path: Path) -> None:
        """Show it until it is closed.

        Raises
        ------
        ResultError
            where there is no display.
        """
        if any(kind in self.plotter.render_window.GetClassName() for kind in _BLIND):
            self.plotter.close()
            raise _no_display(path, f"DISPLAY={os.environ.get('DISPLAY', '')} does not answer")
        self.plotter.show()

    def move_to(self, time: float) -> None:
        """Show the frame nearest to a time [s]."""
        self.frame = int(np.abs(self.motion.times - time).argmin())
        self._update()

    def next_field(self) -> None:
        """Show another field."""
        self.field = (self.field + 1) % len(self.motion.fields)
        self._add_field()
        self.plotter.render()

    def look(self, side: float) -> None:
        """Look from upstream (1) or from downstream (-1); from -y and +y where the stream is not known."""
        upstream = np.array([0.0, -1.0, 0.0]) if self.motion.upstream is None else self.motion.upstream
        aside = 0.5 * np.cross(upstream, [0.0, 0.0, 1.0])
        self.plotter.view_vector(side * (upstream + aside) + [0.0, 0.0, 0.45], viewup=(0.0, 0.0, 1.0))

    def _add_field(self) -> None:
        field = self.motion.fields[self.field]
        for title in list(self.plotter.scalar_bars.keys()):
            self.plotter.remove_scalar_bar(title)
        self._update()
        self.plotter.add_mesh(
            self.surface, name="surface", scalars="values", cmap=field.colours, nan_color="#D9D9D9",
            clim=(field.factor * field.low, field.factor * field.high), lighting=False, reset_camera=False,
            scalar_bar_args={"title": f"{field.name} [{field.unit}]", "color": "black", "fmt": "%.3g"},
        )  # fmt: skip

    def _add_controls(self) -> None:
        times = self.motion.times
        if len(times) > 1:
            self.plotter.add_slider_widget(
                self.move_to, (float(times[0]), float(times[-1])), value=float(times[self.frame]),
                title="time [s]", color="black", fmt="%.2f", interaction_event="always",
                pointa=(0.1, 0.93), pointb=(0.5, 0.93),
            )  # fmt: skip
        self.plotter.add_key_event("f", self.next_field)
        for key, side in (("u", 1.0), ("d", -1.0)):
            self.plotter.add_key_event(key, lambda side=side: self.look(side))

    def _update(self) -> None:
        moved = self.motion.moved[self.frame]
        for mesh in (self.surface, self.edges):
            mesh.points = self.motion.points + self.motion.scale * moved
        self.surface.point_data["values"] = self.motion.fields[self.field].of(moved, self.frame)
