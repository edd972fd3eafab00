"""What lines of text say of a series of numbers: interval, rate, count, length, peak and unit, by meaning.

Every number of a line has a label, which is the words before it, and a unit or a noun behind it or in
brackets. Words are taken apart where their case changes, and compared by how they begin, so that
`SAMPLING INTERVAL (sec) : 0.01`, `2000 points equally spaced at 0.01 s`, `#RecordLength(sec): 20` and
`Frecuencia de muestreo = 100 Hz` need no pattern of their own.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass, replace

from romdam.records.formats.text import acceleration_unit

LONGEST_STEP = 10.0  # s; more is no interval between samples
INTERVAL, RATE, COUNT, LENGTH, PEAK = "interval", "rate", "count", "length", "peak"
SECONDS = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "seg": 1.0, "segundos": 1.0,
    "sek": 1.0, "secondi": 1.0, "secondes": 1.0, "sn": 1.0, "saniye": 1.0, "ms": 1e-3, "msec": 1e-3,
    "msecs": 1e-3, "millisecond": 1e-3, "milliseconds": 1e-3, "us": 1e-6, "usec": 1e-6, "microsecond": 1e-6,
    "microseconds": 1e-6, "min": 60.0, "minutes": 60.0,
}  # fmt: skip
_RATES = {"hz": 1.0, "khz": 1e3, "sps": 1.0, "hertz": 1.0}
_A_SECOND = r"\s*(?:/|per|por|al|a)\s*s(?:ec(?:ond)?|eg\w*)?s?"
_LIKE_RATES = re.compile(rf"(?:samples?|sampl?|pts|points?|data|values?|muestras|dati|1){_A_SECOND}\b")
_PER_SAMPLE = re.compile(r"(?:s|sec|seconds?)\s*(?:/|per)\s*(?:sample|point|sampl)")
# how words begin, in the languages of agencies; `|` parts them
_SAMPLING = (
    "sampl",
    "muestr",
    "campion",
    "echant",
    "abtast",
    "digiti",
    "orneklem",
    "smp",
    "采样",
    "サンプリング",
)
_STEPS = (
    "interval",
    "step",
    "spac",
    "increment",
    "deltat",
    "schritt",
    "passo",
    "paso",
    "aralig",
    "aralik",
    "间隔",
    "間隔",
)
_STEP_WORDS = {"dt", "δt", "delta", "pas", "tsamp", "tstep", "del", "deltat", "dtime", "timestep"}
_RATE_WORDS = (
    "rate",
    "freq",
    "frec",
    "tasa",
    "cadenc",
    "velocidad",
    "sps",
    "frekans",
    "rata",
    "频率",
    "周波数",
)
_NOUNS = ("point", "sample", "pts", "punto", "punti", "muestra", "campion", "echantillon", "wert", "value")
_COUNTED = {"npts", "ndata", "nsamp", "nsamples", "npoints", "npt", "npnts", "nsmp", "ndat"}
_COUNTING = {"number", "no", "num", "nb", "numero", "nr", "count", "total", "size", "nombre", "anzahl"}
_DATA = ("data", "dati", "dato", "veri", "accelerat", "ordinate", "reading", "term", *_NOUNS)
_LENGTHS = (
    "length",
    "duration",
    "duracion",
    "durata",
    "duree",
    "dauer",
    "longitud",
    "lunghezza",
    "sure",
    "时长",
    "持时",
)
_PEAKS = ("peak", "max", "maxi", "pga", "massim", "pico", "spitze", "maks", "峰值", "最大")
_OTHER_RATES = (
    "filter", "corner", "cut", "highpass", "lowpass", "hp", "lp", "natural", "nyquist", "usable",
    "band", "taper", "pole", "order", "sensor", "instrument", "transducer", "domin", "fundamental", "resonan",
    "baud", "clock", "drift", "geolog",
)  # fmt: skip
_OTHER_COUNTS = (
    "channel", "station", "bit", "component", "line", "version", "event", "stage", "header", "comment",
    "column", "row", "record", "decimal", "block", "file", "page", "year", "serial", "row", "trigger", "code",
)  # fmt: skip
_OTHER_LENGTHS = (
    "signif", "strong", "ruptur", "arias", "fault", "wave", "focal", "cable", "taper", "pre", "post",
    "trigger", "header", "block", "format", "word", "bracket", "brack", "husid", "source", "line", "crest",
    "dam", "pad", "window",
)  # fmt: skip
_OTHER_PEAKS = (
    "vel", "disp", "pgv", "pgd", "time", "mag", "freq", "range", "scale", "full", "volt", "capac", "intens",
    "sensor", "limit", "depth", "dist", "period", "spectr", "sa", "psa",
)  # fmt: skip
_WORD = re.compile(r"[^\W\d_]+")
_CLOCK = r"\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?"
_DATES = re.compile(rf"\d{{1,4}}[-/.]\d{{1,2}}[-/.]\d{{1,4}}(?:[T\s-]*{_CLOCK})?|{_CLOCK}")
_NUMBER = re.compile(
    r"(?<![\w.])[-+]?(?:\d{1,3}(?:,\d{3})+(?![\d.,])|\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?(?![\d_]|\.\d)"
)
_DECIMAL_COMMA = re.compile(r"(?<![\d.,])(\d+),(\d+)(?![\d.,])")
_BEHIND = re.compile(r"\s*[\[({]?\s*([^\W\d_%][^\s,;:=()\[\]{}~]*|%\s?g)", re.UNICODE)
_BRACKETS = re.compile(r"[\[({]\s*([^)\]}]*?)\s*[)\]}]")
_JOINS = re.compile(r"[\s~,;/&:]*(?:and|to|y|e)?[\s~,;/&:]*")
_PER = re.compile(r"\bper\s+(?:channel|component|record|trace|file)\b", re.I)
_DIRECTIONS = re.compile(r"[\s~,;/&:()=\[\]]*(?:[NSEWUDXYZLTV][-_ ]?[NSEWUDP]?)[\s~,;/&:()=\[\]]*", re.I)
_OF_ACCELERATION = (
    "acc", "accs", "acce", "ivme", "acel", "beschl", "ampl", "data", "valu", "motion", "ordinat",
)  # fmt: skip
_OF_TIME = ("time", "data", "point", "equal", "tiempo", "tempo", "temps", "zeit", "zaman")
_UNIT_LABEL = re.compile(r"(?:units?|unidad(?:es)?|unit[aàé]s?|birimi?|einheit)\b", re.I)
_CASE = re.compile(r"(?<=[a-z])(?=[A-Z])")


@dataclass(frozen=True)
class Statement:
    """A number that a line says something of the series with.

    Attributes
    ----------
    kind : INTERVAL, RATE, COUNT, LENGTH or PEAK
    value : as printed; of intervals, lengths and rates in s and Hz
    unit : of a peak, in romdam's spelling; "" where the line does not say
    slack : half of the last printed digit, in the unit of the value
    text : label and number, for messages
    """

    kind: str
    value: float
    unit: str
    slack: float
    text: str


def plain_words(text: str) -> list[str]:
    """Words in lower case without accents, taken apart where their case changes."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    plain = unicodedata.normalize("NFKD", apart.replace("µ", "u").replace("μ", "u").replace("ı", "i"))
    return [word.lower() for word in _WORD.findall("".join(c for c in plain if not unicodedata.combining(c)))]


def statements(line: str, *, decimal_comma: bool = False) -> list[Statement]:
    """What a line says of a series, number by number.

    Parameters
    ----------
    decimal_comma : whether 0,01 is a number wherever it stands; else where its whole part is 0
    """
    line = _DATES.sub(lambda match: " " * len(match[0]), line)
    line = _DECIMAL_COMMA.sub(
        lambda match: f"{match[1]}.{match[2]}" if decimal_comma or match[1] == "0" else match[0], line
    )
    line = re.sub(r"(?<=\d)(?=[^\W\d_eEdD])", " ", line)  # 0.01s
    numbers = list(_NUMBER.finditer(line))
    found: list[Statement] = []
    begin, last = 0, None
    for number, match in enumerate(numbers):
        end = numbers[number + 1].start() if number + 1 < len(numbers) else len(line)
        label, behind = line[begin : match.start()], line[match.end() : end]
        _, _, fraction = match[0].replace(",", "").lower().partition(".")
        value = float(match[0].replace(",", "").lower().replace("d", "e"))
        digits = re.split("[ed]", fraction)[0]
        exponent = float("1e" + (re.split("[ed]", match[0].lower())[1:] or ["0"])[0])
        slack = 0.5 * 10.0 ** -len(digits) * exponent
        unit = _unit_behind(behind)
        text = f"{label} {match[0]} {unit}"
        goes_on = _JOINS.fullmatch(label) or _DIRECTIONS.fullmatch(label)
        if last is not None and last.kind == PEAK and goes_on:
            stated: Statement | None = replace(last, value=abs(value), slack=slack)
        else:
            stated = _statement(_PER.sub("", label), value, slack, unit, behind)
        if stated is not None:
            found.append(replace(stated, text=" ".join(text.split())[:60]))
        last = stated
        begin = match.end()
        known = _unit_word(unit) in SECONDS or _unit_word(unit) in _RATES or acceleration_unit(unit)
        if known or (unit and _begins(plain_words(unit)[:1], _NOUNS)):
            begin += behind.index(unit) + len(unit)
    return found


def _unit_behind(behind: str) -> str:
    """The word behind a number that may be its unit."""
    match = _BEHIND.match(behind)
    return match[1].rstrip(".,;:") if match else ""


def _begins(words: list[str], starts: tuple[str, ...]) -> bool:
    """Whether one of the words begins so; starts of up to three letters are whole words.

    Long ones, and those of scripts without blanks, may stand anywhere in a word: Abtastintervall.
    """
    long = tuple(start for start in starts if len(start) > 3)
    within = [start for start in starts if len(start) > 5 or not start.isascii()]
    return any(
        word in starts or word.startswith(long) or any(part in word for part in within) for word in words
    )


def _statement(label: str, value: float, slack: float, unit: str, behind: str) -> Statement | None:
    """What a number says; None where it is of something else."""
    words = plain_words(label)
    in_brackets = [bracket for bracket in _BRACKETS.findall(label) if bracket]
    units = [_unit_word(word) for word in (unit, *in_brackets)]
    seconds = next((SECONDS[word] for word in units if word in SECONDS), None)
    hertz = next((_RATES[word] for word in units if word in _RATES), None)
    acceleration = next(filter(None, map(acceleration_unit, (unit, *in_brackets))), "")
    peaking = _begins(words, _PEAKS)
    if value <= 0.0 and not peaking:
        return None
    tail = " ".join(behind.lower().split())[:40]
    if _PER_SAMPLE.match(tail) and value < 1.0:
        return Statement(INTERVAL, value, "", slack, "")
    per_second = any(_LIKE_RATES.search(text.lower()) for text in (tail[:24], *in_brackets))
    if per_second or (_LIKE_RATES.search(label.lower()) and value == int(value)):
        return Statement(RATE, value, "", slack, "")
    if not _begins(words, _OTHER_RATES) and "pass" not in words:
        plain = not acceleration and (plain_words(unit) or [""])[0] in ("", *_COUNTED)
        if hertz is None and (seconds is not None or not acceleration) and _steps(words, seconds is not None):
            factor = seconds or 1.0
            if value * factor <= LONGEST_STEP:
                return Statement(INTERVAL, value * factor, "", slack * factor, "")
        if seconds is None and _rates(words, hertz is not None or "sps" in units, plain):
            return Statement(RATE, value * (hertz or 1.0), "", slack * (hertz or 1.0), "")
    long = _begins(words, _LENGTHS) and not _begins(words, _OTHER_LENGTHS) and hertz is None
    if long and (seconds is not None or not (unit or in_brackets)):
        return Statement(LENGTH, value * (seconds or 1.0), "", slack * (seconds or 1.0), "")
    if peaking and not _begins(words, _OTHER_PEAKS) and seconds is None and hertz is None:
        after_in = (re.findall(r"\bin\s+(\S+)", label, re.I) or [""])[-1]
        acceleration = acceleration or acceleration_unit(after_in.rstrip(":=,"))
        if acceleration or "pga" in words or _begins(words, _OF_ACCELERATION):
            return Statement(PEAK, abs(value), acceleration, slack, "")
    counted = seconds is None and hertz is None and value == int(value) and value >= 3
    if counted and _is_count(words, plain_words(unit + tail[len(unit) :])[:2]):
        return Statement(COUNT, value, "", 0.0, "")
    return None


def _steps(words: list[str], in_seconds: bool) -> bool:
    """Whether words are of the interval between samples."""
    sampling = _begins(words, _SAMPLING)
    direct = bool(_STEP_WORDS & set(words))
    stepping = direct or _begins(words, _STEPS)
    if sampling and _begins(words, ("period", "time", "zaman")) and not _begins(words, _RATE_WORDS):
        stepping = True
    if in_seconds and (sampling or _begins(words, _NOUNS)) and set(words) & {"at", "every", "each"}:
        stepping = True
    return stepping and (in_seconds or direct or sampling or _begins(words, _OF_TIME) or len(words) <= 2)


def _rates(words: list[str], in_hertz: bool, plain: bool) -> bool:
    """Whether words are of samples a second."""
    sampling = _begins(words, _SAMPLING)
    one_word = any("rate" in word or "freq" in word for word in words if _begins([word], _SAMPLING))
    rated = _begins(words, ("rate", "sps", "fs")) or (sampling and _begins(words, _RATE_WORDS)) or one_word
    return (in_hertz and (rated or sampling or not words)) or (rated and plain)


def _unit_word(text: str) -> str:
    """A unit in lower case without what is around it."""
    return text.strip().strip(".").lower().replace("µ", "u").replace("μ", "u")


def _is_count(words: list[str], behind: list[str]) -> bool:
    """Whether a whole number counts samples; `behind` are the two words behind it."""
    counted = bool(_COUNTED & set(words))
    nouns = [i for i, word in enumerate(words) if _begins([word], _NOUNS)]
    if counted or any(_COUNTING & set(words[max(0, i - 3) : i]) for i in nouns):  # number of data points
        return True
    if behind[:1] and _begins(behind[:1], ("data", "acce")):  # 4000 data points
        behind = behind[1:]
    behind_it = _begins(behind[:1], _NOUNS) and behind[0].endswith(("s", "i", "n"))
    if _begins(words, _OTHER_COUNTS):
        return behind_it
    if _begins(words, ("per", "scale", "max", "peak", "mean", "min", "first", "rate", "freq")):
        return False
    return behind_it or _plural_end(words) or (bool(_COUNTING & set(words)) and _begins(words, _DATA))


def _plural_end(words: list[str]) -> bool:
    """Whether the label ends with the noun: `samples: 2000`."""
    return bool(words) and _begins(words[-1:], _NOUNS) and words[-1].endswith(("s", "i"))


def unit_stated(line: str) -> tuple[str, bool]:
    """The unit of acceleration that a line states, and whether it names it as the unit; "" for none.

    `AmplitudeUnit: gal`, `Acceleration in g`, `values (cm/s2)`, but no unit of a number.
    """
    words = plain_words(line)
    apart = _CASE.sub(" ", line)
    if match := _UNIT_LABEL.search(apart):
        rest = apart[match.end() :]
        for text in _unit_texts(rest):
            if unit := acceleration_unit(text):
                return unit, True
    if _begins(words, _PEAKS):
        return "", False
    texts = [*_BRACKETS.findall(line), *re.findall(r"\b(?:in|en|is|as)\s+([^\s,;:()]+)", line, re.I)]
    if _begins(words, _OF_ACCELERATION):
        for text in texts:
            if unit := acceleration_unit(text.rstrip(".:,;")):
                return unit, False
    for text in _unit_texts(line):
        plainly = re.search("gals?$|GALS?$|/", text)  # Gal is a place too
        if plainly and (unit := acceleration_unit(text)):
            behind_number = re.search(r"\d\s*[\[(]?\s*" + re.escape(text), line)
            if behind_number is None:
                return unit, False
    return "", False


def _unit_texts(line: str) -> list[str]:
    """Pieces of a line that may be units."""
    return [piece.rstrip(".:,;") for piece in re.split(r"[\s,;:=()\[\]{}|]+", line) if piece.strip(".")]
