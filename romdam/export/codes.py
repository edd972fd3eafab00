"""The codes that decks are written for."""

from __future__ import annotations

from collections.abc import Callable

from romdam.export.abaqus import write_abaqus
from romdam.export.calculix import write_calculix
from romdam.export.code_aster import write_code_aster
from romdam.export.deck import Deck
from romdam.export.opensees import write_opensees

Writer = Callable[[Deck], tuple[dict[str, str], tuple[str, ...]]]

CODES: dict[str, Writer] = {
    "opensees": write_opensees,
    "calculix": write_calculix,
    "code_aster": write_code_aster,
    "abaqus": write_abaqus,
}
