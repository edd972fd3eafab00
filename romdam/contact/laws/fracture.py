"""A bond that softens with its fracture energy, in tension, in shear and in both together."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from romdam.contact.laws.law import (
    COHESION_J,
    COHESION_K,
    DT,
    MU_J,
    MU_K,
    NORMAL_FORCE,
    OPENING,
    SLIP_J,
    SLIP_K,
    TENSION,
    Law,
    Parameter,
    Past,
    Row,
)
from romdam.core.jit import njit

SHAPES = ("linear", "exponential", "bilinear")
LINEAR, EXPONENTIAL, BILINEAR = range(3)
_LENGTH = (2.0, 1.0, 3.6)  # of each shape: strength times the opening that damage counts in, over the energy
_STEEPEST = (1.0, 1.0, 3.0)  # of each shape: largest fall of the strength's share per damage
_KINK = 0.8 / 3.6  # damage at the kink of the bilinear curve, where a third of the strength is left
_NO_CRACK = 1e-9  # of the opening that damage counts in: what opens by less is round-off
_SMALL = 1e-5  # damage of a step below which its mean strength is that at the middle
_END = 23.0  # damage at which the exponential curve ends: 1e-10 of strength and energy are left there
_LOST = 1e3  # damage that leaves nothing, of any shape
_STEEPEST_FRICTION = 2.75  # tan 70 degrees: of Barton and Bandis, at low stress

COMPLIANCE, STRENGTH, OPENS, COHESION, SLIPS, SHAPE = range(6)
DAMAGE, WIDEST, CRACK, STORED, DISSIPATED = range(5)


@njit(cache=True)
def strength_share(shape: float, damage: float) -> float:
    """Share of the strength that is left, phi."""
    if shape == EXPONENTIAL:  # without an end, cracks that are long open would have forces to agree on
        return math.exp(-damage) if damage < _END else 0.0
    if shape == BILINEAR and damage < _KINK:
        return 1.0 - 3.0 * damage
    return max(1.0 - damage, 0.0) / (3.0 * (1.0 - _KINK) if shape == BILINEAR else 1.0)


@njit(cache=True)
def energy_share(shape: float, damage: float) -> float:
    """Integral of phi from no damage on."""
    if shape == EXPONENTIAL:
        return -math.expm1(-min(damage, _END))
    r = min(damage, 1.0)
    if shape == LINEAR:
        return r - 0.5 * r * r
    if r < _KINK:
        return r - 1.5 * r * r
    rest = 0.5 * ((1.0 - _KINK) ** 2 - (1.0 - r) ** 2) / (3.0 * (1.0 - _KINK))
    return _KINK - 1.5 * _KINK * _KINK + rest


@njit(cache=True)
def _crack(parameters: Any, memory: Any, step: Any) -> float:
    """Opening beyond that of the spring K_n [m]."""
    crack = step[OPENING] + parameters[COMPLIANCE] * step[NORMAL_FORCE]
    if crack <= 0.0 or (memory[WIDEST] == 0.0 and crack < _NO_CRACK * parameters[OPENS]):
        return 0.0
    return crack


@njit(cache=True)
def _damage(parameters: Any, memory: Any, step: Any, crack: float) -> float:
    """Damage at the end of the step."""
    damage = memory[DAMAGE] + max(crack - memory[WIDEST], 0.0) / parameters[OPENS]
    if parameters[COHESION] > 0.0:
        damage += math.hypot(step[SLIP_J], step[SLIP_K]) / parameters[SLIPS]
    return damage


@njit(cache=True)
def _share(parameters: Any, memory: Any, step: Any, damage: float) -> float:
    """phi over the step: its mean, so that the work is that under the curve; at rest that at the end."""
    shape, before = parameters[SHAPE], memory[DAMAGE]
    if step[DT] == 0.0:
        return strength_share(shape, damage)
    if damage - before < _SMALL:
        return strength_share(shape, 0.5 * (before + damage))
    return (energy_share(shape, damage) - energy_share(shape, before)) / (damage - before)


class Fracture(Law):
    """A bond that loses tensile strength and cohesion as cracks take their fracture energy.

    Of both is left the share phi of one damage r, which grows by the crack's opening y beyond its widest and
    by the slip s, dr = dy / y_c + ds / s_c; y_c and s_c are such that opening alone takes `energy` and slip
    alone `shear_energy`. So on every path that grows the shares of both energies add up to one (the linear
    criterion of mixed modes). y and s are without the elastic part of K_n and K_s, and the curve over the
    whole opening has the same area. A crack that closes unloads along the secant to the origin; under
    compression K_n acts in full. Friction acts under compression alone, as it does when the bond is lost.

    The force of a step is the mean of the curve over its growth: the energy is the same for every step.

    References
    ----------
    Hillerborg, Modeer, Petersson, Cem. Concr. Res. 6 (1976) 773: the fictitious crack.
    Petersson, Crack growth and development of fracture zones in plain concrete, TVBM-1006, Lund (1981): the
    bilinear curve, with its kink at a third of the strength and 0.8 G_f / f_t, zero at 3.6 G_f / f_t.
    Wu, Reuter, T&AM Report 275, University of Illinois (1965): G_I / G_Ic + G_II / G_IIc = 1.
    """

    section = "fracture"
    parameters = (
        Parameter("tensile_strength", "Pa", above=True, per_area=True, meaning="Tensile strength f_t."),
        Parameter(
            "energy", "N/m", above=True, meaning="Fracture energy of opening, per area of the joint: G_f."
        ),
        Parameter("cohesion", "Pa", per_area=True, default=0.0, meaning="Cohesion c."),
        Parameter(
            "shear_energy",
            "N/m",
            default=0.0,
            meaning="Fracture energy of slip, without the work of friction: G_f^II.",
        ),
        Parameter(
            "softening", "", choices=SHAPES, default="linear", meaning="Curve by which the strength falls."
        ),
    )
    memory = ("damage", "widest", "crack", "stored", "dissipated")
    shear = True
    follows_step = True

    @classmethod
    def needs_shear(cls, joint: Mapping[str, Any]) -> bool:
        return bool(joint[cls.section]["cohesion"] > 0.0)

    @classmethod
    def wrong(cls, joint: Mapping[str, Any]) -> str | None:
        keys = cls.values(joint)
        strength, cohesion, shear_energy = keys["tensile_strength"], keys["cohesion"], keys["shear_energy"]
        for key in ("tensile_strength", "cohesion", "tension_stiffness", "viscosity"):
            if joint[key] not in (0.0, {"per_gap": 0.0}):
                return f"fracture and `{key}` of the joint do not go together; leave one of them out"
        if (cohesion > 0.0) != (shear_energy > 0.0):
            return (
                f"fracture.cohesion is {cohesion:g} Pa and fracture.shear_energy {shear_energy:g} N/m; "
                "cohesion softens with shear_energy: give both, or none"
            )
        friction = _largest_friction(joint)
        if friction * strength > cohesion and friction > 0.0:
            return (
                f"fracture.cohesion {cohesion:g} Pa must be at least friction times tensile_strength, "
                f"{friction * strength:g} Pa; raise cohesion, or lower tensile_strength"
            )
        of_modes = (
            ("tensile_strength", "energy", "normal_stiffness"),
            ("cohesion", "shear_energy", "shear_stiffness"),
        )
        shape = SHAPES.index(keys["softening"])
        for strength_key, energy_key, stiffness_key in of_modes:
            stiffness = joint[stiffness_key]
            if stiffness in ("rigid", "auto") or keys[strength_key] == 0.0:  # auto: asked again as a number
                continue
            if isinstance(stiffness, Mapping):
                return (
                    f"fracture needs `{stiffness_key}` per area, got {stiffness['per_gap']:g} N/m of each "
                    "gap; give it per area (16 GPa/m)"
                )
            if stiffness == 0.0:
                continue  # refused elsewhere
            least = _STEEPEST[shape] / _LENGTH[shape] * keys[strength_key] ** 2 / stiffness
            if keys[energy_key] <= least:
                return (
                    f"fracture.{energy_key} {keys[energy_key]:g} N/m must exceed {least:.4g} N/m, or the "
                    f"joint itself would snap back as it softens ({keys['softening']}: "
                    f"{_STEEPEST[shape] / _LENGTH[shape]:.3g} {strength_key}^2 / {stiffness_key}); raise "
                    f"{energy_key} or {stiffness_key}, or lower {strength_key}"
                )
        return None

    @classmethod
    def row(cls, joint: Mapping[str, Any], area: float) -> tuple[float, ...]:
        keys, stiffness = cls.values(joint), joint["normal_stiffness"]
        shape = SHAPES.index(keys["softening"])
        strength, cohesion = keys["tensile_strength"], keys["cohesion"]
        return (
            0.0 if stiffness == "rigid" else 1.0 / (stiffness * area),
            strength * area,
            _LENGTH[shape] * keys["energy"] / strength,
            cohesion * area,
            _LENGTH[shape] * keys["shear_energy"] / cohesion if cohesion > 0.0 else 0.0,
            float(shape),
        )

    @classmethod
    def process_zone(cls, parameters: Row, area: float, modulus: float) -> float:
        """Length over which a crack softens in a material of this modulus, E G_f / f_t^2 [m]."""
        energy_over_strength = parameters[OPENS] / _LENGTH[int(parameters[SHAPE])]
        return modulus * energy_over_strength / (parameters[STRENGTH] / area)

    @classmethod
    def initial(cls, parameters: Row, gap: float) -> tuple[float, ...]:
        return (_LOST, 0.0, 0.0, 0.0, 0.0) if gap > 0.0 else (0.0,) * len(cls.memory)

    @classmethod
    def resumed(cls, parameters: Row, past: Past) -> tuple[float, ...]:
        if past.gap > 0.0 or not past.has_moved:
            return cls.initial(parameters, past.gap)
        widest, damage = max(past.widest, 0.0), 0.0
        if parameters[COHESION] > 0.0:
            damage = past.path / parameters[SLIPS]
        damage += widest / parameters[OPENS]
        crack = max(past.opening, 0.0)
        stored = 0.0
        if widest > 0.0:
            left = parameters[STRENGTH] * strength_share(parameters[SHAPE], damage)
            stored = 0.5 * left * crack**2 / widest
        return (damage, widest, crack, stored, 0.0)

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        crack, widest = _crack(parameters, memory, step), memory[WIDEST]
        damage = _damage(parameters, memory, step, crack)
        strength = parameters[STRENGTH] * _share(parameters, memory, step, damage)
        before = parameters[STRENGTH] * strength_share(parameters[SHAPE], memory[DAMAGE])
        if crack > widest:
            tension, grown = strength, crack - widest
            if step[DT] > 0.0 and memory[CRACK] < widest:  # on the secant first, and then on the curve
                loaded = widest - memory[CRACK]
                tension = (strength * grown + before * loaded) / (grown + loaded)
            limit[TENSION] = tension
        elif widest > 0.0:
            limit[TENSION] = before * crack / widest
        else:
            limit[TENSION] = strength
        cohesion = parameters[COHESION] / parameters[STRENGTH] * strength
        limit[COHESION_J], limit[COHESION_K] = cohesion, cohesion
        if step[NORMAL_FORCE] < 0.0:
            limit[MU_J], limit[MU_K] = 0.0, 0.0

    @staticmethod
    def commit(parameters: Any, memory: Any, step: Any) -> None:
        crack, widest = _crack(parameters, memory, step), memory[WIDEST]
        damage, strength, shape = (
            _damage(parameters, memory, step, crack),
            parameters[STRENGTH],
            parameters[SHAPE],
        )
        mean = strength * _share(parameters, memory, step, damage)
        if widest > 0.0:
            left = strength * strength_share(shape, memory[DAMAGE])
            memory[DISSIPATED] += 0.5 * left * min(crack, widest) ** 2 / widest
        memory[DISSIPATED] += mean * max(crack - widest, 0.0)
        memory[DAMAGE], memory[WIDEST], memory[CRACK] = damage, max(crack, widest), crack
        memory[STORED] = 0.0
        if crack > 0.0:
            memory[STORED] = 0.5 * strength * strength_share(shape, damage) * crack**2 / memory[WIDEST]
        memory[DISSIPATED] -= memory[STORED]


def _largest_friction(joint: Mapping[str, Any]) -> float:
    """Largest coefficient of friction that the joint may have."""
    largest = max(*joint["friction"], *(joint["friction_static"] or (0.0,)))
    for section in ("velocity_friction", "slip_weakening"):
        if joint[section]:
            largest = max(largest, joint[section]["mu_s"], joint[section]["mu_d"])
    return max(largest, _STEEPEST_FRICTION) if joint["barton_bandis"] else largest
