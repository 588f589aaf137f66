"""Least squares on the measured FRF, weighted by its random error, from several starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.features import accelerance_amplitudes
from dovetail.identification.fitting import refine
from dovetail.identification.foreign import examine
from dovetail.identification.posterior import MODEL_ERROR
from dovetail.identification.provenance import provenance
from dovetail.identification.reconstruction import reconstruct
from dovetail.identification.result import Identification

if TYPE_CHECKING:
    from dovetail.identification.identifier import Identifier

__all__ = ["fitted", "identify"]


def identify(
    assembly: Assembly, measured: tuple[Frf, ...], identifier: Identifier | None = None, *, seed: int | None = None
) -> Identification:
    """Fit the joint to the measured FRF, from the ranges alone or from a network's answer as well.

    Parameters
    ----------
    assembly : Assembly
    measured : tuple of Frf
        One for each response, on the assembly's frequencies.
    identifier : Identifier, optional
        Its answer is one more start.
    seed : int, optional
        Of the other starts; the description's by default.
    """
    return fitted(assembly, measured, identifier, seed, MODEL_ERROR)


def fitted(
    assembly: Assembly, measured: tuple[Frf, ...], identifier: Identifier | None, seed: int | None, model_error: float
) -> Identification:
    """Fit the joint, and say whether a model with this relative error can have made the measurement."""
    starts = []
    if identifier is not None:
        guess = identifier.predict_parameters(accelerance_amplitudes(measured))[0]
        starts = [guess] if np.isfinite(guess).all() else []
    settings = assembly.description.identification
    fit = refine(assembly, measured, starts, seed=settings.seed if seed is None else seed)
    origin = provenance(assembly, measured, identifier.evaluation if identifier is not None else None)
    foreign = examine(assembly, measured, fit, model_error)
    return reconstruct(assembly, fit.theta, measured, method="refined", provenance=origin, fit=fit, foreign=foreign)
