"""A prismatic reservoir: the wet faces' mesh extruded upstream, and the integrals over it.

Linear prisms and hexahedra, which conform to any face. Its walls are what the rim of the wet mesh sweeps:
floor, banks and, of a slice, its planes of symmetry; its far end is a plane across the channel.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import block_diag, csr_matrix, vstack

from romdam.core.scene import Block, Ints, Reservoir
from romdam.fem.water.body import WaterBody, scattered, section_of, vector_operator
from romdam.fem.water.coupling import wall_couplings, yielding_of_rock
from romdam.geometry.elements import ELEMENTS, Floats
from romdam.scene.mortar.surface import MortarSurface
from romdam.scene.reservoir.walls import wall_edges
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

    def cells(self) -> Iterator[tuple[WetPieces, Ints, Floats, Floats, Floats]]:
        """Pieces of the wet mesh with the cells over them.

        Yields
        ------
        piece
        cells : (n, 2c) nodes
        shape : (nq, 2c) linear shape functions
        gradient : (n, nq, 3, 2c) of these [1/m]
        volume : (n, nq) of the points [m3]
        """
        k = len(self.mesh.points)
        for piece in self.mesh.pieces:
            lower = np.arange(self.layers - 1)[:, None, None] * k + piece.nodes
            cells = np.concatenate([lower, lower + k], axis=2).reshape(-1, 2 * piece.nodes.shape[1])
            base, (eta, w_base) = piece.element, piece.element.rule_of(2)
            t, w_line = np.polynomial.legendre.leggauss(2)
            t, w_line = (t + 1.0) / 2.0, w_line / 2.0  # along the prism from 0 to 1
            flat, slope, count = base.shape(eta), base.gradient(eta), len(eta) * len(t)
            up = np.stack([1.0 - t, t], axis=1)
            shape = np.einsum("qa,lj->qlja", flat, up).reshape(count, -1)
            across = np.einsum("qda,lj->qldja", slope, up).reshape(count, 2, -1)
            through = np.einsum("qa,j->qja", flat, np.array([-1.0, 1.0])).reshape(len(eta), -1)
            through = np.repeat(through, len(t), axis=0)[:, None]
            local = np.concatenate([across, through], axis=1)
            jacobian = np.einsum("qda,nak->nqdk", local, self.points[cells])
            volume = np.abs(np.linalg.det(jacobian)) * np.outer(w_base, w_line).ravel()
            gradient = np.asarray(np.linalg.solve(jacobian, local[None]), dtype=float)
            yield piece, cells, shape, gradient, volume

    def far(self, nodes: Ints) -> Ints:
        """Nodes of the wet mesh as those of the far end."""
        return nodes + (self.layers - 1) * len(self.mesh.points)


def prism(water: Reservoir, mesh: WetMesh, longest: float = np.inf) -> Prism:
    """Extrude the wet mesh as far as the reservoir reaches, in layers that grow up to `longest` [m]."""
    edges = [mesh.points[p.nodes] - mesh.points[np.roll(p.nodes, 1, axis=1)] for p in mesh.pieces]
    size = np.mean([np.linalg.norm(edge, axis=2).mean() for edge in edges])
    growing = int(np.ceil(np.log1p(water.length / size * (_GROWTH - 1.0)) / np.log(_GROWTH)))
    most = max(growing, 2) + int(water.length / longest)
    thickness = np.minimum(_GROWTH ** np.arange(most), longest / size)
    count = int(np.searchsorted(np.cumsum(thickness), water.length / size * (1.0 - 1e-9))) + 1
    thickness = thickness[: max(count, 2)]
    shares = np.concatenate([[0.0], np.cumsum(thickness) / thickness.sum()])
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
    points, upstream, size = channel.points, channel.upstream, len(channel.points)
    # the flux through all walls follows from the divergence theorem, less the far end, which stays
    H, G, rigid = csr_matrix((size, size)), csr_matrix((size, size)), np.zeros((size, 3))
    for piece, cells, shape, gradient, volume in channel.cells():
        stiff = np.einsum("nqka,nqkb,nq->nab", gradient, gradient, volume, optimize=True)
        H = H + scattered(stiff, cells, size)
        G = G + scattered(np.einsum("qa,qb,nq->nab", shape, shape, volume, optimize=True), cells, size)
        np.add.at(rigid, cells, -np.einsum("nqka,nq->nak", gradient, volume, optimize=True))
        end, (eta, weight) = channel.far(piece.nodes), piece.element.rule
        tangents = np.einsum("qda,nak->nqdk", piece.element.gradient(eta), points[end])
        area = np.abs(np.cross(tangents[:, :, 0], tangents[:, :, 1]) @ upstream) * weight
        flux = np.einsum("qa,nq->na", piece.element.shape(eta), area)[..., None] * upstream
        np.add.at(rigid, end, flux)
    # walls, outward; floor and banks that lean take waves up
    k, quad = len(mesh.points), ELEMENTS["quad4"]
    edges, leans = wall_edges(mesh, upstream)
    lower = np.arange(channel.layers - 1)[:, None, None] * k + edges
    every_wall = np.concatenate([lower, lower[..., ::-1] + k], axis=2)
    walls, all_walls = (
        every_wall[:, leans].reshape(-1, 4),
        MortarSurface("reservoir", points, every_wall.reshape(-1, 4)),
    )
    xi, weight = quad.rule_of(2)
    shape = quad.shape(xi)
    tangents = np.einsum("qda,nak->nqdk", quad.gradient(xi), points[walls])
    area = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=2) * weight
    floor = scattered(np.einsum("qa,qb,nq->nab", shape, shape, area, optimize=True), walls, size)
    # the far end's plane, whose nodes are numbered as the wet mesh
    axes = np.stack([np.cross([0.0, 0.0, 1.0], upstream), [0.0, 0.0, 1.0]])
    flat = points[channel.far(np.arange(k))] @ axes.T
    yields = yielding_of_rock(all_walls, water.rock, blocks)[len(all_walls.facets) - len(edges) :]
    faces = [(p.element, p.nodes) for p in mesh.pieces]
    section = section_of(flat, axes, faces, edges, absorbs=leans.astype(float), yields=yields)
    coupling: dict[str, csr_matrix] = {}  # int N_p n . N_u dA, outward from the dam
    for piece in mesh.pieces:
        of_block = blocks[piece.block].points
        linear, shape, vectors, _ = piece.quadrature(of_block)
        values = np.einsum("qc,nqa,nqk->ncak", linear, shape, vectors, optimize=True)
        rows, columns = piece.nodes[:, :, None], piece.facets[:, None, :]
        Q = vector_operator(rows, columns, values, (k, len(of_block)))
        coupling[piece.block] = csr_matrix(coupling[piece.block] + Q) if piece.block in coupling else Q
    unknowns = over.shape[1]
    couplings = {  # of all unknowns, the first layer's first
        name: csr_matrix(vstack([T.T @ Q, csr_matrix((unknowns - count, Q.shape[1]))]))
        for name, Q in coupling.items()
    }
    wet = np.arange(count)
    for name, Q in wall_couplings(all_walls, water.rock, blocks).items():
        of_rock = csr_matrix(over.T @ Q)
        wet = np.union1d(wet, np.flatnonzero(np.diff(of_rock.indptr)))
        couplings[name] = csr_matrix(couplings[name] + of_rock) if name in couplings else of_rock
    return WaterBody(
        H=csr_matrix(over.T @ csr_matrix(H) @ over),
        G=csr_matrix(over.T @ csr_matrix(G) @ over),
        floor=csr_matrix(over.T @ floor @ over),
        rigid=over.T @ rigid,
        wet=wet,
        coupling={name: Q[wet] for name, Q in couplings.items()},
        end=np.arange(over.shape[1] - count, over.shape[1]),
        section=section.following(T),
    )
