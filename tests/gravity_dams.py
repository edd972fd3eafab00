"""Small gravity dams for the tests, as dictionaries."""

from typing import Any

CONCRETE = {"E": 31.027e9, "nu": 0.2, "rho": 2643.0}
ROCK = {"E": 30e9, "nu": 0.25, "rho": 2700.0}
JOINT = {"normal_stiffness": 20e9, "shear_stiffness": 10e9, "friction": 0.6}
KOYNA = {"upstream": [[0, 0], [103, 0]], "downstream": [[0, 70], [66.5, 19.25], [103, 14.8]]}
FOUNDATION = {"material": "rock", "mass": False, "depth": 100, "upstream": 100, "downstream": 130}
DIVISIONS = {"along": 1, "through": 3, "up": 6, "depth": 2, "upstream": 2, "downstream": 2, "banks": 2}


def gravity_dam(**keys: Any) -> dict[str, Any]:
    """A job of three monoliths with Koyna's profile on rock; `keys` go into gravity_dam."""
    dam: dict[str, Any] = {
        **KOYNA,
        "monoliths": [16, 16, 16],
        "base": [20, 0, 10],
        "material": "concrete",
        "divisions": DIVISIONS,
        "rock": FOUNDATION | {"left": 60, "right": 60},
        "joints": {"base": JOINT, "contraction": JOINT},
    }
    return {"materials": {"concrete": dict(CONCRETE), "rock": dict(ROCK)}, "gravity_dam": dam | keys}
