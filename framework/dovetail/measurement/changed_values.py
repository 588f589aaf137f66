"""Statements that the values are not those of the FRF: changed, by another convention, or a load per motion.

A clause counts if all of its words are about values, so that a log file or a half sine is not one.
"""

from __future__ import annotations

import re

from dovetail.measurement.frf_units import read_unit
from dovetail.measurement.quantity_words import word_set

_CONVENTION = re.compile(
    r"(?:\bexp\s*[({\[]?|\be\s*(?:\^|\*\*)\s*[({\[]?)\s*[-\u2212]\s*1?\s*[ij]|\be-[ij]\s*(?:w|\u03c9|\u03a9|omega)",
    re.IGNORECASE,
)
"""A vibration as exp(-iwt), of which the FRF is conjugated."""
_OPERATION = re.compile(
    r"normali[sz]ed freq\w*|frequency ratio|\bconj\w*\s*\(|\|\s*(?:H|FRF)\s*\|\s*(?:\^\s*2|\*\*\s*2|\u00b2)"
    r"|\bH\s*\*(?=\s|$)|\b1\s*/\s*(?:H|FRF)\b(?!\.)|\b(?:H|FRF)\s*/\s*(?:H|FRF|max|mean|static)"
    r"|(?:divided by|multiplied by|geteilt durch|multipliziert mit|[/*\u00b7])\s*\(?\s*[-\u2212]?\s*(?:[ij]\s*\*?\s*)?"
    r"(?:w|omega|\u03c9)\s*\)?\s*(?:\^|\*\*|\u00b2)"
    r"|^\W*(?:[x*\u00b7\u00d7]\s*)?10\s*(?:\^|\*\*)\s*\(?[-\u2212+]?\d+\)?(?:\s+\S*/\S*)?\W*$"
    r"|\bphase (?:of (?:the )?(?:force|excitation|input|load)|reference\W+(?:response|output|motion))",
    re.IGNORECASE,
)
_NEGATIVE = re.compile(r"\bconvention\b.{0,20}(?:\b(?:negative|minus|physics|optics)\b|-\s*$)")
_CHANGED = word_set(
    "conj conjugate conjugates conjugated conjugation konjugiert negativ negative negated inverse reciprocal"
    " kehrwert squared quadriert doubled twice tripled halved lag lagging scaled skaliert normalized normalised"
    " normiert swapped exchanged vertauscht psd auto cross autospectrum autopower crosspower impulse inverted"
    " reversed flipped shifted rotated turned delayed advanced verdoppelt halbiert invert negate flip swap reverse"
    " integrated integration integral integriert differentiated differentiation derivative differenziert abgeleitet"
    " zeroed rectified difference residual residuum ratio quotient milli micro nano kilo mega thousand thousands"
    " thousandth thousandths hundred hundredths promille mille"
)
_SCALES = word_set("db decibel decibels dezibel log ln logarithm logarithmic logarithmus logarithmisch lg")
_SIZES = word_set("double half two three ten")
"""Words of a factor next to those of values."""
VALUES = word_set(
    "values value data amplitude amplitudes magnitude magnitudes mag real imag imaginary part parts phase phases"
    " sign frf frfs h hxy function functions transfer response responses force forces channel channels y ordinate"
    " curve curves user vorzeichen"
    " samples signal signals motion acceleration velocity displacement accelerance mobility receptance werte wert"
)
FILLING = word_set(
    "a an the of is are was were be been as in by to with and for its all each this these has have get gets"
    " given made on per it than scale scaling axis convention spectrum spectra power positive means means time"
    " frequency-domain complex linear unit units factor included applied times once multiplied divided large"
    " larger big bigger high higher much size sized measured true yes number numbers column columns result"
    " results base basis natural common mass static stiffness unity one max maximum peak obtain divide multiply"
    " die der das sind ist mit von alle type kind deg degree degrees rad radians info note notes comment"
    " comments remark remarks description title name header meta metadata text between prefix"
)
_PARTS = {
    **dict.fromkeys(("real", "re", "realteil"), "real"),
    **dict.fromkeys(("imag", "im", "imaginary", "imagin\u00e4rteil"), "imag"),
    **dict.fromkeys(("amplitude", "magnitude", "mag", "modulus", "betrag"), "amplitude"),
    **dict.fromkeys(("phase", "angle"), "phase"),
}
_BETWEEN_PARTS = word_set("and und part parts db deg degree degrees rad radians frequency freq hz coherence linear log")
_LARGER = word_set("large larger big bigger high higher size factor multiplied divided")
NEGATION = re.compile(r"\b(?:no|not|none|off|false|nein|without|never)\b")
_CLAUSE = re.compile(r"[;\n]|,(?!\d)|\.\s")
_POWER = re.compile(r"\b10\s*[*\u00b7]?\s*log|\bpower\b|\bsquared\b")
_REFERENCE = re.compile(
    r"(?:\bdb\b.{0,20}?\bre(?:f|ference|l)?|\bre(?:f|ference)? db)\b\W*(?P<number>[-+]?[\d.]+(?:e[-+]?\d+)?)"
)


def find_change(key: str, text: str) -> str:
    """Return a sentence on the first words for values that were changed; empty without any.

    Parameters
    ----------
    key : str
        The name in front of the text; empty for running text.
    text : str
    """
    if match := _CONVENTION.search(text):
        return f"'{match[0]}' is a convention of which FRFs are conjugated, and may act on the values."
    whole = f"{key}: {text}".replace("_", " ") if key else text
    if match := _OPERATION.search(text) or _OPERATION.search(whole):
        return f"'{match[0]}' may act on the values."
    for clause in clauses_of(key, text):
        words = _words(clause)
        changes = (_CHANGED & words) or _factor_words(words)
        if not re.search(r"\d", clause):
            words = frozenset(word for word in words if word in VALUES or read_unit(word) is None)
        about = bool(words & VALUES) or words <= _CHANGED | FILLING | _SIZES
        if _NEGATIVE.search(clause) or (changes and about and words - changes <= VALUES | FILLING | _SIZES):
            return f"'{clause.strip()[:60]}' may act on the values."
    return ""


def find_scale(key: str, text: str) -> str:
    """Return ``dB``, ``power`` or ``log`` if a text says that amplitudes are on such a scale; empty otherwise."""
    for clause in clauses_of(key, text):
        words = _words(clause)
        if (words & _SCALES or _POWER.search(clause)) and words <= _SCALES | VALUES | FILLING:
            is_power = _POWER.search(clause) is not None
            return "power" if is_power else "dB" if words & {"db", "decibel", "decibels", "dezibel"} else "log"
    return ""


def parts_in(text: str) -> list[str]:
    """Return the parts of complex values that a text lists, as in ``Real/Imag`` and ``magnitude (dB), phase``.

    Returns
    -------
    list of str
        Of ``real``, ``imag``, ``amplitude`` and ``phase``; empty for a text with other words.
    """
    words = re.findall(r"[^\W\d_]+", text.lower())
    known = all(word in _PARTS or word in _BETWEEN_PARTS for word in words)
    return list(dict.fromkeys(_PARTS[word] for word in words if word in _PARTS)) if known else []


def reference_of_decibels(key: str, text: str) -> float:
    """Return the number over which decibels are, as in ``dB re 1e-6``; 1 without one."""
    match = _REFERENCE.search(f"{key}: {text}".lower().replace("_", " "))
    try:
        return float(match["number"]) if match else 1.0
    except ValueError:
        return 1.0


def clauses_of(key: str, text: str) -> list[str]:
    """Return the clauses of a text in lower case that deny nothing, the first one with the name in front of it."""
    whole = re.sub(r"(?<=[a-z\u00e4\u00f6\u00fc])(?=[A-Z])(?!B\b)", " ", key).replace("_", " ")
    clauses = _CLAUSE.split(text)
    if key:
        clauses = [
            f"{whole}: {text}",
            *(one for one in clauses if VALUES & _words(one.lower()) and " " in one.strip()),
        ]
    return [clause.lower() for clause in clauses if not NEGATION.search(clause.lower())]


def _words(clause: str) -> frozenset[str]:
    return frozenset(re.findall(r"[^\W\d_]+", clause))


def _factor_words(words: frozenset[str]) -> frozenset[str]:
    """Return the words of a factor, as in ``half amplitude`` and ``two times as large``."""
    sizes = _SIZES & words
    needed = _LARGER | {"amplitude", "amplitudes", "values", "value", "magnitude"}
    return sizes if sizes and needed & words else frozenset()
