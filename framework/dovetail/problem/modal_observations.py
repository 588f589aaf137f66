"""Natural frequencies and damping ratios as observations, and the model's as functions of the parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from dovetail.assembly import Assembly
from dovetail.errors import Fault, MeasurementError
from dovetail.measurement import ModalParameters
from dovetail.problem.definition import Problem, WithPrior
from dovetail.problem.least_squares import Linearisation
from dovetail.problem.observations import Observations, StackedResiduals
from dovetail.problem.residuals import ModelFrfs, Residual, Weighted
from dovetail.synthesis import DampedModes


@dataclass(frozen=True)
class Settings:
    """Constants of the comparison. Errors are relative: of natural frequencies, and of damping ratios."""

    least: tuple[float, float] = (5e-4, 0.05)
    """Smallest errors that are assumed."""
    assumed: tuple[float, float] = (5e-3, 0.3)
    """Errors of a table that gives none."""
    rough: tuple[float, float] = (0.03, 0.5)
    """Errors allowed in the first searches: the larger they are, the fewer local minima there are."""
    further_modes: int = 4
    """Modes of the model that are computed beyond twice those of the table, which may lack some."""
    reach: float = 1.5
    """Highest mode of the model that is computed, over the highest natural frequency of the table."""
    least_damping: float = 1e-4
    """Damping ratio to which relative errors of smaller ones refer."""
    least_turn: float = 0.5
    """Imaginary part of a pole over its magnitude below which no table has it: a damping ratio above 0.87."""


SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class ModelModes(ModelFrfs):
    """The natural frequencies of an assembly that belong to those of a table, and the damping ratios if it has them.

    Parameters
    ----------
    assemblies : (Assembly,)
    table : ModalParameters
    """

    table: ModalParameters

    @cached_property
    def combined(self) -> None:
        """No FRFs are computed."""

    @property
    def counts(self) -> tuple[int, ...]:
        """Numbers in the table."""
        return (len(self.table.frequency) * (1 if self.table.damping_ratio is None else 2),)

    def frf(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the numbers (n, m) at parameter vectors (n, n_params)."""
        return np.stack([numbers for numbers, _ in self._at(theta, differentiate=False)])

    def frf_jacobian(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the numbers (n, m) and their derivatives (n, m, n_params)."""
        numbers, derivatives = zip(*self._at(theta, differentiate=True), strict=True)
        return np.stack(numbers), np.stack(derivatives)

    def at(self, _lines: NDArray[np.intp]) -> ModelModes:
        """Return the same: a table has few numbers, all of which are compared."""
        return self

    def poles(
        self, theta: NDArray[np.float64], *, differentiate: bool = False
    ) -> Iterator[tuple[NDArray[Any], NDArray[Any]]]:
        """Yield the model's poles (k,) for each row of theta (n, p), and their derivatives (k, p) by the parameters."""
        count = 2 * len(self.table.frequency) + SETTINGS.further_modes
        highest, turn = SETTINGS.reach * float(self.table.frequency[-1]), SETTINGS.least_turn
        by_joint = self._assembly.by_joint(theta)
        for poles in self._damped.at(by_joint, count, highest=highest, least_turn=turn, differentiate=differentiate):
            none = np.zeros((len(poles.values), theta.shape[1]), dtype=np.complex128)
            changes = poles.derivatives.items()
            yield poles.values, sum((change @ self._slopes[name].T for name, change in changes), none)

    def matched(self, poles: NDArray[np.complex128]) -> NDArray[np.intp]:
        """Return the pole of each mode of the table, -1 for none, by the least sum of log distances."""
        pole_of_mode = np.full(len(self.table.frequency), -1, dtype=np.intp)
        distance = np.abs(np.log(self.table.frequency[:, None] * 2.0 * np.pi / np.abs(poles)))
        rows, columns = linear_sum_assignment(distance)
        pole_of_mode[rows] = columns
        return pole_of_mode

    def count_modes(self, theta: NDArray[np.float64]) -> int:
        """Return how many modes the model has at parameters (p,), up to as many as the table."""
        count = len(self.table.frequency)
        (poles,) = self._damped.at(self._assembly.by_joint(theta[np.newaxis]), count, differentiate=False)
        return len(poles.values)

    @property
    def _assembly(self) -> Assembly:
        (assembly,) = self.assemblies
        assert isinstance(assembly, Assembly)
        return assembly

    @cached_property
    def _damped(self) -> DampedModes:
        return DampedModes(self._assembly.graph)

    @cached_property
    def _slopes(self) -> dict[str, NDArray[np.float64]]:
        """Derivatives of all parameters of each joint by those that are identified."""
        count = len(self._assembly.parameters)
        fixed, moved = (self._assembly.by_joint(theta) for theta in (np.zeros((1, count)), np.eye(count)))
        return {name: moved[name] - fixed[name] for name in fixed}

    def _at(
        self, theta: NDArray[np.float64], *, differentiate: bool
    ) -> Iterator[tuple[NDArray[np.complex128], NDArray[np.complex128]]]:
        for poles, derivatives in self.poles(theta, differentiate=differentiate):
            # a mode that the model lacks has the frequency and the damping 0
            matched, lacking = self.matched(poles), np.zeros((1, theta.shape[1]))
            s, ds = np.append(poles, 0.0)[matched], np.vstack([derivatives, lacking])[matched]
            size = np.maximum(np.abs(s), np.finfo(float).tiny)
            size_jacobian = (np.conj(s)[:, None] * ds).real / size[:, None]
            numbers, jacobian = [np.abs(s) / (2.0 * np.pi)], [size_jacobian / (2.0 * np.pi)]
            if self.table.damping_ratio is not None:
                numbers.append(-s.real / size)
                jacobian.append((-ds.real + (s.real / size)[:, None] * size_jacobian) / size[:, None])
            yield np.concatenate(numbers).astype(complex), np.concatenate(jacobian).astype(complex)


@dataclass(frozen=True, eq=False)
class RealDifferences(Weighted):
    """Differences of real numbers over their standard deviation."""

    def of(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of the model's numbers (n, m)."""
        return np.asarray((frf.real - self.measured) * self.weight)

    def jacobian(self, _frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from those of the numbers."""
        return np.asarray(frf_jacobian.real * self.weight)

    def factored(self) -> tuple[None, Residual]:
        """Return no factors: the numbers are no FRFs."""
        return None, self


@dataclass(frozen=True, eq=False)
class ModalObservations(Observations):
    """A table of natural frequencies, with damping ratios if known: one group of numbers of each kind, and no FRF.

    Parameters
    ----------
    table : ModalParameters
    """

    table: ModalParameters = field(kw_only=True)

    @property
    def counts(self) -> tuple[int, ...]:
        """Numbers of each group."""
        return (len(self.table.frequency),) * (1 if self.table.damping_ratio is None else 2)

    @property
    def frequency(self) -> NDArray[np.float64]:
        """(m,) Hz; the natural frequency to which each number belongs."""
        return np.tile(self.table.frequency, len(self.counts))

    @cached_property
    def values(self) -> NDArray[np.complex128]:
        """(m,) natural frequencies [Hz], then damping ratios."""
        return self.amplitude.astype(np.complex128)

    @cached_property
    def amplitude(self) -> NDArray[np.float64]:
        """(m,) the same."""
        groups = [self.table.frequency, self.table.damping_ratio]
        return np.concatenate([group for group in groups if group is not None])

    @property
    def scales(self) -> list[NDArray[np.float64]]:
        """Numbers of each group to which relative errors refer."""
        groups = zip(self.split(self.amplitude), (0.0, SETTINGS.least_damping), strict=False)
        return [np.maximum(group, least) for group, least in groups]

    @property
    def deviations(self) -> list[NDArray[np.float64] | None]:
        """Standard deviations of each group in the table, None where it gives none."""
        return [self.table.frequency_sd, self.table.damping_sd][: len(self.counts)]

    @property
    def variance_known(self) -> bool:
        """Whether the table gives all its errors."""
        return all(deviation is not None for deviation in self.deviations)

    def variance(self, _model: NDArray[np.complex128] | None = None) -> NDArray[np.float64]:
        """Return the variance (m,) of each number: known, or assumed."""
        groups = zip(self.deviations, SETTINGS.assumed, strict=False)
        return self.variance_with([size if sd is None else 0.0 for sd, size in groups])

    def variance_with(self, errors: Sequence[float]) -> NDArray[np.float64]:
        """Return the variance (m,) of each number with relative errors of each group.

        They are in addition to those in the table; where it gives none, they are all errors, and not below the least.
        """
        groups = zip(self.deviations, self.scales, errors, SETTINGS.least, strict=False)
        return np.concatenate(
            [
                (max(size, least) * scale) ** 2 if sd is None else sd**2 + (size * scale) ** 2
                for sd, scale, size, least in groups
            ]
        )

    def assumed(self, variance: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return False for each number: errors that the table does not give are estimated."""
        return np.zeros(len(variance), dtype=np.bool_)

    def residual_count(self, used: NDArray[np.bool_]) -> int:
        """Return how many numbers are used."""
        return int(np.count_nonzero(used))

    def weighted(self, variance: NDArray[np.float64], used: NDArray[np.bool_]) -> StackedResiduals[Weighted]:
        """Return the whitened residuals."""
        differences = RealDifferences(self.amplitude, variance, used / np.sqrt(variance), has_phase=False)
        return StackedResiduals((differences,), (len(variance),))

    def logarithms(self, _variance: NDArray[np.float64]) -> Residual:
        """Return residuals with few local minima, for the search."""
        rough = self.variance_with(SETTINGS.rough)
        return self.weighted(rough, np.ones(len(rough), dtype=np.bool_))

    def at(self, _lines: NDArray[np.intp]) -> ModalObservations:
        """Return the same: a table has few numbers, all of which are compared."""
        return self


@dataclass(frozen=True, eq=False)
class ModalProblem(Problem):
    """A table of natural frequencies, and an assembly whose parameters are to be identified from it."""

    observations: ModalObservations

    @staticmethod
    def from_table(assembly: Assembly, table: ModalParameters) -> ModalProblem:
        """Return the problem of a table.

        Raises
        ------
        MeasurementError
            The table has more modes than the model.
        DovetailError
            The assembly has no matrices, or too many DOFs.
        """
        problem, count = ModalProblem(assembly, ModalObservations((), table=table)), len(table.frequency)
        modelled = problem.model.count_modes(assembly.from_unit(np.full(len(assembly.parameters), 0.5)))
        if modelled < count:
            text = f"the table has {count} modes, the model of '{assembly.name}' has {modelled}."
            raise MeasurementError(Fault(table.label, text, remedy="Leave out those that are not bending modes."))
        return problem

    @cached_property
    def model(self) -> ModelModes:
        """The model's numbers as functions of the parameters."""
        return ModelModes((self.assembly,), self.observations.table, limit=self.limit)

    def allowing(self, errors: Sequence[float]) -> WithPrior:
        """Return residuals with relative errors of each group, followed by the parameters' normal quantiles.

        A table often has fewer numbers than there are unknowns; then the prior decides.
        """
        normal = [replace(parameter, prior="normal") for parameter in self.parameters]
        return WithPrior(self.weighted(self.observations.variance_with(errors)), normal)

    def freedom(self, fraction: NDArray[np.float64], linear: Linearisation) -> float:
        """Return the degrees of freedom: numbers, less those that parameters can follow."""
        return sum(self.freedom_of_groups(fraction, linear))

    def freedom_of_groups(self, fraction: NDArray[np.float64], linear: Linearisation) -> list[float]:
        """Return the degrees of freedom of each group at fractions of the ranges (p,)."""
        pairs = zip(self.parameters, fraction, strict=True)
        prior = np.diag([float(parameter.normal_residual(part)[1]) for parameter, part in pairs])
        tangent = np.linalg.qr(np.concatenate([prior, linear.jacobian[0].T]))[0][len(prior) :]
        return [float(np.sum(1.0 - part)) for part in self.observations.split(np.sum(tangent**2, axis=1))]
