"""Headers are believed: what they state is taken, and what contradicts the data or the keys is told."""

import numpy as np
import pytest

from romdam.config.sections.motions.records import read_entry
from romdam.core.errors import RecordError
from romdam.records.channel import Orientation
from romdam.records.formats.registry import Declared, read_channels
from romdam.records.formats.statements import COUNT, INTERVAL, LENGTH, PEAK, RATE, statements
from romdam.records.record_set import load_motions

DT, COUNT_OF = 0.01, 2000
TIME = np.arange(COUNT_OF) * DT
UP, NORTH, EAST = Orientation(None, 1), Orientation(0.0), Orientation(90.0)


def wave(peak, freq):
    """A motion that ends at rest, with an extreme of one sign [gal]."""
    x = (TIME - 10.0) / 2.0
    acc = np.exp(-(x**2)) * np.cos(2 * np.pi * freq * (TIME - 10.0))
    return peak * acc / np.abs(acc).max()


NS, EW, UD = wave(171.17, 2.3), wave(-224.91, 3.1), wave(146.39, 5.7)


def rows(*columns, form="%12.6f", mark=""):
    return "\n".join(mark.join(form % value for value in row) for row in zip(*columns, strict=True)) + "\n"


def wrapped(values, per_row, form="%13.6E"):
    lines = [values[i : i + per_row] for i in range(0, len(values), per_row)]
    return "\n".join("".join(form % value for value in line) for line in lines) + "\n"


AFAD = (
    "STRONG GROUND MOTION RECORDS OF TURKIYE\nPLACE\t:\tDUZCE\n"
    "EARTHQUAKE DATE\t:\t17/08/1999 00:01:39 (GMT)\n"
    "EPICENTER COORDINATES\t:\t40.70N - 29.91E\n"
    "EARTHQUAKE DEPTH (km)\t:\t18\nEARTHQUAKE MAGNITUDE\t:\t7.4 (Ms)\n"
    "STATION ID\t:\t8101\nSTATION COORDINATES\t:\t40.84N - 31.17E\nSTATION ALTITUDE (m)\t:\t171\n"
    "RECORDER TYPE\t:\tSMA-1\nRECORD TIME\t:\t17/08/1999 00:01:47 (GMT)\nNUMBER OF DATA\t:\t2000\n"
    "SAMPLING INTERVAL (sec)\t:\t0.01\nRAW PGA VALUES (gal)\t:\t(N-S) 171.17 (E-W) 224.91 (U-D) 146.39\n\n"
    "       N-S         E-W         U-D\n"
) + rows(NS, EW, UD)
CWB = (
    "#Earthquake Information\n#Origin Time(GMT+08): 2018/02/06-23:50:42\n#EpicenterLongitude(E): 121.69\n"
    "#Magnitude(Ml): 6.0\n\n#Station Information\n#StationCode: EAS\n#StationLongitude(E): 120.857\n"
    "#InstrumentKind: FBA\n#StartTime(GMT+08): 2018/02/06-23:50:29.000\n#RecordLength(sec): 20\n"
    "#SampleRate(Hz): 100\n#AmplitudeUnit:  gal. DCoffset(corr)\n#AmplitudeMAX. U:    146.390~   -120.0\n"
    "#AmplitudeMAX. N:    171.170~   -160.0\n#AmplitudeMAX. E:    180.0~   -224.910\n"
    "#DataSequence: Time U(+); N(+); E(+)\n#Data: 4F10.3 \n"
) + rows(TIME, UD, NS, EW, form="%10.3f")
CWB = CWB.replace("-120.0\n", f"{UD.min():.3f}\n").replace("-160.0\n", f"{NS.min():.3f}\n")
CWB = CWB.replace("180.0~", f"{EW.max():.3f}~")
CSMNC = (
    "051BXD130420080201\n0130420080246 2013-04-20 8:2:46 BTM\nLUSHAN EARTHQUAKE, LUSHAN,CHN\n"
    "EPICENTER  30.300N 103.000E DEPTH 13 KM\nMAGNITUDE  7.0(Ms)\nSTATION: 51BXD 30.400N 102.800E\n"
    "SITE CONDITION: ROCK\nINSTRUMENT TYPE: MR2002/SLJ-100\nOBSERVING POINT: GROUND\nCOMP. EW\n"
    "UNCORRECTED ACCELERATION          UNIT: CM/SEC/SEC\n"
    "NO. OF POINTS:  2000  EQUALLY SPACED INTERVALS OF:  0.01  SEC\n"
    "PEAK VALUE:    -224.910   AT   10.00 SEC    DURATION:  20 SEC\nPRE-EVENT TIME:  2  SEC\nCSMNC\n\n"
) + wrapped(EW, 8)
JMA = (
    "SITE CODE= 4B5YONAGO-SHI,\nLAT.= 35.43,\nLON.= 133.34,\nSAMPLING RATE= 100Hz,\nUNIT  = gal(cm/s/s),\n"
    "INITIAL TIME = 2000 10 06 13 30 03,\n  NS,   EW,   UD\n"
) + rows(NS, EW, UD, form="%.3f", mark=",")
KNET_CSV = "Time (s),N-S (gal),E-W (gal),U-D (gal)\n" + rows(TIME, NS, EW, UD, form="%.3f", mark=",")
ISESD = (
    "EUROPEAN STRONG-MOTION DATABASE\nearthquake: Place, 1/1/2000\nstation: Town\ncomponent: NS\n"
    "corrected acceleration time history\nunits: m/s^2\nnumber of data points: 2000\n"
    "sampling interval: 0.01 s\nfilter: low cut 0.25 Hz, high cut 25 Hz\nPGA: 1.7117 m/s^2\n"
) + wrapped(0.01 * NS, 5)
KAGSR = (
    "# KAGSR strong motion\n# Station: PET\n# Channel: HNE\n# Sampling rate, sps: 100\n"
    "# Number of samples: 2000\n"
    "# Units: cm/s**2\n# Max. amplitude: 224.91 cm/s**2\n"
) + rows(EW)
FORMS = {
    "AFAD": (AFAD, {NORTH: NS, EAST: EW, UP: UD}),
    "CWB": (CWB, {UP: UD, NORTH: NS, EAST: EW}),
    "CSMNC": (CSMNC, {EAST: EW}),
    "JMA": (JMA, {NORTH: NS, EAST: EW, UP: UD}),
    "K-NET csv": (KNET_CSV, {NORTH: NS, EAST: EW, UP: UD}),
    "ISESD": (ISESD, {NORTH: NS}),
    "KAGSR": (KAGSR, {EAST: EW}),
}


@pytest.mark.parametrize("name", FORMS)
def test_national_forms_declare_nothing(tmp_path, name):
    text, motions = FORMS[name]
    (tmp_path / "r.txt").write_text(text)
    channels = read_channels(tmp_path / "r.txt")
    assert [channel.orientation for channel in channels] == list(motions)
    for channel, values in zip(channels, motions.values(), strict=True):
        assert channel.dt == pytest.approx(DT, rel=1e-9)
        scale = {"cm/s2": 1.0, "m/s2": 100.0}[channel.unit]
        np.testing.assert_allclose(scale * channel.data, values, atol=6e-4)


def told(folder, text, **keys):
    """Whether a file is refused, or a warning beyond those of the sound file is said."""
    (folder / "r.txt").write_text(text)
    entry = read_entry({"file": "r.txt", "components": {"y": "each"}} | keys, "entry")
    try:
        return {word for motion in load_motions([entry], folder) for word in motion.warnings}
    except RecordError:
        return None


WRONG = [  # form, what it states, what it is made to state, and keys of the job
    ("AFAD", "SAMPLING INTERVAL (sec)\t:\t0.01", "SAMPLING INTERVAL (sec)\t:\t0.005", {"dt": "0.01 s"}),
    ("AFAD", "", "", {"dt": "0.005 s"}),
    ("AFAD", "", "", {"dt": "0.02 s"}),
    ("AFAD", "NUMBER OF DATA\t:\t2000", "NUMBER OF DATA\t:\t4000", {}),
    ("AFAD", "", "", {"unit": "m/s2"}),
    ("AFAD", "", "", {"unit": "g"}),
    ("AFAD", "(E-W) 224.91", "(E-W) 324.91", {}),
    ("AFAD", "(gal)\t:\t(N-S) 171.17", "(gal)\t:\t(N-S) 91.17", {}),
    ("CWB", "#RecordLength(sec): 20", "#RecordLength(sec): 40", {}),
    ("CWB", "#SampleRate(Hz): 100", "#SampleRate(Hz): 200", {}),
    ("CWB", "#SampleRate(Hz): 100", "#SampleRate(Hz): 50", {"time_column": 1}),
    ("CWB", "", "", {"unit": "m/s2"}),
    ("CWB", "", "", {"dt": "0.02 s"}),
    ("CWB", "171.170~", "371.170~", {}),
    ("CWB", "#AmplitudeUnit:  gal", "#AmplitudeUnit:  g", {"unit": "cm/s2"}),
    ("CSMNC", "NO. OF POINTS:  2000", "NO. OF POINTS:  4000", {"layout": "series", "header_lines": 16}),
    ("CSMNC", "INTERVALS OF:  0.01", "INTERVALS OF:  0.005", {}),
    ("CSMNC", "", "", {"dt": "0.005 s", "header_lines": 16}),
    ("CSMNC", "DURATION:  20 SEC", "DURATION:  60 SEC", {}),
    ("CSMNC", "PEAK VALUE:    -224.910", "PEAK VALUE:    -424.910", {}),
    ("CSMNC", "", "", {"unit": "m/s2", "header_lines": 16}),
    ("CSMNC", "UNIT: CM/SEC/SEC", "UNIT: G", {}),
    ("JMA", "SAMPLING RATE= 100Hz", "SAMPLING RATE= 50Hz", {"dt": "0.01 s"}),
    ("JMA", "", "", {"dt": "0.02 s", "header_lines": 6}),
    ("JMA", "", "", {"unit": "g", "header_lines": 6}),
    ("JMA", "", "", {"unit": "m/s2"}),
    ("K-NET csv", "", "", {"dt": "0.02 s"}),
    ("K-NET csv", "", "", {"unit": "m/s2", "time_column": 1}),
    ("ISESD", "number of data points: 2000", "number of data points: 1000", {}),
    ("ISESD", "sampling interval: 0.01 s", "sampling interval: 0.02 s", {"dt": "0.01 s"}),
    ("ISESD", "PGA: 1.7117 m/s^2", "PGA: 0.1745 g", {"unit": "g"}),
    ("ISESD", "PGA: 1.7117 m/s^2", "PGA: 2.5 m/s^2", {}),
    ("ISESD", "", "", {"unit": "cm/s2"}),
    ("KAGSR", "rate, sps: 100", "rate, sps: 50", {"dt": "0.01 s"}),
    ("KAGSR", "samples: 2000", "samples: 1999", {}),
    ("KAGSR", "", "", {"unit": "g"}),
    ("KAGSR", "amplitude: 224.91", "amplitude: 124.91", {}),
    ("KAGSR", "", "", {"dt": "0.005 s"}),
]
FREE = [  # a line of free text above one column in gal at 0.01 s, which contradicts it
    "Delta t : 0,005 s", "Sampling frequency = 200 Hz", "fs = 50", "Frecuencia de muestreo: 200 Hz",
    "Passo di campionamento: 5 ms", "sampled every 0.02 s", "2000 0.0200", "4000 0.0100",
    "Record length = 40 s", "Durata (s) 30", "Nb d'echantillons : 4000", "4000 data points",
    "NPTS= 4000, DT= 0.01 SEC", "NPTS= 2000, DT= 0.02 SEC", "Samples: 1500", "sample rate 250 sps",
    "Peak ground acceleration: 0.5 g", "PGA (cm/s2) = 90.0", "Max. acceleration 3.1 m/s2",
    "acceleration [m/s2]", "Values in g", "Einheit: m/s^2", "ACCELERATION IN G", "time step (ms): 20",
    "0.02", "Total number of points in the record: 8192", "Unit: mm/s2",
]  # fmt: skip


@pytest.mark.parametrize(("name", "stated", "made", "keys"), WRONG)
def test_contradictions_of_national_headers_are_told(tmp_path, name, stated, made, keys):
    text = FORMS[name][0]
    assert stated in text
    usual = told(tmp_path, text)
    assert usual is not None
    said = told(tmp_path, text.replace(stated, made) if stated else text, **keys)
    assert said is None or said - usual, said


@pytest.mark.parametrize("line", FREE)
def test_contradictions_of_free_text_are_told(tmp_path, line):
    keys = {"dt": "0.01 s", "unit": "cm/s2", "header_lines": 2}
    usual = told(tmp_path, "A dam\nits crest\n" + rows(EW), **keys)
    assert usual is not None
    said = told(tmp_path, f"A dam\n{line}\n" + rows(EW), **keys)
    assert said is None or said - usual


@pytest.mark.parametrize(
    "name", ["acc in g", "acc_g", "acc_ms2", "Acceleration [m/s^2]", "ACC (G)", "acc_m_s2"]
)
def test_units_in_names_of_columns_count(tmp_path, name):
    """One column in gal, of which its name says otherwise: refused with `unit`, another size without."""
    assert told(tmp_path, f"{name}\n" + rows(EW), dt="0.01 s", unit="cm/s2") is None
    (tmp_path / "r.txt").write_text(f"{name}\n" + rows(EW / 1000.0))
    (channel,) = read_channels(tmp_path / "r.txt", Declared(dt=0.01))
    assert channel.unit == ("g" if "g" in name.lower() else "m/s2")


def test_a_title_is_no_unit(tmp_path):
    (tmp_path / "r.txt").write_text("Record of Dam G\n" + rows(EW))
    (channel,) = read_channels(tmp_path / "r.txt", Declared(dt=0.01))
    assert channel.unit == ""


def test_an_interval_of_before_is_told_where_another_line_states_the_right_one(tmp_path):
    keys = {"dt": "0.01 s", "unit": "cm/s2", "header_lines": 2}
    lines = "Original sampling rate: 200 Hz, 4000 samples\nSampling rate: 100 Hz, 2000 samples\n"
    said = told(tmp_path, lines + rows(EW), **keys)
    assert said is not None
    assert any("line 1: an interval of 0.005 s is stated" in text for text in said)
    assert any("line 1: 4000 samples are stated" in text for text in said)


TRUE = [
    "Delta t : 0,01 s", "Sampling frequency = 100 Hz", "Record length = 20 s, 2000 samples", "2000 0.0100",
    "PGA = 224.9 gal at 10.0 s, 31/12/1999", "Low-cut filter at 0.1 Hz, order 4, corner frequency 25 Hz",
    "Magnitude 7.1, epicentral distance 20 km, depth 12.5 km", "Station 2000, channel 3 of 18, code 0123",
    "Significant duration 8.3 s", "Natural frequency 200 Hz, sensitivity 1.25 V/g, 24 bits", "unit: gal",
    "PGV = 12.3 cm/s, PGD 4.1 cm", "Vs30 = 560 m/s", "full scale 2 g", "Event of 2011-03-11 14:46:18",
]  # fmt: skip


@pytest.mark.parametrize("line", TRUE)
def test_what_agrees_or_is_of_something_else_is_not_told(tmp_path, line):
    keys = {"dt": "0.01 s", "unit": "cm/s2", "header_lines": 2}
    usual = told(tmp_path, "A dam\nits crest\n" + rows(EW), **keys)
    assert told(tmp_path, f"A dam\n{line}\n" + rows(EW), **keys) == usual


@pytest.mark.parametrize(
    ("line", "kinds"),
    [
        ("2000 points of accel data equally spaced at .020 sec, in cm/sec2", {COUNT: 2000.0, INTERVAL: 0.02}),
        ("#AmplitudeMAX. N:  269.144~ -300.000", {PEAK: 300.0}),
        ("NO. OF POINTS: 2000 DURATION: 20.00 SEC", {COUNT: 2000.0, LENGTH: 20.0}),
        ("VEL. DE MUESTREO (muestras/s) : 100", {RATE: 100.0}),
        ("SAMPLE INTERVAL= 10000 us", {INTERVAL: 0.01}),
        ("NPTS=   2000, DT=   .0100 SEC,   0 POLE @    13.90000 HZ", {COUNT: 2000.0, INTERVAL: 0.01}),
        ("DATE 20000101 TIME 121212", {}),
    ],
)
def test_numbers_are_read_by_their_labels(line, kinds):
    found = {stated.kind: stated.value for stated in statements(line)}
    assert found == pytest.approx(kinds)
