"""What a configuration attaches to the blocks of a scene: anchors, dampers and masses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from romdam.config.job import Config
from romdam.config.sections.attachments import AnchorConfig, DamperConfig, Place, PointConfig
from romdam.core.arrays import Bools, Floats, Ints
from romdam.core.attachment import Attachment
from romdam.core.errors import ConfigError
from romdam.core.scene import Block
from romdam.scene.points import face_weights, point_weights
from romdam.scene.select import select_facets


@dataclass(frozen=True)
class AttachmentPlaces:
    """What builders of attachments see of a scene.

    Attributes
    ----------
    blocks : name -> Block
    fixed : block name -> (n, 3) True where a support holds the component
    gravity : (3,) acceleration that makes weight [m/s2]
    source : name of the configuration file, for messages
    """

    blocks: Mapping[str, Block]
    fixed: Mapping[str, Bools]
    gravity: Floats
    source: str

    def along(self, point: PointConfig, directions: Floats, key: str) -> dict[str, csr_matrix]:
        """Rows (r, 3 nodes) of a point's block that give its displacement along unit vectors (r, 3).

        Parameters
        ----------
        key : of the configuration, for messages
        """
        block = self.blocks[point.block]
        nodes, weights = point_weights(block, point.at, point.tolerance, f"{self.source}: {key}")
        return {point.block: rows_of(block, nodes, weights, directions)}

    def apart(
        self, head: PointConfig, foot: PointConfig | None, direction: Floats, key: str
    ) -> dict[str, csr_matrix]:
        """Rows (1, 3 nodes) by which `head` goes away from `foot` along a unit vector (3,).

        Both points may be of one block. Without a foot the other end moves with the base.
        """
        rows = self.along(head, direction[None], f"{key}.head")
        for name, of_foot in (
            {} if foot is None else self.along(foot, direction[None], f"{key}.foot")
        ).items():
            rows[name] = rows[name] - of_foot if name in rows else -of_foot
        self.refuse_held(rows, key)
        return rows

    def distance(self, head: PointConfig, foot: Place, key: str) -> tuple[dict[str, csr_matrix], float]:
        """Rows (1, 3 nodes) by which the distance of two points grows, and that distance [m].

        Raises
        ------
        ConfigError
            for points so close that they have no direction.
        """
        of_block = foot if isinstance(foot, PointConfig) else None
        axis = np.array(head.at) - np.array(foot.at if isinstance(foot, PointConfig) else foot)
        length = float(np.linalg.norm(axis))
        if length <= head.tolerance:
            raise ConfigError(
                f"{self.source}: {key}: its ends are {length:.3g} m apart, limit more than the tolerance of "
                f"{head.tolerance:g} m, so that it has a direction; name two places"
            )
        return self.apart(head, of_block, axis / length, key), length

    def refuse_held(self, rows: Mapping[str, csr_matrix], key: str) -> None:
        """Refuse what supports hold wholly, so that it would do nothing.

        Raises
        ------
        ConfigError
            with the key.
        """
        if not any(
            abs(of_block[:, ~self.fixed[name].ravel()]).sum() > 0.0 for name, of_block in rows.items()
        ):
            raise ConfigError(
                f"{self.source}: {key}: supports hold every node that it acts on, limit some that move: it "
                "would do nothing; name another place, or leave it out"
            )


Builder = Callable[[Config, AttachmentPlaces], list[Attachment]]


def build_attachments(config: Config, places: AttachmentPlaces) -> tuple[Attachment, ...]:
    """Everything that a configuration attaches to the blocks.

    Raises
    ------
    ConfigError
        for places that are not in the blocks, and what supports hold.
    """
    return tuple(one for build in BUILDERS.values() for one in build(config, places))


def rows_of(block: Block, nodes: Ints, weights: Floats, direction: Floats) -> csr_matrix:
    """(r, 3 nodes) weighted displacement of nodes (m,) of a block along directions (r, 3)."""
    values = direction[:, None, :] * weights[:, None]  # (r, m, 3)
    columns = 3 * nodes[:, None] + np.arange(3)
    row = np.broadcast_to(np.arange(len(direction))[:, None, None], values.shape)
    places = np.broadcast_to(columns, values.shape)
    return csr_matrix((values.ravel(), (row.ravel(), places.ravel())), (len(direction), block.points.size))


def _anchors(config: Config, places: AttachmentPlaces) -> list[Attachment]:
    return [_anchor(name, anchor, places) for name, anchor in config.anchors.items()]


def _anchor(name: str, anchor: AnchorConfig, places: AttachmentPlaces) -> Attachment:
    """Its elongation: how far its ends go apart along its axis."""
    key = f"anchors.{name}"
    rows, length = places.distance(anchor.head, anchor.foot, key)
    return Attachment(
        effect="anchors",
        name=name,
        rows=rows,
        stiffness=np.array([anchor.stiffness_over(length)]),
        tension=np.array([(1.0 - anchor.loss) * anchor.pretension]),
        limits=(0.0 if anchor.pretension else -np.inf, anchor.strength or np.inf),
        key=key,
    )


def _dampers(config: Config, places: AttachmentPlaces) -> list[Attachment]:
    return [_damper(name, damper, places) for name, damper in config.dampers.items()]


def _damper(name: str, damper: DamperConfig, places: AttachmentPlaces) -> Attachment:
    """A dashpot on the distance of its ends."""
    key = f"dampers.{name}"
    rows, _ = places.distance(damper.head, damper.foot, key)
    return Attachment("dampers", name, rows, damping=np.array([damper.damping]), key=key)


def _masses(config: Config, places: AttachmentPlaces) -> list[Attachment]:
    """Masses on the mean displacement of a place along x, y and z."""
    masses = []
    for name, lumped in config.masses.items():
        key, block = f"masses.{name}", places.blocks[lumped.block]
        if lumped.at is not None:
            point = PointConfig(block=lumped.block, at=lumped.at, tolerance=lumped.tolerance)
            rows = places.along(point, np.eye(3), f"{key}.at")
        else:
            assert lumped.face is not None
            facets = select_facets(block, lumped.face, f"{places.source}: {key}.face")
            weights, _ = face_weights(block, facets)
            some = np.flatnonzero(weights)
            rows = {lumped.block: rows_of(block, some, weights[some], np.eye(3))}
        if block.material.rho == 0.0 and block.matrices is None:
            raise ConfigError(
                f"{places.source}: {key}: block {lumped.block!r} has no mass, and its reduced model no "
                "inertia that this one's could be added to; name another block, or leave out `mass: false`"
            )
        places.refuse_held(rows, key)
        masses.append(
            Attachment(
                effect="masses",
                name=name,
                rows=rows,
                mass=np.full(3, lumped.mass),
                weight=lumped.mass * places.gravity,
                key=key,
            )
        )
    return masses


BUILDERS: dict[str, Builder] = {"anchors": _anchors, "dampers": _dampers, "masses": _masses}
