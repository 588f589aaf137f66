"""The reader 'json_frf': FRFs that a laboratory's own program exports as JSON.

A file is ``{"format": "lab-frf", "unit": "um/N", "frfs": [...]}``; each FRF has ``first`` and ``step`` of its lines
[Hz], ``real`` and ``imag``, and may have ``coherence``, ``response``, ``force`` and ``note``.
"""

import json

import numpy as np

from dovetail import FrfReader, RecordedFrf

SIGNATURE = '"format": "lab-frf"'


class JsonFrf(FrfReader):
    """JSON with one FRF or several, evenly spaced."""

    name = "json_frf"
    summary = "JSON exports of the laboratory's own program"
    suffixes = (".json",)

    def sniff(self, content):
        """Look for the signature in the first bytes."""
        return SIGNATURE.encode() in content

    def read(self, path, content):
        """Return the FRFs of a file."""
        try:
            whole = json.loads(content)
            return [recorded(entry, str(whole["unit"])) for entry in whole["frfs"]]
        except (KeyError, TypeError, AttributeError, RecursionError) as error:
            raise ValueError(f"this is no export of lab-frf: {type(error).__name__} {error}.") from None

    def samples(self, folder):
        """Write a file of two FRFs."""
        entry = {"first": 10.0, "step": 2.0, "real": [1.0, -2.0, 0.5], "imag": [0.1, 0.2, 0.3]}
        frfs = [{**entry, "response": f"{node}+x", "force": "1+x"} for node in (1, 2)]
        file = folder / "two.json"
        file.write_text(json.dumps({"format": "lab-frf", "unit": "um/N", "frfs": frfs}))
        return [file]


def recorded(entry, unit):
    """Return one FRF of a file."""
    real, imag = (np.array(entry[part], dtype=float) for part in ("real", "imag"))
    coherence = entry.get("coherence")
    return RecordedFrf(
        frequency=float(entry["first"]) + float(entry["step"]) * np.arange(real.size),
        values=real + 1j * imag,
        unit=unit,
        coherence=None if coherence is None else np.array(coherence, dtype=float),
        response=str(entry.get("response", "")),
        force=str(entry.get("force", "")),
        note=str(entry.get("note", "")),
    )
