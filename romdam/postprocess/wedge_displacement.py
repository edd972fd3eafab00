"""Permanent displacement of a rigid wedge while its factor of safety is below 1, after Newmark.

The wedge moves as a rigid body against the ground at its place. In each small step its velocity changes by
force over mass, its planes stop what would pass through them, and friction and cohesion brake the rest
against its direction:

    v' = P(v + h F / m),   v <- v' max(0, 1 - h (mu . N + c . A) / (m |v'|)),

with P the projection on directions that the planes in contact leave, N the impulse of P over h. So a force
that turns round brakes first, and moves the wedge back afterwards; where it has lifted off it lands without a
rebound. From rest this moves where the factor of safety is below 1, and nowhere else.

References
----------
Newmark, Effects of earthquakes on dams and embankments, Geotechnique 15 (1965) 139.
Moreau, Unilateral contact and dry friction in finite freedom dynamics (1988), section 10: the step.
"""

from __future__ import annotations

import numpy as np

from romdam.config.sections.wedges import WedgeConfig
from romdam.core.arrays import Bools, Floats
from romdam.postprocess.wedges import WedgeGeometry, WedgeSliding

_SUBSTEPS = 16  # of the interval between two rows, in which the force is linear
_TOUCHES = 1e-9  # of the wedge's size, how near to a plane it is in contact
_ALONG = 1e-9  # of the velocity: so little of it away from a plane is along it


def permanent_displacement(
    sliding: WedgeSliding, geometry: WedgeGeometry, wedge: WedgeConfig, force: Floats, time: Floats
) -> Floats:
    """Integrate the motion of a wedge, (nt, 3) [m].

    Parameters
    ----------
    sliding : of the wedge under these forces
    force : (nt, 3) on the wedge, inertia included; linear between the rows [N]
    time : (nt,) [s]
    """
    mass, count = wedge.density * geometry.volume, len(wedge.planes)
    normals, near = geometry.normals[:count], _TOUCHES * geometry.size
    friction = np.array([plane.friction for plane in wedge.planes.values()])
    cohesion = np.array([plane.cohesion for plane in wedge.planes.values()]) * geometry.areas[:count]
    moved, velocity, here = np.zeros((len(time), 3)), np.zeros(3), np.zeros(3)
    for k, dt in enumerate(np.diff(time)):
        rests = not velocity.any() and (normals @ here <= near).all()
        if rests and min(sliding.factor[k], sliding.factor[k + 1]) >= 1.0:
            moved[k + 1] = here
            continue
        h = dt / _SUBSTEPS
        for substep in range(_SUBSTEPS):
            push = force[k] + (substep + 0.5) / _SUBSTEPS * (force[k + 1] - force[k])
            touching = normals @ here <= near
            after = _step(velocity + h * push / mass, normals, touching, friction, cohesion * h / mass)
            here = here + 0.5 * h * (velocity + after)
            below = normals @ here < -near
            if below.any():  # landed within the step
                here = here - np.linalg.lstsq(normals[below], normals[below] @ here, rcond=None)[0]
            velocity = after
        moved[k + 1] = here
    return moved


def _step(free: Floats, normals: Floats, touching: Bools, friction: Floats, cohesion: Floats) -> Floats:
    """Velocity (3,) that planes in contact leave of a free one, braked by their strength [m/s]."""
    from scipy.optimize import nnls

    if not touching.any():
        return free
    inward, mu, c = normals[touching], friction[touching], cohesion[touching]
    pushes, _ = nnls(inward.T, -free)
    after = free + pushes @ inward
    speed = float(np.linalg.norm(after))
    if speed <= _ALONG * float(np.linalg.norm(free)):
        return np.zeros(3)
    on_plane = np.abs(inward @ after) <= _ALONG * speed
    braked = float(pushes @ mu + on_plane @ c)
    return np.asarray(after * max(0.0, 1.0 - braked / speed))
