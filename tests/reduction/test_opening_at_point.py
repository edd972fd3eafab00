"""The opening that is written is that of the two nodes at the gap's position, reduced and at full order."""

import numpy as np
import pytest
from small_scenes import full, march, raw, reduced, scene, shaking

DT = 0.0025


@pytest.mark.parametrize("discretization", ["mortar", "node_to_node"])
@pytest.mark.parametrize("order", [pytest.param("full", marks=pytest.mark.slow), "modal", "adaptive"])
def test_opening_at_a_crest_corner_is_the_difference_of_its_nodes(order, discretization):
    config = raw(friction=0.5, discretization=discretization)
    for block in config["blocks"].values():
        block["box"]["element"] = "tet10"
    built = scene(config)
    joint = built.joints["c"]
    corner = int(np.flatnonzero((joint.position == [4.0, 0.0, 8.0]).all(axis=1))[0])
    system = full(built) if order == "full" else reduced(built, modes=10).system
    integrator = "generalized_alpha" if order == "full" else order
    ground = shaking(DT, 0.5)  # from equilibrium: modes without states are strained from the first row on
    history = march(system, DT, ground, integrator=integrator, initial_state="static")
    apart = history.disp[:, 3:6] - history.disp[:, :3]
    seen = history.jump[:, corner] @ joint.axes[corner]
    assert np.abs(apart).max() > 1e-6, "nothing moved"
    np.testing.assert_allclose(seen, apart, atol=1e-9 * np.abs(apart).max())
    at_rows = history.jump[:, corner, 0].max()
    assert history.peaks["opening"][corner] >= at_rows - 1e-12 * np.abs(apart).max()


def test_what_joint_forces_see_is_another_jump():
    """Or there were nothing to tell apart above."""
    config = raw(discretization="mortar")
    for block in config["blocks"].values():
        block["box"]["element"] = "tet10"
    system = reduced(scene(config), modes=10).system
    assert abs(system.at_point).max() > 0.01 * abs(system.B).max()
