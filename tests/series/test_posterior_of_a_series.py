"""Posteriors of series against closed forms and grids: shared, free, law and varying parameters, and the evidence."""

import numpy as np
import pytest

from dovetail.registry import installed_components
from dovetail.series import sampling
from dovetail.series.description import Role
from dovetail.series.fitting import fit_series
from dovetail.series.residuals import SeriesResiduals
from dovetail.series.sampling import _Sampler, sample_series
from dovetail.series.unknowns import SeriesUnknowns
from support.mounts_in_series import NORMAL, mount, series

LINES = np.arange(140.0, 181.0, 4.0)
LAWS = installed_components()
SCATTER = Role("varying", scatter=(1e-3, 0.3))


def role(name):
    return Role("law", LAWS.create("law", name), "level")


def sampled(described, fitted, samples=400):
    unknowns = SeriesUnknowns(described)
    fit = fit_series(unknowns, fitted)
    return unknowns, sample_series(unknowns, fitted, fit, samples=samples)


def gaussian(unknowns, fitted, at):
    """Mean, covariance and log evidence of the unknowns if the residuals are linear about `at` (d,)."""
    likelihoods = [test.likelihood() for test in fitted]
    exact = SeriesResiduals(unknowns, [one.marginalised for one in likelihoods])
    step = 1e-3 * np.eye(len(at))
    count = unknowns.count
    residuals = exact.residuals(at[np.newaxis])[0, count:]
    jacobian = (exact.residuals(at + step) - exact.residuals(at - step))[:, count:].T / 2e-3
    residuals = residuals - jacobian @ at
    covariance = np.linalg.inv(np.eye(count) + jacobian.T @ jacobian)
    spread = np.eye(len(residuals)) + jacobian @ jacobian.T
    square = residuals @ np.linalg.solve(spread, residuals)
    log_evidence = sum(one.log_constant for one in likelihoods) - (square + np.linalg.slogdet(spread)[1]) / 2.0
    return -covariance @ jacobian.T @ residuals, covariance, log_evidence


LINEAR = {
    "shared": {"k": Role("shared"), "c": Role("shared")},
    "free": {},
    "one of each": {"k": Role("shared")},
    "laws": {"k": role("linear"), "c": role("constant")},
}


@pytest.mark.parametrize("roles", LINEAR)
def test_samples_and_evidence_of_a_linear_series_are_those_of_the_closed_form(roles):
    assembly = mount(NORMAL, LINES)
    truths = [{"k": 1.0001e6, "c": 20.02}, {"k": 0.9999e6, "c": 19.97}, {"k": 1.0002e6, "c": 20.0}]
    unknowns, posterior = sampled(*(found := series(assembly, truths, LINEAR[roles], 0.02)))
    mean, covariance, log_evidence = gaussian(unknowns, found[1], np.zeros(unknowns.count))
    assert posterior.search_efficiency > 0.9
    centred = (posterior.z - mean) @ np.linalg.cholesky(np.linalg.inv(covariance))
    assert np.abs(posterior.weight @ centred).max() < 4.0 / np.sqrt(posterior.effective_sample_size)
    np.testing.assert_allclose(posterior.weight @ centred**2, 1.0, atol=5.0 * np.sqrt(2.0 / 380.0))
    assert posterior.evidence.log == pytest.approx(log_evidence, abs=0.02)
    assert posterior.evidence.error < 0.02


def test_annealed_draws_of_the_prior_find_what_the_searches_missed(monkeypatch):
    """Three ends of searches, of which one counts, with an e^20th of the marginal likelihood."""
    search = _Sampler.search

    def found_little(sampler, count):
        points, log_density = search(sampler, count)
        rows = np.arange(count) % 3
        return points.at_rows(rows), log_density[rows] + 20.0 + 5.0 * rows

    monkeypatch.setattr(_Sampler, "search", found_little)
    truths = [{"k": 1.0001e6, "c": 20.02}, {"k": 0.9999e6, "c": 19.97}, {"k": 1.0002e6, "c": 20.0}]
    unknowns, posterior = sampled(*(found := series(mount(NORMAL, LINES), truths, LINEAR["shared"], 0.02)))
    mean, covariance, log_evidence = gaussian(unknowns, found[1], np.zeros(unknowns.count))
    centred = (posterior.z - mean) @ np.linalg.cholesky(np.linalg.inv(covariance))
    assert np.abs(posterior.weight @ centred).max() < 0.3
    np.testing.assert_allclose(posterior.weight @ centred**2, 1.0, atol=0.4)
    assert posterior.effective_sample_size > 100
    assert posterior.evidence is None
    assert posterior.least_log_evidence == pytest.approx(log_evidence + np.log(0.01), abs=1.0)


@pytest.mark.parametrize(("ended", "moved"), [(279, True), (281, False)])
def test_samples_of_searches_of_which_many_find_no_end_are_moved(monkeypatch, ended, moved):
    """Of 400, whose weights are even."""
    search, move, calls = _Sampler.search, sampling.move_by_weight, []

    def found(sampler, count):
        points, log_density = search(sampler, count)
        return points.at_rows(np.arange(ended)), log_density[:ended]

    def watched(*arguments):
        calls.append(arguments[1].complete)
        return move(*arguments)

    monkeypatch.setattr(_Sampler, "search", found)
    monkeypatch.setattr(sampling, "move_by_weight", watched)
    truths = [{"k": 1.0001e6, "c": 20.02}, {"k": 0.9999e6, "c": 19.97}]
    _, posterior = sampled(*series(mount(NORMAL, LINES), truths, LINEAR["shared"], 0.02))
    assert calls == ([False] if moved else [])
    assert len(posterior.z) == (400 if moved else ended)


def test_the_scatter_and_the_evidence_are_those_of_integration_over_the_scatter():
    """Given the standard deviation the series is linear; a grid over it gives the rest."""
    assembly = mount(NORMAL, LINES)
    truths = [{"k": 1e6 * (1.0 + 1e-4 * u), "c": 20.0} for u in (-2.0, 1.5, 0.3, -0.7, 1.2, 0.4)]
    unknowns, posterior = sampled(*(found := series(assembly, truths, {"k": SCATTER, "c": Role("shared")}, 0.01)))
    (column,) = unknowns.scatter_columns
    grid, masses, means = np.linspace(-4.0, 4.0, 161), [], []
    for z in grid:
        at = np.zeros(unknowns.count)
        at[column] = z
        others = np.arange(unknowns.count) != column
        mean, _, log_evidence = conditional(unknowns, found[1], at, others)
        masses.append(log_evidence - z**2 / 2.0 - np.log(2.0 * np.pi) / 2.0)
        means.append(mean)
    highest = max(masses)
    share = np.exp(np.array(masses) - highest)
    log_evidence = highest + np.log(share.sum() * (grid[1] - grid[0]))
    share /= share.sum()
    error = 1.0 / np.sqrt(posterior.effective_sample_size)
    for power in (1, 2):
        spread = np.sqrt(share @ grid ** (2 * power) - (share @ grid**power) ** 2)
        assert abs(posterior.weight @ posterior.z[:, column] ** power - share @ grid**power) < 4.0 * spread * error
    assert posterior.evidence.log == pytest.approx(log_evidence, abs=max(0.02, 4.0 * posterior.evidence.error))
    assert posterior.evidence.error < 0.05
    common = share @ np.array(means)[:, 0]
    spread = np.sqrt(posterior.weight @ (posterior.z[:, 0] - common) ** 2)
    assert abs(posterior.weight @ posterior.z[:, 0] - common) < 4.0 * spread * error


def conditional(unknowns, fitted, at, free):
    """As `gaussian`, of some of the unknowns at given values of the others."""
    likelihoods = [test.likelihood() for test in fitted]
    exact = SeriesResiduals(unknowns, [one.marginalised for one in likelihoods])
    steps, count = 1e-3 * np.eye(len(at))[free], unknowns.count
    residuals = exact.residuals(at[np.newaxis])[0, count:]
    jacobian = (exact.residuals(at + steps) - exact.residuals(at - steps))[:, count:].T / 2e-3
    covariance = np.linalg.inv(np.eye(len(steps)) + jacobian.T @ jacobian)
    spread = np.eye(len(residuals)) + jacobian @ jacobian.T
    square = residuals @ np.linalg.solve(spread, residuals)
    log_evidence = sum(one.log_constant for one in likelihoods) - (square + np.linalg.slogdet(spread)[1]) / 2.0
    return -covariance @ jacobian.T @ residuals, covariance, log_evidence


CURVED = {
    "k": {"range": ["5e5 N/m", "2e6 N/m"], "scale": "log"},
    "c": {"range": ["2 N s/m", "200 N s/m"], "scale": "log"},
}


def test_a_curved_posterior_of_two_tests_is_that_of_a_grid():
    """A shared stiffness and two dampings from eight noisy lines each: the grid has three dimensions."""
    assembly = mount(CURVED, np.linspace(60.0, 300.0, 8))
    truths = [{"k": 1e6, "c": 80.0}, {"k": 1e6, "c": 160.0}]
    unknowns, posterior = sampled(*(found := series(assembly, truths, {"k": Role("shared")}, 1.0)), samples=1000)
    likelihoods = [test.likelihood() for test in found[1]]
    exact = SeriesResiduals(unknowns, [one.marginalised for one in likelihoods])
    axes = []
    for z in posterior.z.T:
        middle = posterior.weight @ z
        axes.append(middle + np.sqrt(posterior.weight @ (z - middle) ** 2) * np.linspace(-7.0, 9.0, 60))
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    volume = np.prod([axis[1] - axis[0] for axis in axes]) / (2.0 * np.pi) ** 1.5
    density = (
        sum(one.log(part) + one.log_constant for one, part in zip(likelihoods, exact.fractions(points), strict=True))
        - (points**2).sum(axis=1) / 2.0
    )
    share = np.exp(density - density.max())
    log_evidence = np.log(share.sum() * volume) + density.max()
    assert posterior.evidence.log == pytest.approx(log_evidence, abs=max(0.03, 4.0 * posterior.evidence.error))
    share /= share.sum()
    for column in range(3):
        order = np.argsort(points[:, column], kind="stable")
        for level in (0.05, 0.5, 0.95):
            end = np.interp(level, np.cumsum(share[order]), points[order, column])
            below = posterior.weight[posterior.z[:, column] <= end].sum()
            tolerance = 4.0 * np.sqrt(level * (1.0 - level) / posterior.effective_sample_size) + 0.01
            assert below == pytest.approx(level, abs=tolerance), (column, level)


def test_the_likelihood_of_an_exact_model_is_the_density_of_the_measured_values():
    assembly = mount(NORMAL, LINES)
    _, (test,) = series(assembly, [{"k": 1e6, "c": 20.0}], {}, 0.02)
    likelihood, frf = test.likelihood(), test.problem.measured[0]
    fraction = np.array([[0.3, 0.6]])
    difference = np.abs(frf.values - likelihood.frf(fraction)[0]) ** 2
    density = -np.sum(difference / frf.variance + np.log(np.pi * frf.variance))
    assert likelihood.log(fraction)[0] + likelihood.log_constant == pytest.approx(density)


def test_samples_follow_even_if_no_search_converges(monkeypatch):
    """They are moved from the normal approximation at the mode."""
    from dovetail.series.tangent_map import ArrowTangentMap

    searched = ArrowTangentMap.solve

    def none_converged(self, *arguments, **options):
        ends, converged = searched(self, *arguments, **options)
        return ends, np.zeros_like(converged)

    monkeypatch.setattr(ArrowTangentMap, "solve", none_converged)
    truths = [{"k": 1.0001e6, "c": 20.02}, {"k": 1.0001e6, "c": 20.02}]
    unknowns, posterior = sampled(*(found := series(mount(NORMAL, LINES), truths, LINEAR["shared"], 0.02)))
    mean, covariance, _ = gaussian(unknowns, found[1], np.zeros(unknowns.count))
    spread = np.sqrt(np.diagonal(covariance))
    assert posterior.weight @ posterior.z == pytest.approx(mean, abs=0.3 * spread.max())
    assert posterior.z.std(axis=0) == pytest.approx(spread, rel=0.2)
