"""A deck as a study of code_aster: `run_aster deck.export`.

Never run: there was no code_aster. The commands and their keywords are those of its catalogue (version 17,
code_aster/Cata/Commands) and of its manuals U4; a gap is a DIS_T element on a point whose displacement is the
jump (`romdam.export.aster_mesh`), of the behaviour DIS_CHOC (R5.03.17): RIGI_NOR where jump + JEU - DIST_1 is
negative, no tension, Coulomb's limit by return to the circle. AMOR_ALPHA is of the stiffness, AMOR_BETA of
the mass (U4.43.01). Added mass is M_T_N with its coupling of directions, damped by A_T_N.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Ints
from romdam.export.aster_mesh import Groups, block_group, mail_text, single_group
from romdam.export.deck import Deck, as_written
from romdam.export.tables import assignments, comments, openings_head

Relation = tuple[tuple[int, ...], tuple[str, ...], tuple[float, ...]]  # points, components, factors; sum is 0

_COMPONENTS = {"FIX_X": ("DX",), "FIX_Y": ("DY",), "FIX_Z": ("DZ",), "NO_SLIP": ("DY", "DZ")}
_UPPER = ((0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2))  # a symmetric matrix by columns, as M_T_N wants it


def write_code_aster(deck: Deck) -> tuple[dict[str, str], tuple[str, ...]]:
    """Files by name, and what differs from romdam's model."""
    law, sticks, jump_points = deck.gaps.law, deck.gaps.sticks, deck.jump_points
    stated = ["Such decks were never run in code_aster; they are written for version 17."]
    if any(solid.material.rho == 0.0 for solid in deck.solids):
        stated.append("With massless blocks the first acceleration is zero, whatever acts at the start.")
    slides = sticks & np.isfinite(deck.gaps.friction)
    deck = deck.stating(*stated)

    # supports by component, and jump points without slips
    held_points = [np.flatnonzero(column) for column in deck.fixed.T] + [jump_points[~sticks]]
    held = {name: points for name, points in zip(_COMPONENTS, held_points, strict=True) if len(points)}
    # slave nodes of ties, then jumps, as linear relations
    leads = np.repeat(deck.meshed, 3) & (np.diff(deck.follows.indptr) > 0)
    jumps = np.flatnonzero(np.column_stack([np.ones(len(sticks), dtype=bool), sticks, sticks]).ravel())
    relations = [
        *_rows(deck.follows[leads], np.flatnonzero(leads).tolist()),
        *_rows(deck.jumps()[jumps], (jumps + 3 * len(deck.points)).tolist()),
    ]
    # static forces (n + ng, 3); on jump points what the tension stiffness has at the initial gap
    of_jumps = np.zeros((len(deck.gaps), 3))
    of_jumps[:, 0] = -law.K_nz * law.gap
    forces = np.concatenate([deck.force, of_jumps])
    loaded = np.flatnonzero(forces.any(axis=1))
    # tension stiffness acts in both signs, and so does shear without a bound
    springs = as_written(np.column_stack([law.K_nz, np.where(sticks & ~slides, law.K_s, 0.0)]))
    tension = {
        f"T{k}": tuple(kind) for k, kind in enumerate(np.unique(springs[law.K_nz > 0.0], axis=0).tolist())
    }
    pulled = {name: jump_points[(springs == kind).all(axis=1)] for name, kind in tension.items()}
    laws, gaps = _gap_kinds(deck)
    wet = np.flatnonzero(deck.added_mass.any(axis=(1, 2)))
    openings = zip(jump_points.tolist(), law.gap.tolist(), strict=True)
    solids = {block_group(k): solid for k, solid in enumerate(deck.solids)}
    settings: dict[str, object] = {
        "BLOCKS": {
            name: (one.material.E, one.material.nu, one.material.rho, *one.damping)
            for name, one in solids.items()
        },
        "HELD": {name: _COMPONENTS[name] for name in held},
        "RELATIONS": [(tuple(map(single_group, points)), *others) for points, *others in relations],
        "FORCES": [(single_group(point), *forces[point].tolist()) for point in loaded.tolist()],
        "WATER": {f"W{k}": deck.added_mass[point][_UPPER].tolist() for k, point in enumerate(wet.tolist())},
        "GAPS": laws,
        "TENSION": tension,
        "OPENINGS": [(single_group(point), gap) for point, gap in openings],
        "PROBES": {name: single_group(point) for name, point in deck.probes.items()},
        "HEAD": openings_head(len(deck.gaps), deck.probes),
        "ALPHA": deck.alpha,
        "STATIC": deck.static and bool(forces.any()),
        "MODES": 10,
        "DT": deck.motion.dt,
        "STEPS": deck.motion.steps,
        "STRIDE": deck.motion.stride,
        "GROUND": deck.motion.acc.tolist(),
    }
    probes = np.array(list(deck.probes.values()), dtype=np.int64)
    related = np.array([point for points, _, _ in relations for point in points], dtype=np.int64)
    single = np.unique(np.concatenate([loaded, jump_points, probes, related]))
    discrete = {f"W{k}": wet[k : k + 1] for k in range(len(wet))} | gaps | pulled
    head = comments("#", deck.title, deck.stated)
    return {
        "deck.comm": f"{head}\nDEBUT()\n\n{assignments(settings)}\n{_SCRIPT}",
        "deck.mail": mail_text(deck, Groups(single, held, discrete)),
        "deck.export": _EXPORT,
    }, deck.stated


def _gap_kinds(deck: Deck) -> tuple[dict[str, dict[str, float]], dict[str, Ints]]:
    """Keywords of DIS_CONTACT, and points, of every group of gaps of one law."""
    law, friction = deck.gaps.law, deck.gaps.friction
    slides = deck.gaps.sticks & np.isfinite(friction)
    # what K_nz leaves of the compression bears friction for all of it
    with np.errstate(divide="ignore", invalid="ignore"):
        coulomb = np.where(slides, friction * law.K_n / (law.K_n - law.K_nz), 0.0)
    columns = [law.K_n - law.K_nz, law.gap, slides * law.K_s, coulomb]
    of_gaps = np.column_stack(columns)
    _, first, kind = np.unique(as_written(of_gaps), axis=0, return_index=True, return_inverse=True)
    laws, points = {}, {}
    for k, (stiffness, gap, shear, friction) in enumerate(of_gaps[first].tolist()):
        keywords = {"RIGI_NOR": stiffness, "JEU": max(0.0, gap), "DIST_1": max(0.0, -gap)}
        laws[f"G{k}"] = keywords | ({"RIGI_TAN": shear, "COULOMB": friction} if shear else {})
        points[f"G{k}"] = deck.jump_points[kind.ravel() == k]
    return laws, points


def _rows(rows: csr_matrix, dofs: list[int]) -> Iterator[Relation]:
    """Each DOF (3 point + component) is the combination of others in its row."""
    for dof, start, end in zip(dofs, rows.indptr[:-1].tolist(), rows.indptr[1:].tolist(), strict=True):
        entries = zip(rows.indices[start:end].tolist(), rows.data[start:end].tolist(), strict=True)
        terms = [(dof, -1.0), *((c, factor) for c, factor in entries if factor)]
        points = tuple(c // 3 for c, _ in terms)
        yield points, tuple("D" + "XYZ"[c % 3] for c, _ in terms), tuple(factor for _, factor in terms)


_EXPORT = """P actions make_etude
P time_limit 360000
P memory_limit 8192
P ncpus 1
F comm deck.comm D 1
F mail deck.mail D 20
F mess deck.mess R 6
F libr openings.csv R 41
F libr frequencies.csv R 42
"""

_SCRIPT = '''
DISCRETE = [*WATER, *GAPS, *TENSION]
NOTHING = (0.0, 0.0, 0.0)

mesh = LIRE_MAILLAGE(FORMAT="ASTER", UNITE=20)
parts = [_F(GROUP_MA=tuple(BLOCKS), PHENOMENE="MECANIQUE", MODELISATION="3D")]
if DISCRETE:
    parts.append(_F(GROUP_MA=tuple(DISCRETE), PHENOMENE="MECANIQUE", MODELISATION="DIS_T"))
model = AFFE_MODELE(MAILLAGE=mesh, AFFE=tuple(parts))

materials = [
    _F(GROUP_MA=name, MATER=DEFI_MATERIAU(ELAS=_F(E=E, NU=nu, RHO=rho, AMOR_ALPHA=beta, AMOR_BETA=alpha)))
    for name, (E, nu, rho, alpha, beta) in BLOCKS.items()
]
materials += [_F(GROUP_MA=name, MATER=DEFI_MATERIAU(DIS_CONTACT=_F(**law))) for name, law in GAPS.items()]
if WATER or TENSION:
    plain = DEFI_MATERIAU(ELAS=_F(E=1.0, NU=0.0, RHO=0.0))
    materials.append(_F(GROUP_MA=(*WATER, *TENSION), MATER=plain))
field = AFFE_MATERIAU(MAILLAGE=mesh, AFFE=tuple(materials))


def common(tension):
    """Statements on the model that all operators take; with joints open no spring in tension is stiff."""
    known = {"MODELE": model, "CHAM_MATER": field}
    if not DISCRETE:
        return known
    cards = []
    for name in DISCRETE:
        normal, shear = TENSION.get(name, (0.0, 0.0)) if tension else (0.0, 0.0)
        cards.append(_F(GROUP_MA=name, CARA="K_T_D_N", VALE=(normal, shear, shear)))
        if name in WATER:
            damping = tuple(ALPHA * mass for mass in WATER[name])
            cards.append(_F(GROUP_MA=name, CARA="M_T_N", VALE=tuple(WATER[name])))
            cards.append(_F(GROUP_MA=name, CARA="A_T_N", VALE=damping))
        else:
            cards.append(_F(GROUP_MA=name, CARA="M_T_D_N", VALE=0.0))
            cards.append(_F(GROUP_MA=name, CARA="A_T_D_N", VALE=NOTHING))
    return {**known, "CARA_ELEM": AFFE_CARA_ELEM(MODELE=model, DISCRET=tuple(cards))}


bounds = {"DDL_IMPO": tuple(_F(GROUP_NO=name, **{c: 0.0 for c in own}) for name, own in HELD.items())}
if RELATIONS:
    bounds["LIAISON_DDL"] = tuple(
        _F(GROUP_NO=groups, DDL=components, COEF_MULT=factors, COEF_IMPO=0.0)
        for groups, components, factors in RELATIONS
    )
support = AFFE_CHAR_MECA(MODELE=model, **bounds)

# frequencies with open joints, and the masses that the ground moves
free = common(False)
rigid = CALC_MATR_ELEM(OPTION="RIGI_MECA", CHARGE=support, **free)
heavy = CALC_MATR_ELEM(OPTION="MASS_MECA", CHARGE=support, **free)
number = NUME_DDL(MATR_RIGI=rigid)
stiff = ASSE_MATRICE(MATR_ELEM=rigid, NUME_DDL=number)
mass = ASSE_MATRICE(MATR_ELEM=heavy, NUME_DDL=number)
modes = CALC_MODES(MATR_RIGI=stiff, MATR_MASS=mass, OPTION="PLUS_PETITE", CALC_FREQ=_F(NMAX_FREQ=MODES))
with open("fort.42", "w") as file:
    file.write("mode,frequency [Hz]\\n")
    for mode, value in enumerate(modes.LIST_VARI_ACCES()["FREQ"], 1):
        file.write(f"{mode},{value!r}\\n")

END = STEPS * DT
loads = [_F(CHARGE=support)]
if FORCES:
    forces = tuple(_F(GROUP_NO=name, FX=x, FY=y, FZ=z) for name, x, y, z in FORCES)
    dead = AFFE_CHAR_MECA(MODELE=model, FORCE_NODALE=forces)
    ramp = DEFI_FONCTION(NOM_PARA="INST", VALE=(-1.0, 0.0, 0.0, 1.0), PROL_DROITE="CONSTANT")
    loads.append(_F(CHARGE=dead, FONC_MULT=ramp))
law = [_F(RELATION="ELAS", GROUP_MA=(*BLOCKS, *WATER, *TENSION))]
if GAPS:
    law.append(_F(RELATION="DIS_CHOC", GROUP_MA=tuple(GAPS)))
closed = common(True)


def times(start, end, steps):
    """The steps, cut in two up to six times where Newton's method fails."""
    instants = DEFI_LIST_REEL(DEBUT=start, INTERVALLE=_F(JUSQU_A=end, NOMBRE=steps))
    cut = _F(EVENEMENT="ERREUR", ACTION="DECOUPE", SUBD_METHODE="MANUEL", SUBD_PAS=2, SUBD_NIVEAU=6)
    return DEFI_LIST_INST(METHODE="MANUEL", DEFI_LIST=_F(LIST_INST=instants), ECHEC=cut)


newton = {
    "NEWTON": _F(MATRICE="TANGENTE", REAC_ITER=1),
    "CONVERGENCE": _F(RESI_GLOB_RELA=1.0e-6, ITER_GLOB_MAXI=30),
    "COMPORTEMENT": tuple(law),
}
begin = {}
if STATIC:
    ten = _F(LIST_INST=times(-1.0, 0.0, 10))
    still = STAT_NON_LINE(EXCIT=tuple(loads), INCREMENT=ten, **newton, **closed)
    begin = {"ETAT_INIT": _F(EVOL_NOLI=still)}
for k, values in enumerate(GROUND):
    if any(values):
        along = tuple(float(k == c) for c in range(3))
        pull = CALC_CHAR_SEISME(MATR_MASS=mass, DIRECTION=along, MONO_APPUI="OUI")
        inertia = AFFE_CHAR_MECA(MODELE=model, VECT_ASSE=pull)
        instants = [step * DT for step in range(len(values))]
        record = DEFI_FONCTION(NOM_PARA="INST", ABSCISSE=instants, ORDONNEE=values, PROL_DROITE="CONSTANT")
        loads.append(_F(CHARGE=inertia, FONC_MULT=record))
rows = DEFI_LIST_REEL(DEBUT=0.0, INTERVALLE=_F(JUSQU_A=END, NOMBRE=STEPS // STRIDE))
moved = DYNA_NON_LINE(
    EXCIT=tuple(loads),
    INCREMENT=_F(LIST_INST=times(0.0, END, STEPS)),
    SCHEMA_TEMPS=_F(SCHEMA="HHT", ALPHA=-0.1, MODI_EQUI="OUI", FORMULATION="DEPLACEMENT"),
    ARCHIVAGE=_F(LIST_INST=rows),
    **begin,
    **newton,
    **closed,
)


def history(group, component):
    """A point's displacement at every row, and the rows' times."""
    found = CREA_TABLE(
        RESU=_F(RESULTAT=moved, NOM_CHAM="DEPL", NOM_CMP=component, GROUP_NO=group, TOUT_ORDRE="OUI")
    )
    values = found.EXTR_TABLE().values()
    return values["INST"], values[component]


columns = {}
for k, (group, gap) in enumerate(OPENINGS):
    clock, jump = history(group, "DX")
    columns[f"opening:{k}"] = [gap + value for value in jump]
for name, group in PROBES.items():
    for axis in "xyz":
        clock, columns[f"displacement:{name}:{axis}"] = history(group, "D" + axis.upper())
with open("fort.41", "w") as file:
    file.write(HEAD)
    for time, *numbers in zip(clock if columns else [], *columns.values()):
        file.write(",".join(map(repr, [time, *numbers])) + "\\n")

FIN()
'''
