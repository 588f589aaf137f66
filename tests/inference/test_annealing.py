"""Annealed points find the parts of a posterior that lie far from its modes, and say how much the searches missed."""

import numpy as np
import pytest

from dovetail.inference.posterior import drawn_samples
from dovetail.inference.posterior.annealing import anneal
from dovetail.inference.posterior.drawn_samples import SearchEnds, move_by_weight
from dovetail.inference.posterior.evidence import Evidence
from dovetail.inference.posterior.metropolis import Chains
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints
from dovetail.inference.posterior.tangent_mixture import TangentMixture
from dovetail.inference.posterior.tangent_steps import Density
from dovetail.inference.posterior.weights import INDEPENDENT
from dovetail.interfaces import TimeLimit
from dovetail.problem.least_squares import Linearisation
from support.bent_valley import Bow

SIZE = 4


class PeakOnPlain:
    """A likelihood of 1 at a narrow peak and of a constant far from it, where nearly all of the posterior is.

    Parameters
    ----------
    plain : float
        Logarithm of the constant.
    """

    peak, width = np.array([1.0, -0.5, 0.3, 0.8]), 0.05

    def __init__(self, plain: float) -> None:
        self.plain = plain

    def residuals(self, z):
        away = (z - self.peak) / self.width
        squares = np.maximum(np.sum(away**2, axis=1), 1e-12)
        wanted = -2.0 * (np.logaddexp(-squares / 2.0, self.plain) - np.logaddexp(0.0, self.plain))
        return np.concatenate([z, away * np.sqrt(wanted / squares)[:, np.newaxis]], axis=1)

    def linearise(self, z):
        steps = 1e-6 * np.eye(SIZE)
        jacobian = [(self.residuals(z + step) - self.residuals(z - step)) / 2e-6 for step in steps]
        return Linearisation(self.residuals(z), np.stack(jacobian, axis=1))

    @property
    def parts(self):
        """Marginal likelihoods of the peak and of the plain."""
        variance = 1.0 + self.width**2
        density = np.exp(-np.sum(self.peak**2) / 2.0 / variance) * (self.width / np.sqrt(variance)) ** SIZE
        return np.array([density, np.exp(self.plain)]) / (1.0 + np.exp(self.plain))

    def is_on_plain(self, z):
        return np.sum((z - self.peak) ** 2, axis=1) > (8.0 * self.width) ** 2


def searched(posterior, random):
    """Searches about the peak, the only mode, without the ends of those that found the plain."""
    mode = LinearisedPoints.at(posterior, posterior.peak[np.newaxis])
    mixture = TangentMixture(posterior, mode, mode.z, random)
    mixture.sample(400, 400)
    near = np.flatnonzero(~posterior.is_on_plain(mixture.ends.z))
    mixture.ends, mixture._log_sum = mixture.ends.at_rows(near), mixture._log_sum[near]
    return mixture


@pytest.mark.parametrize("plain", [-3.0, -6.0])
def test_annealed_points_find_the_marginal_likelihood_and_the_posterior(plain):
    posterior = PeakOnPlain(plain)
    annealed = anneal(Density.of(posterior), SIZE, lambda: -np.inf, np.random.default_rng(1))
    assert annealed.log_evidence == pytest.approx(np.log(posterior.parts.sum()), abs=0.3)
    share = posterior.parts[1] / posterior.parts.sum()
    assert share > 0.99
    assert np.mean(posterior.is_on_plain(annealed.z)) > 0.95
    on_plain = annealed.z[posterior.is_on_plain(annealed.z)]
    assert np.abs(on_plain.mean(axis=0)).max() < 0.25  # five standard errors
    assert np.abs(on_plain.std(axis=0) - 1.0).max() < 0.2
    assert np.logaddexp.reduce(annealed.log_weight) == pytest.approx(annealed.log_evidence)


class Linear:
    """A measurement of linear functions of the coordinates, whose posterior is normal."""

    def __init__(self, random):
        self.slopes, self.values = 3.0 * random.standard_normal((5, SIZE)), 4.0 * random.standard_normal(5)

    def residuals(self, z):
        return np.concatenate([z, z @ self.slopes.T - self.values], axis=1)

    def linearise(self, z):
        jacobian = np.concatenate([np.eye(SIZE), self.slopes.T], axis=1)
        return Linearisation(self.residuals(z), np.broadcast_to(jacobian, (len(z), *jacobian.shape)))


@pytest.mark.parametrize("seed", range(3))
def test_annealed_points_of_a_normal_posterior_have_its_mean_and_covariance(seed):
    posterior = Linear(np.random.default_rng(seed))
    annealed = anneal(Density.of(posterior), SIZE, lambda: -np.inf, np.random.default_rng(seed))
    precision = np.eye(SIZE) + posterior.slopes.T @ posterior.slopes
    mean = np.linalg.solve(precision, posterior.slopes.T @ posterior.values)
    marginal = np.eye(5) + posterior.slopes @ posterior.slopes.T
    exact = -posterior.values @ np.linalg.solve(marginal, posterior.values) / 2.0 - np.linalg.slogdet(marginal)[1] / 2.0
    assert annealed.log_evidence == pytest.approx(exact, abs=1.0)
    white = (annealed.z - mean) @ np.linalg.cholesky(precision)
    assert np.abs(white.mean(axis=0)).max() < 0.25
    assert np.abs(np.cov(white.T) - np.eye(SIZE)).max() < 0.4


def test_samples_are_drawn_from_what_searches_missed():
    posterior, random = PeakOnPlain(-6.0), np.random.default_rng(2)
    ends = SearchEnds.of(searched(posterior, random))
    exact = np.log(posterior.parts.sum())
    assert ends.log_evidence < exact - 2.0
    moved = move_by_weight(Density.of(posterior), ends, 400, random)
    assert np.mean(posterior.is_on_plain(moved.z)) > 0.95
    assert np.abs(moved.z.std(axis=0) - 1.0).max() < 0.25
    assert moved.doubted(Evidence(ends.log_evidence, 0.1)) is None
    assert exact - 6.0 < moved.least_log_evidence < exact


def test_searches_that_missed_nothing_are_kept():
    posterior, random = PeakOnPlain(-30.0), np.random.default_rng(3)
    ends = SearchEnds.of(searched(posterior, random))
    assert ends.log_evidence == pytest.approx(np.log(posterior.parts[0]), abs=0.3)
    moved = move_by_weight(Density.of(posterior), ends, 400, random)
    assert not posterior.is_on_plain(moved.z).any()
    evidence = Evidence(ends.log_evidence, 0.1)
    assert moved.doubted(evidence) is evidence


@pytest.mark.parametrize(("anchor", "covered"), [(0.0, True), (0.8, False), (1.3, False)])
def test_annealed_points_are_no_starts_where_searches_reach_all_of_them(monkeypatch, anchor, covered):
    """Maps that are anchored beside the middle of the valley have folded over at its other end."""
    posterior, random, begun = Bow(), np.random.default_rng(5), []
    mode = LinearisedPoints.at(posterior, np.array([[anchor, anchor**2 - 1.0]]))
    mixture = TangentMixture(posterior, mode, mode.z, random)
    mixture.search(mode, 400)
    ends = SearchEnds.of(mixture)._replace(complete=True)
    np.testing.assert_allclose(mixture.log_weight_at(ends.z), ends.log_weight, atol=1e-9)

    def decorrelate(density, starts, random, progress, limit, correlation):
        begun.extend([starts, correlation])
        return Chains(density, starts, random, limit)

    monkeypatch.setattr(drawn_samples, "decorrelate", decorrelate)
    move_by_weight(Density.of(posterior), ends, 400, random)
    searched_for = np.isclose(begun[0][:, np.newaxis], ends.z).all(axis=2).any(axis=1)
    assert searched_for.all() == covered
    assert (begun[1] == INDEPENDENT) != covered


def test_annealing_ends_where_nearly_all_is_known_to_lie_elsewhere():
    counted = []

    class Counted(PeakOnPlain):
        def residuals(self, z):
            counted.append(len(z))
            return super().residuals(z)

    posterior = Counted(-200.0)
    assert anneal(Density.of(posterior), SIZE, lambda: -4.0, np.random.default_rng(4)) is None
    soon = len(counted)
    anneal(Density.of(posterior), SIZE, lambda: -np.inf, np.random.default_rng(4))
    assert soon < 0.6 * (len(counted) - soon)


def test_points_without_a_finite_frf_do_not_count():
    class HalfDefined(PeakOnPlain):
        def residuals(self, z):
            return np.where(z[:, :1] > 0.0, super().residuals(z), np.nan)

    annealed = anneal(Density.of(HalfDefined(-3.0)), SIZE, lambda: -np.inf, np.random.default_rng(6))
    assert (annealed.z[:, 0] > 0.0).all()
    assert annealed.log_evidence == pytest.approx(np.log(PeakOnPlain(-3.0).parts.sum() / 2.0), abs=0.3)


def test_a_posterior_that_is_too_narrow_is_left_to_searches():
    posterior = Linear(np.random.default_rng(0))
    posterior.slopes, posterior.values = 1e12 * posterior.slopes, 1e12 * posterior.values
    assert anneal(Density.of(posterior), SIZE, lambda: -np.inf, np.random.default_rng(7)) is None


def test_annealing_ends_when_time_is_over():
    over = TimeLimit(0.0)
    assert anneal(Density.of(PeakOnPlain(-3.0)), SIZE, lambda: -np.inf, np.random.default_rng(5), limit=over) is None
