"""The linear system with its joints open, full or reduced, and what an integration of it returns.

`System` is M u'' + (C - D D^T) u' + K u = force - load s(t) + B^T p, with the jumps w = B u that the joint
force p follows. The types before it are what its fields hold: the gaps' parameters and the water in them
(`GapLaw`, `CrackedUplift`), what is known of rest and of construction, the motions s(t) that the load follows
(`Histories`, `Drive`), supports of their own motion (`PseudoStatic`), and moduli that differ under lasting
loads (`SustainedStiffness`). `History` is the result of an integration.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array, hstack, issparse

from romdam.core.arrays import Bools, Floats
from romdam.core.attachment import BearingRows
from romdam.core.errors import ConfigError
from romdam.core.final_state import FinalState, InitialState
from romdam.core.motion import ForceSignal, Incoherence, Motion, SupportMotion, ground_rows
from romdam.core.recorded import GapQuantities

OPEN, STICK, SLIP = 0, 1, 2  # `History.state`
STATES = {"open": OPEN, "stick": STICK, "slip": SLIP}
# term of the energy ledger, see `romdam.timestepping.energy` -> what it is
ENERGY_TERMS = {
    "input": "work of inertia forces, static loads, moving supports and water that enters gaps",
    "kinetic": "kinetic energy relative to the base and what moving supports carry",
    "strain": "strain energy of the blocks",
    "joint_stored": "energy stored in the joints' springs",
    "damping": "energy dissipated by damping",
    "friction": "energy dissipated by sliding",
    "contact": "energy taken away numerically at closing and opening",
    "residual": "imbalance of the energy ledger, round-off when exact",
}


@dataclass(frozen=True)
class LawSource:
    """Source of a law.

    Attributes
    ----------
    name : of the law's class; of a user's class, with its module
    file : the user's file; empty for romdam's own laws
    sha256 : of that file, and of what the law takes from elsewhere
    """

    name: str
    file: str = ""
    sha256: str = ""


@dataclass(frozen=True)
class LawRows:
    """A further joint law at some gaps.

    Attributes
    ----------
    law : which, see `romdam.contact.laws.catalogue`
    values : (n, p) what its functions get as parameters, see `romdam.contact.laws.law`
    on : (n,) which gaps have it
    shear : whether it lets them carry shear
    """

    law: LawSource
    values: Floats
    on: Bools
    shear: bool


class CrackedUplift(Protocol):
    """Water in a joint whose pressure follows from its crack at rest.

    Lines through the joint from heel to toe stand side by side. Each has a crack from the heel to a tip. The
    tip is given by its distance from the heel: 0 where the heel is closed.
    """

    @property
    def redrawn(self) -> bool:
        """Whether the pressure at rest is computed from the tips; else it is that of the closed joint."""
        ...

    @property
    def earthquake(self) -> str:
        """What gaps that open later get: "frozen", "zero" or "full"."""
        ...

    @property
    def length(self) -> Floats:
        """(lines,) distance from heel to toe [m]."""
        ...

    @property
    def drains_at(self) -> float:
        """Distance of the drains from the heel, inf without any [m]."""
        ...

    def tips(self, opening: Floats, is_open: Bools, rigid: Bools) -> Floats:
        """(lines,) distance of the crack's tip from the heel on each line [m].

        Parameters
        ----------
        opening : (n,) of the gaps, negative where springs are pressed in [m]
        is_open, rigid : (n,) gaps that carry no force, and those that have no springs
        """
        ...

    def at_gaps(self, tips: Floats) -> Floats:
        """(n,) distance of the tip on the line through each gap, from those of the lines (lines,) [m]."""
        ...

    def in_crack(self, tips: Floats) -> Bools:
        """(n,) gaps between the heel and the tip."""
        ...

    def force(self, tips: Floats) -> Floats:
        """(n,) force of the water in the gaps for tips (lines,) [N]."""
        ...

    def full_force(self) -> Floats:
        """(n,) force of the reservoir's pressure in the gaps [N]."""
        ...


@dataclass(frozen=True)
class RestUplift:
    """What became of the water in joints whose pressure follows from their cracks at rest.

    Attributes
    ----------
    added : (ng,) force of the water in the gaps at rest, less that of the scene's closed joints [N]
    crack : (ng,) distance of the crack's tip from the heel on the line through each gap, 0 where the heel is
        closed; NaN in joints whose uplift is not redrawn [m]
    iterations : equilibria that were solved until uplift and crack agreed
    change : how far the last equilibrium still moved a tip, relative to the length of its line
    warnings : what a careful reader should know, one sentence each
    """

    added: Floats
    crack: Floats
    iterations: int
    change: float
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class RestBalance:
    """Resultants of the forces on the dam and its blocks at rest, and how far they are out of balance.

    A resultant is (force along x, y, z [N], moment about x, y, z through `about` [N m]). Blocks that are tied
    are one body; the dam stands first, with all blocks that are no rock.

    Attributes
    ----------
    names : of the bodies
    about : (k, 3) middle of each [m]
    loads, joints, supports : (k, 6) of the static loads; of the joints, with the water in them; of supports
        and springs
    left : (k,) largest component of the resultant that nothing takes, relative to the forces that act on the
        body; moments are divided by the half diagonal of the body
    """

    names: tuple[str, ...]
    about: Floats
    loads: Floats
    joints: Floats
    supports: Floats
    left: Floats


@dataclass(frozen=True)
class ConstructionPlan:
    """Stages of construction that a system is still to go through.

    Attributes
    ----------
    names : of the stages
    force : (n, stages) static force at the end of each [N]
    present : (stages, ng) gaps both of whose blocks are built
    grouted : (stages, ng) gaps that are grouted at the end of the stage
    """

    names: tuple[str, ...]
    force: Floats
    present: Bools
    grouted: Bools


@dataclass(frozen=True)
class BuiltStages:
    """The joints at the end of each stage of construction, before its grouting.

    Attributes
    ----------
    names : of the stages
    opening : (stages, ng) of the gaps since their blocks were poured, or since they were grouted; NaN where a
        block is not built [m]
    force : (stages, ng) normal force, compression positive, 0 where a block is not built [N]
    grouted : (stages, ng) gaps that are grouted at the end of the stage
    """

    names: tuple[str, ...]
    opening: Floats
    force: Floats
    grouted: Bools


@dataclass(frozen=True)
class GapLaw:
    """Parameters of every gap of the scene, joints one after another.

    Attributes
    ----------
    K_n, K_nz, K_s : (ng,) closed, tension and stick stiffness [N/m]; K_n is inf where rigid
    mu : (ng, 2) friction along the local axes j and k
    gap : (ng,) initial gap [m]
    slip : (ng, 2) initial jump along j and k [m]; empty where it is zero
    joints : name -> slice of its gaps
    laws : further laws, in the order in which they apply; empty without any
    viscosity : (ng,) normal dashpot [N s/m]; empty without any
    grout : (ng,) force of the grouting that is still to be done [N]; empty without any
    slipped : (ng, 2) accumulated slip that grouting left behind [m]; empty where it is zero
    memory : (L, ng, s) memory of the further laws that grouting left behind, see
        `romdam.contact.problem.GapMemory`; empty where it is that of unloaded gaps
    uplift : joint name -> water that follows from its crack at rest
    """

    K_n: Floats
    K_nz: Floats
    K_s: Floats
    mu: Floats
    gap: Floats
    joints: dict[str, slice]
    laws: tuple[LawRows, ...] = ()
    viscosity: Floats = field(default_factory=lambda: np.zeros(0))
    grout: Floats = field(default_factory=lambda: np.zeros(0))
    slip: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    slipped: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    memory: Floats = field(default_factory=lambda: np.zeros((0, 0, 0)))
    uplift: Mapping[str, CrackedUplift] = field(default_factory=dict)

    @property
    def directions(self) -> int:
        """Components of force and jump at a gap: 1 without anything that carries shear, else 3 (i, j, k)."""
        return 3 if self.mu.max(initial=0.0) > 0.0 or any(rows.shear for rows in self.laws) else 1

    @property
    def has_memory(self) -> bool:
        """Tell whether the gaps' forces follow from more than stiffness and friction."""
        return bool(self.laws) or bool(self.viscosity.any())

    @property
    def remembers(self) -> bool:
        """Tell whether grouting left slip behind, or changed the memory of further laws."""
        return bool(len(self.slipped) or self.memory.size)

    def gap_name(self, gap: int) -> str:
        """A gap by its number within its joint, for messages."""
        for name, gaps in self.joints.items():
            if gaps.start <= gap < gaps.stop:
                return f"gap {gap - gaps.start} of joint {name}"
        return f"gap {gap}"

    def __len__(self) -> int:
        return len(self.gap)


Complex = NDArray[np.complex128]
Rates = Callable[[Floats], tuple[Complex, Complex]]
"""An integrator's acceleration [1/s2] and velocity [1/s] for the unit displacement exp(i k angle) at steps k,
of given angles (nf,); exact ones are -omega^2 and i omega with omega = angle / dt."""


@dataclass(frozen=True)
class Histories:
    """Motions at every step of a run, by name.

    Attributes
    ----------
    rows : motion -> (k, lead + nt)
    lead : number of steps before the record's start
    warnings : what a careful reader should know of them, one sentence each
    """

    rows: dict[Motion, Floats]
    lead: int = 0
    warnings: tuple[str, ...] = ()


class Drive(Protocol):
    """Makes further motions from those that there are, such as waves from the base's acceleration."""

    @property
    def whole_record(self) -> bool:
        """Whether its motions at any time follow from the whole record and not from the part up to that time.

        Then the base's acceleration may have nothing beyond the record's Nyquist frequency.
        """
        ...

    def drive(self, histories: Histories, dt: float, rates: Rates) -> Histories:
        """Add its motions.

        Parameters
        ----------
        histories : the base's acceleration at least
        rates : of the integrator
        """
        ...


@dataclass(frozen=True)
class PseudoStatic:
    """Pseudo-static part u_s d(t) of the motion where supports have motions of their own.

    The motion relative to the base is u_s d(t) + u, with u the displacement of the system. u_s is the static
    response, joints open, to unit displacements of the supports; d is their displacement relative to the
    base, along x, y and z of each. It strains blocks and opens gaps at once; its acceleration is a load on u.

    Attributes
    ----------
    motions : of the supports
    shapes : block name -> u_s, (3 nodes, m)
    jump : (directions * ng, m) B u_s
    at_point : (directions * ng, m) jumps at the gaps' positions less `jump`; None where they are the same
    observe : (rows of `System.observe`, m) what is observed of it
    stiffness : (m, m) u_s^T K u_s, of its strain energy [N/m]
    incoherence : random part of the motions; None without
    """

    motions: tuple[SupportMotion, ...]
    shapes: dict[str, Floats]
    jump: Floats
    at_point: Floats | None
    observe: Floats
    stiffness: Floats
    incoherence: Incoherence | None = None

    def motion(self, ground: Floats) -> tuple[Floats, Floats, Floats]:
        """Acceleration, velocity and displacement (m, nt) of the supports, of a run's ground motion."""
        rows = ground_rows(len(self.motions))
        acc, vel = ground[rows[Motion.SUPPORTS]], ground[rows[Motion.SUPPORTS_VELOCITY]]
        return acc, vel, ground[rows[Motion.SUPPORTS_DISPLACEMENT]]

    def normal(self, directions: int) -> PseudoStatic:
        """The same with the gaps' normal jumps alone, of so many directions."""
        more = None if self.at_point is None else self.at_point[::directions]
        return replace(self, jump=self.jump[::directions], at_point=more)


@dataclass(frozen=True)
class SustainedStiffness:
    """Stiffness under loads that last, where it is another than during the record.

    At rest (K + more) u_0 = force + B^T p. During the record K (u - u_0) is added to it, which is
    K u = force - more u_0 + B^T p: with the force -more u_0, u_0 is an equilibrium of the shaken system too.

    Attributes
    ----------
    more : (n, n) sparse, stiffness under lasting loads less K of the system [N/m]
    rest : (n,) u_0, whose force -more u_0 is then in `System.force`; None before the state at rest is known
    """

    more: csr_matrix
    rest: Floats | None = None

    @property
    def force(self) -> Floats:
        """(n,) -more u_0, zero before u_0 is known [N]."""
        return np.zeros(self.more.shape[0]) if self.rest is None else np.asarray(-(self.more @ self.rest))


@dataclass(frozen=True)
class System:
    """M u'' + (C - D D^T) u' + K u = force - load s(t) + B^T p, with jumps w = B u.

    s(t) is the base's acceleration along x, y, z and what other motions the load follows (`motions`). The
    same type holds the unreduced mesh (sparse M, C, K over its free DOFs) and the reduced model (unit M,
    diagonal K over the open-joint modes, and C too unless dashpots couple them); `diagonal` says which
    integrators apply. Unknowns without mass, whose M is zero, follow by stiffness and damping alone.

    Attributes
    ----------
    M, C, K : (n, n) sparse
    B : (directions * ng, n) sparse; rows of gap m are directions*m + (0: normal, 1: j, 2: k)
    load : (n, k) forces, with the opposite sign, of unit motions: M r for unit acceleration of the base
    force : (n,) static force
    load_steps : name -> its part of `force` (n,), in the order in which the loads come; empty where they come
        at once
    observe : (3 * number of probes + k, n) sparse; displacement of the probes, x, y, z each, and what
        attachments are stretched by (`bearing`)
    at_point : (directions * ng, n) sparse; the jump at the gaps' positions less that of B, which is conjugate
        to the joint force; None where they are the same
    point_shift : (directions * ng,) added to `at_point` u, because grouting closes the two jumps by different
        amounts; None where nothing is added [m]
    law : the gaps
    parts : name -> slice of the unknowns that belong to it alone, in order (one per block)
    diagonal : whether M is the identity (zero where there is no mass) and C, K are diagonal
    floating : whether the system has rigid motions that no support and no stiffness holds
    reduced : whether the unknowns are reduced coordinates, whose histories are kept
    motions : motion -> the columns of the load that follow it, in order; the base's acceleration is first
    drives : what makes motions that are not of a run's ground motion, in the order in which they act
    gyroscopic : whether C is skew between dam and water, where it does no work; B is zero on the water
    pseudo_static : what supports that do not move as the base does add to the displacement u, and so to jumps
        and to what is observed; None without
    signals : sizes of forces that vary in time, in the order of their columns of the load
    drag : (n, k) D: the damping is C - D D^T, which does not act on rigid motions that joints alone hold and
        as a matrix would be full; None where C is all of it
    uplift : water in cracked joints that is in `force`; None where no joint's follows from its crack
    initial : state of another run that runs begin with; None where they begin as `Settings` say
    construction : stages that the system is still to go through; None without, and once it has
    built : the joints in the stages that it has gone through; None without
    extent : size of the mesh, beyond which nothing moves in a sound run; inf where there is none [m]
    bearing : attachments whose forces are recorded; None without any
    sustained : stiffness under loads that last; None where it is K
    hysteretic : (n, n) sparse, imaginary part of the stiffness at positive frequencies, which only the
        frequency domain knows [N/m]; None without
    """

    M: csr_matrix
    C: csr_matrix
    K: csr_matrix
    B: csr_matrix
    load: Floats | csr_matrix
    force: Floats
    observe: csr_matrix
    law: GapLaw
    parts: dict[str, slice]
    diagonal: bool
    floating: bool
    reduced: bool = False
    at_point: csr_matrix | None = None
    point_shift: Floats | None = None
    motions: dict[Motion, slice] = field(default_factory=lambda: {Motion.BASE: slice(0, 3)})
    drives: tuple[Drive, ...] = ()
    gyroscopic: bool = False
    pseudo_static: PseudoStatic | None = None
    drag: Floats | None = None
    signals: tuple[ForceSignal, ...] = ()
    uplift: RestUplift | None = None
    initial: InitialState | None = None
    construction: ConstructionPlan | None = None
    built: BuiltStages | None = None
    load_steps: Mapping[str, Floats] = field(default_factory=dict)
    extent: float = math.inf
    bearing: BearingRows | None = None
    sustained: SustainedStiffness | None = None
    hysteretic: csr_matrix | None = None

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.M.shape[0]

    @property
    def under_lasting_loads(self) -> System:
        """The system of the state at rest: the stiffness and the forces of loads that last."""
        if self.sustained is None:
            return self
        more, moved = self.sustained.more, self.sustained.force
        uncoupled = self.diagonal and not (more - diags_array(more.diagonal())).count_nonzero()
        K = csr_matrix(self.K + more)
        return replace(self, K=K, force=self.force - moved, diagonal=uncoupled, sustained=None)

    def rested(self, rest: Floats) -> System:
        """The system that is shaken about a state at rest, displacement (n,) [m]."""
        if self.sustained is None:
            return self
        sustained = replace(self.sustained, rest=rest)
        force = self.force - self.sustained.force + sustained.force
        return replace(self, force=force, sustained=sustained)

    def more_at_points(self, u: Floats) -> Floats:
        """Jumps at the gaps' positions less those of B, (directions * ng,) for u (n,) [m]."""
        assert self.at_point is not None
        more = self.at_point @ u
        return np.asarray(more if self.point_shift is None else more + self.point_shift)

    @property
    def of_probes(self) -> slice:
        """The rows of `observe` that are of the probes."""
        return slice(0, self.observe.shape[0] if self.bearing is None else self.bearing.first)

    @property
    def solids(self) -> int:
        """Number of unknowns of the solids; those of compressible water come after them."""
        return self.parts["reservoir"].start if self.gyroscopic else self.size

    @property
    def effective_ratios(self) -> Floats:
        """(2, n) frequency [Hz] and damping ratio phi^T C phi / (2 omega phi^T M phi) of each unknown.

        Of a reduced system, whose unknowns phi are undamped modes. Hysteretic damping counts as the C that
        takes the same energy at the mode's frequency, K_h / omega. The ratio of a rigid motion is NaN, and
        both are for unknowns without mass and for compressible water.
        """
        M, K = self.M.diagonal()[: self.solids], self.K.diagonal()[: self.solids]
        freq, ratio = np.full((2, self.size), np.nan)
        heavy = np.flatnonzero(M > 0.0)
        omega = np.sqrt(np.maximum(K[heavy] / M[heavy], 0.0))
        freq[heavy], strained = omega / (2.0 * np.pi), omega > 0.0
        c, some = self.C.diagonal()[heavy][strained], heavy[strained]
        if self.hysteretic is not None:
            c = c + self.hysteretic.diagonal()[some] / omega[strained]
        ratio[some] = c / (2.0 * omega[strained] * M[some])
        return np.stack([freq, ratio])

    @property
    def as_hysteretic(self) -> System:
        """The system whose C is taken as the imaginary part of the stiffness, and no longer as damping."""
        return replace(self, C=csr_matrix(self.C.shape), hysteretic=self.C)

    def damping_force(self, rate: Floats) -> Floats:
        """(C - D D^T) v for velocities v, (n,) or (n, k) [N]."""
        force = self.C @ rate
        return np.asarray(force if self.drag is None else force - self.drag @ (self.drag.T @ rate))

    @property
    def needs_whole_record(self) -> bool:
        """Tell whether motions of a drive follow from the whole record alone, see `Drive.whole_record`."""
        return any(drive.whole_record for drive in self.drives)

    def histories(self, ground: Floats, dt: float, rates: Rates) -> Histories:
        """Every motion that the load follows, of a run's ground motion at steps dt [s].

        Parameters
        ----------
        ground : (rows, nt), see `romdam.core.motion.ground_rows`
        rates : of the integrator
        """
        histories = Histories(self._ground_motions(ground))
        for drive in self.drives:
            histories = drive.drive(histories, dt, rates)
        return histories

    def followed(self, rows: Mapping[Motion, Floats]) -> Floats:
        """s(t), (k, nt), from all motions by name."""
        return np.concatenate([rows[motion] for motion in self.motions])

    def load_motion(self, ground: Floats) -> Floats:
        """s(t), (k, nt), of a run's ground motion, for a system without drives."""
        return self.followed(self._ground_motions(ground))

    def forces(self, ground: Floats) -> Floats:
        """(k, nt) sizes of the forces that vary in time, of a run's ground motion [N]."""
        return self._ground_motions(ground).get(Motion.FORCES, ground[:0])

    def shaking(self, ground: Floats) -> Floats:
        """The accelerations in `load_motion`, (k, nt): all of it but forces that vary in time."""
        rows = self._ground_motions(ground)
        return np.concatenate([rows[motion] for motion in self.motions if motion is not Motion.FORCES])

    def _ground_motions(self, ground: Floats) -> dict[Motion, Floats]:
        supports = 0 if self.pseudo_static is None else len(self.pseudo_static.motions)
        return {motion: ground[rows] for motion, rows in ground_rows(supports, len(self.signals)).items()}

    def loaded(self, more: Mapping[Motion, Floats | csr_matrix]) -> System:
        """The system with further loads, (n, k) each, added to the columns that follow the same motion."""
        columns = {motion: self.load[:, columns] for motion, columns in self.motions.items()}
        for motion, force in more.items():
            columns[motion] = columns[motion] + force if motion in columns else force
        ends = np.cumsum([0, *(force.shape[1] for force in columns.values())]).tolist()
        motions = {motion: slice(*pair) for motion, pair in zip(columns, pairwise(ends), strict=True)}
        sparse = any(issparse(force) for force in columns.values())
        load = csr_matrix(hstack(list(columns.values()))) if sparse else np.hstack(list(columns.values()))
        return replace(self, load=load, motions=motions)


def with_parameters(system: System, law: GapLaw, damping: tuple[Floats, Floats] | None) -> System:
    """Give the same blocks other joints' parameters and damping.

    Parameters
    ----------
    damping : modal coefficients c [1/s] of the solids' modes, (m,) before and (m,) after; None to keep the
        system's. Damping of other origin, such as dashpots, stays

    Raises
    ------
    ConfigError
        for a law with shear on a system whose joints were reduced without it; for another number of gaps.
    """
    n, reduced = len(system.law), system.B.shape[0] // max(len(system.law), 1)
    if len(law) != n:
        raise ConfigError(f"the system has {n} gaps, got parameters of {len(law)}")
    if law.directions > reduced > 0:
        raise ConfigError(
            "joints: the system was reduced without the gaps' tangential directions, so a run on it can have "
            "no friction, cohesion or shear key; reduce it with friction"
        )
    B, more, moving = system.B, system.at_point, system.pseudo_static
    if law.directions != reduced > 0:  # without joints there is none
        B, more = csr_matrix(B[::reduced]), None if more is None else csr_matrix(more[::reduced])
        moving = None if moving is None else moving.normal(reduced)
    C = system.C
    if damping is not None:
        before, after = damping
        diagonal = C.diagonal()
        own = diagonal[: system.solids]
        changed = diagonal.copy()
        # `after` to the bit, where nothing else damps a mode
        changed[: system.solids] = np.where(own == before, after, own + (after - before))
        C = csr_matrix(diags_array(changed) if system.diagonal else C + diags_array(changed - diagonal))
    return replace(system, law=law, B=B, C=C, at_point=more, pseudo_static=moving)


@dataclass(frozen=True)
class Coordinates:
    """Unknowns of a reduced system and their rates at the written rows, made when they are read.

    Attributes
    ----------
    make : gives (q, v), both (rows, n), of a slice of the rows
    """

    make: Callable[[slice], tuple[Floats, Floats]]

    @classmethod
    def of(cls, q: Floats, v: Floats) -> Coordinates:
        """Coordinates from histories that are in memory, (nt, n) each."""
        return cls(lambda rows: (q[rows], v[rows]))

    @cached_property
    def whole(self) -> tuple[Floats, Floats]:
        """(q, v) of all rows, (nt, n) each."""
        return self.make(slice(None))

    def row(self, number: int) -> tuple[Floats, Floats]:
        """(q, v) of one row, (n,) each."""
        q, v = self.make(slice(number, number + 1))
        return q[0], v[0]


@dataclass(frozen=True)
class StepMotion:
    """Motion of the output nodes at every base step of a run, whichever of them are written.

    Attributes
    ----------
    dt : base step [s]
    acc, vel : (nt, 3 * number of probes) relative to the base [m/s2], [m/s]
    ground : (nt, 3) ground acceleration of the base [m/s2]
    """

    dt: float
    acc: Floats
    vel: Floats
    ground: Floats


@dataclass(frozen=True)
class History(GapQuantities):
    """Result of an integration at the written times; what is recorded of the gaps is in `GapQuantities`.

    Attributes
    ----------
    time : (nt,) [s]
    disp, vel, acc : (nt, 3 * number of probes) relative to the base [m], [m/s], [m/s2]
    coordinates : of a reduced system; None at full order
    supports : (nt, m) displacement of supports of their own motion, see `PseudoStatic`; empty without any [m]
    energy : name -> (nt,) [J], see `romdam.timestepping.energy`; `ENERGY_TERMS` in any case
    peaks : name -> (ng,) over every step, not only the written ones, see `romdam.timestepping.peaks`; of
        jumps that differ from those that joint forces see, of written rows and what these reach between them
    base_disp : (steps + 1, 3 * number of probes) `disp` at every base step; empty where each is written, and
        once `node_peaks` are known [m]
    node_peaks : (2, 3 * number of probes) largest displacement of either sign over every base step [m], and
        when [s]
    stats : counts and CPU seconds of the run
    integrator : key of `romdam.core.integrators.INTEGRATORS`
    gap : (ng,) initial gaps that the run began with, after grouting [m]
    ground : (nt, 3) ground acceleration of the base that was integrated [m/s2]
    ground_peak : (3,) its largest value over all steps, either sign [m/s2]
    forces : (nt, k) forces that vary in time, see `ForceSignal`; empty without any [N]
    warnings : what a careful reader should know and no number says, one sentence each
    final : the last state, from which another run can begin; None where rows are of the jumps alone
    every_step : motion of the output nodes at every base step; None where it was not asked for
    uplift, built : as of `System`
    attached : (nt, k) force of each row of attachments, see `BearingRows`; empty without any [N]
    attached_peaks : (2, k) least and largest of it over every base step; dashpots over the written rows [N]
    rest : (n,) displacement at rest, where moduli under lasting loads are others (`SustainedStiffness`); else
        empty [m]
    modes : (2, n) frequency [Hz] and effective damping ratio of each unknown of a reduced system, see
        `System.effective_ratios`; empty at full order
    balance : of the forces at rest; None where the run does not begin there
    """

    time: Floats
    disp: Floats
    vel: Floats
    acc: Floats
    coordinates: Coordinates | None
    energy: dict[str, Floats]
    peaks: dict[str, Floats]
    stats: dict[str, float]
    integrator: str
    base_disp: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    node_peaks: Floats = field(default_factory=lambda: np.zeros((2, 0)))
    supports: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    gap: Floats = field(default_factory=lambda: np.zeros(0))
    ground: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    ground_peak: Floats = field(default_factory=lambda: np.zeros(0))
    forces: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    warnings: tuple[str, ...] = ()
    final: FinalState | None = None
    every_step: StepMotion | None = None
    uplift: RestUplift | None = None
    built: BuiltStages | None = None
    attached: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    attached_peaks: Floats = field(default_factory=lambda: np.zeros((2, 0)))
    balance: RestBalance | None = None
    rest: Floats = field(default_factory=lambda: np.zeros(0))
    modes: Floats = field(default_factory=lambda: np.zeros((2, 0)))

    @property
    def q(self) -> Floats | None:
        """(nt, n) unknowns of a reduced system; None at full order."""
        return None if self.coordinates is None else self.coordinates.whole[0]

    @property
    def v(self) -> Floats | None:
        """(nt, n) their rates."""
        return None if self.coordinates is None else self.coordinates.whole[1]
