"""Blocks that nothing loads rest undeformed, whatever strength their joints have."""

import numpy as np
import pytest

import romdam

LAWS = {
    "bond": {"tensile_strength": 1e6, "cohesion": 2e6, "shear_stiffness": 1e10},
    "fracture": {"fracture": {"tensile_strength": 1e6, "energy": 300.0}},
    "fracture with cohesion": {
        "fracture": {"tensile_strength": 1e6, "energy": 300.0, "cohesion": 2e6, "shear_energy": 1e3},
        "shear_stiffness": 1e10,
    },
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_blocks_without_loads_rest_undeformed(law):
    """Fracture left forces of 4 mN, of strengths of 250 kN, and displacements that never came to rest."""
    box = {"size": [1, 1, 1], "element_size": 1.0}
    raw = {
        "materials": {"concrete": {"E": 3e13, "nu": 0.0, "rho": 2400}},
        "blocks": {
            name: {"material": "concrete", "box": {"origin": [0, 0, z], **box}}
            for name, z in (("base", -1), ("top", 0))
        },
        "supports": [{"block": "base", "face": "zmin"}]
        + [{"block": "top", "face": face, "fix": ["x", "y"]} for face in ("xmin", "xmax")],
        "joints": {"foot": {"between": ["base", "top"], "normal_stiffness": 1e10, **law}},
        "damping": {"rayleigh": {"alpha": 0.0, "beta": 1e-9}},
        "model": {"modes": "all"},
        "transient": {"finest_step": 1e-3},
        "outputs": {"error_estimate": False, "plots": False, "mesh_error": False},
    }
    still = romdam.GroundMotion.from_arrays("still", {"x": np.zeros(11)}, 0.001)
    run = romdam.run(raw, motions=still).results[0].dataset
    assert not run.opening.values[0].any() and not run.normal_force.values[0].any()
    strength = 1e6 * run.gap_area.values
    assert (np.abs(run.normal_force.values) <= 1e-7 * strength).all()  # the solver's tolerance is 1e-8
