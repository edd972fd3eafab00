"""The gap element's laws at one gap: pure functions of the jump and of what the gap has been through.

Sign conventions: opening g = w_i + initial gap, positive when open; normal force p_n positive in
compression; (t_j, t_k) is the shear force on side J. A law returns the new history and never moves the old
one, so evaluating a rejected iterate changes nothing; the caller commits once per accepted step.

A gap that has strength (a bond, static friction, a shear key) answers with what it has left, as if that were
ductile, which is the most that it can carry; where it reaches a limit it cannot hold it is weakened and
answers again. Gaps only ever weaken within a step, so this ends. Static friction is regained by a gap that
sticks or opens, a key by one that closes below its depth (at the slip it then has), a bond never.

An oracle for the solver of all gaps (`romdam.contact.step`), which has its laws from `romdam.contact.laws`.

References
----------
Zivkovic et al., "Using of gap element for contraction joints modeling in seismic analysis of
concrete arch dams": K_n, K_nz, K_s, mu_y, mu_z, initial gap. Slip memory (the anchor) is ours: the
source writes the slip force along the total shear displacement, which dissipates wrongly in cycles;
on first loading the two agree.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from romdam.contact.cone import project_shear, slides
from romdam.core.system import OPEN, SLIP, STICK

Pair = tuple[float, float]


class Gap(NamedTuple):
    """Parameters of one gap.

    Attributes
    ----------
    K_n, K_nz, K_s : closed, tension (open) and stick stiffness [N/m]; K_nz must be 0 with a bond
    mu : friction along j and k
    tension, cohesion : of the bond, lost together; cohesion at least mu times tension [N]
    mu_static : friction until the gap slides, at least mu
    key : depth of the shear key [m]
    keyed : whether it holds along j and along k
    viscous : normal dashpot over the length of the step [N/m]
    velocity : mu at rest, mu of fast slip, and the slip per step over which it changes [m]; in place of `mu`
        where that slip is not zero
    weakening : the same with the path of all slip in place of that of the step
    rough : roughness coefficient, compressive strength of the wall [N], basic friction; in place of `mu`
        where the strength is not zero
    fracture : tensile strength [N], its energy [J], cohesion [N], its energy [J] of a bond that softens
        linearly; of a gap without strength of another kind
    """

    K_n: float
    K_nz: float
    K_s: float
    mu: Pair = (0.0, 0.0)
    tension: float = 0.0
    cohesion: float = 0.0
    mu_static: Pair = (0.0, 0.0)
    key: float = 0.0
    keyed: tuple[bool, bool] = (False, False)
    viscous: float = 0.0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    weakening: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rough: tuple[float, float, float] = (0.0, 0.0, 0.0)
    fracture: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)


class Past(NamedTuple):
    """What a gap has been through.

    Attributes
    ----------
    anchor : slip at which the stuck spring carries no force, along j and k [m]
    broken, sliding, out : whether the bond is lost, the gap slides, the key is out
    overlap : opening at the last step where the gap was closed, at most zero [m]
    slipped : slip in the last step, where the gap slid [m]
    path : of all slip so far [m]
    damage, widest, crack, stored : of a bond that softens: damage, widest opening of the crack and that of
        the last step [m], energy that its crack would give back [J]
    """

    anchor: Pair = (0.0, 0.0)
    broken: bool = False
    sliding: bool = False
    out: bool = False
    overlap: float = 0.0
    slipped: float = 0.0
    path: float = 0.0
    damage: float = 0.0
    widest: float = 0.0
    crack: float = 0.0
    stored: float = 0.0


Force = tuple[float, float, float]
Answer = tuple[Force, int, Past]


def shear_limit(mu: float, mu_static: float, bond: Pair, keyed: bool, slides: bool) -> Pair:
    """Cohesion and friction (c, mu) that are left along one direction: |t| <= c + mu (p_n + tension).

    Parameters
    ----------
    bond : tension and cohesion of the bond, zero where it is lost [N]
    keyed : whether a key holds this direction now
    slides : whether static friction is lost
    """
    friction = mu if slides else max(mu, mu_static)
    return math.inf if keyed else max(bond[1] - friction * bond[0], 0.0), friction


def _friction(gap: Gap, past: Past, pressed: float, trial: float) -> Pair:
    """Coefficients along j and k; of the slip that they leave, by bisection, where they change with it.

    Parameters
    ----------
    pressed, trial : what friction acts on, and the shear of the gap that sticks [N]
    """
    roughness, wall, basic = gap.rough
    if wall > 0.0:
        angle = math.atan(basic)
        if pressed < wall:
            rise = math.inf if pressed == 0.0 else roughness * math.log10(wall / pressed)
            angle = max(min(angle + math.radians(rise), math.radians(70.0)), angle)
        return math.tan(angle), math.tan(angle)
    (first, fast, over), before = gap.velocity, 0.0
    if over == 0.0:
        (first, fast, over), before = gap.weakening, past.path
    if over == 0.0:
        return gap.mu

    def after(shear: float) -> float:
        return fast + (first - fast) * math.exp(-(before + (trial - shear) / gap.K_s) / over)

    low, high, at_rest = 0.0, trial, after(trial)
    if pressed == 0.0 or trial <= at_rest * pressed:
        return at_rest, at_rest
    while (middle := 0.5 * (low + high)) not in (low, high):
        low, high = (middle, high) if middle < after(middle) * pressed else (low, middle)
    return high / pressed, high / pressed


def _ductile(jump: Force, past: Past, gap: Gap) -> tuple[Force, Pair]:
    """Force and shear limits for what the gap has left, all of it ductile."""
    opening = jump[0]
    bond = (0.0, 0.0) if past.broken else (gap.tension, gap.cohesion)
    p_n = max(-gap.K_n * opening - gap.viscous * (opening - past.overlap), -bond[0])
    if opening > 0.0 and bond[0] == 0.0:
        p_n = -gap.K_nz * opening
    pressed = max(p_n + bond[0], 0.0)
    trial_j, trial_k = (-gap.K_s * (jump[1 + a] - past.anchor[a]) for a in range(2))
    limits, friction = [], _friction(gap, past, pressed, math.hypot(trial_j, trial_k))
    for axis in range(2):
        keyed = gap.keyed[axis] and not past.out
        c, mu = shear_limit(friction[axis], gap.mu_static[axis], bond, keyed, past.sliding)
        limits.append(c + mu * pressed if pressed > 0.0 or keyed else 0.0)
    t_j, t_k, _ = project_shear(trial_j, trial_k, limits[0], limits[1])
    return (p_n, t_j, t_k), (limits[0], limits[1])


def strong(jump: Force, past: Past, gap: Gap) -> Answer:
    """Force, state and new history of one gap with everything that its parameters give it.

    Parameters
    ----------
    jump : (opening, slip along j, slip along k) [m], the opening with the initial gap

    Returns
    -------
    ((p_n, t_j, t_k), state, past) : forces [N]; state is OPEN, STICK or SLIP
    """
    if gap.fracture[0] > 0.0:
        return softened(jump, past, gap)
    bonded, left = gap.tension > 0.0 or gap.cohesion > 0.0, past
    while True:
        force, limits = _ductile(jump, left, gap)
        slips = slides(limits[0], limits[1], force[1], force[2])
        pulled = force[0] <= -gap.tension and jump[0] > 0.0
        weaker = left._replace(
            broken=left.broken or (bonded and (slips or pulled)),
            sliding=left.sliding
            or (slips and max(s - m for s, m in zip(gap.mu_static, gap.mu, strict=True)) > 0),
            out=left.out or (any(gap.keyed) and jump[0] > gap.key),
        )
        if weaker == left:
            break
        left = weaker
    closed = force[0] + (0.0 if left.broken else gap.tension) > 0.0
    state = SLIP if slips else STICK if closed else OPEN
    spring = (force[1] / gap.K_s, force[2] / gap.K_s) if gap.K_s > 0.0 else (0.0, 0.0)
    anchor = (jump[1] + spring[0], jump[2] + spring[1])
    slipped = math.dist(anchor, past.anchor) if state == SLIP else 0.0
    return (
        force,
        state,
        left._replace(
            anchor=anchor,
            sliding=state == SLIP,
            out=left.out and jump[0] > gap.key,
            overlap=min(jump[0], 0.0),
            slipped=slipped,
            path=past.path + slipped,
        ),
    )


def softened(jump: Force, past: Past, gap: Gap) -> Answer:
    """A bond that softens linearly, by bisection for the crack and for the slip; as `strong`."""
    f, G, c, G_II = gap.fracture
    y_c, s_c = 2.0 * G / f, 2.0 * G_II / c if c > 0.0 else math.inf

    def left(damage: float) -> float:
        return max(1.0 - damage, 0.0)

    def damage(y: float, slip: float) -> float:
        return past.damage + max(y - past.widest, 0.0) / y_c + slip / s_c

    def mean(r: float) -> float:  # of a triangle's height between two places, by its area
        if r <= past.damage:
            return left(past.damage)
        return 0.5 * (left(past.damage) ** 2 - left(r) ** 2) / (r - past.damage)

    def tension(y: float, slip: float) -> float:
        if y <= past.widest:
            return f * left(past.damage) * y / past.widest
        on_secant, on_curve = past.widest - past.crack, y - past.widest
        work = f * (left(past.damage) * on_secant + mean(damage(y, slip)) * on_curve)
        return work / (on_secant + on_curve)

    def normal(slip: float) -> Pair:
        """Normal force, and opening of the crack: K_n (w - y) = T(y)."""
        elastic = gap.K_n * jump[0]
        holds = 0.0 if past.widest > 0.0 else f * mean(damage(0.0, slip))
        if elastic <= holds:
            return -elastic, 0.0
        low, high = 0.0, jump[0]
        while (middle := 0.5 * (low + high)) not in (low, high):
            opens = gap.K_n * (jump[0] - middle) > tension(middle, slip)
            low, high = (middle, high) if opens else (low, middle)
        return -tension(high, slip), high

    def bound(slip: float) -> float:
        p, y = normal(slip)
        return c * mean(damage(y, slip)) + gap.mu[0] * max(p, 0.0)

    trial = [-gap.K_s * (jump[1 + a] - past.anchor[a]) for a in range(2)]
    size, slip = math.hypot(*trial), 0.0
    if size > bound(0.0):
        low, high = 0.0, size / gap.K_s
        while (middle := 0.5 * (low + high)) not in (low, high):
            slides_on = size - gap.K_s * middle > bound(middle)
            low, high = (middle, high) if slides_on else (low, middle)
        slip = high
    p, y = normal(slip)
    share = (size - gap.K_s * slip) / size if size > 0.0 else 0.0
    t_j, t_k = share * trial[0], share * trial[1]
    limit = bound(slip)
    damaged, widest = damage(y, slip if limit > 0.0 else 0.0), max(y, past.widest)
    stored = 0.5 * f * left(damaged) * y**2 / widest if widest > 0.0 else 0.0
    is_open = y > 0.0 or (jump[0] > 0.0 and p == 0.0)
    moved = tuple(slip * t / size if size > 0.0 else 0.0 for t in trial)
    return (
        (p, t_j, t_k),
        OPEN if is_open else SLIP if slip > 0.0 and limit > 0.0 else STICK,
        past._replace(
            anchor=(past.anchor[0] - moved[0], past.anchor[1] - moved[1]),
            damage=damaged,
            widest=widest,
            crack=y,
            stored=stored,
        ),
    )


def frictionless(jump: Force, past: Past, gap: Gap) -> Answer:
    """A gap that carries no shear; arguments and result as `strong`."""
    return strong(jump, past, Gap(gap.K_n, gap.K_nz, 0.0))


def coulomb(jump: Force, past: Past, gap: Gap) -> Answer:
    """Coulomb friction with slip memory; arguments and result as `strong`."""
    return strong(jump, past, Gap(gap.K_n, gap.K_nz, gap.K_s, gap.mu))


def bond(jump: Force, past: Past, gap: Gap) -> Answer:
    """Mohr-Coulomb with a tension cut-off, lost as a whole at the first opening or slip; as `strong`."""
    return strong(jump, past, Gap(gap.K_n, 0.0, gap.K_s, gap.mu, gap.tension, gap.cohesion))


def static_friction(jump: Force, past: Past, gap: Gap) -> Answer:
    """More friction until the gap slides; as `strong`."""
    return strong(jump, past, Gap(gap.K_n, gap.K_nz, gap.K_s, gap.mu, mu_static=gap.mu_static))


def shear_key(jump: Force, past: Past, gap: Gap) -> Answer:
    """No sliding while the opening is less than the key's depth; as `strong`."""
    return strong(jump, past, Gap(gap.K_n, gap.K_nz, gap.K_s, gap.mu, key=gap.key, keyed=gap.keyed))


def dashpot(jump: Force, past: Past, gap: Gap) -> Answer:
    """A normal dashpot that acts while the gap overlaps and never pulls; as `strong`."""
    return strong(jump, past, Gap(gap.K_n, 0.0, gap.K_s, gap.mu, viscous=gap.viscous))


def velocity_friction(jump: Force, past: Past, gap: Gap) -> Answer:
    """Friction that changes with the slip of the step; as `strong`."""
    return strong(jump, past, Gap(gap.K_n, gap.K_nz, gap.K_s, velocity=gap.velocity))


def slip_weakening(jump: Force, past: Past, gap: Gap) -> Answer:
    """Friction that changes with the path of the slip; as `strong`."""
    return strong(jump, past, Gap(gap.K_n, gap.K_nz, gap.K_s, weakening=gap.weakening))


def barton_bandis(jump: Force, past: Past, gap: Gap) -> Answer:
    """Friction that changes with the normal stress; as `strong`."""
    return strong(jump, past, Gap(gap.K_n, gap.K_nz, gap.K_s, rough=gap.rough))


def together(jump: Force, past: Past, gap: Gap) -> Answer:
    """All that may stand together, which is all but friction that changes within a step; as `strong`."""
    none = (0.0, 0.0, 0.0)
    return strong(jump, past, gap._replace(velocity=none, weakening=none, rough=none))


LAWS = {
    "frictionless": frictionless,
    "coulomb": coulomb,
    "bond": bond,
    "static_friction": static_friction,
    "shear_key": shear_key,
    "dashpot": dashpot,
    "velocity_friction": velocity_friction,
    "slip_weakening": slip_weakening,
    "barton_bandis": barton_bandis,
    "all": together,
}
