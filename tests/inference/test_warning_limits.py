"""When a result carries a warning: each limit from both sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.identification.reconstruction import reconstruct
from dovetail.inference.fitting import refine
from dovetail.inference.posterior import Posterior, typical_model_error
from dovetail.problem import Problem
from support.noisy_measurements import noisy


@pytest.fixture(scope="module")
def fit(sdof):
    return refine(Problem.of(sdof, noisy(sdof, sdof.frf(), 0.01, 1)))


def warnings_of(assembly, factor=1.0, **options):
    theta = assembly.from_unit(np.full(2, 0.5))
    measured = dovetail.Frf(assembly.frequency, factor * assembly.frf(theta), "accelerance")
    return " ".join(
        reconstruct(
            Problem.of(assembly, measured), theta, **({"method": "network", "provenance": {}} | options)
        ).warnings
    )


@pytest.mark.parametrize(("factor", "warned"), [(1.9, False), (2.1, True)])
def test_a_coherence_below_nine_tenths_is_warned_of(sdof, factor, warned):
    """That of an FRF and of twice it is (1 + 2)^2 / (2 (1 + 4)) = 0.9."""
    assert ("The mean coherence is 0.8" in warnings_of(sdof, factor)) is warned


def test_a_network_warns_of_a_parameter_that_it_hardly_predicts(sdof):
    evaluation = {"parameters": {"k": {"r2": 0.09}, "c": {"r2": 0.11}}}
    reported = warnings_of(sdof, provenance={"evaluation": evaluation})
    assert "Do not rely on k: on FRFs" in reported


@pytest.mark.parametrize(("count", "shown"), [(8, "101, 102, 103, 104, 105, 106, 107, 108 Hz"),
                                              (9, "101, 102, 103, 104, 105, 106, 107, 108, ... Hz")])  # fmt: skip
def test_eight_lines_that_were_left_out_are_listed(sdof, fit, count, shown):
    used = fit.used.copy()
    used[:count] = False
    reported = warnings_of(sdof, method="refined", fit=replace(fit, used=used, ignored=101.0 + np.arange(count)))
    assert f"{count} isolated lines were left out: {shown}." in reported


@pytest.mark.parametrize(("gap", "in_two_groups"), [(0.3, ()), (0.4, ("k",))])
def test_two_separate_groups_of_values_are_reported(sdof, gap, in_two_groups):
    """Two evenly filled groups, apart by a part of the interval between them; the interval is 0.9 of all samples."""
    k = np.linspace(0.0, 1.0 - 0.9 * gap, 400)
    k[200:] += 0.9 * gap
    fraction = np.stack([k, np.linspace(0.0, 1.0, 400)], axis=1)
    options = {"model_error": typical_model_error(0.0), "searches": 400, "lines": 600, "seconds": 0.0}
    posterior = Posterior.from_fractions(sdof.parameters, fraction, np.full(400, 1.0 / 400), **options)
    assert tuple(posterior.groups) == in_two_groups
    assert ("two separate groups" in posterior.verdicts["k"].reason) is bool(in_two_groups)


def test_samples_about_a_distant_best_fit_are_not_a_second_group_of_values(sdof):
    """Every other sample is about the best fit if parts of the model may be wrong."""
    k = np.random.default_rng(0).normal(0.5, 0.005, 400)
    k[1::2] += 0.1
    fraction = np.stack([k, np.linspace(0.0, 1.0, 400)], axis=1)
    options = {"model_error": typical_model_error(0.0), "searches": 400, "lines": 600, "seconds": 0.0}
    posterior = Posterior.from_fractions(sdof.parameters, fraction, np.full(400, 1.0 / 400), **options)
    assert tuple(posterior.groups) == ()
