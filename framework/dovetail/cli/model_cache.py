"""The network to use: a cached one, or one that is trained now."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dovetail.cli.terminal import note, progress_bars

if TYPE_CHECKING:
    from dovetail.assembly import Assembly
    from dovetail.identification import Identifier


def kept_model(assembly: Assembly, plugins: Sequence[Path]) -> Identifier | None:
    """Return the cached model of the same description, or None."""
    from dovetail.identification import Identifier
    from dovetail.network.model_cache import ModelCache

    found = ModelCache(note).find(assembly, plugins)
    return None if found is None else Identifier.of(found)


def trained_model(assembly: Assembly, plugins: Sequence[Path], *, retrain: bool) -> Identifier:
    """Return the cached model of the same description, or one that is trained now, with a bar."""
    import dovetail
    from dovetail.identification import Identifier
    from dovetail.network.model_cache import ModelCache

    def train() -> Identifier:
        with progress_bars() as progress:
            return dovetail.train(assembly, progress=progress)

    return Identifier.of(ModelCache(note).find_or_train(assembly, plugins, train, retrain=retrain))
