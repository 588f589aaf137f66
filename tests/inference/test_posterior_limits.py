"""Sizes of the model's errors, limits of verdicts and the checks of the sampler: from both sides, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from dovetail.inference.posterior import ModelError, Posterior, error_shapes, tangent_steps, typical_model_error
from dovetail.inference.posterior.laplace import LaplaceApproximation
from dovetail.inference.posterior.likelihood import normal_from_unit, unit_from_normal
from dovetail.inference.posterior.mode_search import CubeResiduals
from dovetail.inference.posterior.model_error import Settings, fit_resonances
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints, TangentMap
from dovetail.problem.least_squares import Linearisation
from support.noisy_measurements import frf_on

FREQUENCY = np.linspace(100.0, 200.0, 501)
ALONE = Settings().individual
ALONE_IN_HEIGHT = Settings().individual_magnitude
HATS = np.stack([np.interp(FREQUENCY, np.linspace(100.0, 200.0, 6), height) for height in np.eye(6)])


def test_the_errors_of_a_flat_frf_have_the_given_sizes():
    """Of docs/uncertainty.md, over the error of natural frequencies: magnitude 20, phase 2; nothing else errs."""
    flat = np.full(501, 3.0 + 4.0j)
    shapes = error_shapes([frf_on(FREQUENCY)], [flat], typical_model_error(1e-3))
    assert not shapes["natural_frequency"].any()
    assert shapes["damping"].shape == shapes["higher"].shape == (0, 501)
    np.testing.assert_allclose(shapes["magnitude"], 20e-3 * HATS * flat, rtol=1e-9)
    np.testing.assert_allclose(shapes["phase"], 2e-3j * HATS * flat, rtol=1e-9)


def test_the_errors_at_a_resonance_have_the_given_sizes():
    """One pole, known exactly: each error is its derivative, or a term of its Taylor series."""
    level, pole = 1e-3, 150.0 * (1.0 + 0.01j)
    near, mirrored = 1.0 / (FREQUENCY - pole), 1.0 / (FREQUENCY + np.conj(pole))
    frf = near - mirrored
    relative = level * pole / (FREQUENCY - pole)  # at most 0.1: the series converges
    linear = near * relative
    halves = np.array([0.0, 0.0, 0.5, 0.5, 0.0, 0.0])  # of the hat functions at 140 and 160 Hz
    sizes = level * np.concatenate([HATS * frf, ALONE_IN_HEIGHT * frf[np.newaxis]])
    expected = {
        "natural_frequency": np.concatenate([halves[:, np.newaxis] * linear, ALONE * linear[np.newaxis]]),
        "damping": 100.0 * level * 1j * 0.01 * (near * pole / (FREQUENCY - pole))[np.newaxis],
        "magnitude": 20.0 * sizes,
        "phase": 2.0j * sizes,
    }
    shapes = error_shapes([frf_on(FREQUENCY)], [frf], typical_model_error(level))
    higher = shapes.pop("higher")
    assert shapes.keys() == expected.keys()
    for kind, errors in shapes.items():
        np.testing.assert_allclose(errors, expected[kind], rtol=1e-5, atol=1e-7)
    beyond = 1.0 / (FREQUENCY - pole * (1.0 + 2.0 * level)) - near - 2.0 * linear  # moved by twice the level
    left = beyond - higher.T @ np.linalg.lstsq(higher.T, beyond, rcond=None)[0]
    assert np.linalg.norm(left) < 0.1 * np.linalg.norm(beyond)


def test_errors_that_go_with_a_very_wrong_natural_frequency_are_bounded():
    assert typical_model_error(5e-4) == ModelError(5e-4, damping=0.05, magnitude=0.01, phase=1e-3)
    assert typical_model_error(0.1) == ModelError(0.1, damping=0.3, magnitude=0.3, phase=0.2)


@pytest.mark.parametrize(
    ("natural", "loss", "counted"),
    [(45.0, 0.02, False), (55.0, 0.02, True), (235.0, 0.02, True), (245.0, 0.02, False), (150.0, 0.35, True)],
)
def test_a_pole_far_outside_the_frequencies_is_not_a_resonance(natural, loss, counted):
    """From half the lowest frequency to 1.2 times the highest, as far as the FRF still shows the pole."""
    pole = natural * (1.0 + 0.5j * loss)
    frf = 1.0 / (FREQUENCY - pole) - 1.0 / (FREQUENCY + np.conj(pole))
    poles = fit_resonances([frf_on(FREQUENCY)], [frf]).poles
    assert (len(poles) == 1) is counted
    if counted:
        assert poles[0] == pytest.approx(pole, rel=1e-4)


@pytest.mark.parametrize(("loss", "counted"), [(1.18, True), (1.22, False)])
def test_an_overdamped_pole_is_not_a_resonance(loss, counted):
    pole = 150.0 * (1.0 + 0.5j * loss)
    frf = 1.0 / (FREQUENCY - pole) - 1.0 / (FREQUENCY + np.conj(pole))
    assert (len(fit_resonances([frf_on(FREQUENCY)], [frf]).poles) == 1) is counted


def posterior_of(*columns, weight=None, normal=()):
    fraction = np.stack(columns, axis=1)
    count = len(fraction)
    return Posterior(
        names=tuple("abcd"[: len(columns)]),
        theta=fraction,
        fraction=fraction,
        weight=np.full(count, 1.0 / count) if weight is None else weight,
        estimate=fraction.mean(axis=0),
        model_error=ModelError(0.0),
        searches=count,
        lines=10,
        seconds=0.0,
        normal=normal,
    )


def spread_out(gain):
    """Fractions around the middle, even, with that part of the prior's variance taken away."""
    return 0.5 + np.sqrt(1.0 - gain) * (np.linspace(0.0, 1.0, 4000) - 0.5)


@pytest.mark.parametrize("gain", [0.92, 0.52, 0.48, 0.02])
def test_the_gain_is_how_much_of_the_priors_variance_is_taken_away(gain):
    verdict = posterior_of(spread_out(gain)).verdicts["a"]
    assert verdict.gain == pytest.approx(gain, abs=1e-3)
    assert (verdict.precision == "range only") is (gain < 0.5)
    assert (verdict.word == "not identifiable") is (gain < 0.5)


def test_what_is_taken_away_of_a_normal_prior_is_counted_in_its_deviations():
    levels = np.linspace(0.0, 1.0, 4001)[1:-1]
    low = unit_from_normal(0.7 * normal_from_unit(levels) - 2.5)
    verdict = posterior_of(low, normal=("a",)).verdicts["a"]
    assert verdict.gain == pytest.approx(1.0 - 0.7**2, abs=2e-3)
    assert verdict.precision != "prior only"
    assert "end of its range" not in verdict.reason
    assert "end of its range" in posterior_of(low).verdicts["a"].reason
    wider = posterior_of(unit_from_normal(0.72 * normal_from_unit(levels)), normal=("a",)).verdicts["a"]
    assert (wider.precision, wider.word) == ("prior only", "not identifiable")


@pytest.mark.parametrize(("correlation", "trades"), [(0.56, False), (0.64, True), (-0.64, True)])
def test_parameters_trade_where_their_correlation_is_large(correlation, trades):
    normal = np.random.default_rng(0).standard_normal((2, 4000))
    normal -= normal.mean(axis=1, keepdims=True)
    first, second = np.linalg.solve(np.linalg.cholesky(np.cov(normal)), normal)
    other = correlation * first + np.sqrt(1.0 - correlation**2) * second
    verdict = posterior_of(0.5 + 0.1 * first, 0.5 + 0.1 * other).verdicts["a"]
    assert ("trades with b" in verdict.reason) is trades
    if trades:
        assert f"(correlation {correlation:+.2f})" in verdict.reason


def test_the_two_that_a_parameter_trades_with_most_are_named():
    normal = np.random.default_rng(0).standard_normal((4, 4000))
    others = [0.5 + 0.1 * (normal[0] + level * normal[index]) for index, level in ((1, 0.6), (2, 0.4), (3, 0.2))]
    reason = posterior_of(0.5 + 0.1 * normal[0], *others).verdicts["a"].reason
    assert reason.startswith("It trades with d (correlation +0.98) and c (correlation +0.93).")


@pytest.mark.parametrize("level", [0.5, 0.9, 0.99])
def test_an_interval_leaves_as_much_out_on_either_side(level):
    interval = posterior_of(np.linspace(0.0, 1.0, 4001)).interval(level)["a"]
    assert interval == pytest.approx(((1.0 - level) / 2.0, (1.0 + level) / 2.0), abs=1e-3)


@pytest.mark.parametrize(("distance", "presses"), [(0.08, True), (0.12, False)])
@pytest.mark.parametrize("end", ["lower", "upper"])
def test_a_parameter_presses_against_an_end_within_a_tenth_of_its_interval(distance, presses, end):
    """Even over a stretch, of which the interval is nine tenths; so far from the end, in widths of the interval."""
    fraction = 0.2 * (0.9 * distance - 0.05 + np.linspace(0.0, 1.0, 4000))
    reason = posterior_of(fraction if end == "lower" else 1.0 - fraction).verdicts["a"].reason
    assert (f"presses against the {end} end" in reason.lower()) is presses


@pytest.mark.parametrize(("effective", "warned"), [(45, True), (55, False)])
def test_fewer_than_fifty_effective_samples_are_warned_of(effective, warned):
    fraction = np.random.default_rng(0).permutation(spread_out(0.9))[:400]
    weight = np.where(np.arange(400) % (400 // effective) == 0, 1.0, 1e-9)[:400]
    weight[np.flatnonzero(weight == 1.0)[effective:]] = 1e-9
    messages = posterior_of(fraction, weight=weight / weight.sum()).warnings
    assert any("effective sample size" in message for message in messages) is warned


@pytest.mark.parametrize(("separate", "warned"), [(0.4, False), (0.6, True)])
def test_halves_that_differ_by_half_an_interval_are_warned_of(separate, warned):
    """Two even halves of width 1, shifted by s: the interval of both is 0.9 + s wide, to a few hundredths."""
    half = np.linspace(0.0, 1.0, 2001)
    shift = next(s for s in np.linspace(0.0, 2.0, 2001) if shifted(half, s) >= separate)
    posterior = posterior_of(np.concatenate([half, half + shift]))
    assert posterior.split_half_difference["a"] == pytest.approx(separate, abs=0.01)
    assert any("Two halves" in message for message in posterior.warnings) is warned


def shifted(half, shift):
    low, high = np.quantile(np.concatenate([half, half + shift]), [0.05, 0.95])
    return shift / (high - low)


@pytest.mark.parametrize(("bend", "decrement", "misleads"), [(0.28, 0.0, False), (0.32, 0.0, True), (0.0, 0.48, False),
                                                            (0.0, 0.52, True)])  # fmt: skip
def test_a_gaussian_misleads_where_the_posterior_is_bent_or_the_mode_was_not_reached(bend, decrement, misleads):
    gaussian = LaplaceApproximation(np.zeros(1), np.eye(1), np.array([bend]), decrement)
    assert gaussian.unreliable.tolist() == [misleads]


class Wave:
    """A narrow valley along a sine, whose tangent maps fold over: the second coordinate is sin(2 z) to a tenth."""

    def residuals(self, z):
        return np.concatenate([z, 10.0 * (z[:, 1:] - np.sin(2.0 * z[:, :1]))], axis=1)

    def linearise(self, z):
        jacobian = np.zeros((len(z), 2, 3))
        jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
        jacobian[:, 0, 2], jacobian[:, 1, 2] = -20.0 * np.cos(2.0 * z[:, 0]), 10.0
        return Linearisation(self.residuals(z), jacobian)


def test_coordinates_reach_the_ends_of_the_ranges_to_double_precision():
    np.testing.assert_allclose(normal_from_unit(np.array([0.0, 1e-12, 0.5, 1.0])), [-8.0, -7.0344838, 0.0, 8.0])
    np.testing.assert_array_equal(CubeResiduals.to_normal(np.array([0.0, 0.5, 0.75, 1.0])), [-8.0, 0.0, 4.0, 8.0])
    assert unit_from_normal(np.array([8.0]))[0] == pytest.approx(1.0, abs=1e-15)
    z = np.linspace(-8.0, 8.0, 5)
    np.testing.assert_allclose(CubeResiduals.to_normal(CubeResiduals.from_normal(z)), z)


def steps_that_do_not_lead_back(check, monkeypatch):
    """How many of 1500 points were moved to where the reversed step ends elsewhere."""
    random = np.random.default_rng(0)
    along = random.uniform(-2.0, 2.0, 1500)
    before = LinearisedPoints.at(Wave(), np.stack([along, np.sin(2.0 * along)], axis=1))
    if not check:
        monkeypatch.setattr(tangent_steps, "_SETTINGS", tangent_steps.Settings(return_distance=np.inf))
    after, acceptance, _ = tangent_steps.tangent_steps(tangent_steps.Density.of(Wave()), before, random, 1)
    moved = np.flatnonzero(np.any(after.z != before.z, axis=1))
    assert acceptance > 0.5
    assert len(moved) / 1500 == pytest.approx(acceptance)
    back = TangentMap(Wave(), after.at_rows(moved))
    returned, _ = back.solve(back.components(before.residuals[moved]), after.at_rows(moved), 100)
    return int(np.count_nonzero(np.abs(returned.z - before.z[moved]).max(axis=1) > 0.05))


def test_no_step_is_taken_that_would_not_lead_back(monkeypatch):
    """Without this the steps leave another density invariant than that of the posterior."""
    assert steps_that_do_not_lead_back(True, monkeypatch) == 0
    assert steps_that_do_not_lead_back(False, monkeypatch) > 10


class Bent:
    """One residual u + u^2 / 2 with u = 4 z, which is v where u = sqrt(1 + 2 v) - 1."""

    def residuals(self, z):
        return 4.0 * z + 8.0 * z**2

    def linearise(self, z):
        return Linearisation(self.residuals(z), 4.0 + 16.0 * z[:, :, np.newaxis])


@pytest.mark.parametrize("target", [1.4, 8.0, 12.0])
def test_a_search_follows_the_path_on_which_its_components_go_straight_to_the_target(target):
    """A tenth of the way is u = sqrt(1 + 2 v / 10) - 1, to second order v / 10 - (v / 10)^2 / 2."""
    start = LinearisedPoints.at(Bent(), np.zeros((1, 1)))
    tangent_map = TangentMap(Bent(), start)
    sign = float(tangent_map.components(np.ones((1, 1)))[0, 0])
    first, _ = tangent_map.solve(np.array([[sign * target]]), start, 1)
    end, found = tangent_map.solve(np.array([[sign * target]]), start, 20)
    if target < 10.0:  # the step is a whole tenth
        assert 4.0 * first.z[0, 0] == pytest.approx(target / 10.0 - (target / 10.0) ** 2 / 2.0, rel=1e-3)
    assert found.all()
    assert 4.0 * end.z[0, 0] == pytest.approx(np.sqrt(1.0 + 2.0 * target) - 1.0, abs=1e-3)


class Square:
    """One residual z^2: at z = 0 its derivative is singular."""

    def residuals(self, z):
        return z**2

    def linearise(self, z):
        return Linearisation(self.residuals(z), 2.0 * z[:, :, np.newaxis])


def test_a_search_from_a_singular_derivative_ends_there_and_the_others_go_on():
    anchor = LinearisedPoints.at(Square(), np.ones((1, 1)))
    tangent_map, starts = TangentMap(Square(), anchor), LinearisedPoints.at(Square(), np.array([[0.0], [1.0]]))
    target = np.repeat(4.0 * tangent_map.components(np.ones((1, 1))), 2, axis=0)
    ends, found = tangent_map.solve(target, starts, 100)
    assert found.tolist() == [False, True]
    np.testing.assert_allclose(ends.z[:, 0], [0.0, 2.0], atol=1e-3)
