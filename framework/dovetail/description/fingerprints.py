"""Fingerprints of descriptions, by which files that depend on them are recognised."""

from __future__ import annotations

import hashlib
import json
import os
from typing import Any


def fingerprint(text: str) -> str:
    """Return the fingerprint of a description that is given as JSON."""
    whole = _without_folders(json.loads(text))
    physics = {key: whole.get(key) for key in ("frequency", "substructures", "joints", "response")}
    physics |= {key: whole[key] for key in ("responses", "calibration") if key in whole}
    return hashlib.sha256(json.dumps(physics, sort_keys=True).encode()).hexdigest()


def _without_folders(value: Any) -> Any:
    """Return plain values with file names stripped of their folders, which differ from machine to machine."""
    if isinstance(value, dict):
        return {key: _without_folders(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_without_folders(entry) for entry in value]
    return os.path.basename(value) if isinstance(value, str) and os.path.isabs(value) else value
