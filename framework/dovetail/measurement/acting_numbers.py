"""Numbers in a file that may act on the values: gains, factors, sensitivities, delays and corrections."""

from __future__ import annotations

import re
from collections.abc import Sequence

from dovetail.measurement.changed_values import find_change
from dovetail.measurement.frf_units import read_unit
from dovetail.measurement.quantity_words import word_set, words_of

_MULTIPLIES = re.compile(
    r"gain|verst[äa]e?rk|amplif|preamp|attenu|a[bu]schw[äa]e?ch|fac?tor|faktor|facteur|fattore|\bscal(?:e|ing)|skalier"
    r"|sensitiv|\bsens\b|empfindl|calib|kalib|[ée]talon|corr?ect|\bcorr\b|korrekt|multipl|divi[ds]|conversion"
    r"|umrechn|normali[sz]|weight"
)
"""Words of what multiplies values; a factor of 1 does nothing."""
_SHIFTS = re.compile(
    r"delay|latenc|\blags?\b|verz[öo]e?ger|retard|skew|offset|compensat|kompens|decay|exponential|\bshift\b|exponent\b|tau\b"
)
"""Words of what shifts values or is added to them; 0 does nothing."""
_INVERTED = re.compile(
    r"\b(?:inverted|negated|reversed|conjugated?|flipped|invertiert|negiert|konjugiert)\b|\b(?:polarity|sign)\W+-"
    r"|=\s*-\s*(?:real|imag|h|frf)\b"
)
"""Words of values whose sign or phase was changed."""
_NEGATION = re.compile(r"\b(?:no|not|none|off|false|nein)\b|(?<![\d.,])0(?![\d.,])")
_REFERENCE = re.compile(
    r"\b(?:trigger|trig|pretrigger|no|nr|number|id|serial|certificate|dates?|due|file|name|version|lab)\b|datum"
)
"""Words of what identifies a calibration."""
_BY_WHOM = re.compile(r"\bby\s+[^\W\d_]")
_TIME = re.compile(
    r"time|zeit|temps|dur|period|length|record|interval|\bdt\b|\bt\b|delta|\bx\b|sampl|abscissa|resol|step|trig|span"
    r"|window|timeout|sweep|dwell|rate|block|frame|acquisition|measur"
)
"""Words of times that do not act on an FRF."""
_LEVEL = re.compile(r"range|dynamic|noise|level|snr|ratio|thd|floor|threshold|limit|reference|\bref\b|trig|sound")
"""Words of decibels that do not act on an FRF."""
_DATES = re.compile(
    r"\b\d{1,4}[-./]\d{1,2}[-./]\d{1,4}(?:[T ]\d{1,2}:\d{2}\S*)?|\b\d{1,2}:\d{2}(?::\d{2}\S*)?"
    r"|\b\d{1,2}[-. ][A-Za-z\u00e4]{3,9}[-. ,]+\d{2,4}\b"
)
_YEAR = re.compile(r"\b(?:19|20)\d{2}\b")
_NUMBER = re.compile(r"(?<![\w.,/^-])[-+]?(?:\d+(?:[.,]\d+)?|\.\d+)(?:[eE][-+]?\d+)?(?![\w]*\d)\s*([^\s\d,;()]\S*)?")
_TIMES = re.compile(
    r"(?:\btimes|\bmultiplied by|\bdivided by|[\u00d7*])\s*[-+]?\d[\d.,]*(?:[eE][-+]?\d+)?|\bx\s?1[0.e]\d*", re.I
)
_PER_VOLT = re.compile(r"[munpk\u00b5\u03bc]?[VC]/")
"""Units of a sensitivity."""
_CURVE = re.compile(r"\bcal\b|\btransducer\b|\bsensor (?:frf|response|h|curve)\b|\b(?:frf|response|h) sensor\b")
"""Words of a sensor's own response, line by line."""
_CLAUSE = re.compile(r"[;\n]|,(?!\d)|\.\s")
_HARMLESS = word_set(
    "air ambient angle ans average averages avg band bands bandwidth begin beta bins bit bits block blocks"
    " blocksize center centre channel channels clamping code coord coordinate coordinates coords count counts"
    " damping date datenum day deg delta depth df diameter dir direction dof dofs dt duration dx dy dz end f"
    " fend fft fig figure firmware flag flags fmax fmin fnyq force frames freq frequency fs fstart fstop h11"
    " hardness height hi high hits hour humidity hz i id impact impacts increment index input j kg khz labview"
    " length level lin line lines lo log low major mass matlab max mean method min minor minute mm mode modes"
    " month ms n n1 n2 nave navg nblocks nch ncol nf nfft nfreq nlines no node nodes npts nr nrow nsamples num"
    " number nyquist offsetx ok order output overhang overlap overload overloads peak point points poly pos"
    " position preload pressure pretrigger pts pulse range rate record records ref reference repeat repetition"
    " resolution response revision rms room rpm rpms run sample samplerate samples sampling samplingrate second"
    " seed sensor serial set size software span speed start status std step stop t taps temp temperature tend"
    " test threshold time tmax tool torque trec trial trigger ts tstart valid version volt volts weather weight"
    " welch width window windows x y year z"
)
"""Words of numbers that describe a measurement and do not act on its values."""
_SHOWN = 60


def is_harmless_number(name: str, value: complex) -> bool:
    """Return whether a single number under a name that is not read cannot act on the values.

    It cannot if all words of its name are those of the settings of a measurement.
    """
    words = words_of(re.split(r"[./]", name)[-1])
    plain = " ".join(words)
    if _SHIFTS.search(plain):
        return value == 0
    if _MULTIPLIES.search(plain):
        return value == 1 or _REFERENCE.search(plain) is not None
    if "per" not in words and len(words) > 1 and (unit := read_unit(re.split(r"[_ ]", name)[-1])) is not None:
        return unit.kind not in ("time", "none")
    return value in (0, 1) or (bool(words) and all(word in _HARMLESS for word in words))


def may_act(name: str) -> bool:
    """Return whether a name is one of numbers that multiply or shift the values."""
    plain = " ".join(words_of(name))
    acts = _MULTIPLIES.search(plain) or _SHIFTS.search(plain) or _CURVE.search(plain)
    return bool(acts) and not _REFERENCE.search(plain)


def find_acting_number(key: str, text: str) -> str:
    """Return a sentence on a number that may act on the values, or an empty text.

    Parameters
    ----------
    key : str
        The name in front of the text; empty for running text.
    text : str
    """
    if (match := _TIMES.search(_DATES.sub(" ", text))) and not _REFERENCE.search(" ".join(words_of(key))):
        return f"'{match[0].strip()[:_SHOWN]}' may be a factor of the values."
    whole = f"{key}: {text}".lower().replace("_", " ")
    if problem := find_change(key, text):
        return problem
    if (match := _INVERTED.search(whole)) and not _NEGATION.search(whole):
        return f"'{match[0]}' may act on the values."
    clauses = [text] if key else _CLAUSE.split(text)
    for clause in clauses:
        if problem := _in_clause(key, clause):
            return problem
    return ""


def _in_clause(key: str, clause: str) -> str:
    words = " ".join(words_of(f"{key} {clause}"))
    multiplies, shifts = _MULTIPLIES.search(words), _SHIFTS.search(words)
    if (multiplies or shifts) and (_REFERENCE.search(words) or _BY_WHOM.search(clause)):
        return ""
    text = _DATES.sub(" ", clause)
    if "calib" in words or "kalib" in words:
        text = _YEAR.sub(" ", text)
    numbers = [(match[0], (match[1] or "").strip(".")) for match in _NUMBER.finditer(text)]
    shown = f"'{f'{key}: {clause}'.strip(': ')[:_SHOWN]}'"
    for number, unit in numbers:
        value = float(_plain(number))
        in_decibels = unit.lower().startswith("db")
        neutral = 0.0 if shifts or in_decibels else 1.0
        if (multiplies or shifts) and value != neutral:
            return f"{shown} may act on the values."
        if key and _acts_by_unit(words_of(key), number, unit) and value not in (neutral, 0.0):
            return f"{shown} may act on the values."
    return ""


def _plain(number: str) -> str:
    match = re.match(r"[-+]?(?:\d+(?:[.,]\d+)?|\.\d+)(?:[eE][-+]?\d+)?", number)
    return (match[0] if match else "0").rstrip(".,").replace(",", ".")


def _acts_by_unit(key: Sequence[str], number: str, unit: str) -> bool:
    """Return whether a number under a key that is not known may be a delay, a gain, a sensitivity or a factor."""
    words = " ".join(key)
    if unit.lower().startswith("db"):
        return not _LEVEL.search(words)
    if not unit:
        return re.search(r"[.,]\d|[eE]", number) is not None and not any(word in _HARMLESS for word in key)
    if _PER_VOLT.match(unit):
        return True
    reading = read_unit(unit)
    return reading is not None and reading.kind == "time" and not _TIME.search(words)
