"""A prismatic reservoir: the wet faces' mesh extruded upstream, and the integrals over it.

Linear prisms and hexahedra, which conform to any face. Its walls are what the rim of the wet mesh sweeps:
floor, banks and, of a slice, its planes of symmetry; its far end is a plane across the channel.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import block_diag, csr_matrix

from romdam.core.scene import Block, Ints, Reservoir
from romdam.fem.water.body import Section, WaterBody, scattered, section_of, vector_operator
from romdam.geometry.elements import ELEMENTS, Floats
from romdam.geometry.facets import row_numbers
from romdam.scene.reservoir.reservoir_mesh import UPRIGHT
from romdam.scene.reservoir.wet_mesh import WetMesh, WetPieces, wet_mesh

_GROWTH = 1.2  # of a layer's thickness over the one before it, away from the dam


@dataclass(frozen=True)
class Prism:
    """Layers of nodes from the dam to the far end, each numbered as the wet mesh.

    Attributes
    ----------
    mesh : of the wet faces, k nodes
    points : (layers * k, 3) [m]
    layers : number of layers of nodes
    upstream : (3,) horizontal unit vector away from the dam
    """

    mesh: WetMesh
    points: Floats
    layers: int
    upstream: Floats

    def cells(self) -> Iterator[tuple[WetPieces, Ints, Floats, Floats]]:
        """Pieces of the wet mesh with the cells (n, 2c) over them, gradients and volumes."""
        k = len(self.mesh.points)
        for piece in self.mesh.pieces:
            base = np.arange(self.layers - 1)[:, None, None] * k + piece.nodes
            cells = np.concatenate([base, base + k], axis=2).reshape(-1, 2 * piece.nodes.shape[1])
            yield piece, cells, *_prism_gradients(self.points[cells], piece)

    def far(self, nodes: Ints) -> Ints:
        """Nodes of the wet mesh as those of the far end."""
        return nodes + (self.layers - 1) * len(self.mesh.points)


def prism(water: Reservoir, mesh: WetMesh, longest: float = np.inf) -> Prism:
    """Extrude the wet mesh as far as the reservoir reaches, in layers that grow up to `longest` [m]."""
    shares = _layers(water, mesh, longest)
    along = mesh.points @ water.upstream
    way = along.max() + water.length - along
    points = np.concatenate([mesh.points + np.outer(way * s, water.upstream) for s in shares])
    return Prism(mesh, points, len(shares), water.upstream)


def prism_body(water: Reservoir, blocks: dict[str, Block], longest: float = np.inf) -> WaterBody:
    """Integrate over a prismatic reservoir, whose layers are up to `longest` thick [m]."""
    mesh = wet_mesh(blocks, water)
    channel = prism(water, mesh, longest)
    T = csr_matrix(mesh.follow[:, mesh.independent])
    over, count = csr_matrix(block_diag([T] * channel.layers)), T.shape[1]
    H, G, rigid = _volumes(channel)
    section = _far_section(channel)
    return WaterBody(
        H=csr_matrix(over.T @ H @ over),
        G=csr_matrix(over.T @ G @ over),
        floor=csr_matrix(over.T @ _floor(channel) @ over),
        rigid=over.T @ rigid,
        wet=np.arange(count),  # the first layer
        coupling={name: csr_matrix(T.T @ Q) for name, Q in _wet_coupling(blocks, mesh).items()},
        end=np.arange(over.shape[1] - count, over.shape[1]),
        section=section.following(T),
    )


def _volumes(reservoir: Prism) -> tuple[csr_matrix, csr_matrix, Floats]:
    """Laplacian [m], int N N dV [m3], and the flux (nodes, 3) of the walls' unit rigid motions [m2].

    The flux through all walls follows from the divergence theorem, less the far end, which stays.
    """
    size = len(reservoir.points)
    H, G, rigid = csr_matrix((size, size)), csr_matrix((size, size)), np.zeros((size, 3))
    for piece, cells, gradient, volume in reservoir.cells():
        shape = _prism_shape(piece)
        stiff = np.einsum("nqka,nqkb,nq->nab", gradient, gradient, volume, optimize=True)
        H = H + scattered(stiff, cells, size)
        G = G + scattered(np.einsum("qa,qb,nq->nab", shape, shape, volume, optimize=True), cells, size)
        np.add.at(rigid, cells, -np.einsum("nqka,nq->nak", gradient, volume, optimize=True))
        end = reservoir.far(piece.nodes)
        np.add.at(rigid, end, _far_end(reservoir.points[end], piece, reservoir.upstream))
    return csr_matrix(H), csr_matrix(G), rigid


def _floor(reservoir: Prism) -> csr_matrix:
    """int N N dA over the floor and the banks that lean, which are the walls that take waves up [m2]."""
    k, size, quad = len(reservoir.mesh.points), len(reservoir.points), ELEMENTS["quad4"]
    edges = _floor_edges(reservoir)
    base = np.arange(reservoir.layers - 1)[:, None, None] * k + edges
    walls = np.concatenate([base, base[..., ::-1] + k], axis=2).reshape(-1, 4)
    xi, weight = quad.rule_of(2)
    shape = quad.shape(xi)
    tangents = np.einsum("qda,nak->nqdk", quad.gradient(xi), reservoir.points[walls])
    area = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=2) * weight
    return scattered(np.einsum("qa,qb,nq->nab", shape, shape, area, optimize=True), walls, size)


def _far_section(reservoir: Prism) -> Section:
    """The far end's plane, whose nodes are numbered as the wet mesh."""
    mesh = reservoir.mesh
    axes = np.stack([np.cross([0.0, 0.0, 1.0], reservoir.upstream), [0.0, 0.0, 1.0]])
    flat = reservoir.points[reservoir.far(np.arange(len(mesh.points)))] @ axes.T
    return section_of(flat, axes, [(p.element, p.nodes) for p in mesh.pieces], _floor_edges(reservoir))


def _floor_edges(reservoir: Prism) -> Ints:
    """Edges (n, 2) of the wet mesh's rim, without seams, that sweep a wall which is not upright."""
    mesh = reservoir.mesh
    edges = mesh.rim
    seams = row_numbers(np.concatenate([edges, mesh.seams]))
    edges = edges[~np.isin(seams[: len(edges)], seams[len(edges) :])]
    normal = np.cross(mesh.points[edges[:, 1]] - mesh.points[edges[:, 0]], reservoir.upstream)
    return np.asarray(edges[np.abs(normal[:, 2]) > UPRIGHT * np.linalg.norm(normal, axis=1)])


def _layers(water: Reservoir, mesh: WetMesh, longest: float) -> Floats:
    """Share of the way from the dam to the far end of every layer of nodes, from 0 to 1."""
    edges = [mesh.points[p.nodes] - mesh.points[np.roll(p.nodes, 1, axis=1)] for p in mesh.pieces]
    size = np.mean([np.linalg.norm(edge, axis=2).mean() for edge in edges])
    growing = int(np.ceil(np.log1p(water.length / size * (_GROWTH - 1.0)) / np.log(_GROWTH)))
    most = max(growing, 2) + int(water.length / longest)
    thickness = np.minimum(_GROWTH ** np.arange(most), longest / size)
    count = int(np.searchsorted(np.cumsum(thickness), water.length / size * (1.0 - 1e-9))) + 1
    thickness = thickness[: max(count, 2)]
    return np.concatenate([[0.0], np.cumsum(thickness) / thickness.sum()])


def _rule(piece: WetPieces) -> tuple[Floats, Floats, Floats, Floats]:
    """Points and weights on a piece, and along the prism from 0 to 1."""
    eta, w_base = piece.element.rule_of(2)
    t, w_line = np.polynomial.legendre.leggauss(2)
    return eta, w_base, (t + 1.0) / 2.0, w_line / 2.0


def _prism_shape(piece: WetPieces) -> Floats:
    """Linear shape functions (nq, 2c) of a prism."""
    eta, _, t, _ = _rule(piece)
    shape = piece.element.shape(eta)
    up = np.stack([1.0 - t, t], axis=1)
    return np.einsum("qa,lj->qlja", shape, up).reshape(len(eta) * len(t), -1)


def _prism_gradients(x: Floats, piece: WetPieces) -> tuple[Floats, Floats]:
    """Gradients (n, nq, 3, 2c) of the linear shape functions of prisms (n, 2c, 3), volumes (n, nq) [m3]."""
    base, (eta, w_base, t, w_line) = piece.element, _rule(piece)
    shape, slope = base.shape(eta), base.gradient(eta)
    up = np.stack([1.0 - t, t], axis=1)
    across = np.einsum("qda,lj->qldja", slope, up).reshape(len(eta) * len(t), 2, -1)
    through = np.einsum("qa,j->qja", shape, np.array([-1.0, 1.0])).reshape(len(eta), 1, 1, -1)
    through = np.broadcast_to(through, (len(eta), len(t), 1, through.shape[-1])).reshape(
        -1, 1, through.shape[-1]
    )
    local = np.concatenate([across, through], axis=1)
    jacobian = np.einsum("qda,nak->nqdk", local, x)
    volume = np.abs(np.linalg.det(jacobian)) * np.outer(w_base, w_line).ravel()
    return np.asarray(np.linalg.solve(jacobian, local[None]), dtype=float), volume


def _far_end(x: Floats, piece: WetPieces, upstream: Floats) -> Floats:
    """int N n dA (n, c, 3) over the plane far end, whose normal out of the water is `upstream`."""
    base = piece.element
    eta, weight = base.rule
    tangents = np.einsum("qda,nak->nqdk", base.gradient(eta), x)
    area = np.abs(np.cross(tangents[:, :, 0], tangents[:, :, 1]) @ upstream) * weight
    return np.einsum("qa,nq->na", base.shape(eta), area)[..., None] * upstream


def _wet_coupling(blocks: dict[str, Block], mesh: WetMesh) -> dict[str, csr_matrix]:
    """Q (wet nodes, 3 n) of every block: int N_p n . N_u dA, outward from the dam [m2]."""
    found: dict[str, csr_matrix] = {}
    for piece in mesh.pieces:
        points = blocks[piece.block].points
        linear, shape, area, _ = piece.quadrature(points)
        values = np.einsum("qc,nqa,nqk->ncak", linear, shape, area, optimize=True)
        Q = vector_operator(
            piece.nodes[:, :, None], piece.facets[:, None, :], values, (len(mesh.points), len(points))
        )
        found[piece.block] = csr_matrix(found[piece.block] + Q) if piece.block in found else Q
    return found
