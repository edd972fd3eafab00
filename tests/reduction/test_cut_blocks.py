"""Blocks cut out of one mesh move as blocks that were meshed apart, and as one body where they are tied."""

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh
from small_scenes import march, raw, reduced, scene

from romdam.fem.assembly import assemble
from romdam.scene.ties import scene_parts

NORMAL = np.array([0.3, 0.2, 1.0])


def one_box_cut_at_the_joint():
    """The two cantilevers of `small_scenes` as one box."""
    keys = raw(friction=0.5)
    whole = {"origin": [0, -4, 0], "size": [4, 10, 8], "element_size": 2.0}
    keys["blocks"] = {"whole": {"material": "concrete", "box": whole}}
    plane = {"plane": {"point": [0, 0, 0], "normal": [0, 1, 0]}}
    keys["cut"] = {"whole": {"along": [plane], "into": ["left", "right"]}}
    return keys


def test_two_cantilevers_cut_out_of_one_box_open_as_two_boxes():
    """Joints that open and slide; all openings and slips to rounding."""
    two, one = (
        march(reduced(scene(keys)).system) for keys in (raw(friction=0.5), one_box_cut_at_the_joint())
    )
    assert two.jump.max() > 1e-4 and one.jump.shape == two.jump.shape
    assert np.abs(one.jump - two.jump).max() < 1e-12 * np.abs(two.jump).max()


def beam(edge, **more):
    """A column of 2 x 2 x 6 m in tet10, clamped at its foot."""
    box = {"origin": [0, 0, 0], "size": [2, 2, 6], "element_size": edge, "element": "tet10"}
    return (
        raw()
        | {
            "blocks": {"whole": {"material": "concrete", "box": box}},
            "supports": [{"block": "whole", "face": "zmin"}],
            "joints": {},
            "loads": {},
            "outputs": {},
        }
        | more
    )


def cut_beam(edge, between):
    plane = {"plane": {"point": [1.0, 1.0, 3.1], "normal": NORMAL.tolist()}}
    cut = {"along": [plane], "into": ["lower", "upper"], "through": "elements"}
    return beam(edge, cut={"whole": cut}, supports=[{"block": "lower", "face": "zmin"}]) | between


def lowest(keys, count=6):
    """Lowest frequencies [Hz] of a scene that is one part."""
    built = scene(keys)
    (part,) = scene_parts(built).values()
    K, M = assemble(part.mesh(built.blocks))
    free = np.flatnonzero(~part.fixed(built.fixed).ravel())
    K, M = K[free][:, free].tocsc(), M[free][:, free].tocsc()
    return np.sqrt(eigsh(K, count, M, sigma=0.0, v0=np.ones(len(free)))[0]) / (2 * np.pi)


def test_a_beam_cut_obliquely_and_tied_has_the_frequencies_of_the_uncut_one():
    """Elements are added, so they go towards those of a finer mesh, and stay on this side of them."""
    uncut, finer = lowest(beam(1.0)), lowest(beam(0.5))
    tied = lowest(cut_beam(1.0, {"ties": {"t": {"between": ["lower", "upper"]}}}))
    assert (finer < tied).all() and (tied < uncut * (1.0 + 1e-5)).all()
    assert np.abs(tied / uncut - 1.0).max() < 5e-3


def test_gap_areas_of_an_oblique_cut_are_the_section():
    joint = {"between": ["lower", "upper"], "normal_stiffness": 1e9}
    for gaps in ("nodes", "corners"):
        built = scene(cut_beam(1.0, {"joints": {"j": joint | {"gaps": gaps}}, "supports": HELD}))
        gap = built.joints["j"]
        assert gap.area.sum() == pytest.approx(4.0 * np.linalg.norm(NORMAL), rel=1e-12)
        assert np.abs(gap.axes[:, 0] - NORMAL / np.linalg.norm(NORMAL)).max() < 1e-12


HELD = [{"block": "lower", "face": "zmin"}, {"block": "upper", "face": "zmax"}]
