"""Small dictionaries of boxes for tests of geometry and scenes."""

from collections.abc import Sequence
from typing import Any


def box(
    origin: Sequence[float], size: Sequence[float], element_size: object = 1.0, element: str = "hex8"
) -> dict[str, Any]:
    """A block of concrete."""
    sizes = {"origin": origin, "size": size, "element_size": element_size, "element": element}
    return {"material": "concrete", "box": sizes}


def two_boxes(element: str = "hex8", **joint: Any) -> dict[str, Any]:
    """Two boxes of 2 x 2 x 2 m that touch at y = 2, both held at z = 0."""
    return {
        "blocks": {
            "left": box([0, 0, 0], [2, 2, 2], element=element),
            "right": box([0, 2, 0], [2, 2, 2], element=element),
        },
        "supports": [{"block": "left", "face": "zmin"}, {"block": "right", "face": "zmin"}],
        "joints": {"c": {"between": ["left", "right"], "normal_stiffness": 1e9} | joint},
    }
