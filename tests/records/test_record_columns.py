"""Plain text of numbers: names and rows, units in prose, times, wrapped series, headers and decimal commas.

The right values are those of the series that each file is written from.
"""

import numpy as np
import pytest
import samples
from test_record_suites import at2

from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import RecordError
from romdam.records.formats.registry import Declared, read_channels
from romdam.records.record_set import load_motions

G = 9.80665
ACC = np.round(samples.motion(), 6)  # m/s2
TIME = samples.DT * np.arange(ACC.size)


def load(folder, text, **entry):
    (folder / "r.txt").write_text(text)
    entry = {"file": "r.txt", "components": {"y": 1}} | entry
    return load_motions([RecordConfig.model_validate(entry)], folder)


def table(*columns, names="", mark=","):
    rows = [mark.join(f"{value:.8f}" for value in row) for row in zip(*columns, strict=True)]
    return "\n".join([*([names] if names else []), *rows]) + "\n"


@pytest.mark.parametrize(
    ("names", "mark", "units"),
    [
        ("Time (s),Raw acc (g),Top acc (m/s2)", ",", (G, 1.0)),
        ("Time (s),Ground acc (cm/s2),Top acc (g)", ",", (0.01, G)),
        ('"Time (s)","Ground acc, raw (cm/s2)","Top acc (g)"', ",", (0.01, G)),
        ("Time (s)\tGround acc (cm/s2)\tTop acc (g)", "\t", (0.01, G)),
        ("Time (s);Ground acc (mg);Top acc (%g)", ";", (1e-3 * G, 1e-2 * G)),
        ("Time (s)  Ground acc (cm/s2)  Top acc (g)", " ", (0.01, G)),
        ("# Time (s), Ground acc (cm/s2), Top acc (g)", ",", (0.01, G)),
        ("t[s] a_gal b_g", " ", (0.01, G)),
    ],
)
def test_each_column_has_the_unit_of_its_name(tmp_path, names, mark, units):
    for column, unit in zip((2, 3), units, strict=True):
        text = table(TIME, ACC / units[0], ACC / units[1], names=names, mark=mark)
        (motion,) = load(tmp_path, text, time_column=1, components={"y": column})
        np.testing.assert_allclose(motion.acc[1], ACC, atol=1e-7)
        assert motion.provenance["channels"][0]["unit_m_s2"] == pytest.approx(unit)


def test_names_that_are_not_as_many_as_the_columns_do_not_count(tmp_path):
    text = table(TIME, ACC, ACC / G, names="Time (s),Ground acc (cm/s2), Top, acc (g)")
    with pytest.raises(RecordError, match="does not say its unit"):
        load(tmp_path, text, time_column=1, components={"y": 3})
    (motion,) = load(tmp_path, text, time_column=1, components={"y": 3}, unit="g")
    np.testing.assert_allclose(motion.acc[1], ACC, atol=1e-7)
    assert "line 1 does not name 3 columns: none of its names counts" in motion.warnings


def test_a_column_named_velocity_takes_no_unit_of_acceleration(tmp_path):
    text = "# units: m/s2\n" + table(TIME, ACC, ACC, names="time,acc,vel")
    with pytest.raises(RecordError, match="velocity or displacement', no unit"):
        load(tmp_path, text, time_column=1, components={"y": 3})


@pytest.mark.parametrize(
    "comment",
    [
        "# Dam crest, PGA in g: {pga:.3f}",
        "# peak acceleration {pga:.4f} g",
        "# Maximum (g) = {pga:.2f}, recorded at the crest",
        "# recorded in Gal, Switzerland",
        "# instrument range 2 g, noise in mg",
    ],
)
def test_a_unit_in_prose_is_not_that_of_the_data(tmp_path, comment):
    text = comment.format(pga=np.abs(ACC).max() / G) + "\n" + table(ACC)
    with pytest.raises(RecordError, match="does not say its unit"):
        load(tmp_path, text, dt=samples.DT)
    (motion,) = load(tmp_path, text, dt=samples.DT, unit="m/s2")
    np.testing.assert_allclose(motion.acc[1], ACC, atol=1e-7)
    assert not [said for said in motion.warnings if "line 1" in said]


def test_a_stated_peak_is_held_against_the_data(tmp_path):
    peak = np.abs(ACC).max()
    (motion,) = load(tmp_path, "# PGA: 0.05 g\n" + table(ACC), dt=samples.DT, unit="m/s2")
    assert any(
        f"states a peak of 0.05 g, the data's is {peak / G:.4g} g; is the unit" in w for w in motion.warnings
    )
    with pytest.raises(RecordError, match=r"a peak of 0.17 g is stated, .* as where one unit is taken for"):
        load(tmp_path, f"# PGA: {peak / G:.2f} g\n" + table(ACC), dt=samples.DT, unit="g")


def test_what_is_declared_wins_over_prose_and_keyed_statements_over_neither(tmp_path):
    (motion,) = load(tmp_path, "# acceleration in g\n" + table(ACC), dt=samples.DT, unit="m/s2")
    np.testing.assert_allclose(motion.acc[1], ACC, atol=1e-7)
    assert "line 1 says g, `unit` m/s2 counts" in motion.warnings
    (motion,) = load(tmp_path, "# acceleration in g\n" + table(ACC / G), dt=samples.DT)
    np.testing.assert_allclose(motion.acc[1], ACC, atol=1e-7)
    with pytest.raises(RecordError, match="the file says g, `unit` m/s2"):
        load(tmp_path, "# units: g\n" + table(ACC), dt=samples.DT, unit="m/s2")
    both = "# acceleration in g\n# units: m/s2\n" + table(ACC)
    with pytest.raises(RecordError, match=r"two units, g in line 1, m/s2 in line 2; give `unit`"):
        load(tmp_path, both, dt=samples.DT)
    (motion,) = load(tmp_path, both, dt=samples.DT, unit="m/s2")
    assert "comments state two units, g in line 1, m/s2 in line 2; `unit` m/s2 counts" in motion.warnings


def test_times_that_are_printed_too_coarsely_are_no_record(tmp_path):
    text = "\n".join(f"{t:.2f} {a:.6f}" for t, a in zip(TIME, ACC, strict=True)) + "\n"
    (motion,) = load(tmp_path, text, dt=samples.DT, unit="m/s2", components={"y": "each"})
    np.testing.assert_allclose(motion.acc[1], ACC, atol=1e-7)
    with pytest.raises(
        RecordError, match=r"printed to 0\.01 s, .* give `dt: 0\.005 s` in place of `time_column`"
    ):
        load(tmp_path, text, time_column=1, unit="m/s2")
    with pytest.raises(RecordError, match=r"no channel 1; it has 2; .*column 1 rises evenly by 0\.005"):
        load(tmp_path, text, dt=samples.DT, unit="m/s2")


def test_a_column_that_never_falls_is_no_motion(tmp_path):
    arias = np.cumsum(ACC**2)
    text = table(TIME, ACC, arias)
    (motion,) = load(tmp_path, text, time_column=1, unit="m/s2", components={"y": "each"})
    np.testing.assert_allclose(motion.acc[1], ACC, atol=1e-7)
    assert "column 3 never falls: taken for times or numbers, not for a motion" in motion.warnings
    with pytest.raises(RecordError, match=r"the only column rises evenly by 0\.005: times"):
        load(tmp_path, table(TIME), dt=samples.DT, unit="m/s2")


def wrapped(values, width):
    rows = [values[i : i + width] for i in range(0, values.size, width)]
    return "\n".join("".join(f"{value:15.7E}" for value in row) for row in rows) + "\n"


@pytest.mark.parametrize("width", [2, 3, 5, 8])
@pytest.mark.parametrize("count", [600, 599])
def test_a_wrapped_series_is_read_by_a_key_that_says_so(tmp_path, width, count):
    entry = {"dt": samples.DT, "unit": "m/s2"}
    text = wrapped(ACC[:count], width)
    with pytest.raises(RecordError, match=r"`layout: series`|2 numbers|1 number"):
        load(tmp_path, text, **entry)
    (motion,) = load(tmp_path, text, **entry, layout="series")
    np.testing.assert_allclose(motion.acc[1], ACC[:count], atol=1e-7)
    (motion,) = load(tmp_path, f"# NPTS = {count}\n" + text, **entry)  # the count says it too
    np.testing.assert_allclose(motion.acc[1], ACC[:count], atol=1e-7)
    assert any(
        f"{count} values are stated: read as one series of {width}" in said for said in motion.warnings
    )


def test_a_wrapped_series_that_lost_a_number_is_refused(tmp_path):
    lines = wrapped(ACC, 5).split("\n")
    lines[7] = lines[7][15:]
    with pytest.raises(RecordError, match="line 8: 4 numbers, the rows of the series above have 5"):
        load(tmp_path, "\n".join(lines), dt=samples.DT, unit="m/s2", layout="series")


def test_components_beside_each_other_are_columns(tmp_path):
    rows = table(*(samples.motion(seed) for seed in (1, 2, 3)), mark=" ")
    (motion,) = load(tmp_path, rows, dt=samples.DT, unit="m/s2", components={"y": 2}, layout="columns")
    np.testing.assert_allclose(motion.acc[1], samples.motion(2), atol=1e-7)


QUOTED = "".join(f'"{t:.3f}","{a / G:.8f}"\n' for t, a in zip(TIME, ACC, strict=True))
HEADER = "SeismoSignal - Corrected Accelerogram\nTime step: 0.005 sec\nAcceleration units: g\n\n"


@pytest.mark.parametrize(
    ("text", "entry"),
    [
        (HEADER + "   Time [sec]      Acceleration [g]\n\n" + table(TIME, ACC / G, mark="   "),
         {"time_column": 1, "header_lines": 6, "components": {"y": 2}}),
        (HEADER + table(ACC / G), {"dt": samples.DT, "header_lines": 4}),
        ("Station: crest\nDate: 2020-01-01\nUnits: g\n\n" + table(TIME, ACC / G, names="Time,Acc"),
         {"time_column": 1, "header_lines": 4, "components": {"y": 2}}),
        ("Station: crest\nTime,Acc\ns,g\n" + table(TIME, ACC / G),
         {"time_column": 1, "header_lines": 3, "components": {"y": 2}}),
        (table(TIME, ACC / G, names="Zeit [s];Beschleunigung [g]", mark=";").replace(".", ","),
         {"time_column": 1, "decimal": ",", "components": {"y": 2}}),
        (table(TIME, ACC / G, names="Zeit [s]\tBeschleunigung [g]", mark="\t").replace(".", ","),
         {"time_column": 1, "decimal": "comma", "delimiter": "tab", "components": {"y": 2}}),
        ('"Time","Acc (g)"\n' + QUOTED, {"time_column": 1, "components": {"y": 2}}),
        ("title\n603 0.005\n" + wrapped(ACC / G, 8), {"dt": samples.DT, "header_lines": 2, "layout": "series",
         "unit": "g"}),
    ],
    ids=["seismosignal", "one column", "labview", "units", "semicolons", "tabs", "quoted", "series"],
)  # fmt: skip
def test_headers_delimiters_and_decimal_commas(tmp_path, text, entry):
    (motion,) = load(tmp_path, text, **entry)
    np.testing.assert_allclose(motion.acc[1], ACC, atol=2e-7)


def test_what_is_refused_names_the_key_that_helps(tmp_path):
    rows = table(TIME, ACC / G, names="Zeit [s];Beschleunigung [g]", mark=";").replace(".", ",")
    with pytest.raises(
        RecordError, match=r"line 2: is the comma of '0,0+' a decimal one\? .* `decimal: comma`"
    ):
        load(tmp_path, rows, time_column=1)
    counted = f"a title\n{ACC.size}\n" + table(ACC)
    with pytest.raises(RecordError, match=r"line 2: 603 looks like the number of .* `header_lines: 2`"):
        load(tmp_path, counted, dt=samples.DT, unit="m/s2")
    silent = HEADER.replace("Acceleration units: g", "a line")
    with pytest.raises(RecordError, match=r"rows of numbers begin in line 5: declare `header_lines: 4`"):
        load(tmp_path, silent + table(ACC / G), dt=samples.DT)
    (motion,) = load(tmp_path, HEADER + table(ACC / G))  # it states all
    np.testing.assert_allclose(motion.acc[1], ACC, atol=1e-7)
    assert any("dt = 0.005 s is taken from line 2" in said for said in motion.warnings)
    with pytest.raises(RecordError, match=r"column 1 rises evenly by 0\.005: give `time_column: 1`"):
        load(tmp_path, table(TIME, ACC), unit="g")
    with pytest.raises(RecordError, match=r"line 3: 1 number, the rows above have 2"):
        load(tmp_path, "0.0,1.0\n0.1,2.0\n0.2,\n0.3,4.0\n", time_column=1, unit="g")
    at2(tmp_path, "a.AT2")
    entry = {"file": "a.AT2", "layout": "series", "components": {"y": 1}}
    with pytest.raises(RecordError, match="`layout` is for plain columns, the file is AT2"):
        load_motions([RecordConfig.model_validate(entry)], tmp_path)


def test_names_stand_next_to_the_rows(tmp_path):
    """Prose among the skipped lines has brackets too, and as many words as there are columns."""
    text = "Tel.(g)622 Fax.(cm/s2)616 mail(m)\nplace\nnumber\n(all in gal)\n" + table(TIME, ACC, ACC)
    (motion,) = load(tmp_path, text, header_lines=4, time_column=1, unit="m/s2", components={"y": 2})
    np.testing.assert_allclose(motion.acc[1], ACC, atol=1e-7)


def test_an_empty_cell_is_a_missing_value_of_its_own_column(tmp_path):
    text = "t,a,b\n0.0,1,4\n0.1,,5\n0.2,3,6\n"
    (tmp_path / "r.csv").write_text(text)
    first, second = read_channels(tmp_path / "r.csv", Declared(time_column=1))
    np.testing.assert_array_equal(first.data, [1.0, np.nan, 3.0])
    np.testing.assert_array_equal(second.data, [4.0, 5.0, 6.0])


def test_quoted_whole_numbers_that_commas_part_are_columns(tmp_path):
    """Each number in quotes, none with a point: no comma stands within a number."""
    counts = np.round(1000.0 * ACC).astype(int)
    text = "".join(f'"{first}","{second}"\n' for first, second in zip(counts, counts[::-1], strict=True))
    (motion,) = load(tmp_path, text, dt=samples.DT, unit="0.001 m/s2", layout="columns", components={"y": 2})
    np.testing.assert_allclose(motion.acc[1], 1e-3 * counts[::-1], atol=1e-9)
