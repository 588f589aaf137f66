"""What the broken plugins share: their list, and the features that a sound one computes."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from dovetail import Component, DovetailError

BROKEN: dict[str, dict[str, type[Component]]] = defaultdict(dict)
"""By kind and by the name of the check that catches the plugin, and that alone does so."""

FURTHER: list[tuple[type[Component], frozenset[str]]] = []
"""More plugins, each with the checks that catch it."""


def breaks(check: str):
    """List a plugin as the one that a check of its kind catches."""

    def enter(model):
        assert check not in BROKEN[model.kind], f"{check} has its plugin"
        BROKEN[model.kind][check] = model
        return model

    return enter


def also_breaks(*checks: str):
    """List a plugin that these checks catch."""

    def enter(model):
        FURTHER.append((model, frozenset(checks)))
        return model

    return enter


def checked(features, width=None):
    if not np.isfinite(features).all():
        raise DovetailError("a feature is not finite.")
    if width not in (None, features.shape[1]):
        raise DovetailError("another width.")
    return features
