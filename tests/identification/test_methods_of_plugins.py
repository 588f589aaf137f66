"""Methods of plugins: chosen by name, by the description or as objects; what they return is checked and judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail import Estimate, IdentificationMethod, ParameterError, PluginError
from dovetail.report.content import fit_sentence

TRUTH = {"k": 4e6, "c": 80.0}
DESCRIPTION = """\
extends: {parent}
frequency: {{start: 200 Hz, stop: 450 Hz, step: 1 Hz}}
joints:
  mount:
    parameters: {{k: {{range: [1e6 N/m, 1e7 N/m], scale: log}}, c: {{range: [20 N s/m, 200 N s/m], scale: log}}}}
"""


class Given(IdentificationMethod):
    """Returns the values of its options, with samples around them."""

    name = "given"
    summary = "the values of its options"

    class Config(dovetail.ComponentConfig):
        """What.

        Attributes
        ----------
        k, c : float
        scatter : float
        """

        k: float = 4e6
        c: float = 80.0
        scatter: float = 0.0

    def identify(self, problem, *, seed, progress=dovetail.silent):
        """Check that the problem's derivatives are those of its FRFs, and return the values."""
        theta = np.array([[self.config.k, self.config.c]])
        frf, jacobian = problem.frf_jacobian(theta)
        step = theta[0, 0] * 1e-6
        ahead = np.array([[step, 0.0]])
        difference = problem.frf(theta + ahead) - problem.frf(theta - ahead)
        np.testing.assert_allclose(jacobian[0, :, 0], difference[0] / (2 * step), rtol=1e-5)
        assert frf.shape == (1, problem.variance.size) == (1, problem.values.size)
        samples = None
        if self.config.scatter:
            samples = theta * (1 + self.config.scatter * np.random.default_rng(seed).uniform(-1, 1, (200, 2)))
        return Estimate(theta[0], samples)


class Listing(Given):
    """Gives a list in place of an estimate."""

    name = "listing"

    def identify(self, problem, *, seed, progress=dovetail.silent):
        """Return the wrong thing."""
        return [4e6, 80.0]


@pytest.fixture(scope="module")
def description(assemblies):
    return DESCRIPTION.format(parent=assemblies / "sdof.yaml")


@pytest.fixture(scope="module")
def assembly(description, tmp_path_factory):
    path = tmp_path_factory.mktemp("block") / "block.yaml"
    path.write_text(description)
    return dovetail.load(path)


@pytest.fixture(scope="module")
def measured(assembly):
    return dovetail.noisy_frf(assembly.simulate(TRUTH), 0.01, 0)


def test_a_right_estimate_is_to_the_noise_and_its_samples_are_the_intervals(assembly, measured):
    result = dovetail.identify(assembly, measured, Given(Given.Config(scatter=0.02)))
    assert (result.method, result.adequacy.word) == ("given", "to the noise")
    low, high = result.interval["k"]
    assert low == pytest.approx(4e6 * (1 - 0.018), rel=0.005)
    assert high == pytest.approx(4e6 * (1 + 0.018), rel=0.005)
    assert [row.verdict for row in result.table] == ["identified", "identified"]
    assert result.provenance["method_options"]["scatter"] == 0.02


def test_a_wrong_estimate_is_not_trustworthy(assembly, measured):
    result = dovetail.identify(assembly, measured, Given(Given.Config(k=2e6)))
    assert not result.is_trustworthy
    assert result.interval is None


def test_options_may_be_given_with_the_call(assembly, measured):
    result = dovetail.identify(assembly, measured, Given(), c=90.0, seed=3)
    assert result.parameters["c"].value == 90.0
    with pytest.raises(ParameterError, match="the method 'given' has no option 'starts'"):
        dovetail.identify(assembly, measured, Given(), starts=3)
    with pytest.raises(ParameterError, match="the method 'given' refuses it"):
        dovetail.identify(assembly, measured, Given(), c="many")


@pytest.mark.parametrize(
    ("method", "problem"),
    [
        (Listing(), "its identify returned list."),
        (Given(Given.Config(k=2e7)), "it gave k = 2e+07 N/m."),
        (Given(Given.Config(c=1e-9)), "it gave c = 1e-09 N s/m."),
    ],
)
def test_a_wrong_type_or_value_in_place_of_an_estimate_is_refused(assembly, measured, method, problem):
    with pytest.raises(PluginError) as error:
        dovetail.identify(assembly, measured, method)
    assert error.value.faults[0].problem == problem


def test_the_description_names_the_method_and_its_options(tmp_path, description, measured):
    plugin = tmp_path / "given.py"
    plugin.write_text(
        "import dovetail\n"
        "class Middle(dovetail.IdentificationMethod):\n"
        "    '''The middle of the ranges.'''\n"
        "    name, summary = 'middle', 'the middle'\n"
        "    class Config(dovetail.ComponentConfig):\n"
        "        '''Where.\n\n        Attributes\n        ----------\n        part : float\n        '''\n"
        "        part: float = 0.5\n"
        "    def identify(self, problem, *, seed, progress=dovetail.silent):\n"
        "        '''Return it.'''\n"
        "        import numpy as np\n"
        "        part = np.array(self.config.part)\n"
        "        return dovetail.Estimate(np.array([float(p.from_unit(part)) for p in problem.parameters]))\n"
        "@dovetail.hookimpl\n"
        "def dovetail_components():\n"
        "    return [Middle]\n"
    )
    path = tmp_path / "block.yaml"
    path.write_text(f"{description}identification: {{method: {{model: middle, part: 0.25}}}}\n")
    described = dovetail.load(path, plugins=plugin)
    result = dovetail.identify(described, measured)
    assert (result.method, result.parameters["c"].value) == ("middle", pytest.approx(20.0 * 10**0.25))
    assert dovetail.identify(described, measured, "refined").method == "refined"
    path.write_text(f"{description}identification: {{method: {{model: midle}}}}\n")
    with pytest.raises(dovetail.DescriptionError, match="'midle' is not a method model"):
        dovetail.load(path, plugins=plugin)


def test_an_unknown_method_is_refused_with_the_installed_ones(assembly, measured):
    with pytest.raises(ValueError, match=r"'postreior' is not a method\. Did you mean 'posterior'\?"):
        dovetail.identify(assembly, measured, "postreior")


class Nearest(IdentificationMethod):
    """The best of a grid, by the differences that the problem gives."""

    name = "nearest"
    summary = "the best of a grid"

    def identify(self, problem, *, seed, progress=dovetail.silent):
        """Look at 2500 places."""
        grid = np.stack(np.meshgrid(np.linspace(3e6, 5e6, 50), np.linspace(50, 110, 50)), axis=-1).reshape(-1, 2)
        cost = np.sum(np.abs(problem.difference(grid)) ** 2 / problem.variance, axis=1)
        return Estimate(grid[np.argmin(cost)])


@pytest.mark.parametrize("phase", [True, False])
def test_a_measurement_without_phase_is_compared_by_its_amplitude(assembly, measured, phase):
    found = dovetail.identify(assembly, measured, Nearest(), phase=phase, cause_seconds=0.0).parameters
    assert found["k"].value == pytest.approx(4e6, rel=0.02)
    assert found["c"].value == pytest.approx(80.0, rel=0.05)


class Unfitted(IdentificationMethod):
    """A method whose estimate is the result as it is."""

    name = "unfitted"
    summary = "Whatever it is made with"
    fits_lines = False

    def __init__(self, answer):
        super().__init__()
        self.answer = answer

    def identify(self, problem, *, seed, progress=dovetail.silent):
        return self.answer()


@pytest.mark.parametrize(
    ("answer", "problem"), [(lambda: {}["none"], "failed: KeyError"), (lambda: 3.0, "its identify returned float")]
)
def test_a_method_without_a_fit_that_fails_is_named(assembly, measured, answer, problem):
    with pytest.raises(PluginError, match=problem):
        dovetail.identify(assembly, measured, Unfitted(answer))


class Sampling(IdentificationMethod):
    """Returns the truth, and a posterior that a test changes."""

    name = "sampling"
    summary = "the truth, and a posterior"
    gives_posterior = True
    change = staticmethod(lambda posterior: posterior)

    def identify(self, problem, *, seed, progress=dovetail.silent):
        """Return the truth."""
        return Estimate(np.array(list(TRUTH.values())))

    def sample(self, problem, judged, *, seed, progress=dovetail.silent):
        """Return the Laplace approximation, changed."""
        return self.change(dovetail.laplace_posterior(problem, judged.fit, samples=100, seed=seed))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda posterior: posterior.theta, "its sample returned ndarray"),
        (lambda posterior: replace(posterior, weight=2.0 * posterior.weight), "with the sum 2"),
        (lambda posterior: replace(posterior, weight=posterior.weight * np.nan), "its weights range from nan"),
        (lambda posterior: replace(posterior, weight=posterior.weight[:-1]), r"its weights have the shape \(99,\)"),
        (lambda posterior: replace(posterior, theta=posterior.theta * np.nan), "it gave k = nan"),
        (lambda posterior: replace(posterior, theta=posterior.theta * 10.0), "it gave k = "),
        (lambda posterior: replace(posterior, theta=posterior.theta[:, :1]), "parameters of the shape"),
        (lambda posterior: replace(posterior, estimate=posterior.estimate * 10.0), "it gave k = "),
        (lambda posterior: replace(posterior, fraction=1.0 - posterior.fraction), "are not those of their values"),
        (lambda posterior: replace(posterior, names=("c", "k")), "its posterior is of c, k"),
    ],
)
def test_a_posterior_that_contradicts_the_problem_is_refused(assembly, measured, monkeypatch, change, problem):
    assert dovetail.identify(assembly, measured, Sampling()).posterior is not None
    monkeypatch.setattr(Sampling, "change", staticmethod(change))
    with pytest.raises(PluginError, match=problem) as error:
        dovetail.identify(assembly, measured, Sampling())
    assert error.value.faults[0].accepted


def test_starts_and_steps_of_a_search_are_reported_only_if_the_method_returns_them(assembly, measured):
    given, refined = (dovetail.identify(assembly, measured, method) for method in (Given(), "refined"))
    assert (given.fit.starts, refined.fit.starts >= 1) == (0, True)
    assert " start" not in fit_sentence(given.fit)
    assert " start" in fit_sentence(refined.fit)
    wrong = dovetail.identify(assembly, measured, Given(), k=6e6)
    assert not any("searches" in text for text in (*wrong.warnings, *wrong.adequacy.reasons))
