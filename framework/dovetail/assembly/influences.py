"""Joints without an effect on any FRF of an assembly, and pairs of parameters with the same effect."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.model import Assembly
from dovetail.errors import DovetailError, PluginError, listing

_OF_THE_CHAIN = ("gain", "phase", "delay", "sign")
"""Parameters of a measurement chain that change no receptance."""
_UNRELATED = 1e-9
"""Receptance over the largest one below which it is rounding."""
_LINES = 12
"""Lines at which the effects are looked at."""
_STEP = 1e-6
"""Part of a parameter's range by which it is changed."""
_NONE = 1e-6
"""Relative change of an FRF over a parameter's range below which it has no effect; in a gallery the least was 2e-4."""
_SAME = 1e-7
"""One minus the cosine of two effects below which they are the same; of different ones it is 1e-4 and more."""


def influence_warnings(assembly: Assembly) -> Iterator[str]:
    """Yield a warning about joints and others of which no parameter changes an FRF, and pairs with the same effect.

    Parameters
    ----------
    assembly : Assembly
        At all lines, or at some of them.
    """
    if not assembly.parameters:
        return
    try:
        effects = [_effects(assembly, 0)]
        if any(_sentences(assembly, effects)):
            effects.append(_effects(assembly, 1))
    except PluginError:
        raise
    except (DovetailError, np.linalg.LinAlgError):  # reported where the FRF is computed
        return
    yield from _sentences(assembly, effects)


def _sentences(assembly: Assembly, effects: Sequence[NDArray[np.float64]]) -> Iterator[str]:
    """Yield what the effects (2 n, n_params) at all of some parameter vectors say."""
    sizes = np.array([np.linalg.norm(effect, axis=0) for effect in effects]).max(axis=0)
    if not effects[0].size or not np.isfinite(sizes).all():  # nothing moves
        return
    identified = assembly.description.identified_parameters
    structural = [n for n, (_, name) in enumerate(identified) if name not in _OF_THE_CHAIN]
    names = [parameter.name for parameter in assembly.parameters]
    for owner in dict.fromkeys(identified[n][0] for n in structural):
        columns = [n for n in structural if identified[n][0] == owner]
        if all(sizes[columns] < _NONE):
            which = listing(names[n] for n in columns)
            yield f"{owner}: none of its parameters ({which}) changes an FRF of this description in its range."
    free = [n for n in structural if sizes[n] >= _NONE and assembly.parameters[n].prior == "uniform"]
    for first, second in combinations(free, 2):
        if all(_are_same(effect[:, first], effect[:, second]) for effect in effects):
            yield (
                f"{names[first]} and {names[second]}: they change all FRFs in the same way, so that only one of them "
                "can be identified. Is one thing described twice? Leave one out, or give it a value."
            )


def _effects(assembly: Assembly, seed: int) -> NDArray[np.float64]:
    """Return the relative changes (2 n, n_params) of receptances by small steps from a random parameter vector.

    By differences and LAPACK: what is fast for many vectors takes longer to load or to compile.
    """
    count = len(assembly.parameters)
    middle = np.random.default_rng(seed).uniform(0.2, 0.8, count)
    vectors = assembly.from_unit(np.vstack([middle, middle + _STEP * np.eye(count)]))
    rows = []
    for response in assembly.each_response:
        engine = response.engine
        lines = np.unique(np.linspace(0, len(engine.frequency) - 1, _LINES).round().astype(int))
        points, (outputs, inputs) = engine.system.points, np.array(engine.pairs).T
        at_all = [engine.plan.pivoted.receptance(response.by_joint(v[None]), lines, points, points) for v in vectors]
        frfs = np.array([receptance[:, outputs, inputs].ravel() for receptance in at_all])
        moves = np.abs(frfs[0]) > _UNRELATED * np.abs(frfs[0]).max()
        relative = (frfs[1:, moves] - frfs[0, moves]) / (_STEP * np.abs(frfs[0, moves]))
        rows += [relative.real, relative.imag]
    return np.concatenate(rows, axis=1).T


def _are_same(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    sizes = float(np.linalg.norm(one) * np.linalg.norm(other))
    return sizes > 0.0 and 1.0 - abs(float(one @ other)) / sizes < _SAME
