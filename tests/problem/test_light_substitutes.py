"""What stands for functions of SciPy whose modules take long to load: with the same results."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy

from dovetail import dataset
from dovetail.frf.resonance_peaks import prominent_peaks
from dovetail.inference.fitting.whiteness import log_improbability
from dovetail.problem.definition import halton, latin_hypercube


def curves(count):
    """Yield smooth, noisy and stepped curves, some of them flat or between infinitely low ends."""
    random = np.random.default_rng(0)
    for number in range(count):
        size = random.integers(1, 60)
        steps = random.integers(0, random.integers(2, 12), size).astype(float)
        curve = (steps, random.standard_normal(size).cumsum(), random.standard_normal(size))[number % 3]
        yield np.concatenate([[-np.inf], curve, [-np.inf]]) if number % 5 == 0 else curve


@pytest.mark.parametrize("prominence", [0.5, 1.0, 3.0])
def test_prominent_peaks_are_those_of_scipy(prominence):
    for curve in curves(600):
        with np.errstate(invalid="ignore"):
            expected, properties = scipy.signal.find_peaks(curve, prominence=prominence)
            peaks, prominences = prominent_peaks(curve, prominence)
        np.testing.assert_array_equal(peaks, expected)
        np.testing.assert_array_equal(prominences, properties["prominences"])


def test_a_latin_hypercube_is_that_of_scipy():
    ours, random = np.random.default_rng(3).spawn(1)[0], np.random.default_rng(3)
    cube = scipy.stats.qmc.LatinHypercube(5, rng=random)
    for count in (64, 17):
        np.testing.assert_array_equal(latin_hypercube(count, 5, ours), cube.random(count))


def test_samples_of_a_dataset_are_those_of_scipy(collet):
    cube = scipy.stats.qmc.LatinHypercube(len(collet.parameters), rng=np.random.default_rng([5, 1]))
    np.testing.assert_array_equal(dataset.latin_hypercube(collet, 40, (5, 1)), collet.from_unit(cube.random(40)))


@pytest.mark.parametrize("size", [1, 4, 23])
def test_a_halton_sequence_is_that_of_scipy(size):
    points = halton(400, size, np.random.default_rng(3).spawn(1)[0])
    expected = scipy.stats.qmc.Halton(size, rng=np.random.default_rng(3)).random(400)
    np.testing.assert_allclose(points, expected, atol=1e-15)


@pytest.mark.parametrize("squares", [0.1, 30.0, 1e3, 1e5])
def test_the_improbability_of_noise_is_the_tail_of_chi_squared(squares):
    tail = -scipy.stats.chi2.logsf(squares, 12) / np.log(10.0)
    expected = tail if np.isfinite(tail) else squares / 2.0 / np.log(10.0)
    assert log_improbability(squares, 12) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("options", ["method='refined'", "form='laplace'"])
def test_an_identification_loads_neither_statistics_nor_signal_processing(options):
    assemblies = Path(__file__).parents[2] / "assemblies"
    code = (
        "import sys, dovetail\n"
        f"assembly, frf = {str(assemblies / 'shaft_hub.yaml')!r}, {str(assemblies / 'measurements/shaft_hub.uff')!r}\n"
        f"dovetail.identify(assembly, frf, {options})\n"
        "print(sorted({'scipy.stats', 'scipy.signal'} & set(sys.modules)))\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == "[]"
