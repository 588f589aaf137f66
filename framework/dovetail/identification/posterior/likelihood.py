"""What a measured FRF weighs against the FRFs of the model: its random error, and the errors of the model itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError
from dovetail.frf import Frf
from dovetail.identification.fitting import Fit
from dovetail.identification.fitting.frfs import Frfs
from dovetail.identification.fitting.measured import Measured, missed
from dovetail.identification.fitting.misfit import SideBySide, Weighted
from dovetail.identification.posterior.model_error import correlation_length, model_errors

__all__ = ["Likelihood", "check_options", "likelihood"]


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Residuals of all lines, and how they err together.

    Parameters
    ----------
    target : Measured
        In the quantities of the responses.
    variance : (n_lines,) array
        E|error|^2 of each line: random, and what the fit left beyond it.
    residual : Weighted or SideBySide
        Over the random error, and over what the fit left beyond it.
    lines : int
        How many of them count.
    errors : (k, m) array
        What one standard deviation of each error of the model adds to the residuals.
    """

    target: Measured
    variance: NDArray[np.float64]
    residual: Weighted | SideBySide[Weighted]
    lines: int
    errors: NDArray[np.float64]


def likelihood(assembly: Assembly, measured: Frf | Sequence[Frf], fit: Fit, model_error: float) -> Likelihood:
    """Weigh a measurement by what its best fit tells.

    Parameters
    ----------
    assembly : Assembly
    measured : Frf or sequence of Frf
        One for each response, on the assembly's frequencies.
    fit : Fit
        Of the same measurement. Its random error and the lines it left out are taken over, and so is the part of the
        FRF by which it found the model to be off: neighbouring lines are off alike, so many of them count as one.
    model_error : float
        Standard deviation of the relative error of natural frequencies.
    """
    target = Measured.of(assembly, measured)
    values = Frfs.of(assembly).frf(fit.theta[np.newaxis])[0]
    off = (fit.discrepancy * np.abs(values)) ** 2
    if fit.discrepancy:
        deviation = target.split(np.sqrt(fit.variance + off))
        each = zip(target.frfs, target.split(values), deviation, target.split(off), strict=True)
        off = np.concatenate([part * correlation_length(missed(frf, own) / size) for frf, own, size, part in each])
    residual = target.weighted(fit.variance + off, fit.used)
    errors = model_errors(assembly.frequency, target.split(values), model_error)
    with_errors = residual.slopes(values[np.newaxis], errors[np.newaxis])[0]
    return Likelihood(target, fit.variance + off, residual, int(np.count_nonzero(fit.used)), with_errors)


def check_options(samples: int, model_error: float) -> None:
    """Make sure that there are samples, and that the error of the model is one.

    Raises
    ------
    ParameterError
    """
    if samples < 1:
        raise ParameterError(Fault("samples", f"{samples} samples are none.", "1 or more"))
    if not (np.isfinite(model_error) and 0.0 <= model_error < 1.0):
        raise ParameterError(Fault("model_error", f"{model_error:g} is no relative error.", "from 0 to 1"))
