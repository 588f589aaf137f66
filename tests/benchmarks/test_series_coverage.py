"""A small version of the study of the intervals of series."""

import numpy as np
import pytest
import series_coverage


@pytest.mark.slow
def test_intervals_of_random_series_hold_about_nine_tenths_of_the_true_values():
    groups = series_coverage.study(25, 0, 200, report=lambda _: None)
    assert {"shared value", "unknown of a law"} <= groups.keys()
    held = [inside for outcomes in groups.values() for _, inside in outcomes]
    assert np.mean(held) == pytest.approx(0.9, abs=0.06)
