"""Many convex polygons of a plane clipped by others, at once."""

from __future__ import annotations

import numpy as np

from romdam.core.arrays import Floats, Ints


def clip(subject: Floats, window: Floats) -> tuple[Floats, Ints]:
    """Clip convex polygons by convex polygons, pair by pair.

    Sutherland and Hodgman, Communications of the ACM 17 (1974) 32: each edge of the window cuts off what
    lies to its right.

    Parameters
    ----------
    subject : (n, a, 2) corners, counterclockwise; a corner may stand twice
    window : (n, b, 2) likewise

    Returns
    -------
    corners : (n, c, 2) of what both cover, counterclockwise; the last one repeated
    count : (n,) of corners, 0 where nothing is left
    """
    corners, count = subject, np.full(len(subject), subject.shape[1])
    for k in range(window.shape[1]):
        a, b = window[:, k], window[:, (k + 1) % window.shape[1]]
        corners, count = _cut(corners, count, a, b - a)
    return corners, count


def _cut(corners: Floats, count: Ints, origin: Floats, edge: Floats) -> tuple[Floats, Ints]:
    """Parts that lie to the left of a line through `origin` along `edge`, polygon by polygon."""
    n, width, _ = corners.shape
    there = np.arange(width) < count[:, None]
    following = np.where(np.arange(1, width + 1) < count[:, None], np.arange(1, width + 1), 0)
    away = corners - origin[:, None]
    left = edge[:, None, 0] * away[..., 1] - edge[:, None, 1] * away[..., 0]
    next_left = np.take_along_axis(left, following, axis=1)
    inside, next_inside = left >= 0.0, next_left >= 0.0
    crosses = inside != next_inside
    share = np.divide(left, left - next_left, out=np.zeros_like(left), where=crosses)
    ahead = np.take_along_axis(corners, following[..., None], axis=1)
    both = np.stack([corners, corners + share[..., None] * (ahead - corners)], axis=2).reshape(
        n, 2 * width, 2
    )
    kept = np.stack([inside & there, crosses & there], axis=2).reshape(n, 2 * width)
    return _packed(both, kept)


def _packed(corners: Floats, kept: np.typing.NDArray[np.bool_]) -> tuple[Floats, Ints]:
    """The kept corners of every polygon moved to its front, the last one repeated."""
    count = kept.sum(axis=1)
    order = np.argsort(~kept, axis=1, kind="stable")[:, : max(int(count.max(initial=0)), 1)]
    at = np.minimum(np.arange(order.shape[1]), np.maximum(count - 1, 0)[:, None])
    order = np.take_along_axis(order, at, axis=1)
    return np.take_along_axis(corners, order[..., None], axis=1), count


def polygon_areas(corners: Floats) -> Floats:
    """Area of polygons (n, c, 2), counterclockwise positive."""
    x, y = (corners - corners[:, :1]).transpose(2, 0, 1)
    return np.asarray(0.5 * (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1))
