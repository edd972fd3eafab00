"""What may be meant and probably is not is said, and what cannot fit is refused before it is meshed."""

from pathlib import Path

import numpy as np
import pytest
from arch_dams import DIVISIONS, arch_dam
from scene_builders import box, two_boxes

from romdam.core.errors import ConfigError
from romdam.core.files import check_file
from romdam.core.machine import machine_memory
from romdam.core.scene import Reservoir
from romdam.geometry.elements import SOLIDS

CONCRETE = {"E": 30e9, "nu": 0.18, "rho": 2440.0}
THIN = {"axis": "y", "at": 2.0}


def material(**keys):
    return two_boxes() | {"materials": {"concrete": CONCRETE | keys}}


def joint(**keys):
    return two_boxes(**keys)


def shifted(height):
    raw = two_boxes()
    raw["blocks"]["right"] = box([0, 2, 2 - height], [2, 2, 2])
    raw["supports"][1] = {"block": "right", "face": "zmin"}
    return raw


def without_joint():
    return {key: value for key, value in two_boxes().items() if key != "joints"}


ODD = {
    "tonnes": (material(rho=2.4), "materials.concrete.rho = 2.4 kg/m3", "is `2.4 t/m3` meant?"),
    "no GPa": (material(E=30.0), "materials.concrete.E = 30 Pa", "is `30 GPa` meant?"),
    "MPa": (material(E=30000.0), "materials.concrete.E = 30000 Pa", "is `30000 MPa` meant?"),
    "nu": (material(nu=1e-3), "materials.concrete.nu = 0.001", "concrete has about 0.2"),
    "soft": (joint(normal_stiffness=16.0), "joints.c.normal_stiffness = 16 N/m3", "such as `16 GPa/m`?"),
    "stiff": (joint(normal_stiffness=1e16), "joints.c.normal_stiffness = 1e+16 N/m3", "`rigid` is exact"),
    "soft shear": (
        joint(normal_stiffness=16e9, shear_stiffness=8.0, friction=0.6),
        "joints.c.shear_stiffness = 8 N/m3",
        "sticking, the joint hardly holds the blocks",
    ),
    "pressure twice": (
        two_boxes() | {"loads": {"pressure": 2 * [{"block": "left", "face": "ymin", "value": 1e3}]}},
        "loads.pressure[1]: ",
        "of block 'left' are loaded by loads.pressure[0] too; their sum acts",
    ),
    "short reservoir": (
        two_boxes()
        | {
            "water": {
                "level": 2.0,
                "faces": [{"block": "left", "face": "ymin"}],
                "model": "incompressible",
                "length": 0.5,
            }
        },
        "water.length = 0.5 m is 0.25 of the depth of 2 m",
    ),
    "water above the dam": (
        two_boxes() | {"loads": {"joint_water": [{"joints": ["c"], "level": 90.0}]}},
        "loads.joint_water[0].level: 90 m is above all blocks, which reach to 2 m",
    ),
    "half a face": (shifted(1.0), "joints.c: the faces lie on each other over 2 m2", "of 4 m2 of 'left'"),
    "no joint": (without_joint(), "blocks: 'left' and 'right' touch over 4 m2", "neither a joint nor a tie"),
    "millimetres": (
        {
            "blocks": {"a": box([0, 0, 0], [5e4, 5e4, 5e4], 1e4)},
            "supports": [{"block": "a", "face": "zmin"}],
        },
        "blocks: all together reach over 5e+04 m",
        "in mm?",
    ),
    "slender": (
        {
            "blocks": {"a": box([0, 0, 0], [2, 2, 400], [1.0, 1.0, 200.0])},
            "supports": [{"block": "a", "face": "zmin"}],
        },
        "blocks.a: the edges of 8 of its 8 elements differ by more than 100 times",
        "stress there is poor",
    ),
}


@pytest.mark.parametrize("name", ODD)
def test_what_is_odd_is_said(name, make):
    raw, *parts = ODD[name]
    remarks = make(raw).remarks
    assert len(remarks) == 1 + (name in ("no GPa", "MPa"))  # E is far from the joint's stiffness too
    assert all(part in remarks[0] for part in parts)


def test_nothing_is_said_of_what_is_not_odd(make):
    for raw in (
        two_boxes(normal_stiffness=16e9),
        two_boxes(normal_stiffness="rigid"),
        arch_dam(ground=False),
    ):
        assert not make(raw).remarks


@pytest.mark.parametrize("size", [1e-3, 1e-9, 1e-6, [1e-6, 1.0, 1e-6]])
@pytest.mark.parametrize("element", SOLIDS)
def test_a_box_too_fine_for_memory_is_refused_before_it_is_meshed(size, element, make):
    raw = two_boxes(element) | {"model": {"order": "full", "memory": "1 GB"}}
    raw["blocks"]["left"]["box"]["element_size"] = size
    with pytest.raises(ConfigError) as caught:
        make(raw)
    message = str(caught.value)
    assert message.startswith("s.yaml: blocks.left.box.element_size: about ")
    assert "limit model.memory = 1.0 GB; the smallest elements that fit have about " in message


def test_the_size_that_fits_fits(make):
    raw = two_boxes() | {"model": {"order": "full", "memory": "2 MB"}}
    raw["blocks"]["left"]["box"]["element_size"] = 0.1
    with pytest.raises(ConfigError, match=r"elements that fit have about 0\.3\d? m"):
        make(raw)
    raw["blocks"]["left"]["box"]["element_size"] = 0.5
    raw["blocks"]["right"]["box"]["element_size"] = 0.5
    make(raw)


def test_an_arch_dam_too_fine_for_memory_is_refused_before_it_is_meshed(make):
    fine = DIVISIONS | {"along": 200, "through": 200, "up": 200}
    with pytest.raises(ConfigError, match=r"arch_dam\.divisions: about \d.* nodes .* divide by"):
        make(arch_dam(divisions=fine, cantilevers=99) | {"model": {"order": "full", "memory": "8 GB"}})


def test_the_machine_tells_its_memory():
    assert machine_memory() > 1e8


U_VALLEY = [(x, y, z) for z in (0, 1, 2) for y in (0, 1) for x in (0, 1, 2, 3)]


def valley():
    """A valley of rock as Abaqus reads it, with a notch one element wide."""

    def number(x, y, z):
        return 1 + x + 4 * y + 8 * z

    cells = [(0, 0), (1, 0), (2, 0), (0, 1), (2, 1)]
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    rows = [[number(x + a, b, z + c) for c in (0, 1) for a, b in ring] for x, z in cells]
    nodes = "\n".join(f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(U_VALLEY, 1))
    elements = "\n".join(f"{k}, {', '.join(map(str, row))}" for k, row in enumerate(rows, 1))
    return f"*NODE\n{nodes}\n*ELEMENT, TYPE=C3D8\n{elements}\n"


def test_a_face_between_contacts_on_both_sides_is_wet(make, tmp_path):
    """A dam one element wide in a notch: all nodes of its upstream face are in the contact."""
    (tmp_path / "valley.inp").write_text(valley())
    raw = {
        "blocks": {
            "rock": {"material": "concrete", "mesh": {"file": "valley.inp"}},
            "dam": box([1, 0, 1], [1, 1, 1]),
        },
        "supports": [{"block": "rock", "face": {"axis": "z", "at": 0}}],
        "ties": {"t": {"between": ["rock", "dam"]}},
        "water": {
            "level": 2.0,
            "faces": [{"block": "dam", "face": "ymin"}],
            "model": "westergaard",
            "upstream": [0, -1, 0],
        },
    }
    assert np.array_equal(make(raw, tmp_path).find(Reservoir).upstream, [0, -1, 0])
    raw["water"]["faces"] = [{"block": "dam", "face": "xmin"}]
    with pytest.raises(ConfigError, match=r"the face is not wet: 1 of its 1 facets lie in the contact 't'"):
        make(raw, tmp_path)


def test_what_is_no_file_is_refused(make, tmp_path):
    (tmp_path / "folder.msh").mkdir()
    raw = {"blocks": {"a": {"material": "concrete", "mesh": {"file": "folder.msh"}}}}
    with pytest.raises(
        Exception, match=r"s\.yaml: blocks\.a\.mesh\.file: .*folder\.msh: is a folder; give a file"
    ):
        make(raw, tmp_path)
    raw = two_boxes(gap={"table": "/dev/zero"})
    with pytest.raises(ConfigError, match=r"joints\.c\.gap\.table: /dev/zero cannot be read \(is a device"):
        make(raw, Path())
    with pytest.raises(ConfigError, match="is a device"):
        check_file(Path("/dev/null"), 1, ConfigError)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            {"model": "incompressible", "length": 0.01},
            r"water\.length: 0\.01 m is 0\.005 of the depth of 2 m",
        ),
        ({"model": "compressible", "sound_speed": 1.0}, r"water\.sound_speed must be at least 20"),
        (
            {"model": "compressible", "sound_speed": 20.0, "cutoff": 2e3},
            r"sound_speed: at 20 m/s .* modes below",
        ),
    ],
)
def test_a_reservoir_that_cannot_be_is_refused(keys, message, make):
    """24 m3 of water at 20 m/s have some 1e8 modes below 2 kHz; at 1 m/s the mesh alone never ended."""
    water = {"level": 2.0, "faces": [{"block": "left", "face": "ymin"}]} | keys
    with pytest.raises(ConfigError, match=message):
        make(two_boxes() | {"water": water})
