"""Matrices from files: every format gives the same, and what no elastic body has is refused with numbers."""

import logging
import re
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from nastran_frames import write_frames
from scipy.io import mmwrite
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, tril

import romdam
from romdam.config.sections.geometry.matrices import MatricesConfig
from romdam.core.errors import MeshError, ResultError
from romdam.core.scene import Material
from romdam.core.sealed import creating
from romdam.fem.assembly import assemble
from romdam.geometry.matrices.checks import check_matrices
from romdam.geometry.matrices.data import DIRECTIONS, MatrixUnknowns
from romdam.geometry.matrices.files import FileMatrices, read_matrices
from romdam.geometry.matrices.hdf5 import write_matrix, write_unknowns
from romdam.geometry.meshes.files import MeshFiles
from romdam.pipelines.modes import ModesOptions
from romdam.visual import mode_views

DATA = Path(__file__).parent / "data" / "calculix"
PLACE = "job.yaml: blocks.right.matrices"
CONCRETE = Material(30e9, 0.2, 2400.0)
OF_CALCULIX = {
    "stiffness": "right.sti", "mass": "right.mas", "unknowns": "right.dof", "nodes": "right.inp"
}  # fmt: skip


def block():
    from romdam.config.sections.geometry.mesh_file import MeshFileConfig

    return MeshFiles(DATA).block("right", MeshFileConfig(file="right.inp"), CONCRETE, "m")


def read(folder, **keys):
    return read_matrices(MatricesConfig(**keys), folder, None, PLACE)


def of_mesh():
    """K, M, unknowns of the meshed block, whose nodes have the numbers 10, 20, ... of the file."""
    mesh = block()
    K, M = assemble(mesh)
    node = np.repeat(10 * (np.arange(len(mesh.points)) + 1), 3)
    return (
        K,
        M,
        MatrixUnknowns(node, np.tile(np.arange(3), len(mesh.points)), np.repeat(mesh.points, 3, axis=0)),
    )


def write_csv(path, unknowns):
    rows = zip(unknowns.node, unknowns.motion, unknowns.position.tolist(), strict=True)
    text = "".join(f"{n},{DIRECTIONS[m]},{','.join(map(repr, at))}\n" for n, m, at in rows)
    path.write_text("node,direction,x,y,z\n" + text)


def write_market(folder, K, M, unknowns, **how):
    mmwrite(folder / "K.mtx", K, precision=17, **how)
    mmwrite(folder / "M.mtx", M, precision=17, **how)
    write_csv(folder / "u.csv", unknowns)
    return {"stiffness": "K.mtx", "mass": "M.mtx", "unknowns": "u.csv"}


def write_labels(folder, K, M, unknowns):
    """Abaqus' *MATRIX GENERATE: node, direction, node, direction, value of one triangle."""
    for name, matrix in (("K.mtx", K), ("M.mtx", M)):
        own = tril(matrix).tocoo()
        rows = zip(own.row, own.col, own.data, strict=True)
        lines = [
            f"{unknowns.node[i]},{unknowns.motion[i] + 1}, {unknowns.node[j]},{unknowns.motion[j] + 1}, {v!r}"
            for i, j, v in ((int(i), int(j), float(v)) for i, j, v in rows)
        ]
        (folder / name).write_text("** ABAQUS\n" + "\n".join(lines))
    shutil.copy(DATA / "right.inp", folder / "nodes.inp")
    return {"stiffness": "K.mtx", "mass": "M.mtx", "nodes": "nodes.inp"}


def write_hdf5(folder, K, M, unknowns, dense=False):
    with creating(folder / "b.h5") as file:
        write_unknowns(file, unknowns)
        for key, matrix in (("stiffness", K), ("mass", M)):
            if dense:
                file[key] = matrix.toarray()
            else:
                write_matrix(file, key, matrix)
    return dict.fromkeys(("stiffness", "mass", "unknowns"), "b.h5")


def write_op4(folder, K, M, unknowns):
    op4 = pytest.importorskip("pyyeti.nastran.op4")
    op4.write(str(folder / "km.op4"), {"KAA": K.toarray(), "MAA": M.toarray()})
    write_csv(folder / "u.csv", unknowns)
    return {"stiffness": "km.op4", "mass": "km.op4", "unknowns": "u.csv"}


def write_extseout(folder, K, M, unknowns):
    """As Nastran's EXTSEOUT does: several matrices in one .op4 file, rows and grid points in a .pch file."""
    op4 = pytest.importorskip("pyyeti.nastran.op4")
    names = {"kxx": K.toarray(), "mxx": M.toarray(), "bxx1": np.zeros((1, 1)), "k4xx1": np.zeros((1, 1))}
    op4.write(str(folder / "km.op4"), names)
    nodes, first = np.unique(unknowns.node, return_index=True)
    pairs = [f"{node:8d}{123:8d}" for node in nodes]
    lines = [f"EXTRN   {''.join(pairs[:4])}"]
    lines += [" " * 8 + "".join(pairs[k : k + 4]) for k in range(4, len(pairs), 4)]
    for node, (x, y, z) in zip(nodes, unknowns.position[first], strict=True):
        lines += [f"GRID*   {node:16d}{0:16d}{x:16.9E}{y:16.9E}", f"*       {z:16.9E}{0:16d}{0:16d}{0:16d}"]
    (folder / "km.pch").write_text("\n".join(["$ EXTRN DATA", *lines, ""]))
    keys = {"stiffness": "km.op4", "mass": "km.op4", "unknowns": "km.pch"}
    return keys | {"names": {"stiffness": "KXX", "mass": "mxx"}}


def write_named_hdf5(folder, K, M, unknowns):
    """Matrices of other names than the keys', one of them in a group."""
    with creating(folder / "b.h5") as file:
        write_unknowns(file, unknowns)
        write_matrix(file, "K_1", K)
        write_matrix(file.create_group("free"), "M", M)
    keys = dict.fromkeys(("stiffness", "mass", "unknowns"), "b.h5")
    return keys | {"names": {"stiffness": "K_1", "mass": "free/M"}}


def write_dmig(folder, K, M, unknowns):
    bulk = pytest.importorskip("pyyeti.nastran.bulk")
    import pandas as pd

    index = pd.MultiIndex.from_arrays([unknowns.node, unknowns.motion + 1], names=["id", "dof"])
    tables = {"KAAX": K, "MAAX": M}
    bulk.wtdmig(
        str(folder / "km.pch"),
        {name: pd.DataFrame(matrix.toarray(), index=index, columns=index) for name, matrix in tables.items()},
    )
    shutil.copy(DATA / "right.inp", folder / "nodes.inp")
    return {"stiffness": "km.pch", "mass": "km.pch", "nodes": "nodes.inp"}


def write_matlab(folder, K, M, unknowns, **how):
    """MATLAB's `save`, by SciPy: K, M and what else stands in a workspace."""
    from scipy.io import savemat

    savemat(
        folder / "model.mat", {"K": K, "M": M, "note": "of a workspace", "times": np.zeros((1, 3))}, **how
    )
    write_csv(folder / "u.csv", unknowns)
    return {"stiffness": "model.mat", "mass": "model.mat", "unknowns": "u.csv"}


def write_matlab_73(folder, K, M, unknowns):
    """As `save -v7.3`: HDF5 behind 512 bytes, sparse matrices by columns, dense ones transposed."""
    with h5py.File(folder / "model.mat", "w", userblock_size=512) as file:
        group, columns = file.create_group("K"), csr_matrix(K).tocsc()
        group.attrs["MATLAB_sparse"] = np.uint64(columns.shape[0])
        group.attrs["MATLAB_class"] = np.bytes_("double")
        group["data"], group["ir"] = columns.data, columns.indices.astype(np.uint64)
        group["jc"] = columns.indptr.astype(np.uint64)
        file["M"] = M.toarray().T
        file["M"].attrs["MATLAB_class"] = np.bytes_("double")
        file.create_group("#refs#")
    with (folder / "model.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    write_csv(folder / "u.csv", unknowns)
    return {"stiffness": "model.mat", "mass": "model.mat", "unknowns": "u.csv"}


def write_mmf(folder, K, M, unknowns):
    """ANSYS' `*EXPORT, MATK, MMF, K.mmf`."""
    keys = write_market(folder, K, M, unknowns, symmetry="symmetric")
    for name in "KM":
        (folder / f"{name}.mtx").rename(folder / f"{name}.mmf")
    return keys | {"stiffness": "K.mmf", "mass": "M.mmf"}


def write_triplets(folder, K, M, unknowns):
    """code_aster's `EXTR_MATR(sparse=True)`: values, rows, columns from 0, written line by line."""
    for name, matrix in (("K.txt", K), ("M.txt", M)):
        own = matrix.tocoo()
        rows = zip(own.row.tolist(), own.col.tolist(), own.data.tolist(), strict=True)
        (folder / name).write_text("".join(f"{i} {j} {value!r}\n" for i, j, value in rows))
    write_csv(folder / "u.csv", unknowns)
    return {"stiffness": "K.txt", "mass": "M.txt", "unknowns": "u.csv"}


WRITERS = {
    "matlab 5": write_matlab,
    "matlab 7": lambda *own: write_matlab(*own, do_compression=True),
    "matlab 4": lambda *own: write_matlab(*own, format="4"),
    "matlab 7.3": write_matlab_73,
    "ansys": write_mmf,
    "code_aster": write_triplets,
    "market": write_market,
    "symmetric market": lambda *own: write_market(*own, symmetry="symmetric"),
    "abaqus": write_labels,
    "hdf5": write_hdf5,
    "dense hdf5": lambda *own: write_hdf5(*own, dense=True),
    "named hdf5": write_named_hdf5,
    "op4": write_op4,
    "extseout": write_extseout,
    "dmig": write_dmig,
}


@pytest.mark.parametrize("form", WRITERS)
def test_every_format_gives_the_same_matrices(form, tmp_path):
    K, M, unknowns = of_mesh()
    own = read(tmp_path, **WRITERS[form](tmp_path, K, M, unknowns))
    digits = 2e-9 if form == "dmig" else 1e-15  # a DMIG of pyYeti's has ten
    assert abs(own.K - K).max() <= digits * abs(K).max()
    assert abs(own.M - M).max() <= digits * abs(M).max()
    assert (own.unknowns.labels == unknowns.labels).all()
    assert np.allclose(own.unknowns.position, unknowns.position, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("form", WRITERS)
def test_frequencies_of_every_format_are_scipys(form, tmp_path, monkeypatch):
    """A job of the files, one block on springs of its own supports: the lowest five to 1e-9."""
    monkeypatch.setattr(mode_views, "draw_modes", lambda scene, dataset, path: path)
    K, M, unknowns = of_mesh()
    keys = WRITERS[form](tmp_path, K, M, unknowns)
    shutil.copy(DATA / "right.inp", tmp_path / "right.inp")
    low = float(unknowns.position[:, 2].min())
    held = unknowns.position[:, 2] == low
    free = np.ix_(~held, ~held)
    full = [matrix.toarray() for matrix in (K, M)]
    if form == "dmig":  # the format has ten digits
        full = [np.vectorize(lambda value: float(f"{value:.9E}"))(matrix) for matrix in full]
    omega2 = eigh(full[0][free], full[1][free], eigvals_only=True, subset_by_index=[0, 4])
    block = {"material": "c", "mesh": {"file": "right.inp"}, "matrices": keys}
    (tmp_path / "r.txt").write_text("0\n1\n0\n")
    job = {
        "materials": {"c": {"E": "30 GPa", "nu": 0.2, "rho": 2400}},
        "blocks": {"right": block},
        "supports": [{"block": "right", "face": {"axis": "z", "at": low}}],
        "records": [{"name": "r", "file": "r.txt", "unit": "m/s2", "dt": "0.01 s", "components": {"y": 1}}],
        "model": {"modes": 10},
        "transient": {"finest_step": "1 ms"},
    }
    found = romdam.modes(
        romdam.load_config(job, tmp_path), tmp_path / "out", ModesOptions(joints="open", count=5)
    )
    assert found.dataset.frequency.values == pytest.approx(np.sqrt(omega2) / (2.0 * np.pi), rel=1e-9)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"MATLAB 5.0 MAT-file, Platform".ljust(128), "cannot be read"),
        (b"", "cannot be read"),
        (b"\x00" * 600, "cannot be read|has the matrices"),
    ],
)
def test_damaged_matlab_files_are_refused(content, message, tmp_path):
    K, M, unknowns = of_mesh()
    keys = write_matlab(tmp_path, K, M, unknowns)
    (tmp_path / "model.mat").write_bytes(content)
    with pytest.raises(MeshError, match=message):
        read(tmp_path, **keys)


def test_a_workspace_of_several_matrices_needs_a_name(tmp_path):
    from scipy.io import savemat

    K, M, unknowns = of_mesh()
    write_csv(tmp_path / "u.csv", unknowns)
    savemat(tmp_path / "model.mat", {"K": K, "Kgeo": K, "M": M})
    keys = {"stiffness": "model.mat", "mass": "model.mat", "unknowns": "u.csv"}
    with pytest.raises(
        MeshError, match=r"has the matrices K, Kgeo, M, of which 2 begin with K, expected one"
    ):
        read(tmp_path, **keys)
    assert abs(read(tmp_path, names={"stiffness": "K"}, **keys).K - K).max() <= 1e-15 * abs(K).max()


@pytest.mark.parametrize(
    ("units", "length", "mass"),
    [  # NIST Special Publication 811, appendix B: a pound-force is 4.4482216152605 N, a slug 14.59390 kg
        ("in-lbf-s", 0.0254, 175.1268),
        ("ft-lbf-s", 0.3048, 14.59390),
        ("ft-slug-s", 0.3048, 14.59390),
    ],
)
def test_matrices_in_customary_units(units, length, mass, tmp_path):
    """Stiffness is force over length, the same as mass over time squared; mass is mass."""
    K, M, unknowns = of_mesh()
    in_file = replace(unknowns, position=unknowns.position / length)
    own = read(tmp_path, units=units, **write_hdf5(tmp_path, K / mass, M / mass, in_file))
    assert abs(own.K - K).max() <= 5e-7 * abs(K).max()  # digits of the factors above
    assert abs(own.M - M).max() <= 5e-7 * abs(M).max()
    assert np.allclose(own.unknowns.position, unknowns.position, rtol=0.0, atol=1e-12)


def test_names_that_are_not_there_or_not_needed(tmp_path):
    keys = write_extseout(tmp_path, *of_mesh())
    with pytest.raises(MeshError) as caught:
        read(tmp_path, **keys | {"names": {}})
    assert "of which 2 begin with K, expected one; give `names`, such as {stiffness: KXX}" in str(
        caught.value
    )
    with pytest.raises(MeshError, match=r"of which 0 are 'KAA', expected one"):
        read(tmp_path, **keys | {"names": {"stiffness": "KAA"}})
    keys = write_market(tmp_path, *of_mesh())
    with pytest.raises(
        MeshError, match=r"matrices\.names\.mass: .*M\.mtx holds one matrix, which has no name"
    ):
        read(tmp_path, **keys | {"names": {"mass": "M"}})


def test_grid_points_that_move_in_a_system_that_is_not_given_are_refused(tmp_path):
    keys = write_extseout(tmp_path, *of_mesh())
    text = (tmp_path / "km.pch").read_text()
    head, _, rest = text.partition("GRID*")
    second = rest.index("\n*") + 2 + 7 + 16
    (tmp_path / "km.pch").write_text(head + "GRID*" + rest[:second] + f"{10:16d}" + rest[second + 16 :])
    with pytest.raises(
        MeshError, match=r"GRID 10 moves in coordinate system 10, which is not given as CORD2R"
    ):
        read(tmp_path, **keys)
    (tmp_path / "km.pch").write_text(head + "GRID*" + rest[:8] + rest[8:].replace(f"{0:16d}", f"{7:16d}", 1))
    with pytest.raises(MeshError, match=r"its GRID cannot be read .*coordinate system 7 is not given"):
        read(tmp_path, **keys)
    (tmp_path / "km.pch").write_text(text.replace("EXTRN ", "EXTRA "))
    with pytest.raises(MeshError, match=r"km\.pch: has no EXTRN that can be read"):
        read(tmp_path, **keys)


@pytest.mark.parametrize("place", ["pch", "bdf"])
def test_rows_along_displacement_systems_are_turned(place, tmp_path):
    mesh = block()
    K, M, unknowns = of_mesh()
    rng = np.random.default_rng(1)
    force, C = rng.normal(size=len(unknowns)), 0.02 * K.toarray() + 3.0 * M.toarray()
    own = read(tmp_path, **write_frames(tmp_path, mesh, K.toarray(), M.toarray(), C, force, place))
    assert (own.unknowns.labels == unknowns.labels).all() and own.unknowns.axes is None
    assert np.allclose(own.unknowns.position, unknowns.position, rtol=0.0, atol=1e-12)
    for read_back, true in ((own.K, K.toarray()), (own.M, M.toarray()), (own.C, C)):
        assert np.abs(read_back.toarray() - true).max() < 1e-11 * np.abs(true).max()
    assert np.abs(own.force - force).max() < 1e-11


def test_rows_without_a_direction_are_turned_where_what_is_held_is_an_axis(tmp_path):
    """A quarter turn about z with its second motion held holds -x: what is left is y and z."""
    op4 = pytest.importorskip("pyyeti.nastran.op4")
    K = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, 0.25], [0.5, 0.25, 2.0]])
    op4.write(str(tmp_path / "km.op4"), {"KXX": K, "MXX": np.diag([1.0, 2.0, 3.0])})
    head = ["EXTRN,1,13,2,4", "GRID,1,,1.,2.,3.,6", "GRID,2,,4.,5.,6.,6"]
    quarter = "CORD2R,6,,0.,0.,0.,0.,0.,1.\n,0.,1.,0."  # its x is y, its y is -x
    (tmp_path / "km.pch").write_text("\n".join([*head, quarter, ""]))
    keys = {"stiffness": "km.op4", "mass": "km.op4", "unknowns": "km.pch"}
    own = read(tmp_path, **keys)
    assert own.unknowns.labels.tolist() == [[1, 1], [1, 2], [2, 4]]  # y, z, and the rotation about y
    assert own.K.toarray() == pytest.approx(K, abs=1e-15)
    oblique = "CORD2R,6,,0.,0.,0.,0.,0.,1.\n,1.,1.,0."
    (tmp_path / "km.pch").write_text("\n".join([*head, oblique, ""]))
    with pytest.raises(MeshError, match="node 1 moves along x, z of its own coordinate system alone"):
        read(tmp_path, **keys)


@pytest.mark.parametrize("coding", ["utf-8-sig", "latin-1"])
def test_tables_are_read_in_utf_8_or_latin_1(coding, tmp_path):
    K, M, unknowns = of_mesh()
    keys = write_market(tmp_path, K, M, unknowns)
    table = (tmp_path / "u.csv").read_text().replace("x,y,z\n", "x,y,z,Fl\xfcgel\n")
    head, *rows = table.splitlines()
    (tmp_path / "u.csv").write_text("\n".join([head, *(f"{row},1" for row in rows)]), encoding=coding)
    own = read(tmp_path, **keys)
    assert (own.unknowns.labels == unknowns.labels).all()


def test_calculix_has_the_stiffness_and_the_consistent_mass_of_hex8():
    own, (K, M, unknowns) = read(DATA, **OF_CALCULIX), of_mesh()
    number = {tuple(label): k for k, label in enumerate(unknowns.labels.tolist())}
    at = np.array([number[tuple(label)] for label in own.unknowns.labels.tolist()])
    assert abs(own.K - K[at][:, at]).max() < 1e-13 * abs(K).max()  # printed with 14 digits
    assert abs(own.M - M[at][:, at]).max() < 1e-13 * abs(M).max()
    assert np.allclose(own.unknowns.position, unknowns.position[at])


@pytest.mark.parametrize(
    "units, length, mass, time", [("mm-t-s", 1e3, 1e-3, 1.0), ("mm-kg-ms", 1e3, 1.0, 1e3)]
)
def test_units_are_converted(units, length, mass, time, tmp_path):
    K, M, unknowns = of_mesh()
    written = MatrixUnknowns(unknowns.node, unknowns.motion, unknowns.position * length)
    keys = write_market(tmp_path, K * (mass / time**2), M * mass, written)
    mmwrite(tmp_path / "f.mtx", np.full((len(unknowns), 1), 5.0))
    own = read(tmp_path, **keys, units=units, force="f.mtx", damping="K.mtx")
    assert abs(own.K - K).max() < 1e-14 * abs(K).max() and abs(own.M - M).max() < 1e-14 * abs(M).max()
    assert abs(own.C - K / time).max() < 1e-14 * abs(K).max() / time  # as many mass per time
    assert np.allclose(own.force, 5.0 / (mass * length / time**2))
    assert np.allclose(own.unknowns.position, unknowns.position)


def test_one_triangle_is_told_of(tmp_path, caplog):
    K, M, unknowns = of_mesh()
    with caplog.at_level(logging.INFO):
        read(tmp_path, **write_market(tmp_path, csr_matrix(tril(K)), M, unknowns, symmetry="general"))
    assert "stiffness" in caplog.text and "only one triangle is stored" in caplog.text


def changed(row, column, factor):
    def change(K, M, unknowns):
        K = K.tolil()
        K[row, column] = factor * K[row, column]
        return csr_matrix(K), M, unknowns

    return change


def with_unknowns(**parts):
    def change(K, M, unknowns):
        own = {name: getattr(unknowns, name).copy() for name in ("node", "motion", "position")}
        for name, make in parts.items():
            own[name] = make(own[name])
        return K, M, MatrixUnknowns(**own)

    return change


REFUSED = {
    "not symmetric": (
        changed(0, 1, 1.5),
        r"stiffness: .*is not symmetric, .* differ by [\d.]+ of the largest",
    ),
    "too few rows": (
        lambda K, M, u: (K[:-3][:, :-3], M, u),
        r"stiffness: .*rows are 0 to 32 of 33, and there are 36 unknowns",
    ),
    "negative": (lambda K, M, u: (-K, M, u), r"stiffness: 36 of 36 unknowns have none or less"),
    "indefinite": (
        lambda K, M, u: (csr_matrix(2.0 * K - csr_matrix(np.diag(K.diagonal()))), M, u),
        r"stiffness: has \d+ negative eigenvalues of 36, limit 0",
    ),
    "no mass": (
        lambda K, M, u: (K, csr_matrix(np.diag(np.r_[np.ones(35), 0.0])), u),
        r"mass: 1 of 36 unknowns have none or less, .* node 120, z with 0",
    ),
    "mass of opposite signs": (
        lambda K, M, u: (K, csr_matrix(M - 0.9 * csr_matrix(np.diag(M.diagonal()))), u),
        r"mass: has \d+ negative eigenvalues of 36",
    ),
    "repeated": (
        with_unknowns(node=lambda n: np.r_[n[:3], n[:3], n[6:]]),
        r"unknowns: .*3 unknowns are given twice, the first is node 10, x, limit once",
    ),
    "no coordinates": (
        with_unknowns(position=lambda p: np.full_like(p, np.nan)),
        r"unknowns: .*36 of 36 unknowns have no coordinates, the first is node 10, x",
    ),
    "other order": (
        with_unknowns(motion=lambda m: np.roll(m, 1)),
        r"stiffness: 6 motions have no strain, and only \d of the six rigid motions",
    ),
    "other coordinates": (
        with_unknowns(position=lambda p: p[::-1] ** 2),
        r"stiffness: 6 motions have no strain, and only [345] of the six",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_no_elastic_body_has_is_refused_with_numbers(case, tmp_path):
    change, message = REFUSED[case]
    keys = write_market(tmp_path, *change(*of_mesh()), symmetry="general")
    with pytest.raises(MeshError, match=message) as raised:
        check_matrices(read(tmp_path, **keys), PLACE)
    assert str(raised.value).startswith(PLACE)


def test_a_mass_in_other_units_is_refused(tmp_path):
    own = read(tmp_path, **write_market(tmp_path, *of_mesh()))
    check_matrices(own, PLACE, 4 * 4 * 8 * 2400.0)
    with pytest.raises(MeshError, match=r"mass: is 3.072e\+05, .* total_mass is 307.2 kg, limit 0.1"):
        check_matrices(own, PLACE, 307.2)


def beam(length=3.0):
    """Euler and Bernoulli's beam along x between two nodes, with rotary inertia: K has six rigid motions."""
    K = np.zeros((12, 12))
    for pair, stiffness in (((0, 6), 5.0), ((3, 9), 0.7)):
        K[np.ix_(pair, pair)] += stiffness * np.array([[1, -1], [-1, 1]])
    for way, turn, sign in ((1, 5, 1.0), (2, 4, -1.0)):
        a, b = 6.0, 6.0 * sign * length / 2
        c, d = 2.0 * length**2, length**2
        at = np.ix_([way, turn, way + 6, turn + 6], [way, turn, way + 6, turn + 6])
        K[at] += np.array([[a, b, -a, b], [b, c, -b, d], [-a, -b, a, -b], [b, d, -b, c]])
    motion = np.tile(np.arange(6), 2)
    position = np.repeat([[1.0, 2.0, 3.0], [1.0 + length, 2.0, 3.0]], 6, axis=0)
    unknowns = MatrixUnknowns(np.repeat([1, 2], 6), motion, position)
    return FileMatrices(unknowns, csr_matrix(K), csr_matrix(np.eye(12)), None, None, np.zeros(12))


def test_rotations_take_part_in_rigid_motions(caplog):
    with caplog.at_level(logging.INFO):
        check_matrices(beam(), PLACE)
    assert "mass 2, 2, 2 kg along x, y, z; 6 rigid motions" in caplog.text


def test_what_is_held_inside_is_a_warning_unless_the_job_says_so():
    own = beam()
    held = replace(own, K=own.K + csr_matrix(np.diag(np.r_[np.ones(6), np.zeros(6)])))
    (said,) = check_matrices(held, PLACE).warnings
    assert "resists 6 of 6 rigid motions of its unknowns" in said
    assert check_matrices(held, PLACE, supported=True).warnings == ()


TEXTS = {
    "words": ("1 1 x\n", "holds what is no number"),
    "four numbers": ("1 1 2 3\n", "has lines of 4 numbers, expected 3"),
    "nothing": ("** nothing\n", "has lines of no numbers"),
    "half a row": ("1.5 1 2\n", "1 numbers of rows or nodes are not whole, such as 1.5"),
    "twice": ("1 1 2\n1 1 2\n2 2 1\n", "1 of 3 entries are given twice"),
    "infinite": ("1 1 inf\n2 2 1\n", "1 of 2 entries are no finite numbers"),
    "pressure": ("1,8,1,8,2\n", "direction 8 of 2 unknowns, expected 1 to 6"),
    "from 2": ("2 2 1\n3 3 1\n37 37 1\n", "rows are 2 to 37 of 37, and there are 36"),
    "market of nothing": ("%%MatrixMarket matrix coordinate real general\n", "is no sound Matrix Market"),
    "too large": ("%%MatrixMarket matrix array real general\n1000000 1000000\n1\n", "no sound Matrix Market"),
    "complex": ("%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1 1\n", "no sound Matrix"),
    "oblong": ("%%MatrixMarket matrix coordinate real general\n2 3 1\n1 1 1\n", "is not square, 2 by 3"),
}  # fmt: skip


@pytest.mark.parametrize("case", TEXTS)
def test_text_that_is_no_matrix_is_refused(case, tmp_path):
    text, message = TEXTS[case]
    keys = write_market(tmp_path, *of_mesh())
    (tmp_path / "K.mtx").write_text(text)
    with pytest.raises(MeshError, match=rf"^{re.escape(PLACE)}\.stiffness: .*{re.escape(message)}"):
        read(tmp_path, **keys)


def test_files_that_are_not_there_or_of_no_format_are_named(tmp_path):
    keys = write_market(tmp_path, *of_mesh())
    for key, value, message in (
        ("mass", "none.mtx", "none.mtx"),
        ("mass", "M.docx", "is of no known format; known endings are .mtx"),
        ("unknowns", "K.mtx", "known endings are .dof, .csv"),
        ("nodes", "u.docx", "known endings are .csv"),
    ):
        lacking = MatrixUnknowns(*of_mesh()[2].labels.T, np.full((36, 3), np.nan))
        write_csv(tmp_path / "u.csv", lacking if key == "nodes" else of_mesh()[2])
        with pytest.raises(MeshError, match=rf"\.{key}: .*{re.escape(message)}"):
            read(tmp_path, **keys | {key: value})
    with pytest.raises(MeshError, match="numbers its rows and does not say what they are"):
        read(tmp_path, stiffness="K.mtx", mass="M.mtx")


def test_damaged_hdf5_is_refused(tmp_path):
    keys = write_hdf5(tmp_path, *of_mesh())
    whole = (tmp_path / "b.h5").read_bytes()
    (tmp_path / "b.h5").write_bytes(whole[:2000] + b"x" + whole[2001:])
    with pytest.raises(ResultError, match="is damaged"):
        read(tmp_path, **keys)


def test_nodes_of_the_blocks_own_mesh_give_coordinates():
    from romdam.config.sections.geometry.mesh_file import MeshFileConfig

    files, config = MeshFiles(DATA), MeshFileConfig(file="right.inp", unit="mm")
    files.block("right", config, CONCRETE, "m")
    keys = {key: value for key, value in OF_CALCULIX.items() if key != "nodes"}
    own = read_matrices(MatricesConfig(**keys), DATA, files.numbered(config), PLACE)
    assert np.ptp(own.unknowns.position, axis=0) == pytest.approx([4e-3, 4e-3, 8e-3])
