"""A scene that has been built: blocks, joints, supports, loads, in plain arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self, TypeVar

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Bools, Floats, Ints
from romdam.core.motion import ForceSignal
from romdam.core.scene_effect import SceneEffect
from romdam.core.system import CrackedUplift, LawRows

Kind = TypeVar("Kind", bound=SceneEffect)

MOST_RING = 0.5  # of a face's area, beyond which too little of it is judged


LOAD_KINDS = ("weight", "forces", "water", "temperature")  # of static loads, in the usual order


@dataclass(frozen=True)
class Material:
    """Isotropic linear elasticity.

    Attributes
    ----------
    E : Young's modulus of what the record adds, and of all where `E_sustained` is None [Pa]
    nu : Poisson's ratio
    rho : density [kg/m3]
    expansion : linear thermal expansion [1/K]
    E_sustained : Young's modulus of loads that last, where it is another [Pa]
    damping : alpha [1/s] and beta [s] of C = alpha M + beta K of what is made of it; None where it has the
        damping of the whole scene
    """

    E: float
    nu: float
    rho: float
    expansion: float = 0.0
    E_sustained: float | None = None
    damping: tuple[float, float] | None = None

    @property
    def sustained_ratio(self) -> float:
        """Stiffness under loads that last over that of the record."""
        return 1.0 if self.E_sustained is None else self.E_sustained / self.E

    @property
    def sustained(self) -> Self:
        """The material as loads that last meet it."""
        return self if self.E_sustained is None else replace(self, E=self.E_sustained, E_sustained=None)

    @property
    def wave_speeds(self) -> tuple[float, float]:
        """Of shear and of pressure waves [m/s]."""
        shear = math.sqrt(self.E / (2.0 * (1.0 + self.nu) * self.rho))
        return shear, shear * math.sqrt((2.0 - 2.0 * self.nu) / (1.0 - 2.0 * self.nu))

    def with_mass(self, mass: bool) -> Self:
        """The same, or without mass."""
        return self if mass else replace(self, rho=0.0)


@dataclass(frozen=True)
class Absorbing:
    """Facets (nf, nodes per facet) where the ground goes on; distance from the dam, inf without [m]."""

    facets: Ints
    distance: float


@dataclass(frozen=True)
class FreeField(SceneEffect):
    """Rock as it would be without a dam: layers, in which plane waves travel up and down.

    Attributes
    ----------
    levels : (layers + 1,) elevations of the ends of a column's elements, the free surface first [m]
    materials : of each element
    order : of the column's elements, 1 or 2, as the rock's own are
    blocks : of rock
    slowness : of the waves along x and y, one over the apparent velocity; zero where they travel straight up
        [s/m]
    origin : x and y where the surface moves as the record [m]
    """

    levels: Floats
    materials: tuple[Material, ...]
    order: int
    blocks: frozenset[str]
    slowness: tuple[float, float] = (0.0, 0.0)
    origin: tuple[float, float] = (0.0, 0.0)

    @property
    def inclined(self) -> bool:
        """Tell whether the waves travel at an angle."""
        return any(self.slowness)


@dataclass(frozen=True)
class BlockMatrices:
    """Matrices of a block that come from a file; its DOFs are 3 * node + component, as those of any block.

    Nodes of the block's mesh come first, then nodes of the file that the mesh has not, then places of three
    unknowns each for rotations and for coordinates of other kinds, on which no joint acts.

    Attributes
    ----------
    K, M : (3 n, 3 n) sparse, symmetric; rows of DOFs that are no unknowns are empty [N/m], [kg]
    motion : (n, 3) what each DOF is: 0, 1, 2 displacement along x, y, z; 3, 4, 5 rotation about them;
        6 any other coordinate; -1 no unknown
    translations : (3 n, 3) displacement in unit translations along x, y, z; coordinates of other kinds follow
        as K says
    C : (3 n, 3 n) sparse, in place of Rayleigh damping; None without [N s/m]
    inertia : (3 n, 3) M r for unit translations r along x, y, z, where it does not follow from M and
        `translations`; None where it does
    force : (3 n,) static force that comes with the matrices [N]
    warnings : what a careful reader should know of them, one sentence each
    """

    K: csr_matrix
    M: csr_matrix
    motion: Ints
    translations: Floats
    C: csr_matrix | None
    inertia: Floats | None
    force: Floats
    warnings: tuple[str, ...] = ()

    @property
    def absent(self) -> Bools:
        """(n, 3) True where a DOF is no unknown."""
        return self.motion < 0


@dataclass(frozen=True)
class Block:
    """One substructure's mesh.

    Attributes
    ----------
    name : unique in the scene
    element : its name in `romdam.geometry.elements`
    points : (n, 3) node positions [m]
    cells : (nc, nodes per cell) node numbers in the VTK order
    material : of every cell
    faces : name -> (nf, nodes per facet) node numbers of facets, VTK order, outward
    absorbing : faces that take waves up, see `romdam.fem.absorbing`
    matrices : that are used in place of what the cells would have; None where the cells are assembled
    unsound_faces : name -> why the mesh file's group or set of that name is no face
    """

    name: str
    element: str
    points: Floats
    cells: Ints
    material: Material
    faces: dict[str, Ints]
    absorbing: tuple[Absorbing, ...] = ()
    matrices: BlockMatrices | None = None
    unsound_faces: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class JointFace:
    """Linear facets (nf, corners), a kind in each array, of a block at whose corners a joint's gaps are."""

    block: str
    facets: tuple[Ints, ...]


@dataclass(frozen=True)
class Joint:
    """Gap elements between the faces I and J of two blocks.

    The jump of gap m is w_m = axes[m] @ (sum_k weights[1][m, k] u_J[nodes[1][k]] - sum_k weights[0][m, k]
    u_I[nodes[0][k]]): opening along i, slip along j and k; force and jump are conjugate in work. On linear
    faces whose nodes coincide there is a gap on every pair and the weights are the identity. Elsewhere it is
    a mean of the jump around the gap's position, so that uniform pressure stays uniform; the jump at the very
    position then follows from `at_point`.

    Attributes
    ----------
    name : unique in the scene
    blocks : names of the blocks I and J
    nodes : node numbers in block I and in block J, those that gaps see
    position : (n, 3) of the gaps [m]
    area : (n,) tributary areas, all positive, which stiffness and strength follow from [m2]
    share : (n,) the joint's area nearby that is held or tied on both sides, so that it bears nothing [m2]
    axes : (n, 3, 3) rows i (normal, from I to J), j, k
    weights : (n, nodes) sparse, of either side; rows sum to 1
    gap : (n,) initial gap [m]; negative is initial penetration
    K_n, K_nz, K_s : (n,) stiffness of each gap [N/m]; K_n is inf where rigid
    mu : (n, 2) friction coefficients along j and k
    viscosity : (n,) normal dashpot of each gap [N s/m]
    grout : (n,) force of the grouting that stays in the gaps [N]
    water : (n,) force of the water in the joint that pushes its sides apart, and no part of K_n's [N]
    laws : further laws that the joint has
    at_point : as `weights`, of the jump at the gaps' very positions; None where it is the same
    face : that the gaps stand on
    corner : (n,) node of the face's block at which each gap stands
    patches : (n, nodes of the face's block) of the mean over what each gap stands for, rows sum to 1; None
        where that is its corner's share of the facets
    uplift : water whose pressure follows from the crack at rest; None where it does not
    element_stiffness : normal and shear stiffness of the elements beside the joint, where its own follows
        from them; else 0 [N/m3]
    """

    name: str
    blocks: tuple[str, str]
    nodes: tuple[Ints, Ints]
    position: Floats
    area: Floats
    share: Floats
    axes: Floats
    weights: tuple[csr_matrix, csr_matrix]
    gap: Floats
    K_n: Floats
    K_nz: Floats
    K_s: Floats
    mu: Floats
    viscosity: Floats
    grout: Floats
    water: Floats
    laws: tuple[LawRows, ...] = ()
    at_point: tuple[csr_matrix, csr_matrix] | None = None
    face: JointFace | None = None
    corner: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    patches: csr_matrix | None = None
    uplift: CrackedUplift | None = None
    element_stiffness: tuple[float, float] = (0.0, 0.0)

    def of_corners(self, values: Floats) -> Floats:
        """Values at the gaps (n,) of values at the corners of the face's facets.

        Parameters
        ----------
        values : (nodes of the face's block,) means over each corner's share of the facets; NaN at other nodes
        """
        if self.patches is None:
            return values[self.corner]
        return np.asarray(self.patches @ np.nan_to_num(values))

    @property
    def whole_area(self) -> Floats:
        """(n,) the joint's area that each gap stands for; they sum to all of it [m2]."""
        return self.area + self.share

    @property
    def is_rigid(self) -> bool:
        """Tell whether any of its gaps is rigid when closed."""
        return bool(np.isinf(self.K_n).any())

    @property
    def water_resultant(self) -> Floats:
        """(3,) force of its water on block J, block I has the opposite [N]."""
        return np.asarray(self.water @ self.axes[:, 0])


@dataclass(frozen=True)
class FacePressure:
    """Pressure on facets (nf, nodes per facet) of a block, positive into the block [Pa]."""

    block: str
    facets: Ints
    value: float


@dataclass(frozen=True)
class Hydrostatic:
    """Still water on facets (nf, nodes per facet) of a block: its level [m] and weight per volume [N/m3]."""

    block: str
    facets: Ints
    level: float
    weight: float


@dataclass(frozen=True)
class Tie:
    """A merged interface of two blocks.

    Without weights node nodes[0][k] of block I is node nodes[1][k] of block J. A mortar tie has weights, and
    block I is its slave: u_I[nodes[0][k]] = sum_m weights[k, m] u_J[nodes[1][m]], each component alike.

    Attributes
    ----------
    name : unique in the scene
    blocks : names of the blocks I and J
    nodes : two arrays of node numbers, in block I and in block J
    weights : (k, m) sparse, rows sum to 1; None where nodes are one
    area : (k,) of the slave nodes [m2], None if alike: by them a slave in several ties takes its mean
    apart : largest distance of the two faces, which the tie bridges [m]
    """

    name: str
    blocks: tuple[str, str]
    nodes: tuple[Ints, Ints]
    weights: csr_matrix | None = None
    area: Floats | None = None
    apart: float = 0.0


@dataclass(frozen=True)
class PointForce:
    """A force (3,) on one node of a block [N], and the key of the load that it belongs to."""

    block: str
    node: int
    force: Floats
    load: str = "loads.force"


@dataclass(frozen=True)
class ForceHistory(SceneEffect):
    """A force on a block that varies in time: nodal forces (n, 3) per newton [1], and its size."""

    block: str
    nodal: Floats
    signal: ForceSignal


@dataclass(frozen=True)
class Probe:
    """A named node whose motion is written."""

    name: str
    block: str
    node: int


@dataclass(frozen=True)
class WetFace:
    """Facets (nf, nodes per facet) of a block that water touches, wholly or up to the level."""

    block: str
    facets: Ints


@dataclass(frozen=True)
class Sound:
    """Waves in water.

    Attributes
    ----------
    speed : of sound [m/s]
    reflection : of a wave that meets the floor, 1 where it is rigid
    cutoff : frequency up to which a reduced model has the reservoir's own modes [Hz]
    """

    speed: float
    reflection: float
    cutoff: float


@dataclass(frozen=True)
class Reservoir(SceneEffect):
    """Water that moves with the dam.

    Attributes
    ----------
    faces : that it touches
    level, depth : elevation of its surface, and above the floor [m]
    density : [kg/m3]
    solved : for in a reservoir, which is prismatic but for its own `mesh`; else Westergaard's pressure
    upstream : (3,) horizontal unit vector away from the dam
    length : of the prismatic reservoir, from its farthest wet point [m]
    mesh : its own (`romdam.scene.reservoir.reservoir_mesh`), with faces dam, surface, bottom, end, rock, or
        None
    sound : of compressible water; None where it is incompressible
    rock : faces of the ground that walls of a reservoir may lie on, and then move with
    """

    faces: tuple[WetFace, ...]
    level: float
    depth: float
    density: float
    solved: bool
    upstream: Floats
    length: float
    sound: Sound | None = None
    mesh: Block | None = None
    rock: tuple[WetFace, ...] = ()


@dataclass(frozen=True)
class StressNodes:
    """Nodes of one block where stress is wanted, with the local axes of a dam's shell.

    Attributes
    ----------
    nodes : (k,) ascending node numbers
    up : (k, 3) cantilever direction: up along the face on stress faces, else vertical
    arch : (k, 3) horizontal tangent; NaN where neither a face nor a joint gives it
    ring : (k,) True where stress is that of the mesh, which headlines leave out; None for nowhere
    contact : (k,) True where that is for contacts nearby; None for nowhere
    """

    nodes: Ints
    up: Floats
    arch: Floats
    ring: Bools | None = None
    contact: Bools | None = None

    @property
    def counted(self) -> Bools:
        """(k,) True where headlines take the stress."""
        return np.ones(len(self.nodes), dtype=bool) if self.ring is None else ~self.ring


@dataclass(frozen=True)
class StressFace:
    """A face whose overstressed area is stated: rows of its nodes in the StressNodes, their areas [m2]."""

    name: str
    block: str
    rows: Ints
    area: Floats


@dataclass(frozen=True)
class Section:
    """A plane through blocks on which the resultants of stress are written.

    Attributes
    ----------
    name : unique among sections
    step : block name -> (n,) values of a function of its nodes that steps from 0 below the plane to 1 above
    arm : block name -> (n,) the same of one that is the distance above the plane [m]
    axes : (3, 3) rows: unit normal, and two axes in the plane
    centroid : (3,) [m]
    area : [m2]
    inertia : (2, 2) second moments of the area about the centroid, along the two axes [m4]
    sides : (4, 3) ends of the section through its centroid: first axis low and high, second low and high [m]
    coarse : whether too few elements are between its plane and the end of a block for a step that is right
    """

    name: str
    step: dict[str, Floats]
    arm: dict[str, Floats]
    axes: Floats
    centroid: Floats
    area: float
    inertia: Floats
    sides: Floats
    coarse: bool = False


@dataclass(frozen=True)
class StressSites:
    """Nodes and faces where stress is written.

    Attributes
    ----------
    blocks : block name -> its nodes
    faces : of which the overstressed area is stated
    probes : named nodes with histories: name -> block and row in its StressNodes
    strength : tensile strength [Pa], or None
    sections : planes with resultants
    ring_ends : (s, 2, 3) ends of the edges that the ring surrounds [m]
    ring_radius : (s,) of the ring around each [m]
    """

    blocks: dict[str, StressNodes]
    faces: tuple[StressFace, ...]
    probes: dict[str, tuple[str, int]]
    strength: float | None
    sections: tuple[Section, ...] = ()
    ring_ends: Floats = field(default_factory=lambda: np.zeros((0, 2, 3)))
    ring_radius: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def ring_shares(self) -> Floats:
        """(faces,) part of each face's area that the ring leaves out."""
        outside = [f.area @ self.blocks[f.block].counted[f.rows] / f.area.sum() for f in self.faces]
        return 1.0 - np.array(outside)


@dataclass(frozen=True)
class ConstructionStage(SceneEffect):
    """A stage of construction: what is there and acts at its end, and what is grouted then.

    Attributes
    ----------
    name : unique among stages
    blocks : that are there
    level : of the still water, at most that of each load [m]; None where none acts yet
    warmed : block name -> change of temperature of the block, or (n,) of its nodes [K]
    grouted : (ng,) gaps that are grouted at its end
    """

    name: str
    blocks: frozenset[str]
    level: float | None
    warmed: Mapping[str, float | Floats]
    grouted: Bools


@dataclass(frozen=True)
class StaticLoads:
    """Loads that last: a run begins at rest under them.

    Attributes
    ----------
    gravity : (3,) acceleration that makes weight [m/s2]; zero if there is none
    pressures, forces, water : on faces and nodes, and of still water
    warmed : block name -> change of temperature of the block, or (n,) of its nodes [K]; none of others
    excluded_from_gravity : blocks whose weight has acted before, so that gravity leaves it out
    staged_weight : whether gravity acts before the joints are grouted, so that they carry none of it
    order : kinds of loads, in the order in which they are applied; empty where all come together
    """

    gravity: Floats = field(default_factory=lambda: np.zeros(3))
    pressures: tuple[FacePressure, ...] = ()
    forces: tuple[PointForce, ...] = ()
    water: tuple[Hydrostatic, ...] = ()
    warmed: Mapping[str, float | Floats] = field(default_factory=dict)
    excluded_from_gravity: frozenset[str] = frozenset()
    staged_weight: bool = False
    order: tuple[str, ...] = LOAD_KINDS


@dataclass(frozen=True)
class Scene:
    """Everything that does not depend on the ground motion.

    Attributes
    ----------
    blocks, joints : name -> Block, name -> Joint, in the configuration's order
    fixed : block name -> (n, 3) True where a support holds the component
    loads : that last
    probes : nodes to be written
    stress : where stress is written; None if nowhere
    ties : merged interfaces
    radiating : blocks whose mass only carries away what the others send out: the ground does not shake it
    effects : what each physical effect has of the scene, such as its reservoir
    remarks : what of the scene is odd and may not be meant, one sentence each
    """

    blocks: dict[str, Block]
    joints: dict[str, Joint]
    fixed: dict[str, Bools]
    loads: StaticLoads = field(default_factory=StaticLoads)
    probes: tuple[Probe, ...] = ()
    stress: StressSites | None = None
    ties: tuple[Tie, ...] = ()
    radiating: frozenset[str] = frozenset()
    effects: tuple[SceneEffect, ...] = ()
    remarks: tuple[str, ...] = ()

    def every(self, kind: type[Kind]) -> tuple[Kind, ...]:
        """Everything of a kind of effect, in the configuration's order."""
        return tuple(effect for effect in self.effects if isinstance(effect, kind))

    def find(self, kind: type[Kind]) -> Kind | None:
        """The one of a kind of effect that a scene has at most one of, such as a reservoir; None without."""
        return next(iter(self.every(kind)), None)

    def with_effects(self, *effects: SceneEffect) -> Self:
        """The scene with these in place of all that it has of their kinds."""
        return replace(self, effects=(*self.without(*map(type, effects)).effects, *effects))

    def without(self, *kinds: type[SceneEffect]) -> Self:
        """The scene without all that it has of some kinds."""
        return replace(self, effects=tuple(one for one in self.effects if not isinstance(one, kinds)))

    @property
    def sustained_ratios(self) -> dict[str, float]:
        """Block -> stiffness under loads that last over that of the record; empty where all have one."""
        ratios = {name: block.material.sustained_ratio for name, block in self.blocks.items()}
        return ratios if any(ratio != 1.0 for ratio in ratios.values()) else {}

    @property
    def extent(self) -> float:
        """Largest of the edges of a box around all blocks [m]."""
        points = np.concatenate([block.points for block in self.blocks.values()])
        return float(np.ptp(points, axis=0).max())

    @property
    def gap_position(self) -> Floats:
        """(ng, 3) of all gaps, joint after joint [m]."""
        return np.concatenate([joint.position for joint in self.joints.values()])
