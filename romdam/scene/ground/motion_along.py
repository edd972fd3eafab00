"""Motion of all supports by their position: stations, and the share that each has in a node's motion.

A table is linear between its stations. The motion of a wave, and its random part, are smooth functions of the
position along an axis: stations stand at Chebyshev's points between the first and the last support, and the
polynomial through them is the motion between. It takes about pi stations for a wave length, and its strains
are right where waves are long, which straight lines between stations need many more for. Where supports have
no more positions than that, the stations of a coherent wave are these and nothing is interpolated.

References
----------
Berrut, Trefethen, Barycentric Lagrange interpolation, SIAM Review 46 (2004), 501-517.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_matrix

from romdam.config.sections.motion_along import MOST_STATIONS, MotionAlongConfig
from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ConfigError
from romdam.core.motion import Incoherence, MovingSupports, SupportMotion
from romdam.core.scene import Block, Reservoir, Scene

log = logging.getLogger(__name__)

ERROR = 0.01  # rms of the motion between stations up to the cut-off, see `interpolation_error`
_SAME = 1e-9  # of the supports' extent: positions that are one
_BEYOND = 1e-6  # of the line's length: round-off of a support at its end
_FREQUENCIES = 8  # up to the cut-off, at which the error is looked at
_LOOKED_AT = 401  # places where the error is looked at: ten for each of the stations
_MOST_STRETCH = 5.0  # distance along the line of two nodes of a cell, of their distance: else the line turns


def motion_along(
    config: MotionAlongConfig,
    blocks: Mapping[str, Block],
    fixed: Mapping[str, Bools],
    supported: Mapping[str, Bools],
    location: str,
) -> MovingSupports:
    """Find the stations, and the share that each has in the motion of every node of a support.

    Parameters
    ----------
    fixed : block name -> (n, 3) components that are held
    supported : the same, of those that supports hold
    location : file and key, for messages

    Raises
    ------
    ConfigError
        for supports beyond the table, a line that turns between neighbours, too short a wave, and blocks
        whose matrices hold components by themselves.
    """
    for name, held in fixed.items():
        left_out = int((held & ~supported[name]).sum())
        if left_out:
            raise ConfigError(
                f"{location}: the matrices of block {name!r} leave out {left_out} components, whose motion "
                "is not known to be the supports', limit 0; write matrices of all components, and hold "
                "them by `supports`"
            )
    held_nodes = {name: np.flatnonzero(held.any(axis=1)) for name, held in fixed.items()}
    points = np.concatenate([blocks[name].points[nodes] for name, nodes in held_nodes.items()])
    if not len(points):
        raise ConfigError(f"{location}: is the motion of supports, and there are 0; give `supports`")
    if config.stations:
        motions, weights = _table(config, points, blocks, held_nodes, location)
        incoherence = None
    else:
        motions, weights, incoherence = _wave(config, points, location)
    shares, first = {}, 0
    for name, nodes in held_nodes.items():
        size = (len(blocks[name].points), len(motions))
        rows = np.repeat(nodes, len(motions))
        columns = np.tile(np.arange(len(motions)), len(nodes))
        values = weights[first : first + len(nodes)]
        shares[name] = csr_matrix((values.ravel(), (rows, columns)), shape=size)
        shares[name].eliminate_zeros()
        first += len(nodes)
    components = {name: np.full(block.points.shape, -1) for name, block in blocks.items()}
    log.info("%s: %d stations for %d nodes of supports", location, len(motions), len(points))
    return MovingSupports(tuple(motions), components, shares, incoherence)


def unit_axis(axis: str | tuple[float, float, float]) -> Floats:
    """(3,) unit vector of an axis or a direction."""
    direction = np.eye(3)["xyz".index(axis)] if isinstance(axis, str) else np.array(axis, dtype=float)
    return np.asarray(direction / np.linalg.norm(direction))


def _table(
    config: MotionAlongConfig,
    points: Floats,
    blocks: Mapping[str, Block],
    held_nodes: Mapping[str, np.ndarray],
    location: str,
) -> tuple[list[SupportMotion], Floats]:
    """Stations of a table, and their shares (n, k) at points (n, 3)."""
    if config.axis is not None:
        at = np.array([station.at for station in config.stations])
        along = points @ unit_axis(config.axis)
    else:
        line = np.array([station.at for station in config.stations])
        at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        along = _along_line(line, at, points)
        _refuse_turns(along, points, blocks, held_nodes, location)
    length = at[-1] - at[0]
    outside = np.maximum(at[0] - along, along - at[-1])
    beyond = outside > _BEYOND * length
    if beyond.any() and config.beyond == "refuse":
        k = 0 if along[outside.argmax()] < at[0] else len(at) - 1
        raise ConfigError(
            f"{location}.stations: do not cover the supports: {int(beyond.sum())} of {len(points)} nodes are "
            f"beyond the first and the last station, by up to {outside.max():.4g} m beyond stations[{k}], "
            "limit 0 m; give stations there, or `beyond: hold`, which moves them as the station at the end"
        )
    motions = [
        SupportMotion(k, station.delay, station.factor, station=float(at[k]))
        for k, station in enumerate(config.stations)
    ]
    place = np.clip(along, at[0], at[-1])
    return motions, np.stack([np.interp(place, at, unit) for unit in np.eye(len(at))], axis=1)


def _along_line(line: Floats, at: Floats, points: Floats) -> Floats:
    """Length (n,) along a line of points (k, 3) to what is nearest to each point, beyond its ends too."""
    least, along = np.full(len(points), np.inf), np.zeros(len(points))
    for k, (start, end) in enumerate(pairwise(line)):
        step = at[k + 1] - at[k]
        share = (points - start) @ (end - start) / step**2
        low = -np.inf if k == 0 else 0.0  # the first and the last piece go on
        high = np.inf if k == len(line) - 2 else 1.0
        share = np.clip(share, low, high)
        # what is beyond an end is as far from it as from the end itself, so that no piece wins by going on
        within = np.clip(share, 0.0, 1.0)
        distance = np.linalg.norm(points - start - within[:, None] * (end - start), axis=1)
        nearer = distance < least
        least[nearer], along[nearer] = distance[nearer], at[k] + share[nearer] * step
    return along


def _refuse_turns(
    along: Floats,
    points: Floats,
    blocks: Mapping[str, Block],
    held_nodes: Mapping[str, np.ndarray],
    location: str,
) -> None:
    """Raise where neighbours on a support are nearest to places of the line that are far apart."""
    first = 0
    for name, nodes in held_nodes.items():
        number = np.full(len(blocks[name].points), -1)
        number[nodes] = first + np.arange(len(nodes))
        first += len(nodes)
        cells = number[blocks[name].cells]
        for i in range(cells.shape[1] if len(nodes) else 0):
            pairs = np.stack([cells, np.roll(cells, i, axis=1)]).reshape(2, -1)
            a, b = pairs[:, (pairs >= 0).all(axis=0)]
            apart = np.linalg.norm(points[a] - points[b], axis=1)
            over = np.abs(along[a] - along[b]) - _MOST_STRETCH * apart
            if len(over) and over.max() > 0.0:
                k = int(over.argmax())
                raise ConfigError(
                    f"{location}.stations: nodes of block {name!r} that are {apart[k]:.4g} m apart are "
                    f"nearest to places of the line {abs(along[a[k]] - along[b[k]]):.4g} m apart, limit "
                    f"{_MOST_STRETCH:g} times as far: the motion would jump; give `axis` and coordinates "
                    "along it, or points nearer to the supports"
                )


def _wave(
    config: MotionAlongConfig, points: Floats, location: str
) -> tuple[list[SupportMotion], Floats, Incoherence | None]:
    """Stations of a wave, their shares (n, k) at points (n, 3), and the random part of their motions."""
    assert config.axis is not None
    along = points @ unit_axis(config.axis)
    low, high = float(along.min()), float(along.max())
    start = low if config.start is None else config.start
    if config.velocity is not None and low < start - _SAME * (high - low):
        raise ConfigError(
            f"{location}.start: the wave meets supports {start - low:.4g} m before the place where "
            f"its motion is the record ({low:g} m before {start:g} m), limit 0 m, as the record begins "
            f"there; set start to {low:g} m, or less"
        )
    rising = np.sort(along)
    different = rising[np.diff(rising, prepend=-np.inf) > _SAME * (high - low)]
    slowness = 0.0 if config.velocity is None else 1.0 / config.velocity
    loss = 0.0 if config.incoherence is None else config.incoherence.alpha / config.incoherence.shear_velocity
    omega = 2.0 * np.pi * config.cutoff * np.arange(1, _FREQUENCIES + 1) / _FREQUENCIES
    # random motions are of places, whatever the mesh: another mesh of the same dam has the same stations
    given = loss == 0.0
    looked_at = np.linspace(low, high, _LOOKED_AT)
    if given:
        looked_at = different[np.unique(np.linspace(0, len(different) - 1, _LOOKED_AT).astype(int))]
    for count in range(1, MOST_STATIONS + 1):
        at = chebyshev_points(low, high, count)
        exact = given and count >= len(different)
        if exact:
            at = different
        error = interpolation_error(looked_at, at, slowness, loss, omega)
        if error <= ERROR or exact:
            break
    else:
        raise ConfigError(
            f"{location}: {MOST_STATIONS} stations leave an error of {error:.2g} in the motion between "
            f"them at {config.cutoff:g} Hz, limit {ERROR:g}, along {high - low:.4g} m of supports; lower "
            "`cutoff`, or correct `velocity` and `incoherence`"
        )
    motions = [
        SupportMotion(k, max(0.0, slowness * (place - start)), station=place)
        for k, place in enumerate(at.tolist())
    ]
    random = config.incoherence
    incoherence = None if random is None or loss == 0.0 else Incoherence(at - start, loss, random.seed)
    return motions, lagrange(along, at), incoherence


def chebyshev_points(low: float, high: float, count: int) -> Floats:
    """(k,) rising places with both ends; the middle alone where there is one [m]."""
    if count == 1:
        return np.array([0.5 * (low + high)])
    unit = np.cos(np.pi * np.arange(count)[::-1] / (count - 1))
    return np.asarray(0.5 * (low + high) + 0.5 * (high - low) * unit)


def lagrange(along: Floats, at: Floats) -> Floats:
    """Shares (n, k) of values at some places (k,) in those of the polynomial through them at others (n,)."""
    if len(at) == 1:
        return np.ones((len(along), 1))
    size = float(at[-1] - at[0])
    apart = 4.0 * (at[:, None] - at) / size + np.eye(len(at))  # scaled so that products stay near 1
    weights = 1.0 / np.prod(apart, axis=1)
    from_places = (along[:, None] - at) / size
    hits = np.abs(from_places) < 10.0 * _SAME
    terms = weights / np.where(hits, 1.0, from_places)
    at_station = hits.any(axis=1)
    terms[at_station] = hits[at_station]
    return np.asarray(terms / terms.sum(axis=1, keepdims=True))


def interpolation_error(along: Floats, at: Floats, slowness: float, loss: float, omega: Floats) -> float:
    """Largest rms error of the motion between stations at some frequencies.

    It is relative to the record's motion, and to the difference between the ends where that is less, so that
    strains of long waves are right too. With gamma(d) = exp(-(loss omega d)^2 - i omega slowness d) the
    coherency of two places and w the shares of the stations, it is the root of
    1 - 2 Re w gamma(along, at) + w gamma(at, at) w^T.

    Parameters
    ----------
    along, at : (n,) places, (k,) stations [m]
    slowness, loss : 1 / apparent velocity, and as `Incoherence.loss` [s/m]
    omega : (f,) [rad/s]
    """
    shares, worst, length = lagrange(along, at), 0.0, float(np.ptp(along))
    for frequency in omega:

        def coherency(distance: Floats, frequency: float = frequency) -> np.ndarray:
            return np.exp(-((loss * frequency * distance) ** 2) - 1j * frequency * slowness * distance)

        with_stations = (shares * coherency(along[:, None] - at)).sum(axis=1).real
        among = np.einsum("nk,kl,nl->n", shares, coherency(at[:, None] - at), shares, optimize=True).real
        error = float((1.0 - 2.0 * with_stations + among).max())
        difference = frequency * length * np.hypot(slowness, np.sqrt(2.0) * loss)
        if difference > 0.0:
            worst = max(worst, error / min(1.0, difference**2))
    return float(np.sqrt(worst))


def along_remarks(scene: Scene, moving: MovingSupports, config: MotionAlongConfig) -> Iterator[str]:
    """Tell what supports move by position, and what does not move with them."""
    if config.beyond == "hold":
        count = 0
        for name, shares in moving.shares.items():
            whole = np.asarray(shares[:, [0, -1]].toarray()) == 1.0
            count += int((whole & scene.fixed[name].any(axis=1, keepdims=True)).sum())
        yield (
            f"ground.along.beyond: hold: {count} nodes of supports move as the first or the last station, "
            "at or beyond them"
        )
    water = scene.find(Reservoir)
    if water is not None and not water.rock:
        yield (
            "ground.along: the floor and the banks of the reservoir move as the record, not along with the "
            "supports; with rock that is meshed, `water.rock` lets them move with it"
        )
