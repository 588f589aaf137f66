"""The parameters of each test as functions of the unknowns of a series."""

from pathlib import Path

import numpy as np
import pytest

from dovetail.series.reading import read_series
from dovetail.series.unknowns import SeriesUnknowns, within_range

SERIES = Path(__file__).parents[2] / "assemblies" / "series"

ROLES = [
    "shared",
    "free",
    "varying",
    {"law": "constant"},
    {"law": "linear"},
    {"law": "power"},
    {"law": "exponential_approach"},
    {"law": {"model": "monotone_spline", "pieces": 3}},
    {"role": "varying", "law": "linear", "scatter": ["1 %", "20 %"]},
]


def series_with(role, tests=(20, 60, 100)):
    return read_series(
        {
            "dovetail_series": 1,
            "assembly": str(SERIES / "clamped_rod.yaml"),
            "covariates": {"torque": "N m"},
            "tests": {
                f"T{torque}": {"measured": str(SERIES / f"torque_{torque}.csv"), "at": {"torque": f"{torque} N m"}}
                for torque in tests
            },
            "parameters": {"k": role},
        }
    )


@pytest.mark.parametrize("role", ROLES, ids=str)
def test_derivatives_are_those_of_the_fractions(role):
    unknowns = SeriesUnknowns(series_with(role))
    random = np.random.default_rng(0)
    for index, one in enumerate(unknowns.maps):
        z = unknowns.for_test(index, random.standard_normal((6, unknowns.count)))
        fractions, jacobian = one.linearise(z)
        np.testing.assert_array_equal(one.fractions(z), fractions)
        assert fractions.min() > 0.0
        assert fractions.max() < 1.0
        for column in range(z.shape[1]):
            step = 1e-6 * np.eye(z.shape[1])[column]
            change = (one.fractions(z + step) - one.fractions(z - step)) / 2e-6
            np.testing.assert_allclose(jacobian[:, :, column], change, atol=1e-7)


def test_a_shared_value_is_one_unknown_and_free_ones_are_one_for_each_test():
    unknowns = SeriesUnknowns(series_with("shared"))
    assert [unknown.definition.name for unknown in unknowns.shared] == ["k"]
    assert [[unknown.parameter for unknown in own] for own in unknowns.own] == [["c", "kr", "cr"]] * 3


def test_values_scatter_normally_far_from_the_ends_of_the_range():
    z = np.linspace(-3.0, 3.0, 7)
    positions, _ = within_range(np.full(7, 0.5), np.full(7, 0.01), z)
    np.testing.assert_allclose(positions, 0.5 + 0.01 * z, atol=1e-12)


@pytest.mark.parametrize("mean", [0.0, 0.02, 0.98, 1.0])
def test_values_near_an_end_of_the_range_follow_the_normal_distribution_that_is_cut_off_there(mean):
    import scipy

    z = np.linspace(-6.0, 6.0, 25)
    positions, _ = within_range(np.full(25, mean), np.full(25, 0.1), z)
    cut = scipy.stats.truncnorm(-mean / 0.1, (1.0 - mean) / 0.1, mean, 0.1)
    np.testing.assert_allclose(cut.cdf(positions), scipy.special.ndtr(z), atol=1e-9)
