"""Identification from natural frequencies and damping ratios, with intervals and verdicts as from an FRF."""

from __future__ import annotations

import time
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.optimize import brentq, linear_sum_assignment

from dovetail.assembly import Assembly
from dovetail.errors import Fault, MeasurementError, listing
from dovetail.identification.reconstruction import identified_parameters, known_parameters
from dovetail.identification.result import MatchedMode, ModalIdentification
from dovetail.inference.adequacy import Adequacy
from dovetail.inference.adequacy.assess import check_limits
from dovetail.inference.adequacy.verdict import NOTHING_LEFT, word_for
from dovetail.inference.posterior import LEVEL, TYPICAL, Form, ModelError, Posterior, typical_model_error
from dovetail.inference.posterior.distribution import check_options
from dovetail.inference.posterior.likelihood import PosteriorResiduals, normal_from_unit, unit_from_normal
from dovetail.inference.posterior.mode_search import maximise_posterior
from dovetail.inference.posterior.sampling import draw
from dovetail.interfaces import Progress, silent
from dovetail.measurement import ModalParameters
from dovetail.problem.least_squares import Linearisation, SumOfSquares
from dovetail.provenance import provenance
from dovetail.synthesis import DampedModes

_LEAST_FREEDOM = 0.5
"""Degrees of freedom below which the residuals of a fit say nothing about errors."""
_LEAST_ERRORS = (TYPICAL.natural_frequency, TYPICAL.damping)
"""Smallest relative errors of natural frequencies and of damping ratios."""


@dataclass(frozen=True)
class Settings:
    """Constants of the search, and the errors that are assumed if none are stated."""

    assumed: ModelError = field(default=ModelError(5e-3, damping=0.3))
    """Relative errors of a table that states none and has too few modes to estimate any."""
    starts: int = 24
    """Number of searches, from the best of eight times as many points of a Latin hypercube over the ranges."""
    rough: ModelError = field(default=ModelError(0.03, damping=0.5))
    """Errors allowed in the first searches: the larger they are, the fewer local minima there are."""
    rounds: int = 3
    """Rounds in which the errors are estimated from the residuals and the fit is repeated."""
    further_modes: int = 4
    """Modes of the model that are computed beyond twice those of the table, which may lack some."""
    reach: float = 1.5
    """Highest mode of the model that is computed, over the highest natural frequency of the table."""
    least_damping: float = 1e-4
    """Damping ratio to which relative errors of smaller ones refer."""
    least_turn: float = 0.5
    """Imaginary part of a pole over its magnitude below which no table has it: a damping ratio above 0.87."""
    apart: float = 0.1
    """Difference of a coordinate, in standard deviations of the prior, above which two ends are distinct."""
    region: float = 20.0
    """Sum of squares above the lowest one up to which the end of a search is also a start of samples."""


_SETTINGS = Settings()


class _ModalResiduals(SumOfSquares):
    """Whitened residuals of natural frequencies and damping ratios, as functions of the parameters.

    Parameters
    ----------
    assembly : Assembly
    measured : ModalParameters
    error : ModelError
        Errors of model and table in addition to the standard deviations that the table states.
    """

    def __init__(self, assembly: Assembly, measured: ModalParameters, error: ModelError) -> None:
        self.assembly, self.measured = assembly, measured
        self.modes = DampedModes(assembly.graph)
        count = len(assembly.parameters)
        fixed, moved = assembly.by_joint(np.zeros((1, count))), assembly.by_joint(np.eye(count))
        self._slopes = {name: moved[name] - fixed[name] for name in fixed}
        self.groups = [(measured.frequency, measured.frequency_sd, measured.frequency)]
        if measured.damping_ratio is not None:
            least = np.maximum(measured.damping_ratio, _SETTINGS.least_damping)
            self.groups.append((measured.damping_ratio, measured.damping_sd, least))
        self.target = np.concatenate([values for values, _, _ in self.groups])
        self.deviation = self.deviations(error)

    def deviations(self, error: ModelError) -> NDArray[np.float64]:
        """Return the standard deviation of each number of the table (m,)."""
        sizes = zip((error.natural_frequency, error.damping), _LEAST_ERRORS, self.groups, strict=False)
        parts = [
            max(size, least) * scale if sd is None else np.hypot(sd, size * scale)
            for size, least, (_, sd, scale) in sizes
        ]
        return np.concatenate(parts)

    def split(self, numbers: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Split numbers of the table (m,) into those of frequencies and, if there are any, those of damping ratios."""
        return np.split(numbers, len(self.measured.frequency) * np.arange(1, len(self.groups)))

    def with_error(self, error: ModelError) -> _ModalResiduals:
        """Return the same residuals with other errors allowed."""
        other = copy(self)
        other.deviation = self.deviations(error)
        return other

    def poles(
        self, theta: NDArray[np.float64], *, differentiate: bool = False
    ) -> Iterator[tuple[NDArray[Any], NDArray[Any]]]:
        """Yield the model's poles (k,) for each row of theta (n, p), and their derivatives (k, p) by the parameters."""
        count = 2 * len(self.measured.frequency) + _SETTINGS.further_modes
        highest = _SETTINGS.reach * float(self.measured.frequency[-1])
        by_joint = self.assembly.by_joint(theta)
        turn = _SETTINGS.least_turn
        for poles in self.modes.at(by_joint, count, highest=highest, least_turn=turn, differentiate=differentiate):
            none = np.zeros((len(poles.values), theta.shape[1]), dtype=np.complex128)
            changes = poles.derivatives.items()
            yield poles.values, sum((change @ self._slopes[name].T for name, change in changes), none)

    def matched(self, poles: NDArray[np.complex128]) -> NDArray[np.intp]:
        """Return the pole of each mode of the table, -1 for none, by the least sum of log distances."""
        pole_of_mode = np.full(len(self.measured.frequency), -1, dtype=np.intp)
        distance = np.abs(np.log(self.measured.frequency[:, None] * 2.0 * np.pi / np.abs(poles)))
        rows, columns = linear_sum_assignment(distance)
        pole_of_mode[rows] = columns
        return pole_of_mode

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at fractions of the ranges (n, p)."""
        return np.stack([residuals for residuals, _ in self._at(fraction, differentiate=False)])

    def linearise(self, fraction: NDArray[np.float64]) -> Linearisation:
        """Return residuals and derivatives at fractions of the ranges (n, p)."""
        residuals, jacobians = zip(*self._at(fraction, differentiate=True), strict=True)
        return Linearisation(np.stack(residuals), np.stack(jacobians))

    def _at(
        self, fraction: NDArray[np.float64], *, differentiate: bool
    ) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        theta = self.assembly.from_unit(fraction)
        slopes = np.stack(
            [p.slope(column) for p, column in zip(self.assembly.parameters, theta.T, strict=True)], axis=1
        )
        for slope, (poles, derivatives) in zip(slopes, self.poles(theta, differentiate=differentiate), strict=True):
            # a mode that the model lacks has the frequency and the damping 0
            matched = self.matched(poles)
            s, ds = np.append(poles, 0.0)[matched], np.vstack([derivatives * slope, np.zeros_like(slope)])[matched]
            size = np.maximum(np.abs(s), np.finfo(float).tiny)
            of_size = (np.conj(s)[:, None] * ds).real / size[:, None]
            values, jacobian = [np.abs(s) / (2.0 * np.pi)], [of_size / (2.0 * np.pi)]
            if len(self.groups) == 2:
                values.append(-s.real / size)
                jacobian.append((-ds.real + (s.real / size)[:, None] * of_size) / size[:, None])
            residuals = (np.concatenate(values) - self.target) / self.deviation
            yield residuals, (np.concatenate(jacobian) / self.deviation[:, None]).T


def identify_from_modes(
    assembly: Assembly,
    measured: ModalParameters,
    *,
    form: Form = "samples",
    samples: int = 200,
    model_error: float | None = None,
    seed: int | None = None,
    progress: Progress = silent,
) -> ModalIdentification:
    """Fit the joint to natural frequencies and damping ratios, and estimate the posterior of its parameters.

    Parameters
    ----------
    assembly : Assembly
    measured : ModalParameters
        Modes may be missing; what is there belongs to the model's nearest modes, each to one.
    form, samples, seed
        As in the method "posterior".
    model_error : float, optional
        Relative error of natural frequencies that the model is allowed, in addition to the deviations in the table;
        by default what the table shows, and 5e-4 at least.
    progress : Progress
        Called after the searches, and at the end.

    Raises
    ------
    MeasurementError
        The table has more modes than the model.
    DovetailError
        The assembly has no matrices, or too many DOFs.
    """
    check_options(samples, form)
    check_limits(model_error)
    began = time.perf_counter()
    seed = assembly.description.identification.seed if seed is None else seed
    residuals = _ModalResiduals(assembly, measured, _SETTINGS.rough)
    middle, count = assembly.from_unit(np.full((1, len(assembly.parameters)), 0.5)), len(measured.frequency)
    (poles,) = residuals.modes.at(assembly.by_joint(middle), count, differentiate=False)
    if len(poles.values) < count:
        problem = f"the table has {count} modes, the model of '{assembly.name}' has {len(poles.values)}."
        raise MeasurementError(Fault(measured.label, problem, remedy="Leave out those that are no bending modes."))
    ends = _search(residuals, np.random.default_rng([seed, 7]))
    progress("searching", 1, 2)
    allowed = None if model_error is None else typical_model_error(model_error)
    error = TYPICAL if allowed is None else allowed
    for _ in range(_SETTINGS.rounds):
        residuals = residuals.with_error(error)
        ends = maximise_posterior(PosteriorResiduals(residuals), ends, tolerance=1e-4)
        freedom = _freedom(residuals, ends[0])
        shown = _shown(residuals, ends[0], freedom)
        error = shown if allowed is None else allowed
    residuals = residuals.with_error(error)
    ends = maximise_posterior(PosteriorResiduals(residuals), ends, tolerance=1e-4)
    z, weight, unreliable = draw(PosteriorResiduals(residuals), ends, form, samples, seed)
    posterior = Posterior.from_fractions(
        assembly.parameters,
        unit_from_normal(z),
        weight,
        model_error=error,
        searches=samples,
        lines=len(residuals.target),
        seconds=time.perf_counter() - began,
    )
    best = assembly.from_unit(unit_from_normal(ends[0]))
    names = tuple(name for name, failed in zip(posterior.names, unreliable, strict=True) if failed)
    posterior = replace(posterior, form=form, mode=best if form == "laplace" else None, unreliable=names)
    progress("searching", 2, 2)
    adequacy = _judged(shown, sum(freedom), model_error, has_deviations=measured.frequency_sd is not None)
    return _result(residuals, best, posterior, adequacy, sum(freedom), seed)


def _search(residuals: _ModalResiduals, random: np.random.Generator) -> NDArray[np.float64]:
    """Return the distinct ends of searches from all over the ranges, (n, p) normal quantiles, the best first."""
    rough = PosteriorResiduals(residuals)
    cube = scipy.stats.qmc.LatinHypercube(len(residuals.assembly.parameters), rng=random).random(8 * _SETTINGS.starts)
    points = normal_from_unit(cube)
    best = np.argsort(np.sum(rough.residuals(points) ** 2, axis=1))[: _SETTINGS.starts]
    ends = maximise_posterior(rough, points[best], tolerance=1e-2)
    cost = np.sum(rough.residuals(ends) ** 2, axis=1)
    near = ends[cost < cost[0] + _SETTINGS.region]
    apart = np.abs(near[:, None] - near).max(axis=2) + np.triu(np.ones((len(near),) * 2))
    return np.asarray(near[(apart > _SETTINGS.apart).all(axis=1)])


def _freedom(residuals: _ModalResiduals, z: NDArray[np.float64]) -> list[float]:
    """Return the degrees of freedom of the frequencies, and those of the damping ratios."""
    jacobian = PosteriorResiduals(residuals).linearise(z[None])[1]
    tangent = np.linalg.qr(jacobian[0].T)[0]
    return [float(np.sum(1.0 - part)) for part in residuals.split(np.sum(tangent**2, axis=1)[len(z) :])]


def _shown(residuals: _ModalResiduals, z: NDArray[np.float64], freedom: list[float]) -> ModelError:
    """Return the errors that explain the residuals of a best fit."""
    remains = residuals.split(residuals.residuals(unit_from_normal(z)[None])[0] * residuals.deviation)
    assumed = (_SETTINGS.assumed.natural_frequency, _SETTINGS.assumed.damping)
    groups = zip(remains, residuals.groups, freedom, _LEAST_ERRORS, assumed, strict=False)
    sizes = [_size(off, sd, scale, *known) for off, (_, sd, scale), *known in groups]
    return ModelError(sizes[0], damping=sizes[1] if len(sizes) == 2 else 0.0)


def _size(off: Any, sd: Any, scale: Any, freedom: float, least: float, assumed: float) -> float:
    """Return the relative error with which, added to the stated ones, chi-squared equals the degrees of freedom."""
    if freedom < _LEAST_FREEDOM:
        return assumed if sd is None else least

    def excess(size: float) -> float:
        return float(np.sum(off**2 / ((0.0 if sd is None else sd**2) + (size * scale) ** 2)) - freedom)

    size = float(brentq(excess, least, 1e6)) if excess(least) > 0.0 else least
    if sd is not None:
        return size
    tails = scipy.stats.t.ppf((1.0 + LEVEL) / 2.0, [freedom, np.inf])  # estimated from few modes, it may be far larger
    return max(size, min(size * float(tails[0] / tails[1]), assumed))


def _judged(shown: ModelError, freedom: float, allowed: float | None, *, has_deviations: bool) -> Adequacy:
    """Return how well the model explains a table, from the errors that it shows."""
    sizes = (shown.natural_frequency, shown.damping)
    plain = has_deviations and all(a <= b for a, b in zip(sizes, _LEAST_ERRORS, strict=True))
    adequacy = Adequacy("to the noise" if plain else word_for(shown), None if plain else shown, allowed)
    if adequacy.fits and freedom < 1.0:  # not one value more than unknowns
        return Adequacy("not judged", allowed=allowed, reasons=(NOTHING_LEFT,))
    return adequacy


def _matched_modes(residuals: _ModalResiduals, best: NDArray[np.float64]) -> tuple[MatchedMode, ...]:
    """Return the modes of the model with SI parameters (p,), up to the last of the table, with those of the table."""
    measured, ((poles, _),) = residuals.measured, residuals.poles(best[np.newaxis])
    row_of = {int(pole): row for row, pole in enumerate(residuals.matched(poles))}
    columns = [[] if values is None else values.tolist() for values in (measured.frequency, measured.damping_ratio)]
    modes = []
    for pole, s in enumerate(poles[: max(row_of) + 1].tolist()):
        known = [column[row_of[pole]] if pole in row_of and column else None for column in columns]
        modes.append(MatchedMode(abs(s) / (2.0 * np.pi), -s.real / abs(s), *known))
    return tuple(modes)


def _result(
    residuals: _ModalResiduals,
    best: NDArray[np.float64],
    posterior: Posterior,
    adequacy: Adequacy,
    freedom: float,
    seed: int,
) -> ModalIdentification:
    assembly, measured = residuals.assembly, residuals.measured
    off = residuals.residuals(assembly.to_unit(best)[None])[0]
    origin = provenance(assembly, [measured], seed) | {"posterior_form": posterior.form}
    result = ModalIdentification(
        parameters=identified_parameters(assembly, best),
        known={name: at for name, at in known_parameters(assembly).items() if np.isfinite(at)},
        measured=measured,
        modes=_matched_modes(residuals, best),
        chi_squared=float(off @ off) / freedom if freedom >= _LEAST_FREEDOM else None,
        degrees_of_freedom=freedom,
        adequacy=adequacy,
        posterior=posterior,
        warnings=(),
        provenance=origin,
    )
    return replace(result, warnings=_warnings(result))


def _warnings(result: ModalIdentification) -> tuple[str, ...]:
    """Return the warnings that a reader of the result must know."""
    measured, error = result.measured, result.posterior.model_error
    lacking = [f"{mode.natural_frequency:.6g}" for mode in result.modes if mode.measured_frequency is None]
    words = [f"The table lacks modes that the model has: {listing(lacking)} Hz."] if lacking else []
    if measured.frequency_sd is None or (measured.damping_ratio is not None and measured.damping_sd is None):
        damping = "" if measured.damping_ratio is None else f" and {100.0 * error.damping:.2g} % of a damping ratio"
        size = f"{100.0 * error.natural_frequency:.2g} % of a natural frequency{damping}"
        words.append(f"The table does not state all its errors: {size} were assumed, by what remains of the fit.")
    return (*words, *result.posterior.warnings)
