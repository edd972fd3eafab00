"""Small arch dams for the tests, as dictionaries."""

from typing import Any

CONCRETE = {"E": 28e9, "nu": 0.2, "rho": 2400.0, "expansion": 1e-5}
ROCKS = {
    "rock_a": {"E": 45e9, "nu": 0.20, "rho": 2620.0},
    "rock_b": {"E": 26e9, "nu": 0.22, "rho": 2650.0},
    "rock_c": {"E": 14e9, "nu": 0.24, "rho": 2590.0},
}
DIVISIONS = {"along": 1, "through": 1, "up": 3, "rock": 2, "upstream": 1, "downstream": 1, "growth": 2.0}
PERIMETER = {"material": "concrete", "thickness": 4.0}
ROCK = {
    "half_width": 260.0,
    "upstream": 160.0,
    "downstream": 220.0,
    "depth": 120.0,
    "zones": {
        "left": {"material": "rock_b", "mass": True, "x": [-1000, -40]},
        "right": {"material": "rock_c", "mass": True, "x": [60, 1000]},
        "centre": {"material": "rock_a", "mass": True},
    },
}
JOINTS = {"normal_stiffness": 24e9, "shear_stiffness": 12e9, "friction": 0.6, "gaps": "corners"}


def arch_dam(ground: bool = True, **keys: Any) -> dict[str, Any]:
    """A job of a dam 100 m high with four cantilevers; `keys` go into arch_dam."""
    dam: dict[str, Any] = {
        "crest": 100.0,
        "crown": {"upstream": [[0, 0], [40, -9], [100, -2]], "thickness": [[0, 24], [50, 17], [100, 7]]},
        "arcs": {
            "upstream_radius": [[0, 75], [100, 125]],
            "downstream_radius": [[0, 52], [100, 116]],
            "thickening": 0.15,
        },
        "valley": [[0, 22], [40, 55], [100, 105]],
        "abutment_height": 25.0,
        "cantilevers": 4,
        "material": "concrete",
        "element": "hex8",
        "divisions": DIVISIONS,
        "joints": JOINTS,
    }
    if ground:
        dam |= {"perimeter": PERIMETER, "rock": ROCK}
    return {"materials": {"concrete": CONCRETE} | ROCKS, "arch_dam": dam | keys}
