"""Settings that couple the modes of a reduced model, and those that then cannot be had."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple

from romdam.config.effects import has_viscous_boundary
from romdam.core.integrators import INTEGRATORS

if TYPE_CHECKING:
    from romdam.config.sections.job import Config


class Coupling(NamedTuple):
    """A key that makes modes coupled, what couples them, what to write in place of it.

    `of_solids` tells whether it is part of the damping of the solids.
    """

    key: str
    by: str
    remedy: str
    of_solids: bool = True


def coupling(config: Config) -> Coupling | None:
    """Tell what couples the modes of a job; None where nothing does."""
    if has_viscous_boundary(config):
        key = "ground.viscous" if config.ground.viscous else "arch_dam.rock.boundary"
        remedy = "hold the rock by supports (`boundary: fixed`) and give it `mass: false`"
        return Coupling(key, "dashpots of viscous faces", remedy)
    if config.water is not None and config.water.has_waves:
        return Coupling("water.model", "compressible water", "set water.model: incompressible", False)
    for name, block in config.blocks.items():
        if block.matrices is not None and block.matrices.damping is not None:
            remedy = "leave it out: damping.rayleigh then damps this block too"
            return Coupling(f"blocks.{name}.matrices.damping", "a damping matrix", remedy)
    return None


def refuse_coupled(coupled: Coupling | None, integrator: str | None, varied: Collection[str]) -> None:
    """Refuse what needs modes that nothing couples.

    Parameters
    ----------
    integrator : that is asked for, if any
    varied : paths of what samples of a suite vary

    Raises
    ------
    ValueError
        with the key and the remedy.
    """
    if coupled is None:
        return
    ratios = [path for path in varied if path.startswith("damping.")]
    if ratios and coupled.of_solids:
        raise ValueError(
            f"suite.parameters: {len(ratios)} of damping varied, limit 0 with {coupled.by} "
            f"({coupled.key}): they are "
            f"in the modes' damping too; vary joints, or {coupled.remedy}"
        )
    if integrator is not None and INTEGRATORS[integrator].uncoupled:
        raise ValueError(
            f"transient.integrator: {integrator} needs modes that nothing couples, and {coupled.by} "
            f"({coupled.key}) "
            f"couple them; leave the integrator out, or {coupled.remedy}"
        )
