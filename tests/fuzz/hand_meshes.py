"""Mesh files made by hand: each with the volume it holds, or what its refusal must say."""

from mesh_texts import (
    CELLS4,
    CUBES,
    HEX,
    NODES4,
    OLD4,
    OLDEST,
    SLAB,
    TETS,
    assembly,
    bdf,
    chexa,
    grids,
    inp,
    moved,
    msh,
    msh4,
    packed,
    small,
    stretched,
    vtu,
)

TWO = CUBES[:8] + CUBES[4:]  # the upper cube on nodes of its own
APART = [[1, 2, 4, 3, 5, 6, 8, 7], [9, 10, 12, 11, 13, 14, 16, 15]]
FINE = [(x / 2, y / 2, 1 + z / 2) for z in (0, 1, 2) for y in (0, 1, 2) for x in (0, 1, 2)]
FINE_HEX = [
    [n + 9, *(n + 9 + d for d in (1, 4, 3, 9, 10, 13, 12))]
    for z in (0, 9)
    for y in (0, 3)
    for n in (z + y, z + y + 1)
]
MIDDLE = [(a, b) for a, b in ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))]
TET = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
TET10 = TET + [tuple((TET[a][k] + TET[b][k]) / 2 for k in range(3)) for a, b in MIDDLE]
TURNED = [(y, -x, z) for x, y, z in CUBES]  # in a system whose x axis is the basic y axis

# name -> (file name, text or {name: text}, volume, volume and remark, or what the refusal says)
HAND = {
    # Nastran, read
    "blank continuation": ("a.bdf", small(), 2.0),
    "plus continuation": ("a.bdf", small(mark=("", "+")), 2.0),
    "marked continuation": ("a.bdf", small(mark=("+A", "+A")), 2.0),
    "free": ("a.bdf", bdf(grids(), chexa()), 2.0),
    "free blank continuation": ("a.bdf", bdf(grids(), chexa(form="CHEXA,{0},{1},{2}\n,{3}")), 2.0),
    "large": (
        "a.bdf",
        bdf(
            [
                f"GRID*   {k:<16}{'':16}{x:<16.6f}{y:<16.6f}*\n*       {z:<16.6f}"
                for k, (x, y, z) in enumerate(CUBES, 1)
            ],
            [
                "CHEXA*  "
                + "".join(f"{n:<16}" for n in (k, 1, *c[:2]))
                + "\n*       "
                + "".join(f"{n:<16}" for n in c[2:6])
                + "\n*       "
                + "".join(f"{n:<16}" for n in c[6:])
                for k, c in enumerate(HEX, 1)
            ],
        ),
        2.0,
    ),
    "comments and case": (
        "a.bdf",
        "SOL 101 $ x\nCEND\nbegin bulk\n$ GRID,99\n"
        + bdf([line.lower() + " $ a comment" for line in grids()], "$ nothing", chexa()),
        2.0,
    ),
    "exponents": (
        "a.bdf",
        bdf(grids(stretched(CUBES, 10), "GRID,{0},,{1:.1f},{2:.1f},{3:.1f}"), chexa()).replace(
            ",10.0", ",1.+1"
        ),
        2000.0,
    ),
    "include": (
        "a.bdf",
        {
            "a.bdf": bdf("INCLUDE 'sub/nodes.bdf'", chexa()),
            "sub/nodes.bdf": "INCLUDE 'more.bdf'\n",
            "sub/more.bdf": "\n".join(grids()),
        },
        2.0,
    ),
    "include over two lines": (
        "a.bdf",
        {"a.bdf": bdf("INCLUDE 'sub/\n        nodes.bdf'", chexa()), "sub/nodes.bdf": "\n".join(grids())},
        2.0,
    ),
    "cards that are no misspelt ones": (
        "a.bdf",
        bdf(grids(), chexa(), "AEGRID,1,0.,0.,0.", "TRIMVAR,1,URDD3", "CQUADX4,9,1,1,2,3,4", "OGRDSET,1"),
        (2.0, "elements that are neither solids nor shells are left out (1 CQUADX4)"),
    ),
    "large GRID without its second line": (
        "a.bdf",
        bdf(grids(), "GRID*   13              " + 16 * " " + "0.0             0.0             *\nPSOLID,1,1"),
        "GRID 13 lacks its continuation line",
    ),
    "marker with a blank in its first column": (
        "a.bdf",
        small(mark=(" A 1", "+A 1")),
        2.0,
    ),
    "include loop": (
        "a.bdf",
        {"a.bdf": bdf("INCLUDE 'b.bdf'", chexa()), "b.bdf": "INCLUDE 'a.bdf'"},
        "includes itself",
    ),
    "include missing": ("a.bdf", bdf("INCLUDE 'gone.bdf'", grids(), chexa()), "line 1: the included file"),
    "grdset": (
        "a.bdf",
        bdf("GRDSET,,7", "CORD2R,7,,0.,0.,0.,0.,0.,1.\n,0.,1.,0.", grids(TURNED), chexa()),
        2.0,
    ),
    "grdset unknown system": (
        "a.bdf",
        bdf("GRDSET,,7", grids(), chexa()),
        "coordinate system 7 is not given",
    ),
    "cylinder": (
        "a.bdf",
        bdf(
            "CORD2C,3,,0.,0.,0.,0.,0.,1.,+\n+,1.,0.,0.",
            grids([(1 + x, 90.0 * y, z) for x, y, z in SLAB], "GRID,{0},3,{1},{2},{3}"),
            chexa(HEX[:1]),
        ),
        1.5,
    ),
    "system on a line": (
        "a.bdf",
        bdf(
            "CORD2R,3,,0.,0.,0.,0.,0.,1.,+\n+,0.,0.,2.", grids(SLAB, "GRID,{0},3,{1},{2},{3}"), chexa(HEX[:1])
        ),
        "lie on a line",
    ),
    "system of itself": (
        "a.bdf",
        bdf(
            "CORD2R,3,3,0.,0.,0.,0.,0.,1.,+\n+,1.,0.,0.",
            grids(SLAB, "GRID,{0},3,{1},{2},{3}"),
            chexa(HEX[:1]),
        ),
        "coordinate system 3 refers to itself",
    ),
    # Nastran, refused
    "cut between elements": ("a.bdf", "\n".join(small().split("\n")[:14]), "a line without ENDDATA"),
    "no end": ("a.bdf", "\n".join([*grids(), *chexa()]), "it ends in a line without ENDDATA"),
    "after the end": (
        "a.bdf",
        bdf(grids(), chexa(HEX[:1])) + "CHEXA,2,1,5,6,8,7,9,10,+\n+,12,11\n",
        (1.0, "1 entries after ENDDATA are left out"),
    ),
    "node twice": ("a.bdf", bdf(grids(), "GRID,5,,0.,0.,1.5", chexa()), "uses node 5, which is given twice"),
    "element twice": (
        "a.bdf",
        bdf(grids(), chexa(HEX[:1]), chexa(HEX[1:])),
        "element 1 (hexahedron) has a number that is given twice",
    ),
    "continuation of another": ("a.bdf", small(mark=("+A", "+B")), "both continue '+B'"),
    "continuation lost": ("a.bdf", bdf(grids(), chexa(form="CHEXA,{0},{1},{2}")), "expected 8 or 20"),
    "mid-edge nodes left out": (
        "a.bdf",
        bdf(grids(SLAB), "CHEXA,1,1,1,2,4,3,5,6\n,8,7,,2,3"),
        "names a node twice",
    ),
    "misspelt": (
        "a.bdf",
        bdf(grids(), chexa()).replace("CHEXA,2", "CHEXB,2"),
        "CHEXB is not known; is CHEXA meant?",
    ),
    "real for a whole number": (
        "a.bdf",
        bdf(grids(), chexa()).replace("GRID,7,", "GRID,7.,"),
        "expected a whole number",
    ),
    "letters for a number": (
        "a.bdf",
        bdf(grids(), chexa()).replace("1.0,1.0,1.0", "1.0,l.0,1.0"),
        "expected a number",
    ),
    "repeated node": (
        "a.bdf",
        bdf(grids(), chexa([HEX[0], [5, 6, 8, 7, 9, 9, 12, 11]])),
        "names a node twice",
    ),
    "unknown node": (
        "a.bdf",
        bdf(grids(), chexa([HEX[0], [5, 6, 8, 7, 9, 10, 12, 21]])),
        "element 2 (hexahedron) uses node 21, which is not given",
    ),
    # gmsh
    "msh 2.2": ("a.msh", msh(), 2.0),
    "msh 2.2 sparse numbers": (
        "a.msh",
        msh(numbers=range(10, 130, 10), cells=[[10 * n for n in c] for c in HEX]),
        2.0,
    ),
    "msh 4.1": ("a.msh", msh4(NODES4, CELLS4), 2.0),
    "msh 4.0": ("a.msh", OLD4, 2.0),
    "msh 4.0 cut": ("a.msh", OLD4.replace("\n12 1 1 2", ""), "early: the file was cut"),
    "msh 1": ("a.msh", OLDEST, 2.0),
    "msh 1 of other counts": ("a.msh", OLDEST.replace("2 5 1 1 8 5", "2 5 1 1 7 5"), "$ELM gives element 2"),
    "msh names without dimension": (
        "a.msh",
        msh(extra='$PhysicalNames\n1\n1 "a dam"\n$EndPhysicalNames\n', head="2 0 8"),
        2.0,
    ),
    "msh of high order": (
        "a.msh",
        msh().replace("$Elements\n2\n", "$Elements\n3\n9 26 2 1 1 1 2 3 4\n"),
        (2.0, "elements that no block is made of are left out (1 of type 26)"),
    ),
    "msh 4.1 with two groups": ("a.msh", msh4(NODES4, CELLS4, "0 0 0 1\n1 0 0 0 1 1 2 2 5 6 0"), 2.0),
    "msh 3": ("a.msh", msh(head="3 0 8"), "versions 2.2, 4.0 and 4.1 are read"),
    "msh node twice": (
        "a.msh",
        msh([*CUBES, (0, 0, 1.5)], numbers=[*range(1, 13), 5]),
        "uses node 5, which is given twice",
    ),
    "msh element twice": (
        "a.msh",
        msh(ids=[3, 3]),
        "element 3 (hexahedron) has a number that is given twice",
    ),
    "msh count too low": (
        "a.msh",
        msh().replace("$Elements\n2\n", "$Elements\n1\n"),
        "more than its counts say",
    ),
    "msh count too high": ("a.msh", msh().replace("$Nodes\n12\n", "$Nodes\n99\n"), "early: the file was cut"),
    "msh count of 10^12": (
        "a.msh",
        msh().replace("$Nodes\n12\n", "$Nodes\n1000000000000\n"),
        "the file was cut",
    ),
    "msh not closed": ("a.msh", msh()[:-14], "is not closed by $EndElements"),
    "msh unknown entity": (
        "a.msh",
        msh4(NODES4, CELLS4, "0 0 0 1\n2 0 0 0 1 1 2 0 0"),
        "of entity 1 of dimension 3",
    ),
    "msh partitioned": (
        "a.msh",
        msh4(NODES4, CELLS4, extra="$PartitionedEntities\n1\n$EndPartitionedEntities\n"),
        "is partitioned",
    ),
    "msh group without elements": (
        "a.msh",
        msh(extra='$PhysicalNames\n2\n3 1 "a"\n3 2 "b"\n$EndPhysicalNames\n'),
        (2.0, "group 'b' is named and holds no elements"),
    ),
    "msh plane": ("a.msh", msh(CUBES[:4], [[1, 2, 4, 3]], kind=3), "has no solid elements"),
    "msh nan": ("a.msh", msh(moved(CUBES, (0, 0, float("nan")), [11])), "finite coordinates"),
    "msh inf": ("a.msh", msh(moved(CUBES, (0, float("inf"), 0), [3])), "finite coordinates"),
    "msh 1e300": ("a.msh", msh(moved(CUBES, (1e300, 0, 0), [3])), "finite coordinates up to 1e+12"),
    "nonsense": ("a.msh", "$MeshFormat\n2.2 0\n", "cannot be read as a gmsh file"),
    # Abaqus
    "inp": ("a.inp", inp(), 2.0),
    "inp include": ("a.inp", {"a.inp": "*INCLUDE, INPUT=sub/b.inp\n", "sub/b.inp": inp()}, 2.0),
    "inp include loop": ("a.inp", "*INCLUDE, INPUT=a.inp\n", "includes itself"),
    "inp cylindrical": ("a.inp", inp(node="*NODE, SYSTEM=C"), "SYSTEM=C is not followed"),
    "inp system": ("a.inp", "*SYSTEM\n1.,0.,0.\n" + inp(), "*SYSTEM is not followed"),
    "inp ngen": ("a.inp", inp(more="*NGEN\n1, 12, 1\n"), "*NGEN is not followed"),
    "inp elgen": ("a.inp", inp(more="*ELGEN\n1, 2, 1, 1\n"), "*ELGEN is not followed"),
    "inp instance of no part": (
        "a.inp",
        inp(more="*INSTANCE, NAME=P-1, PART=P\n5., 0., 0.\n*END INSTANCE\n"),
        "which is not given before",
    ),
    "inp moved instance": ("a.inp", assembly("*INSTANCE, NAME=a, PART=p\n5., 0., 0.\n*END INSTANCE"), 2.0),
    "inp instance moved nowhere": (
        "a.inp",
        assembly("*INSTANCE, NAME=a, PART=p\n5., x\n*END INSTANCE"),
        "expected a ",
    ),
    "inp instance cut": (
        "a.inp",
        assembly("*INSTANCE, NAME=a, PART=p\n5., 0., 0."),
        "has no end: the file was cut",
    ),
    "inp two instances": (
        "a.inp",
        assembly(
            "*INSTANCE, NAME=a, PART=P\n*END INSTANCE\n*INSTANCE, NAME=b, PART=p\n0, 0, 9\n*END INSTANCE"
        ),
        4.0,
    ),
    "inp generate": ("a.inp", inp(more="*ELSET, ELSET=all, GENERATE\n1, 2\n"), 2.0),
    "inp generate beyond": (
        "a.inp",
        inp(more="*ELSET, ELSET=all, GENERATE\n1, 1000000000\n"),
        (2.0, "ranges of GENERATE hold numbers that are not given (ELSET all 999999998)"),
    ),
    "inp generate by zero": (
        "a.inp",
        inp(more="*ELSET, ELSET=all, GENERATE\n1, 2, 0\n"),
        (2.0, "*ELSET all, GENERATE 1, 2, 0 is no range that goes up"),
    ),
    "inp set of lost elements": (
        "a.inp",
        inp(cells=HEX[:1], points=SLAB, more="*ELSET, ELSET=all\n1, 2\n"),
        (1.0, "group 'all' has element 2, which is not given (1 such members, limit 0)"),
    ),
    "inp blank coordinate": ("a.inp", inp().replace("\n1, 0, 0, 0", "\n1, , 0, 0"), 2.0),
    "inp unknown type": ("a.inp", inp(kind="C3X8"), "has no solid elements in this block (left out: 2 C3X8)"),
    "inp misspelt": (
        "a.inp",
        inp().replace("*ELEMENT", "*ELEMEMT"),
        "*ELEMEMT is not known; is *ELEMENT meant?",
    ),
    "inp cut": (
        "a.inp",
        inp(cells=HEX[:1]),
        (1.0, "belongs to no element and is left out (4 such nodes of 12)"),
    ),
    # VTU
    "vtu": ("a.vtu", vtu(), 2.0),
    "vtu base64": ("a.vtu", vtu(array=packed(4)), 2.0),
    "vtu base64, header apart": ("a.vtu", vtu(array=packed(8), attributes='header_type="UInt64"'), 2.0),
    "vtu two pieces": ("a.vtu", vtu(pieces=2), "has 2 pieces, limit 1"),
    "vtu count": ("a.vtu", vtu(count=3), "expected 3"),
    "vtu offsets": ("a.vtu", vtu(offsets=[7, 16]), "not as many as offsets say"),
    "vtu wrong type": ("a.vtu", vtu(kind=10), "not as many as offsets say"),
    "vtu unknown type": ("a.vtu", vtu(kind=42), "VTK's type 42"),
    "vtu unknown node": (
        "a.vtu",
        vtu(cells=[HEX[0], [5, 6, 8, 7, 9, 10, 12, 21]]),
        "element 1 (hexahedron) uses node 20, which is not given",
    ),
    "vtu unknown compressor": (
        "a.vtu",
        vtu(attributes='compressor="vtkLZ4DataCompressor"'),
        "vtkLZ4DataCompressor",
    ),
    # what the elements make
    "halves on nodes of their own": ("a.msh", msh(TWO, APART), "pairs of nodes of block 'b' coincide"),
    "halves 5e-6 apart": (
        "a.msh",
        msh(CUBES[:8] + moved(CUBES[4:], (0, 0, 5e-6)), APART),
        "an element across them",
    ),
    "halves 5e-6 into each other": (
        "a.msh",
        msh(CUBES[:8] + moved(CUBES[4:], (0, 0, -5e-6)), APART),
        "an element across them",
    ),
    "hanging nodes": ("a.msh", msh(CUBES[:8] + FINE, [HEX[0], *FINE_HEX]), "coincide"),
    "hanging nodes that share": (
        "a.msh",
        msh([*moved(CUBES[:8], (0, 0, 2e-4)), *FINE], [HEX[0], *FINE_HEX]),
        "an element across them",
    ),
    "overlapping": (
        "a.msh",
        msh(CUBES[:8] + moved(CUBES[:8], (0.5, 0.25, 0.25)), APART),
        "an element across them",
    ),
    "one in the other": (
        "a.msh",
        msh(stretched(SLAB, 4) + moved(SLAB, (1, 1, 1)), APART),
        "an element across them",
    ),
    "three on a face": (
        "a.msh",
        msh([*CUBES, (0, 0, 3), (1, 0, 3), (0, 1, 3), (1, 1, 3)], [*HEX, [5, 6, 8, 7, 13, 14, 16, 15]]),
        "belong to more than two elements",
    ),
    "both on one side": (
        "a.msh",
        msh([*SLAB, (0, 0, 3), (1, 0, 3), (0, 1, 3), (1, 1, 3)], [HEX[0], [1, 2, 4, 3, 9, 10, 12, 11]]),
        "on the same side",
    ),
    "one twice": ("a.msh", msh(SLAB, [HEX[0], HEX[0]]), "occur twice"),
    "inside out": ("a.msh", msh(SLAB, [HEX[0][4:] + HEX[0][:4]]), (1.0, "1 of 1 hexahedron are inside out")),
    "flat": ("a.msh", msh([(x, y, 0) for x, y, _ in SLAB], [HEX[0]]), "Jacobian determinant of 0"),
    "a corner turned in": (
        "a.msh",
        msh(moved(SLAB, (-0.8, -0.8, -0.8), [7]), [HEX[0]]),
        "Jacobian determinant",
    ),
    "tetrahedra": ("a.msh", msh(SLAB, TETS, kind=4), 1.0),
    "a tetrahedron through others": (
        "a.msh",
        msh(SLAB, [*TETS[:5], [1, 5, 4, 8]], kind=4),
        "Jacobian determinant",
    ),
    "tet10": ("a.vtu", vtu(TET10, [list(range(1, 11))], kind=24), 1 / 6),
    "mid-edge node far off": (
        "a.vtu",
        vtu(moved(TET10, (0, 0.6, 0), [4]), [list(range(1, 11))], kind=24),
        "mid-edge node 4",
    ),
    "other mid-edge nodes on one face": (
        "a.vtu",
        vtu(
            [*TET10, (1, 1, 1), (0.6, 0.5, 0.1), (1, 0.5, 0.5), (0.5, 1, 0.5), (0.5, 0.5, 1)],
            [list(range(1, 11)), [2, 3, 4, 11, 12, 10, 9, 13, 14, 15]],
            kind=24,
        ),
        "have other mid-edge nodes",
    ),
    "no face of an element": (
        "a.bdf",
        bdf(grids(), chexa(), "CQUAD4,9,7,1,2,8,3"),
        (2.0, "group '7': element 9 (quad) is no face of a solid element, whose corners it has"),
    ),
}
