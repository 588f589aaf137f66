"""Statements that the values are something other than a displacement, a velocity or an acceleration per load.

As in `changed_values`, a clause counts if all of its words are about values: ``type: strain`` is one, and the pressure
of the air is not.
"""

from __future__ import annotations

import re
import warnings

from dovetail.measurement.changed_values import FILLING, NEGATION, VALUES, clauses_of
from dovetail.measurement.quantity_words import word_set

_QUANTITIES = word_set(
    "strain strains microstrain dehnung stress stresses sound pressure transmissibility transmissibilities current"
    " jerk intensity"
)
_ROTATIONS = word_set("rotation rotations rotational rotary angular verdrehung drehwinkel winkelbeschleunigung")
_NO_ROTATION = word_set("frequency frequencies force forces")
_ABOUT = VALUES | FILLING | word_set("quantity measurand output input numerator excitation point drive measurement")
_NEGATIVE_DIRECTION = re.compile(r"(?<![\w.)\]])[-\u2212][xyz](?![\w-])", re.IGNORECASE)
_DIRECTED = re.compile(
    r"direction|orient|axis|dof|sensor|accelerometer|hammer|points?\b|mounted|polarity|response|force|excitation"
    r"|richtung"
)
_TURNED_SENSOR = re.compile(
    r"\bupside[ -]?down\b|\bpolarity\W+(?:neg\w*|minus|inv\w*|rev\w*|-)|\b(?:neg\w*|inv\w*|rev\w*) polarity\b"
    r"|kopf(?:ü|ue)ber"
)
_EXPONENTIAL = re.compile(r"\bexponential\b|\bexponentiell\w*|\bexp\b(?![\s({\[]*[-\u2212+ij(])")
_WINDOW = re.compile(r"window|fenster|weighting|bewertung")
_UNCALIBRATED = re.compile(r"\buncalibrated\b|\bnot calibrated\b|\bcalibrated\W+(?:no|false|0)\b")


def find_other_quantity(key: str, text: str) -> str:
    """Return a sentence on the first words for another quantity, or a sensor that is turned; empty without any.

    Parameters
    ----------
    key : str
        The name in front of the text; empty for running text.
    text : str
    """
    whole = f"{key}: {text}".strip(": ").lower().replace("_", " ")
    turned = _TURNED_SENSOR.search(whole) or _UNCALIBRATED.search(whole)
    direction = _NEGATIVE_DIRECTION.search(f"{key}: {text}" if key else text)
    if turned or (direction and _DIRECTED.search(whole)):
        return f"'{whole[:60]}' may act on the values."
    for clause in clauses_of(key, text):
        words = _plain_words(clause)
        if words & _QUANTITIES and words <= _QUANTITIES | _ABOUT:
            return f"'{clause.strip()[:60]}' is not a motion per load."
    return ""


def names_rotation(key: str, text: str) -> bool:
    """Return whether a text says that the motion is a rotation."""
    for clause in clauses_of(key, text):
        words = _plain_words(clause)
        if words & _ROTATIONS and words <= _ROTATIONS | _ABOUT and not words & _NO_ROTATION:
            return True
    return False


def warn_of_exponential_window(key: str, text: str, where: str) -> None:
    """Warn if a text says that an exponential window was applied, whose damping an identification takes for a joint's.

    Parameters
    ----------
    key, text : str
        As in `find_other_quantity`.
    where : str
    """
    whole = f"{key}: {text}".strip(": ").lower().replace("_", " ")
    if _EXPONENTIAL.search(whole) and _WINDOW.search(whole) and not NEGATION.search(whole):
        warnings.warn(
            f"{where}: '{whole[:60]}': such a window adds to the damping of every mode. If it was applied, give its "
            "decay rate in the description, 'calibration: {window: ... 1/s}' of the response.",
            stacklevel=2,
        )


def _plain_words(clause: str) -> frozenset[str]:
    """Return the words of a clause; none of one with a number, which is a setting."""
    return frozenset() if re.search(r"\d", clause) else frozenset(re.findall(r"[^\W\d_]+", clause))
