"""Further laws at gaps that were written down by hand."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from romdam.contact.laws import (
    BartonBandis,
    Bond,
    Fracture,
    ShearKey,
    SlipWeakening,
    StaticFriction,
    VelocityFriction,
)
from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.law import Law
from romdam.contact.problem import every_law
from romdam.core.arrays import Bools, Floats
from romdam.core.system import GapLaw, LawRows


def with_laws(
    law: GapLaw,
    tensile_strength: ArrayLike = 0.0,
    cohesion: ArrayLike = 0.0,
    friction_static: ArrayLike | None = None,
    shear_key: ArrayLike | None = None,
    viscosity: ArrayLike = 0.0,
    velocity: ArrayLike | None = None,
    weakening: ArrayLike | None = None,
    rough: ArrayLike | None = None,
    fracture: ArrayLike | None = None,
) -> GapLaw:
    """The same gaps with further laws.

    Parameters
    ----------
    tensile_strength, cohesion, viscosity : of one or each gap [N], [N s/m]
    friction_static : of each gap (n, 2)
    shear_key : of each gap (n, 3): depth [m], whether it holds along j and along k
    velocity : mu_s, mu_d, v_c [m/s] of one or each gap
    weakening : mu_s, mu_d, d_c [m] of one or each gap
    rough : JRC, JCS [N], mu_b of one or each gap
    fracture : tensile strength [N], its energy [J], cohesion [N], its energy [J] of one or each gap, which
        softens linearly
    """
    n, rows = len(law), list[tuple[type[Law], Floats, bool]]()

    def full(values: ArrayLike) -> Floats:
        return np.broadcast_to(np.asarray(values, dtype=float), (n,))

    if friction_static is not None:
        static = np.asarray(friction_static, dtype=float)
        rows.append((StaticFriction, np.hstack([static, law.mu]), bool(static.any())))
    for one, values in ((VelocityFriction, velocity), (SlipWeakening, weakening), (BartonBandis, rough)):
        if values is not None:
            rows.append((one, np.broadcast_to(np.asarray(values, dtype=float), (n, 3)), True))
    if np.any(tensile_strength) or np.any(cohesion):
        rows.append((Bond, np.column_stack([full(tensile_strength), full(cohesion)]), bool(np.any(cohesion))))
    if fracture is not None:
        f, G, c, G_II = np.broadcast_to(np.asarray(fracture, dtype=float), (n, 4)).T
        slips = np.divide(2.0 * G_II, c, out=np.zeros(n), where=c > 0.0)
        columns = [1.0 / law.K_n, f, 2.0 * G / f, c, slips, np.zeros(n)]
        rows.append((Fracture, np.column_stack(columns), bool(c.any())))
    if shear_key is not None:
        rows.append((ShearKey, np.asarray(shear_key, dtype=float), True))
    laws = tuple(
        LawRows(source_of(one), values, (values != 0.0).any(axis=1), shear) for one, values, shear in rows
    )
    return replace(law, laws=laws, viscosity=full(viscosity) + 0.0 if np.any(viscosity) else np.zeros(0))


def lost(law: GapLaw, memory: Floats) -> Bools:
    """Whether the bond is lost, the gap slides, the key is out, of every gap, (n, 3)."""
    names = [rows.law.name for rows in every_law(law)]
    flags = np.zeros((len(law), 3), dtype=bool)
    for column, name in enumerate(("Bond", "StaticFriction", "ShearKey")):
        if name in names:
            flags[:, column] = memory[names.index(name), :, 0] > 0.0
    return flags
