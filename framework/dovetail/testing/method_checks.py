"""Checks of methods of identification, with an oscillator whose FRF is known in closed form."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
import yaml
from numpy.typing import NDArray

from dovetail.assembly import Assembly, load
from dovetail.errors import PluginError
from dovetail.frf import Frf
from dovetail.identification.application import checked_posterior
from dovetail.inference.adequacy.judgement import judge
from dovetail.inference.fitting import Fit, fit_at
from dovetail.inference.posterior import Posterior
from dovetail.interfaces import Estimate, IdentificationMethod, silent
from dovetail.problem import Problem
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.specimen import SEED, Specimen
from dovetail.testing.surroundings import observe

_MASS = 1.0
"""Of the oscillator [kg]."""
_TRUTH = np.array([2.0e6, 60.0])
_NOISE = 0.01
"""Standard deviation of real and imaginary part, relative to the magnitude."""
_CLOSE = 0.05
"""Largest relative error of an estimate's FRF."""

_DESCRIPTION = """\
dovetail: 1
name: oscillator
frequency: {start: 100 Hz, stop: 400 Hz, step: 2 Hz}
substructures:
  mass: {model: lumped, masses: [{mass: 1 kg}]}
  base: {model: ground}
joints:
  mount:
    model: spring_damper
    direction: x
    connect: {a: {to: mass, at: 0 mm}, b: {to: base, at: 0 mm}}
    parameters:
      k: {range: [1e6 N/m, 4e6 N/m], scale: log}
      c: {range: [20 N s/m, 200 N s/m], scale: linear}
responses:
"""
_RESPONSE = "  - {name: sensor%d, at: mass, position: 0 mm, direction: x, quantity: accelerance}\n"


@cache
def _assembly(responses: int) -> Assembly:
    """Return a mass on a spring and a damper, with one or more responses."""
    text = _DESCRIPTION + "".join(_RESPONSE % number for number in range(responses))
    return load(yaml.safe_load(text))


def _oscillator(theta: NDArray[np.float64], lines: NDArray[np.float64]) -> NDArray[np.complex128]:
    omega = 2.0 * np.pi * lines
    return np.asarray(-(omega**2) / (theta[:, :1] + 1j * omega * theta[:, 1:] - _MASS * omega**2))


@dataclass(frozen=True, eq=False)
class MethodSpecimen(Specimen):
    """A method, and measurements of an oscillator."""

    component: IdentificationMethod

    def problem(self, responses: int = 1, *, noise: float = _NOISE) -> Problem:
        """Return a problem of one or more measurements of the same oscillator."""
        random = np.random.default_rng(SEED)
        axes = [np.linspace(100.0, 400.0, 151 + 20 * number) for number in range(responses)]
        measured = []
        for axis in axes:
            exact = _oscillator(_TRUTH[np.newaxis], axis)[0]
            error = (
                noise * np.abs(exact) * (random.standard_normal(axis.shape) + 1j * random.standard_normal(axis.shape))
            )
            variance = 2.0 * (max(noise, 1e-6) * np.abs(exact)) ** 2
            measured.append(Frf(axis, exact + error, "accelerance", label="oscillator", variance=variance))
        problem = Problem.of(_assembly(responses).on(*axes), measured)
        return problem if self.component.fits_lines else replace(problem, network=lambda: Estimate(1.001 * _TRUTH))

    def estimate(self, problem: Problem | None = None) -> Estimate:
        """Return the method's estimate, after a check of its type."""
        estimate = self.component.identify(problem or self.problem(), seed=SEED, progress=silent)
        if not isinstance(estimate, Estimate):
            raise Nonconformity(f"identify returned {type(estimate).__name__}.", "Return a dovetail.Estimate.")
        return estimate

    def posterior(self, problem: Problem, estimate: Estimate) -> Posterior:
        """Return what the method's `sample` returns for a judged estimate, after the checks of an identification.

        Raises
        ------
        NotApplicable
            It is never called for this method.
        """
        if not (self.component.gives_posterior and self.component.fits_lines) or estimate.samples is not None:
            raise NotApplicable("it has no `sample` that is called once the estimate is judged.")
        fit = estimate if isinstance(estimate, Fit) else fit_at(problem, problem.to_unit(np.asarray(estimate.theta)))
        sampled = self.component.sample(problem, judge(problem, fit, seed=SEED), seed=SEED, progress=silent)
        try:
            return checked_posterior(problem, sampled, self.component)
        except PluginError as error:
            fault = error.faults[0]
            raise Nonconformity(fault.problem, f"Return {fault.accepted}.") from None

    def run(self, problem: Problem) -> None:
        """Call every part of the method, as an identification does."""
        estimate = self.estimate(problem)
        with suppress(NotApplicable):
            self.posterior(problem, estimate)

    @cached_property
    def first(self) -> Estimate:
        """The estimate for the standard problem."""
        return self.estimate()

    @cached_property
    def first_posterior(self) -> Posterior:
        """The posterior for the standard problem."""
        return self.posterior(self.problem(), self.first)


def check_the_estimate_is_within_the_ranges(specimen: MethodSpecimen) -> None:
    """`theta` and `samples` are finite vectors, in the order of the parameters and within their ranges."""
    estimate = specimen.first
    arrays = [("theta", np.asarray(estimate.theta)[np.newaxis])]
    if estimate.samples is not None:
        arrays.append(("samples", np.asarray(estimate.samples)))
    for name, array in arrays:
        if array.ndim != 2 or array.shape[1] != len(_TRUTH) or not np.isfinite(array).all():
            raise Nonconformity(
                f"{name} has the shape {array.shape} or is not finite.", "Return one number for each parameter."
            )
        for column, parameter in enumerate(_assembly(1).parameters):
            if np.any((array[:, column] < parameter.lower) | (array[:, column] > parameter.upper)):
                raise Nonconformity(f"{name}: {parameter.name} is outside its range.", "Clip to `lower` and `upper`.")


def check_an_oscillator_is_identified(specimen: MethodSpecimen) -> str:
    """From a measurement with 1 % noise, the FRF of an oscillator with two unknowns is estimated within 5 %."""
    error = _misfit(specimen.problem(noise=0.0), specimen.first)
    if error > _CLOSE:
        raise Nonconformity(f"the FRF of its estimate is off by {100 * error:.2g} %.", "Search longer.")
    return f"the FRF is off by {100 * error:.2g} %"


def check_several_measurements_are_used(specimen: MethodSpecimen) -> None:
    """Measurements of two responses with different lines are identified too."""
    problem = specimen.problem(2)
    error = _misfit(specimen.problem(2, noise=0.0), specimen.estimate(problem))
    if error > _CLOSE:
        raise Nonconformity(f"with two responses the FRF is off by {100 * error:.2g} %.", "Use `problem.values`.")


def check_the_same_seed_gives_the_same_estimate(specimen: MethodSpecimen) -> None:
    """The same problem and seed give the same estimate bit for bit."""
    again = specimen.estimate()
    if not np.array_equal(again.theta, specimen.first.theta):
        raise Nonconformity("two runs with the same seed differ.", "Draw all random numbers from default_rng(seed).")


def check_the_posterior_has_samples_of_the_parameters(specimen: MethodSpecimen) -> str:
    """`sample` returns a `Posterior` of the parameters: finite samples within the ranges, weights that add up to 1."""
    return f"{len(specimen.first_posterior.weight)} samples"


def check_the_same_seed_gives_the_same_posterior(specimen: MethodSpecimen) -> None:
    """The same problem, judged estimate and seed give the same posterior bit for bit."""
    first, again = specimen.first_posterior, specimen.posterior(specimen.problem(), specimen.first)
    if not (np.array_equal(first.theta, again.theta) and np.array_equal(first.weight, again.weight)):
        raise Nonconformity("two posteriors with the same seed differ.", "Draw all numbers from default_rng(seed).")


def check_samples_agree_with_the_estimate(specimen: MethodSpecimen) -> None:
    """If there are samples, of the estimate or of `sample`, the truth is not far outside of them."""
    if specimen.first.samples is None:
        posterior = specimen.first_posterior
        samples, weight = posterior.theta, posterior.weight
    else:
        samples = np.asarray(specimen.first.samples)
        weight = np.full(len(samples), 1.0 / len(samples))
    mean = weight @ samples
    deviation = np.sqrt(weight @ (samples - mean) ** 2)
    distance = np.abs(_TRUTH - mean) / np.maximum(deviation, 1e-12 * _TRUTH)
    if np.any(distance > 6.0):
        column = int(np.argmax(distance))
        name = _assembly(1).parameters[column].name
        problem = f"the truth of {name} is {distance[column]:.2g} standard deviations away."
        raise Nonconformity(problem, "Scale the samples' scatter to the measurement's random error.")


def check_inputs_are_left_unchanged(specimen: MethodSpecimen) -> None:
    """The arrays of the problem are not changed."""
    problem = specimen.problem()
    kept = problem.values.copy(), problem.variance.copy()
    specimen.run(problem)
    if not (np.array_equal(problem.values, kept[0]) and np.array_equal(problem.variance, kept[1])):
        raise Nonconformity("it changed the measurement.", "Compute with copies.")


def check_nothing_is_printed_or_changed(specimen: MethodSpecimen) -> None:
    """Identification prints nothing, and changes no global settings or random numbers."""
    seen = observe(lambda: specimen.run(specimen.problem()))
    changed = [*seen.generators, *seen.settings, *(["the standard output"] if seen.printed.strip() else [])]
    if changed:
        raise Nonconformity(f"it changes {', '.join(changed)}.", "Restore it; report through `progress`.")


def _misfit(exact: Problem, estimate: Estimate) -> float:
    """Return the relative error of the estimate's FRF, over all lines."""
    difference = exact.frf(np.asarray(estimate.theta, dtype=np.float64)[np.newaxis])[0] - exact.values
    return float(np.linalg.norm(difference) / np.linalg.norm(exact.values))
