"""What the broken plugins share: where they are listed, and what a sound one says of features."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from dovetail import Component, DovetailError

BROKEN: dict[str, dict[str, type[Component]]] = defaultdict(dict)
"""By kind and by the name of the check."""


def breaks(check: str):
    """List a plugin as the one that a check of its kind catches."""

    def enter(model):
        BROKEN[model.kind][check] = model
        return model

    return enter


def checked(features, width=None):
    if not np.isfinite(features).all():
        raise DovetailError("a feature is not finite.")
    if width not in (None, features.shape[1]):
        raise DovetailError("another width.")
    return features
