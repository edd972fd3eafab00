"""The shape of a double-curvature arch dam: faces, joint planes, foot along the valley.

Axes: x from the left to the right bank, y downstream, z up. Joints and all columns of the mesh are vertical
planes through one axis, the centre of the crest's upstream arc, so that each is radial to the crest. A column
is named by its angle theta from the crown; its foot lies where the dam's middle surface meets the valley.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from romdam.config.sections.geometry.arch_dam import ArchDamConfig, Polynomial, Profile
from romdam.core.errors import ConfigError
from romdam.geometry.elements import Floats

_STEEPEST = np.radians(85.0)  # of a column's plane, from the crown's
_SAMPLES = 41  # elevations at which the shape is checked

Curve = Callable[[Floats], Floats]


def curve(profile: Profile, location: str) -> Curve:
    """A profile as a function of the elevation; points are joined without overshoot (monotone cubic).

    Raises
    ------
    ConfigError
        for elevations that do not ascend.
    """
    if isinstance(profile, Polynomial):
        coefficients = profile.polynomial
        return lambda z: np.polynomial.polynomial.polyval(np.asarray(z, dtype=float), coefficients)
    points = np.atleast_2d(np.array(profile if isinstance(profile, tuple) else [(0.0, profile)], dtype=float))
    down = np.flatnonzero(np.diff(points[:, 0]) <= 0.0)
    if len(down):
        a, b = points[down[0] : down[0] + 2, 0]
        raise ConfigError(
            f"{location}: elevations must ascend, got {a:g} m then {b:g} m; put the lowest first"
        )
    if len(points) == 1:
        return lambda z: np.full(np.shape(z), points[0, 1])
    from scipy.interpolate import PchipInterpolator  # here: half a second that scenes of boxes do not need

    inner = PchipInterpolator(points[:, 0], points[:, 1], extrapolate=False)
    low, high = points[[0, -1], 0]
    return lambda z: inner(np.clip(z, low, high))


class ArchShape:
    """Points of the dam from a column's angle, the way through the thickness and the elevation.

    Parameters
    ----------
    config : the dam
    location : file and key, for messages

    Raises
    ------
    ConfigError
        for a thickness or radius that is not positive, a valley that narrows upwards or is wider than the
        arcs reach, and joint planes that meet within the dam.
    """

    def __init__(self, config: ArchDamConfig, location: str) -> None:
        self.config, self.location = config, location
        self.upstream = curve(config.crown.upstream, f"{location}.crown.upstream")
        self.thickness = curve(config.crown.thickness, f"{location}.crown.thickness")
        self.radius = curve(config.arcs.upstream_radius, f"{location}.arcs.upstream_radius")
        inner = config.arcs.downstream_radius
        self.inner: Curve = (
            (lambda z: self.radius(z) - self.thickness(z))
            if inner is None
            else curve(inner, f"{location}.arcs.downstream_radius")
        )
        self.end = _STEEPEST  # until it is known
        self.valley = self._valley()
        self._refuse_bad_profiles()
        crest = np.array(config.crest)
        self.axis = float(self.upstream(crest) + self.radius(crest))  # y of the columns' common axis
        self.end = self._end_angle()
        self._refuse_crossing()

    def point(self, theta: Floats, through: Floats, z: Floats) -> Floats:
        """Positions (..., 3) [m] at angles, shares of the thickness (1 is downstream), elevations."""
        outer, inner = self._reach(theta, z)
        r = outer + np.asarray(through) * (inner - outer)
        return np.stack(np.broadcast_arrays(r * np.sin(theta), self.axis - r * np.cos(theta), z), axis=-1)

    def foot(self, theta: Floats) -> Floats:
        """Elevation of the columns' feet on the valley (floor `base`) [m]."""
        return np.array([self._foot(abs(float(t))) for t in np.atleast_1d(theta)])

    def _reach(self, theta: Floats, z: Floats, share: Floats | None = None) -> tuple[Floats, Floats]:
        """Distance of the up- and downstream face from the axis along a column's plane [m].

        `share` is theta over the end faces' angle, for when that is not known yet.
        """
        y = self.upstream(z)
        outer = self._ray(theta, y, self.radius(z))
        inner = self._ray(theta, y + self.thickness(z), self.inner(z))
        extra = self.config.arcs.thickening * (np.asarray(theta / self.end) if share is None else share) ** 2
        return outer, outer - (outer - inner) * (1.0 + extra)

    def _ray(self, theta: Floats, crown: Floats, radius: Floats) -> Floats:
        """Distance from the axis to an arc through (0, crown); nan where the plane misses it."""
        with np.errstate(invalid="ignore"):
            if self.config.arcs.shape == "circular":
                offset = self.axis - (crown + radius)
                return offset * np.cos(theta) + np.sqrt(radius**2 - (offset * np.sin(theta)) ** 2)
            far = self.axis - crown
            return (
                2.0
                * far
                / (np.cos(theta) + np.sqrt(np.cos(theta) ** 2 + 2.0 * np.sin(theta) ** 2 * far / radius))
            )

    def _valley(self) -> Curve:
        config = self.config
        points = np.array(config.valley)
        curve(config.valley, f"{self.location}.valley")
        narrower = np.flatnonzero(np.diff(points[:, 1]) < 0.0)
        if len(narrower) or points[0, 1] <= 0.0:
            at = narrower[0] if len(narrower) else 0
            widths = ", ".join(f"{w:g} m at {z:g} m" for z, w in points[at : at + 2])
            raise ConfigError(
                f"{self.location}.valley: the half-width must be above 0 and not shrink upwards, got "
                f"{widths}; give [elevation, half-width] from the floor up"
            )
        top = config.crest - config.abutment_height
        return lambda z: np.interp(np.minimum(z, top), points[:, 0], points[:, 1])

    def _refuse_bad_profiles(self) -> None:
        z = np.linspace(self.config.base, self.config.crest, _SAMPLES)
        stated = {
            "crown.thickness": self.thickness(z),
            "arcs.upstream_radius": self.radius(z),
            "arcs.downstream_radius": self.inner(z),
        }
        for key, values in stated.items():
            k = int(np.argmin(values))
            if values[k] <= 0.0:
                raise ConfigError(
                    f"{self.location}.{key}: must be above 0 from base to crest, got {values[k]:.4g} m at "
                    f"elevation {z[k]:.4g} m; correct the profile there"
                )

    def _middle(self, theta: Floats, z: Floats, share: Floats | None = None) -> Floats:
        """x of the middle surface [m]."""
        outer, inner = self._reach(theta, z, share)
        return 0.5 * (outer + inner) * np.sin(theta)

    def _end_angle(self) -> float:
        """The angle of the end faces, where the middle surface reaches the walls."""
        z = np.array(self.config.crest - self.config.abutment_height)
        half, ends = float(self.valley(z)), np.array(1.0)
        angles = np.linspace(0.0, _STEEPEST, 400)
        reach = self._middle(angles, z, ends)
        beyond = np.flatnonzero(reach >= half)
        if not len(beyond):
            raise ConfigError(
                f"{self.location}.valley: its walls cut the arcs: at elevation {float(z):g} m the "
                f"half-width is {half:.4g} m, but the arc (upstream radius {float(self.radius(z)):.4g} m) "
                f"reaches {np.nanmax(reach):.4g} m only; narrow the valley or enlarge the radius"
            )
        low, high = angles[beyond[0] - 1], angles[beyond[0]]
        from scipy.optimize import brentq

        return float(brentq(lambda t: float(self._middle(np.array(t), z, ends)) - half, low, high))

    def _foot(self, theta: float) -> float:
        base, top = self.config.base, self.config.crest - self.config.abutment_height
        if theta >= self.end * (1.0 - 1e-12):
            return top

        def beyond(z: Floats) -> Floats:
            return self.valley(z) - self._middle(np.array(theta), z)

        z = np.linspace(base, top, _SAMPLES)
        room = beyond(z)
        if room[0] >= 0.0:
            return base
        if np.isnan(room).any() or room[-1] < 0.0:
            raise ConfigError(
                f"{self.location}.valley: its walls cut the arcs {np.degrees(theta):.4g} degrees from the "
                f"crown: the arc does not reach the wall below elevation {top:g} m; widen the radii "
                "towards the base"
            )
        last = int(np.flatnonzero(room < 0.0)[-1])
        from scipy.optimize import brentq

        return float(brentq(lambda x: float(beyond(np.array(x))), z[last], z[last + 1]))

    def _refuse_crossing(self) -> None:
        """Columns run through one axis: the downstream face must stay on this side of it."""
        theta = np.linspace(0.0, self.end, _SAMPLES)
        feet = self.foot(theta)
        z = feet[:, None] + (self.config.crest - feet)[:, None] * np.linspace(0.0, 1.0, _SAMPLES)
        _, inner = self._reach(np.broadcast_to(theta[:, None], z.shape), z)
        at = np.unravel_index(int(np.argmin(np.where(np.isnan(inner), -np.inf, inner))), inner.shape)
        if not inner[at] > 0.0:
            raise ConfigError(
                f"{self.location}.arcs: the joints would cross within the dam: their planes meet in the axis "
                f"y = {self.axis:.4g} m, and the downstream face lies {-inner[at]:.4g} m beyond it at "
                f"elevation {z[at]:.4g} m, {np.degrees(theta[at[0]]):.3g} degrees from the crown, limit 0; "
                "enlarge the radii or reduce the thickness"
            )
