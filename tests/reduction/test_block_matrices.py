"""Blocks from matrices: the openings of the meshed block, whichever way the matrices came; and back again."""

import copy
from pathlib import Path

import numpy as np
import pytest
from gravity_dams import FOUNDATION, gravity_dam
from nastran_frames import write_frames
from scipy.io import mmread
from scipy.linalg import eigh
from scipy.sparse import block_diag, csr_matrix
from simulating import simulated

from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig, ModelConfig, RayleighConfig
from romdam.core.errors import ConfigError, MeshError
from romdam.core.sealed import creating, reading
from romdam.effects.full_order import assemble_full
from romdam.export.matrices import write
from romdam.fem.assembly import assemble
from romdam.geometry.matrices.data import DIRECTIONS, MatrixUnknowns
from romdam.geometry.matrices.hdf5 import write_matrix, write_unknowns
from romdam.reduction.natural_modes import natural_modes
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

DATA = Path(__file__).parents[1] / "geometry" / "data" / "calculix"
RAYLEIGH = RayleighConfig(frequencies=(10.0, 100.0), ratio=0.05)
DAMPING = DampingConfig(rayleigh=RAYLEIGH)
ALL = ModelConfig(modes="all")
PRESSED = [{"block": "right", "face": "ymax", "value": 1e5}]
EXPORTED = ("stiffness", "mass", "unknowns")


def raw(friction=0.0, **right):
    """Two columns of two hex8 each, side by side and pressed together."""
    box = {"size": [4, 4, 8], "element_size": 4.0}
    joint = {"between": ["left", "right"], "normal_stiffness": 30e9, "friction": friction}
    return {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400.0, "expansion": 1e-5}},
        "blocks": {
            "left": {"material": "concrete", "box": {**box, "origin": [0, -8, 0], "size": [4, 8, 8]}},
            "right": {"material": "concrete", **({"box": {"origin": [0, 0, 0], **box}} | right)},
        },
        "supports": [{"block": name, "face": {"axis": "z", "at": 0}} for name in ("left", "right")],
        "joints": {"c": joint | ({"shear_stiffness": 20e9} if friction else {})},
        "loads": {
            "gravity": [0, 0, -9.81],
            "pressure": [{"block": "right", "face": {"axis": "y", "at": 4}, "value": 1e4}],
        },
        "outputs": {"nodes": {"top": {"block": "right", "at": [4, 0, 8]}}},
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "model": {"order": "full"},
        "transient": {"finest_step": 0.01},
    }  # fmt: skip


def built(config, folder=DATA):
    return build_scene(parse_config(config, "s.yaml"), folder, "s.yaml")


def ground(steps=300):
    t = 0.002 * np.arange(steps)
    return np.stack([0.3 * np.sin(70.0 * t), 20.0 * np.sin(45.0 * t), 0.5 * np.cos(30.0 * t)])


def history(scene, model=ALL, damping=DAMPING, integrator="modal"):
    system = reduce_scene(scene, model, damping).system
    return simulated(system, ground(), 0.002, integrator)


def same(own, other, digits=1e-9):
    """Openings, slips and displacements agree to digits of the largest opening; the joint did open."""
    largest = np.abs(other.jump[..., 0]).max()
    assert other.jump[..., 0].max() > 1e-5
    assert np.abs(own.jump - other.jump).max() < digits * largest
    assert np.abs(own.disp - other.disp).max() < digits * np.abs(other.disp).max()


def calculix(**more):
    keys = {"stiffness": "right.sti", "mass": "right.mas", "unknowns": "right.dof"}
    return {"box": None, "mesh": {"file": "right.inp"}, "matrices": keys | more}


@pytest.mark.parametrize("friction", [0.0, 0.7])
def test_calculix_own_matrices_give_the_openings_of_the_meshed_block(friction):
    same(history(built(raw(friction, **calculix(total_mass=3.072e5)))), history(built(raw(friction))))


def test_frequencies_are_those_that_calculix_finds_of_its_matrices():
    """CalculiX 2.20, *FREQUENCY on right.inp with *BOUNDARY zmin,1,3: right.dat has 7 digits."""
    config = raw(**calculix())
    del config["blocks"]["left"], config["joints"]
    config["supports"] = config["supports"][1:]
    modes = natural_modes(built(config), DAMPING, 3)
    assert modes.freq == pytest.approx([37.34752, 37.34752, 73.16226], rel=2e-7)
    assert modes.total_mass == pytest.approx(4 * 4 * 8 * 2400.0)


@pytest.mark.parametrize("place", ["pch", "bdf"])
def test_nodes_that_move_along_systems_of_nastran_give_the_same_frequencies_and_openings(place, tmp_path):
    """With damping and a load of its own; the nodes' rows were turned by hand."""
    config = raw(0.7)
    right = built(config).blocks["right"]
    K, M = (matrix.toarray() for matrix in assemble(right))
    C, force = 2e-4 * K + 1.5 * M, 1e3 * np.random.default_rng(5).normal(size=len(K))
    keys = write_frames(tmp_path, right, K, M, C, force, place)
    basic = np.repeat(10 * (np.arange(len(right.points)) + 1), 3)
    with creating(tmp_path / "b.h5") as file:
        unknowns = MatrixUnknowns(
            basic, np.tile(np.arange(3), len(right.points)), np.repeat(right.points, 3, axis=0)
        )
        write_unknowns(file, unknowns)
        for key, matrix in (("stiffness", K), ("mass", M), ("damping", C)):
            write_matrix(file, key, csr_matrix(matrix))
        file["force"] = force[:, None]
    unturned = dict.fromkeys(("stiffness", "mass", "damping", "unknowns", "force"), "b.h5")
    config["blocks"]["right"]["matrices"] = keys
    own = built(config, tmp_path)
    config["blocks"]["right"]["matrices"] = unturned
    other = built(config, tmp_path)
    freq = [natural_modes(scene, DAMPING, 6).freq for scene in (own, other)]
    assert freq[0] == pytest.approx(freq[1], rel=1e-9)
    same(*(history(scene, integrator="generalized_alpha") for scene in (own, other)))


def exported(scene, folder, model=None, damping=DAMPING):
    reduced = None if model is None else reduce_scene(scene, model, damping)
    system = assemble_full(scene, damping) if reduced is None else reduced.system
    return write(scene, system, reduced, damping, folder)


def read_back(config, form, keys):
    """The configuration with both blocks from what was exported."""
    config = copy.deepcopy(config)
    for name in ("left", "right"):
        names = {key: f"{name}_{key}.mtx" for key in keys} | {"unknowns": f"{name}_unknowns.csv"}
        config["blocks"][name]["matrices"] = dict.fromkeys(keys, f"{name}.h5") if form == "h5" else names
    return config


@pytest.mark.parametrize("form", ["h5", "mtx"])
def test_the_whole_mesh_goes_out_and_comes_back(form, tmp_path):
    scene = built(raw(0.7))
    exported(scene, tmp_path)
    same(history(built(read_back(raw(0.7), form, EXPORTED), tmp_path)), history(scene))


@pytest.mark.parametrize("form", ["h5", "mtx"])
@pytest.mark.parametrize("friction", [0.0, 0.7])
def test_reduced_blocks_go_out_and_come_back(friction, form, tmp_path):
    """With the loads on faces that have no unknowns any more as `force`, and the weight by `inertia`."""
    scene, model = built(raw(friction)), ModelConfig(modes=5)
    exported(scene, tmp_path, model)
    config = read_back(raw(friction), form, (*EXPORTED, "inertia", "force"))
    config["loads"]["pressure"] = []
    # pressure comes with the weight, as one load: of the states at rest that friction leaves it finds another
    same(history(built(config, tmp_path)), history(scene, model), 1e-9 if friction == 0.0 else 1e-3)


def test_a_free_reduced_block_comes_back_with_its_weight(tmp_path):
    """A block that stands on the joint alone: inertia, weight and rigid motions follow from M and K."""
    config = raw(0.7)
    upper = config["blocks"]["right"]["box"] | {"origin": [0, -4, 8]}
    config["blocks"]["right"]["box"], config["loads"]["pressure"] = upper, []
    config["supports"], config["outputs"] = config["supports"][:1], {}
    scene, model = built(config), ModelConfig(modes=4)
    exported(scene, tmp_path, model)
    back = read_back(config, "h5", (*EXPORTED, "inertia"))
    del back["blocks"]["right"]["matrices"]["inertia"]
    reread = built(back, tmp_path)
    first = slice(100)  # each impact of a block that rocks magnifies round-off
    one, other = history(reread, ALL).jump[first], history(scene, model).jump[first]
    assert other[..., 0].max() > 1e-5 and np.abs(one - other).max() < 1e-9 * np.abs(other).max()
    inertia = reread.blocks["right"].matrices.M @ reread.blocks["right"].matrices.translations
    assert reread.blocks["right"].matrices.translations.T @ inertia == pytest.approx(
        3.072e5 * np.eye(3), abs=1e-3
    )


@pytest.mark.parametrize("friction", [0.0, 0.7])
def test_what_is_written_rebuilds_the_reduced_model(friction, tmp_path):
    """Side by side the blocks have the modes of the system, and G phi its gap operator but for signs."""
    scene, model = built(raw(friction)), ModelConfig(modes=5)
    exported(scene, tmp_path, model)
    of = {key: [csr_matrix(mmread(tmp_path / f"{name}_{key}.mtx")) for name in ("left", "right")]
          for key in ("stiffness", "mass", "damping", "gaps", "inertia")}  # fmt: skip
    K, M, C = (block_diag(of[key]).toarray() for key in ("stiffness", "mass", "damping"))
    omega2, phi = eigh(K, M)
    G = np.hstack([part.toarray() for part in of["gaps"]]) @ phi
    load = phi.T @ np.vstack([part.toarray() for part in of["inertia"]])
    with reading(tmp_path / "system.h5") as file:
        B = csr_matrix(tuple(file["gaps"][name][()] for name in ("data", "indices", "indptr"))).toarray()
        own, inertia = np.sort(file["stiffness"]["data"][()]), file["inertia"][()]
        assert tuple(file["blocks"].attrs["right"])[1] == len(omega2)
    assert omega2 == pytest.approx(own, rel=1e-9)
    assert phi.T @ C @ phi == pytest.approx(np.diag(np.diag(phi.T @ C @ phi)), abs=1e-6 * omega2.max() ** 0.5)
    assert pytest.approx(B @ B.T, rel=1e-9, abs=1e-9 * np.abs(B @ B.T).max()) == G @ G.T
    assert G @ load == pytest.approx(B @ inertia, rel=1e-9, abs=1e-9 * np.abs(B @ inertia).max())


def test_matrices_whose_supports_were_applied_before(tmp_path, caplog):
    """Without the rows that supports hold: exact with M r of the whole; what hangs on supports is said."""
    scene = built(raw(0.7))
    block, free = scene.blocks["right"], ~scene.fixed["right"].ravel()
    K, M = assemble(block)
    node, position = np.arange(len(free)) // 3, np.repeat(block.points, 3, axis=0)
    with creating(tmp_path / "r.h5") as file:
        write_unknowns(file, MatrixUnknowns(node[free], (np.arange(len(free)) % 3)[free], position[free]))
        write_matrix(file, "stiffness", csr_matrix(K[free][:, free]))
        write_matrix(file, "mass", csr_matrix(M[free][:, free]))
        file["inertia"] = (M @ np.tile(np.eye(3), (len(block.points), 1)))[free]
    caplog.set_level("INFO")
    keys = dict.fromkeys((*EXPORTED, "inertia"), "r.h5")
    same(history(built(raw(0.7, matrices=keys), tmp_path)), history(scene))
    assert "resists 6 of 6 rigid motions of its unknowns" in caplog.text


def with_oscillator(folder, scene):
    """Matrices of the right column, with a mass on a spring at its top and a lone oscillator."""
    block = scene.blocks["right"]
    K, M = assemble(block)
    n, top = K.shape[0], 3 * int(np.argmax(block.points.sum(axis=1))) + 1
    K, M = (block_diag([matrix, np.zeros((2, 2))]).tolil() for matrix in (K, M))
    spring = 5e8
    K[top, top] += spring
    K[top, n] = K[n, top] = -spring
    K[n, n], M[n, n], K[n + 1, n + 1], M[n + 1, n + 1] = spring, 2e4, 3e9, 1e3
    unknowns = MatrixUnknowns(
        np.r_[np.repeat(np.arange(n // 3) + 1, 3), 900, 901],
        np.r_[np.tile(np.arange(3), n // 3), [DIRECTIONS.index("internal")] * 2],
        np.vstack([np.repeat(block.points, 3, axis=0), np.full((2, 3), np.nan)]),
    )
    with creating(folder / "o.h5") as file:
        write_unknowns(file, unknowns)
        write_matrix(file, "stiffness", csr_matrix(K))
        write_matrix(file, "mass", csr_matrix(M))
    return K.toarray(), M.toarray()


def test_unknowns_without_a_node_go_along(tmp_path):
    """The frequencies of all that is free, against a dense solution of the matrices as they were written."""
    scene = built(raw())
    K, M = with_oscillator(tmp_path, scene)
    reread = built(raw(matrices=dict.fromkeys(EXPORTED, "o.h5")), tmp_path)
    free = np.r_[~scene.fixed["right"].ravel(), True, True]
    expected = eigh(K[free][:, free], M[free][:, free], eigvals_only=True)
    basis = reduce_scene(reread, ALL, DAMPING).basis["right"]
    assert np.sort(basis.omega2) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("order", ["full", "reduced"])
def test_a_damping_matrix_stands_in_place_of_rayleighs(order, tmp_path):
    """C = alpha M + beta K from a file is what Rayleigh damping of that block is."""
    exported(built(raw()), tmp_path)
    keys = (*EXPORTED, "damping")
    reread = built(raw(matrices=dict.fromkeys(keys, "right.h5")), tmp_path)
    other = DampingConfig(rayleigh=RayleighConfig(alpha=0.0, beta=0.0))
    whole = assemble_full(reread, DAMPING) if order == "full" else reduce_scene(reread, ALL, DAMPING).system
    plain = (
        assemble_full(built(raw()), DAMPING)
        if order == "full"
        else reduce_scene(built(raw()), ALL, DAMPING).system
    )
    lone = assemble_full(reread, other) if order == "full" else reduce_scene(reread, ALL, other).system
    right = plain.parts["right"]
    scale = np.abs(plain.C.toarray()).max()
    assert abs(whole.C - plain.C).max() < 1e-9 * scale
    assert abs(lone.C[right, right] - plain.C[right, right]).max() < 1e-9 * scale
    assert abs(lone.C[plain.parts["left"], plain.parts["left"]]).max() == 0.0
    assert not whole.diagonal


def changed(**more):
    config = raw(**calculix())
    for path, value in more.items():
        place = config
        *outer, key = path.split("__")
        for name in outer:
            place = place[name]
        place[key] = value
    return config


_OTHER_NODES = {"blocks__right__matrices__nodes": "right.inp"}
_DAMPED = {"blocks__right__matrices__damping": "right.sti"}
_STRAY = {"blocks__right__matrices__tolerance": 5.0, "blocks__right__matrices__units": "mm-kg-s"}
_AWAY = {"origin": [100, 0, 0], "size": [4, 4, 8], "element_size": 4.0}
_FAR = _OTHER_NODES | {"blocks__right__mesh": None, "blocks__right__box": _AWAY}
_TIED = {"joints": {}, "ties": {"t": {"between": ["left", "right"]}}}
REFUSED = {
    "stress": (
        {"outputs__stress": {"blocks": ["right"]}},
        "outputs.stress: the stress of block 'right' is not",
    ),
    "temperature": (
        {"loads__temperature": [{"change": 5.0}]},
        "loads.temperature: the change of block 'right'",
    ),
    "tie": (_TIED, "ties.t: block 'right' has matrices of its own"),
    "far": (_FAR, "none of the 12 nodes of its matrices"),
    "two nodes": (_OTHER_NODES | _STRAY, "nodes of the mesh are two of the matrices'"),
    "mass": ({"blocks__right__mass": False}, "blocks.right: `mass: false` is for blocks that are assembled"),
    "no shape": (
        {"blocks__right__mesh": None},
        "blocks.right: give exactly one of `box` and `mesh`, the shape",
    ),
    "modal": (_DAMPED | {"damping": {"modal": 0.05}}, "matrices.damping: damping.modal gives ratios"),
    "integrator": (
        _DAMPED | {"model": {"modes": 5}, "transient__integrator": "modal"},
        "modal needs modes that nothing couples",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_matrices_cannot_have_is_refused(case):
    change, message = REFUSED[case]
    with pytest.raises((ConfigError, MeshError), match="s.yaml: .*" + message):
        built(changed(**change))


def test_a_joint_at_nodes_that_are_no_unknowns_is_refused(tmp_path):
    """A reduced block keeps what its joint sees; a joint elsewhere would hold on to nothing."""
    scene = built(raw())
    exported(scene, tmp_path, ModelConfig(modes=5))
    config = read_back(raw(), "h5", (*EXPORTED, "inertia"))
    config["outputs"] = {}
    with pytest.raises(
        ConfigError, match=r"loads.pressure: 4 of its 6 nodes of block 'right' are no unknowns"
    ):
        built(config, tmp_path)
    config["loads"]["pressure"] = []
    with pytest.raises(ConfigError, match=r"joints.c: 4 of its 4 nodes of block 'left' are no unknowns of"):
        built(config | {"joints": raw(0.7)["joints"]}, tmp_path)
    config["outputs"] = {"nodes": {"top": {"block": "right", "at": [4, 4, 8]}}}
    with pytest.raises(ConfigError, match=r"no node of block 'right' within 0.001 m of \(4, 4, 8\)"):
        built(config, tmp_path)


def test_the_command_writes_and_reads_back(tmp_path):
    import yaml
    from typer.testing import CliRunner

    from romdam.cli import app

    np.savetxt(tmp_path / "none.txt", ground()[1])
    (tmp_path / "job.yaml").write_text(yaml.safe_dump(raw() | {"model": {"modes": 5}}))
    done = CliRunner().invoke(
        app,
        ["export", str(tmp_path / "job.yaml"), "--to", "matrices", "-o", str(tmp_path / "out")],
    )
    assert done.exit_code == 0, done.output
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"system.h5", "left.h5", "right.h5", "right_stiffness.mtx", "right_unknowns.csv"} <= names


def test_a_block_of_a_dam_takes_matrices_by_its_name(tmp_path):
    """A monolith written and read back under the dam's own name: the same K, M, loads and gap operator."""
    rock = FOUNDATION | {"left": 60, "right": 60, "mass": True}
    config = gravity_dam(rock=rock) | {key: raw()[key] for key in ("records", "model", "transient")}
    config["loads"] = {"gravity": [0, 0, -9.81]}
    scene = built(config)
    exported(scene, tmp_path)
    own = {"material": "concrete", "matrices": dict.fromkeys(EXPORTED, "monolith_2.h5")}
    system = assemble_full(scene, DAMPING)
    reread = assemble_full(built(config | {"blocks": {"monolith_2": own}}, tmp_path), DAMPING)
    for name in ("K", "M", "C", "B", "load", "force"):
        one, other = getattr(reread, name), getattr(system, name)
        assert abs(one - other).max() <= 1e-14 * abs(other).max(), name
    tied = {"material": "rock", "matrices": dict.fromkeys(EXPORTED, "rock_1.h5")}
    with pytest.raises(
        ConfigError, match=r"s.yaml: tie .* of the dam: block 'rock_1' has matrices of its own"
    ):
        built(config | {"blocks": {"rock_1": tied}}, tmp_path)


def test_what_cannot_stand_alone_is_said(tmp_path, caplog):
    """Rock tied together is in the system alone; waves and supports of their own motion are in neither."""
    config = gravity_dam() | {key: raw()[key] for key in ("records", "model", "transient")}
    exported(built(config), tmp_path, ModelConfig(modes=5))
    assert "block rock_1: no matrices of its own, since ties make it one with" in caplog.text
    assert not (tmp_path / "rock_1.h5").exists() and (tmp_path / "monolith_1.h5").exists()
    config = raw()
    config["supports"][1]["motion"] = {"factor": 0.5}
    with pytest.raises(
        ConfigError, match=r"supports\[\]\.motion, or ground\.along, is not written as matrices"
    ):
        exported(built(config), tmp_path)


def test_negative_damping_is_refused(tmp_path):
    exported(built(raw()), tmp_path)
    with reading(tmp_path / "right.h5") as file:
        K = csr_matrix(tuple(file["stiffness"][name][()] for name in ("data", "indices", "indptr")))
    with creating(tmp_path / "c.h5") as file:
        write_matrix(file, "damping", -1e-4 * K)
    keys = dict.fromkeys(EXPORTED, "right.h5") | {"damping": "c.h5"}
    with pytest.raises(MeshError, match=r"matrices.damping: 36 of 36 entries on its diagonal are negative"):
        built(raw(matrices=keys), tmp_path)
