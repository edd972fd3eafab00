"""Exact modal propagation at a fixed step: the baseline that the others are compared with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from romdam.timestepping.modal.integrator import ModalIntegrator


@dataclass(frozen=True)
class Modal(ModalIntegrator):
    """Every mode dynamic, joint force and spring at the end of a fixed step."""

    name: ClassVar[str] = "modal"
