"""Rock wedges of tests: Hoek and Bray's, random tetrahedra and a slab, with the loads on them."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import xarray as xr

from romdam.config.sections.wedges import WedgeConfig, WedgesConfig
from romdam.core.arrays import Floats
from romdam.postprocess.wedge_loads import WedgeLoads, wedge_loads
from romdam.postprocess.wedges import WedgeGeometry, upward_normal, wedge_geometry

NORTH = (0.0, 1.0, 0.0)
FOOT, POUND = 0.3048, 4.4482216152605  # [m], [N]
PSF = POUND / FOOT**2


def only(raw: dict[str, Any], **common: Any) -> tuple[WedgesConfig, WedgeConfig, WedgeGeometry]:
    """The wedge of a file that has one, and its geometry."""
    config = WedgesConfig.model_validate({"wedges": {"w": raw}} | common)
    wedge = config.wedges["w"]
    return config, wedge, wedge_geometry(wedge, config, "w.yaml: wedges.w")


def loads_of(
    config: WedgesConfig,
    geometry: WedgeGeometry,
    time: Sequence[float] = (0.0,),
    run: xr.Dataset | None = None,
    levels: Mapping[Any, Any] | None = None,
) -> WedgeLoads:
    return wedge_loads("w", geometry, config, np.array(time), run=run, levels=levels or {}, source="w.yaml")


def active(config: WedgesConfig, geometry: WedgeGeometry) -> Floats:
    return np.asarray(loads_of(config, geometry).force.sum(axis=1)[0])


def hoek_and_bray(pressure: float = 0.0) -> dict[str, Any]:
    """The example of Rock Slope Engineering (1981), appendix 2: a slope of 100 ft, a crack 40 ft behind."""
    normal = {
        name: upward_normal(dip, direction, NORTH)
        for name, (dip, direction) in {"1": (45, 105), "3": (12, 195), "4": (65, 185)}.items()
    }
    up_the_face = np.cross(normal["1"], normal["4"])
    crest = up_the_face * 100.0 * FOOT / up_the_face[2]
    back = np.cross(normal["1"], normal["3"])
    behind = crest + 40.0 * FOOT * back / np.linalg.norm(back) * -np.sign(back @ normal["4"])

    def plane(dip: float, direction: float, through: Any, **more: Any) -> dict[str, Any]:
        return {"dip": dip, "dip_direction": direction, "through": list(map(float, through))} | more

    water = {"water": pressure} if pressure else {}
    return {
        "inside": [-7.8, 21.4, 19.3],
        "density": 160.0 * POUND / FOOT**3 / 9.81,
        "planes": {
            "1": plane(45, 105, [0, 0, 0], friction=np.tan(np.radians(20)), cohesion=500 * PSF, **water),
            "2": plane(70, 235, [0, 0, 0], friction=np.tan(np.radians(30)), cohesion=1000 * PSF, **water),
        },
        "surfaces": {
            "upper slope": plane(12, 195, crest),
            "face": plane(65, 185, [0, 0, 0]),
            "crack": plane(70, 165, behind, **water),
        },
    }


def random_wedge(rng: np.random.Generator, planes: int) -> tuple[dict[str, Any], Floats]:
    """A tetrahedron with `planes` planes to slide on, its corners anywhere."""
    corners = rng.normal(size=(4, 3)) * 20.0
    middle, names, sides = corners.mean(axis=0), [], {}
    for k, face in enumerate(combinations(range(4), 3)):
        a, b, c = corners[list(face)]
        normal = np.cross(b - a, c - a)
        normal *= np.sign(normal[2]) / np.linalg.norm(normal)
        names.append(f"f{k}")
        sides[names[-1]] = {
            "dip": float(np.degrees(np.arccos(normal[2]))),
            "dip_direction": float(np.degrees(np.arctan2(normal[0], normal[1]))),
            "through": a.tolist(),
        }
    raw: dict[str, Any] = {"inside": middle.tolist(), "density": 2600.0, "planes": {}, "surfaces": {}}
    for k, name in enumerate(names):
        if k < planes:
            raw["planes"][name] = sides[name] | {
                "friction": rng.uniform(0, 1),
                "cohesion": rng.uniform(0, 1e5),
            }
        else:
            raw["surfaces"][name] = sides[name]
    return raw, corners


SLAB = {
    "inside": [5.0, 5.0, 1.0],
    "density": 2500.0,
    "planes": {"base": {"dip": 0, "through": [0, 0, 0], "friction": 0.5, "cohesion": 2e4}},
    "surfaces": {
        "top": {"dip": 0, "through": [0, 0, 4]},
        **{
            f"{axis}{at}": {"dip": 90, "dip_direction": direction, "through": [at, at, 0]}
            for axis, direction in (("x", 90), ("y", 0))
            for at in (0, 10)
        },
    },
}  # fmt: skip
