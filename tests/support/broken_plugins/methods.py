"""Sound methods, and one with a single fault for each check of the kit that methods have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from dovetail import Estimate, IdentificationMethod, laplace_posterior, silent
from support.broken_plugins.lists import also_breaks, breaks


class SoundMethod(IdentificationMethod):
    """Least squares from the best of a few hundred random candidates, with samples of the linearised posterior."""

    name = "sound_method"
    summary = "Least squares from a random start"

    def identify(self, problem, *, seed, progress=silent):
        """Search, and draw samples around the best fit."""
        random = self.generator(seed)
        count = len(problem.parameters)

        def si(fractions):
            columns = [p.from_unit(np.clip(x, 0.0, 1.0)) for p, x in zip(problem.parameters, fractions.T, strict=True)]
            return np.stack([np.clip(x, p.lower, p.upper) for p, x in zip(problem.parameters, columns, strict=True)], 1)

        values, weight = self.measured(problem), np.sqrt(2.0 / problem.variance)

        def residuals(fraction):
            difference = (problem.frf(si(fraction[None]))[0] - values) * weight
            return np.concatenate([difference.real, difference.imag])

        candidates = random.random((400, count))
        start = candidates[np.argmin([np.sum(np.log1p(residuals(one) ** 2)) for one in candidates])]
        found = least_squares(residuals, start, bounds=(0.0, 1.0))
        covariance = np.linalg.inv(found.jac.T @ found.jac + 12.0 * np.eye(count))
        drawn = random.multivariate_normal(self.middle(found.x), covariance, size=200)
        return Estimate(self.finished(si(found.x[None])[0]), si(drawn))

    def generator(self, seed):
        """Return the random numbers."""
        return np.random.default_rng(seed)

    def measured(self, problem):
        """Return what is fitted."""
        return problem.values

    def middle(self, fraction):
        """Return where samples scatter."""
        return fraction

    def finished(self, theta):
        """Return the estimate."""
        return theta


@breaks("the_estimate_is_within_the_ranges")
class Outside(SoundMethod):
    """Leaves the ranges."""

    def finished(self, theta):
        """Return a tenth."""
        return 0.01 * theta


@breaks("an_oscillator_is_identified")
class Guessing(SoundMethod):
    """Searches without the measurement where there is one response."""

    def finished(self, theta):
        """Return something else."""
        return theta * np.array([1.1, 1.0]) if not self.config_of_two else theta

    config_of_two = False

    def measured(self, problem):
        """Note whether there are two responses, for this call alone."""
        object.__setattr__(self, "config_of_two", len(problem.measured) == 2)
        return problem.values


@breaks("several_measurements_are_used")
class FirstAlone(SoundMethod):
    """Takes the first measurement for all lines."""

    def measured(self, problem):
        """Repeat the first measurement."""
        return np.resize(problem.measured[0].values, problem.variance.size)


@breaks("the_same_seed_gives_the_same_estimate")
class Unseeded(SoundMethod):
    """Draws from the clock."""

    def generator(self, seed):
        """Take no notice of the seed."""
        return np.random.default_rng()

    def finished(self, theta):
        """Return an estimate that shows it."""
        return theta * (1.0 + 1e-9 * np.random.default_rng().random())


@breaks("samples_agree_with_the_estimate")
class Elsewhere(SoundMethod):
    """Samples of another place than the estimate's."""

    def middle(self, fraction):
        """Return the other end."""
        return 1.0 - fraction


@breaks("inputs_are_left_unchanged")
class Overwriting(SoundMethod):
    """Writes into the variance."""

    def measured(self, problem):
        """Double the variance."""
        problem.variance[...] *= 2.0
        return problem.values


@breaks("nothing_is_printed_or_changed")
class Printing(SoundMethod):
    """Prints while it searches."""

    def measured(self, problem):
        """Print the number of lines."""
        print(problem.variance.size)
        return problem.values


class SoundPosterior(SoundMethod):
    """The same search, and the Laplace approximation once the fit is judged."""

    gives_posterior = True

    def identify(self, problem, *, seed, progress=silent):
        """Return the estimate alone."""
        return Estimate(super().identify(problem, seed=seed, progress=progress).theta)

    def sample(self, problem, judged, *, seed, progress=silent):
        """Return samples of a Gaussian."""
        self.parameters = problem.parameters
        return self.changed(laplace_posterior(problem, judged.fit, samples=100, seed=seed, progress=progress))

    def changed(self, posterior):
        """Return the posterior."""
        return posterior


@breaks("the_posterior_has_samples_of_the_parameters")
class Weightless(SoundPosterior):
    """Weights that do not add up to 1."""

    def changed(self, posterior):
        """Return counts."""
        return replace(posterior, weight=100.0 * posterior.weight)


@also_breaks("the_posterior_has_samples_of_the_parameters")
class Unfinished(SoundPosterior):
    """A sample that is not a number."""

    def changed(self, posterior):
        """Lose the last sample."""
        theta = posterior.theta.copy()
        theta[-1] = np.nan
        return replace(posterior, theta=theta)


@also_breaks("the_posterior_has_samples_of_the_parameters")
class Array(SoundPosterior):
    """Samples without their weights."""

    def changed(self, posterior):
        """Return an array."""
        return posterior.theta


@also_breaks("the_posterior_has_samples_of_the_parameters")
class FewerWeights(SoundPosterior):
    """A weight too few."""

    def changed(self, posterior):
        """Lose the last weight."""
        return replace(posterior, weight=posterior.weight[:-1])


@also_breaks("the_posterior_has_samples_of_the_parameters")
class Misnamed(SoundPosterior):
    """The parameters in the other order."""

    def changed(self, posterior):
        """Exchange the names."""
        return replace(posterior, names=posterior.names[::-1])


@breaks("the_same_seed_gives_the_same_posterior")
class UnseededSamples(SoundPosterior):
    """Draws the samples from the clock."""

    def sample(self, problem, judged, *, seed, progress=silent):
        """Take no notice of the seed."""
        return super().sample(problem, judged, seed=int(np.random.default_rng().integers(1 << 30)), progress=progress)


@also_breaks("samples_agree_with_the_estimate")
class SampledElsewhere(SoundPosterior):
    """A posterior of another place than the estimate's."""

    def changed(self, posterior):
        """Mirror the samples in the middle of the ranges."""
        fraction = 1.0 - posterior.fraction
        theta = np.stack([p.from_unit(x) for p, x in zip(self.parameters, fraction.T, strict=True)], axis=1)
        return replace(posterior, theta=theta, fraction=fraction)


@also_breaks("nothing_is_printed_or_changed")
class PrintingSampler(SoundPosterior):
    """Prints while it samples."""

    def changed(self, posterior):
        """Print the number of samples."""
        print(len(posterior.theta))
        return posterior


@also_breaks("inputs_are_left_unchanged")
class OverwritingSampler(SoundPosterior):
    """Writes into the variance while it samples."""

    def sample(self, problem, judged, *, seed, progress=silent):
        """Double the variance afterwards."""
        posterior = super().sample(problem, judged, seed=seed, progress=progress)
        problem.variance[...] *= 2.0
        return posterior
