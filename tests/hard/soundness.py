"""What every run has to answer for, whatever the scene: closed ledger, no energy made, laws kept."""

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.system import GapLaw, History

CLOSED = 1e-6  # ledger residual that counts as closed, relative to the energy at hand
GAIN = 1e-9  # what a dissipation may fall by in an interval, relative to the same energy
FRICTION_GAIN = 2e-8  # the same with friction, whose forces are found to 1e-8 only
LAW = 1e-6  # by how much a force may miss its law, relative to the largest force or jump


def soundness(law: GapLaw, history: History) -> dict[str, float]:
    """Figures of one run, energies relative to the largest of input, kinetic, strain and stored energy.

    Parameters
    ----------
    law : GapLaw
    history : History

    Returns
    -------
    dict of floats; `ledger_residual` keeps its sign, increments are the smallest between two rows
    """
    energy, p, g = history.energy, history.traction, history.jump[..., 0]
    names = ("input", "kinetic", "strain", "joint_stored")
    size = max(1e-300, *(float(np.abs(energy[name]).max()) for name in names))
    residual = energy["residual"]
    arrays = (p, g, history.mean_traction, history.disp, history.vel, history.acc, *energy.values())
    return {
        "finite": float(all(np.isfinite(a).all() for a in arrays)),
        "ledger_residual": float(residual[np.argmax(np.abs(residual))]) / size,
        "contact_increment": _least(energy["contact"]) / size,
        "friction_increment": _least(energy["friction"]) / size,
        "damping_increment": _least(energy["damping"]) / size,
        "contact_share": float(energy["contact"][-1]) / size,
        "friction_share": float(energy["friction"][-1]) / size,
        "peak_force": float(p[..., 0].max(initial=0.0)),
        **_law_misses(law, p, g, float(np.abs(history.disp).max(initial=0.0))),
    }


def _least(work: Floats) -> float:
    return float(np.diff(work).min(initial=0.0))


def _law_misses(law: GapLaw, p: Floats, g: Floats, motion: float) -> dict[str, float]:
    """By how much forces miss their laws, the first row apart: an undeformed start carries no force yet."""
    p, g = p[1:], g[1:]
    force = max(float(p[..., 0].max(initial=0.0)), 1e-300)
    pressed = p[..., 0] + law.K_nz * np.maximum(g, 0.0)
    with np.errstate(invalid="ignore"):
        compressed = np.where(np.isinf(law.K_n), 0.0, pressed / law.K_n)
    depth = np.abs(np.minimum(g, 0.0) + compressed).max(initial=0.0)
    above = _shear_above(law.mu, p) if p.shape[2] == 3 else 0.0
    return {
        "tension": float(-pressed.min(initial=0.0)) / force,
        "shear_above_limit": above / force,
        "penetration_mismatch": float(depth) / max(float(np.abs(g).max(initial=0.0)), motion, 1e-300),
    }


def _shear_above(mu: Floats, p: Floats) -> float:
    """Largest shear beyond its limit [N]; equal coefficients bound the resultant."""
    limit = mu * p[..., :1]
    equal = np.hypot(p[..., 1], p[..., 2]) - limit[..., 0]
    single = (np.abs(p[..., 1:]) - limit).max(axis=-1)
    return float(np.where(mu[:, 0] == mu[:, 1], equal, single).max(initial=0.0))


def assert_sound(law: GapLaw, history: History) -> dict[str, float]:
    """Every invariant of `soundness`; returns the figures."""
    found = soundness(law, history)
    gain = FRICTION_GAIN if law.directions == 3 else GAIN
    assert found["finite"]
    assert abs(found["ledger_residual"]) <= CLOSED, found
    for name in ("contact", "friction", "damping"):
        assert found[f"{name}_increment"] >= -gain, found
    for name in ("tension", "shear_above_limit", "penetration_mismatch"):
        assert found[name] <= LAW, found
    assert history.stats["largest_residual"] <= 1e-8
    return found
