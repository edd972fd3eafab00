"""Jobs and record files with a mistake that people make, and what the message has to say of it."""

from __future__ import annotations

from dataclasses import dataclass

JOB = """\
title: two blocks

materials:
  concrete:
    E: 30 GPa
    nu: 0.18
    rho: 2440 kg/m3

blocks:
  left:
    material: concrete
    box: {origin: [0, -5, 0], size: [5, 5, 20], element_size: 5 m}
  right:
    material: concrete
    box: {origin: [0, 0, 0], size: [5, 10, 20], element_size: 5 m}

supports:
  - {block: left, face: zmin}
  - {block: right, face: zmin}

joints:
  middle:
    between: [left, right]
    normal_stiffness: 16 GPa/m
    shear_stiffness: 8 GPa/m
    friction: 0.6

loads:
  gravity: [0, 0, -9.81]
  weight: staged
  hydrostatic:
    - level: 18 m
      faces: [{block: left, face: ymin}]

damping:
  rayleigh: {frequencies: [5 Hz, 50 Hz], ratio: 5 %}

records:
  - name: pulse
    file: pulse.txt
    unit: m/s2
    dt: 0.01 s
    components: {y: 1}

model: {order: reduced, modes: 10}

transient: {finest_step: 2 ms}

outputs:
  output_interval: 0.01 s
  nodes:
    top: {block: right, at: [0, 0, 20]}
  plots: false
"""
RECORD = "".join(f"{0.1 * (k % 7) - 0.3:.4f}\n" for k in range(50))


@dataclass(frozen=True)
class Wrong:
    """A mistake, in the words of the message that has to tell it.

    Attributes
    ----------
    old, new : text of the job, and what stands in its place
    line : text of the line that the message has to name, of the job as it is then
    words : what the message says of key, value, cause and remedy
    record : text of the record's file
    encoding : of the job
    """

    old: str
    new: str
    line: str
    words: tuple[str, ...]
    record: str = RECORD
    encoding: str = "utf-8"


def _said(old: str, new: str, *words: str) -> Wrong:
    """A mistake that is told of the (first) line in which it stands."""
    return Wrong(old, new, new.strip().splitlines()[0], words)


def _of_record(record: str, *words: str, keys: str = "    dt: 0.01 s\n") -> Wrong:
    """A mistake in the record's file, whose own line is among the words."""
    return Wrong("    dt: 0.01 s\n", keys, "file: pulse.txt", ("records[0].file: pulse.txt", *words), record)


_TWO_COLUMNS = [f"{0.01 * k:.2f} {0.1 * (k % 7):.1f}\n" for k in range(60)]
_AT2 = """\
PEER NGA STRONG MOTION DATABASE RECORD
Northridge-01, 1/17/1994, Beverly Hills - 14145 Mulhol, 9
ACCELERATION TIME SERIES IN UNITS OF G
NPTS=   60, DT=   .0100 SEC
""" + "".join(
    " ".join(f"{0.01 * ((5 * row + k) % 7) - 0.03:.6E}" for k in range(5)) + "\n" for row in range(10)
)

WRONG = {
    # how the YAML is written
    "section misspelt": _said(
        "materials:", "materails:", "materails is not a known key; did you mean 'materials'?"
    ),
    "key misspelt": _said(
        "friction: 0.6", "fricton: 0.6", "joints.middle.fricton is not", "did you mean 'friction'?"
    ),
    "key of other programs": _said(
        "rho: 2440 kg/m3", "density: 2440 kg/m3", "concrete.density is not", "mean 'rho'?"
    ),
    "tab": _said("    nu: 0.18", "\tnu: 0.18", "indented with a tab; use blanks"),
    "indent": _said("    nu: 0.18", "   nu: 0.18", "'nu: 0.18' does not go on from line 5", "same column"),
    "bracket": _said("[left, right]", "[left, right", "the [ has no ]; close it"),
    "no blank after a colon": _said(
        "nu: 0.18", "nu:0.18", "'nu:0.18' is no key with a value; write `nu: 0.18`"
    ),
    "equals sign": _said("nu: 0.18", "nu = 0.18", "'nu = 0.18' is no key", "write `nu: 0.18`"),
    "colon in a text": _said("title: two blocks", "title: Koyna: test", "put text with `: ` in quotes"),
    "key twice": Wrong(
        "    nu: 0.18", "    nu: 0.18\n    nu: 0.19", "nu: 0.19", ("key 'nu' is given twice; remove one",)
    ),
    "list without dashes": Wrong(
        "  - {block: left, face: zmin}\n  - {block: right, face: zmin}",
        "  block: left\n  face: zmin",
        "supports:",
        ("supports must be a list", "begin each of its entries with `- `"),
    ),
    "section left empty": _said(
        "transient: {finest_step: 2 ms}", "transient:", "transient is empty; fill it, for example"
    ),
    "backslashes in quotes": _said(
        "file: pulse.txt", 'file: "C:\\users\\pulse.txt"', "not valid YAML", "single quotes"
    ),
    "not in UTF-8": Wrong(
        "title: two blocks",
        "title: Talsperre Kölnbrein",
        "title:",
        ("UTF-8", "save it as UTF-8"),
        encoding="latin-1",
    ),
    # numbers and units
    "decimal comma in a list": _said(
        "[0, 0, -9.81]",
        "[0, 0, -9,81]",
        "loads.gravity must have at most 3 entries, got [0, 0, -9, 81]",
        "a comma a decimal one? Write a point",
    ),
    "decimal comma": _said("nu: 0.18", "nu: 0,18", "nu: cannot read '0,18'", 'is "0.18" meant?'),
    "decimal comma with a unit": _said(
        "2440 kg/m3", "2440,5 kg/m3", "rho: cannot read", 'is "2440.5 kg/m3" meant?'
    ),
    "comma of thousands": _said("2440 kg/m3", "2,440 kg/m3", 'is "2.440 kg/m3" meant, or "2440 kg/m3"?'),
    "prefix alone": _said(
        "E: 30 GPa", "E: 30 G", "concrete.E: '30 G' is not a quantity in Pa", 'is "30 GPa" meant?'
    ),
    "letters of a unit": _said("E: 30 GPa", "E: 30 Gpa", "unknown unit in '30 Gpa'", 'is "30 GPa" meant?'),
    "stiffness of no area": _said(
        "16 GPa/m", "16 GPa", "normal_stiffness: '16 GPa' is not", 'is "16 GPa/m" meant?'
    ),
    "unit of a record": _said("unit: m/s2", "unit: G", "records[0].unit: '1 G' is not", 'is "1 g" meant?'),
    "no unit of a PGA": Wrong(
        "    dt: 0.01 s",
        "    dt: 0.01 s\n    scale: {pga: 0.3}",
        "scale:",
        ("records[0].scale.pga: 0.3 has no unit; write 0.3 g or 0.3 m/s2",),
    ),
    "angle of friction": _said(
        "friction: 0.6",
        "friction: 35 deg",
        "joints.middle.friction: '35 deg'",
        "write 0.70",
        "tan(35 deg) = 0.70",
    ),
    "angle without unit": _said(
        "friction: 0.6", "friction: 35", "friction must be at most 2, got 35", "tan(35 deg) = 0.70"
    ),
    "interval in ms": _said(
        "dt: 0.01 s", "dt: 10", "records[0].dt must be at most 0.9 s, got 10", "is `10 ms` meant?"
    ),
    "step in ms": _said(
        "finest_step: 2 ms",
        "finest_step: 2",
        "transient.finest_step: 2 s is longer than outputs.output_interval, 0.01 s",
        "is `2 ms` meant?",
    ),
    "percent": _said(
        "ratio: 5 %", "ratio: 5", "rayleigh.ratio must be less than 1, got 5", "is `5 %` meant?"
    ),
    "gravity as a number": _said(
        "gravity: [0, 0, -9.81]", "gravity: 9.81", "gravity must be a list", "[0, 0, -9.81]"
    ),
    "negative stiffness": _said(
        "shear_stiffness: 8 GPa/m", "shear_stiffness: -8 GPa/m", "must be at least 0, got '-8 GPa/m'"
    ),
    "point in a plane": _said("at: [0, 0, 20]", "at: [0, 20]", "outputs.nodes.top.at[2] is missing"),
    # names
    "no such material": Wrong(
        "concrete\n    box: {origin: [0, 0, 0]",
        "concret\n    box: {origin: [0, 0, 0]",
        "material: concret\n",
        ("blocks.right.material: no 'concret' is defined", "did you mean 'concrete'?"),
    ),
    "no such block": _said(
        "between: [left, right]",
        "between: [left, rigth]",
        "joints.middle.between: no 'rigth'",
        "did you mean 'right'?",
    ),
    "no such axis": _said(
        "components: {y: 1}", "components: {Y: 1}", "components.Y must be 'x', 'y' or 'z', got 'Y'"
    ),
    "no such file": _said(
        "file: pulse.txt",
        "file: puls.txt",
        "records[0].file: puls.txt: cannot be read",
        "near it is pulse.txt",
    ),
    # what shows when the scene is built
    "no such face": _said(
        "[{block: left, face: ymin}]",
        "[{block: left, face: upstream}]",
        "loads.hydrostatic[0].faces[0].face: block 'left' has no face 'upstream'",
        "its faces are xmax, xmin",
    ),
    "blocks apart": Wrong(
        "origin: [0, 0, 0]",
        "origin: [0, 1, 0]",
        "middle:",
        (
            "joints.middle: blocks 'left' and 'right' do not touch",
            "is 1 m",
            "move a block, or raise joints.middle.tolerance",
        ),
    ),
    "no node there": _said(
        "at: [0, 0, 20]",
        "at: [0, 0, 21]",
        "outputs.nodes.top.at: no node of block 'right' within 0.001 m",
        "the nearest is (0, 0, 20)",
        "use its position, or raise `tolerance`",
    ),
    "elements that do not fit": _said(
        "[5, 10, 20], element_size: 5 m",
        "[5, 10, 20], element_size: 3 m",
        "blocks.right.box.element_size = 3 m does not divide the box",
        "2.5 or 5 m",
    ),
    "water above the dam": _said(
        "level: 18 m",
        "level: 180 m",
        "loads.hydrostatic[0].level",
        "180 m, and they reach from 0 to 20 m",
        "lower it",
    ),
    "millimetres": _said(
        "size: [5, 10, 20]",
        "size: [5000, 10000, 20000]",
        "blocks.right.box.element_size: about 8.01e+09 nodes",
        "limit",
        "the smallest elements that fit",
    ),
    "plane beside the block": _said(
        "{block: right, face: zmin}",
        "{block: right, face: {axis: z, at: 1}}",
        "supports[1].face: the plane z = 1 m catches no node",
        "spans z = 0 to 20 m",
        "correct `at`",
    ),
    # records
    "no such column": _said(
        "components: {y: 1}",
        "components: {y: 3}",
        "records[0].components.y.channel: pulse.txt: no channel 3; it has 1",
        "name one",
    ),
    "no interval": Wrong(
        "    dt: 0.01 s\n",
        "",
        "- name: pulse",
        ("records[0].dt: pulse.txt", "does not say its interval; give `dt` or `time_column`"),
    ),
    "no unit": Wrong(
        "    unit: m/s2\n",
        "",
        "- name: pulse",
        ("records[0].unit: pulse.txt", "does not say its unit", '"cm/s2"'),
    ),
    "letter in a number": _of_record(
        RECORD.replace("0.1000", "0.1O00", 1), "line 3", "'-0.1O00'", "mend or remove it"
    ),
    "decimal commas in a record": _of_record(
        RECORD.replace(".", ","),
        "line 1",
        "the comma of '-0,3000' a decimal one? Then declare `decimal: comma`",
    ),
    "heading": _of_record(
        "Northridge 1994\nat MUL\n" + RECORD,
        "line 1",
        "rows of numbers begin in line 3: declare `header_lines: 2`",
    ),
    "no number": _of_record(
        RECORD.replace("0.1000", "nan", 1),
        "1 of 50 samples are not finite, the first at t = 0.02 s",
        "mend the record or set `gaps: linear`",
    ),
    "empty file": _of_record("", "line 1", "the file is empty"),
    "number lost": _of_record(
        "".join([*_TWO_COLUMNS[:30], "0.30\n", *_TWO_COLUMNS[31:]]),
        "line 31",
        "1 number, the rows above have 2",
    ),
    "page of a website": _of_record(
        "<!DOCTYPE html>\n<html><body>Log in</body></html>\n",
        "line 1",
        "an HTML or XML page",
        "fetch the data file again",
    ),
    "AT2 cut short": _of_record(_AT2, "50", "60", keys=""),
    "uneven times": _of_record(
        "".join([*_TWO_COLUMNS[:30], *_TWO_COLUMNS[33:]]), "line 31", keys="    time_column: 1\n"
    ),
}
