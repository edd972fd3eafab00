"""Settings that couple the modes of a reduced model, and those that then cannot be had."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple

from romdam.config.effects import has_viscous_boundary
from romdam.core.integrators import INTEGRATORS

if TYPE_CHECKING:
    from romdam.config.sections.job import Config


class Coupling(NamedTuple):
    """A key that makes modes coupled, what couples them, and what to write in place of it."""

    key: str
    by: str
    remedy: str


def coupling(config: Config) -> Coupling | None:
    """Tell what couples the modes of a job; None where nothing does."""
    if has_viscous_boundary(config):
        key = "ground.viscous" if config.ground.viscous else "arch_dam.rock.boundary"
        remedy = "hold the rock by supports (`boundary: fixed`) and give it `mass: false`"
        return Coupling(key, "dashpots of viscous faces", remedy)
    if config.water is not None and config.water.has_waves:
        return Coupling("water.model", "compressible water", "set water.model: incompressible")
    for name, block in config.blocks.items():
        if block.matrices is not None and block.matrices.damping is not None:
            remedy = "leave it out: damping.rayleigh then damps this block too"
            return Coupling(f"blocks.{name}.matrices.damping", "a damping matrix", remedy)
    return None


def refuse_coupled(
    own: Coupling | None, integrator: str | None, modes: object, varied: Collection[str]
) -> None:
    """Refuse what needs modes that nothing couples.

    Parameters
    ----------
    integrator : that is asked for, if any
    modes : `model.modes`
    varied : parameters that samples of a suite vary

    Raises
    ------
    ValueError
        with the key and the remedy.
    """
    if own is None:
        return
    if varied:
        raise ValueError(
            f"suite.parameters: {len(varied)} varied, limit 0 with {own.by} ({own.key}): samples share modes "
            f"that nothing couples; leave the parameters out, or {own.remedy}"
        )
    if modes == "auto":
        raise ValueError(
            f"model.modes: auto judges modes by an estimate; there is none with {own.by} ({own.key}): give a "
            f"number, 60 is a good start, or {own.remedy}"
        )
    if integrator is not None and INTEGRATORS[integrator].uncoupled:
        raise ValueError(
            f"transient.integrator: {integrator} needs modes that nothing couples, and {own.by} ({own.key}) "
            f"couple them; leave the integrator out, or {own.remedy}"
        )
