"""Valid but unusual reducers, regressors, methods and readers work; invalid ones are refused by name."""

from __future__ import annotations

import shutil
from copy import deepcopy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from pydantic import Field
from typer.testing import CliRunner

import dovetail
import dovetail_bench
from dovetail.cli.app import app
from dovetail.errors import MeasurementError, PluginError
from dovetail.identification.one_measurement import find_method
from dovetail.measurement import noisy_frf
from dovetail.network.model_cache import _key
from dovetail.registry import Registry
from support import unusual_learners
from support.mass_on_mount import mass_on_mount

PLUGIN = Path(unusual_learners.__file__)
BLOCK = mass_on_mount(
    {"start": 10, "stop": 600, "step": 5},
    {"k": {"range": [1e5, 1e7], "scale": "log"}, "c": {"range": [5.0, 100.3]}},
    identification={"samples": 60, "seed": 0, "test_fraction": 0.2},
)
TRUTH = np.array([1e6, 30.0])


def described(**identification):
    description = deepcopy(BLOCK)
    regressor = {"model": "mlp", "hidden": [4], "max_epochs": 1}
    components = {"reducer": {"model": "pca", "n_components": 5}, "regressor": regressor, **identification}
    description["identification"].update(components)
    return description


def block(**identification):
    return dovetail.load(described(**identification), plugins=PLUGIN)


@pytest.fixture(scope="module")
def measured():
    assembly = dovetail.load(BLOCK)
    return noisy_frf(dovetail.Frf(assembly.frequency, assembly.frf(TRUTH), "accelerance"), 0.01, 3)


class Guess(dovetail.IdentificationMethod):
    """A method that gives what it is asked to give."""

    name, summary = "guess", "What it is given"

    class Config(dovetail.ComponentConfig):
        stiffness: float = Field(1e6, alias="lambda")

    samples = None

    def identify(self, problem, *, seed, progress=dovetail.silent):
        return dovetail.Estimate(np.array([self.config.stiffness, 30.0]), self.samples)


def registry_of(**classes):
    registry = Registry()
    for source, components in classes.items():
        hook = dovetail.hookimpl(staticmethod(lambda offered=components: offered))
        registry.add(type("Hook", (), {"dovetail_components": hook}), source)
    return registry


def identified(measured, method, **options):
    return dovetail.identify(dovetail.load(BLOCK), measured, method, cause_seconds=0.0, **options)


def test_an_estimate_far_from_the_best_fit_is_reported(measured):
    wrong = identified(measured, Guess(), **{"lambda": 1.02e6})
    assert wrong.fit.chi_squared > 100.0
    assert any("not the best fit" in warning for warning in wrong.warnings)
    assert wrong.provenance["method_options"] == {"stiffness": 1.02e6}
    near = identified(measured, Guess(), **{"lambda": 1.0 * identified(measured, "refined").theta[0]})
    assert not any("not the best fit" in warning for warning in near.warnings)


def test_few_samples_give_no_interval_and_single_precision_may_reach_the_end(measured):
    class Few(Guess):
        samples = TRUTH[None]

    class Single(Guess):
        def identify(self, problem, *, seed, progress=dovetail.silent):
            return dovetail.Estimate(np.array([1e6, 100.3], dtype=np.float32))

    with pytest.raises(PluginError, match="too few for intervals"):
        identified(measured, Few())
    assert identified(measured, Single()).theta[1] == pytest.approx(100.3, rel=1e-9)


def test_the_package_that_is_asked_for_gives_the_method():
    class Twin(Guess):
        pass

    class Needy(Guess):
        name = "needy"

        class Config(dovetail.ComponentConfig):
            count: int

    registry = registry_of(first=[Guess, Needy], second=[Twin])
    described_method = Guess()
    assembly = SimpleNamespace(description=SimpleNamespace(identification=SimpleNamespace(method=described_method)))
    assert find_method("guess", assembly, registry) is described_method
    assert find_method("first:guess", assembly, registry) is described_method
    assert type(find_method("second:guess", assembly, registry)) is Twin
    with pytest.raises(PluginError, match="count"):
        find_method("needy", None, registry)


def test_names_that_would_never_be_reached_are_refused():
    class Phase(Guess):
        name = "phasing"

        class Config(dovetail.ComponentConfig):
            phase: bool = True

    registry = registry_of(theirs=[type("Rigid", (Guess,), {"name": "rigid"}), Phase])
    reasons = " ".join(failure.reason for failure in registry.failures)
    assert "the name 'rigid'" in reasons
    assert "the option 'phase'" in reasons


def test_one_package_offers_a_name_once():
    registry = registry_of(theirs=[Guess, type("Other", (Guess,), {})])
    (failure,) = registry.failures
    assert failure.reason == "it offers two method models of the name 'guess'."
    assert [offer.component for offer in registry.offers("method")] == [Guess]


def test_the_context_reaches_a_fit_by_epochs():
    dovetail.train(block(regressor={"model": "line_in_context"}), robust=True)


def test_an_epoch_that_is_gone_is_not_given_again():
    dovetail.train(block(regressor={"model": "line_of_epochs"}), robust=True)
    with pytest.raises(PluginError, match="earlier samples are not kept"):
        dovetail.train(block(regressor={"model": "line_of_epochs"}), fresh=True)


def test_draws_beyond_the_range_can_be_corrected():
    settings = {"augmentation": {"fresh": True}, "correction": {"samples": 1000}}
    dovetail.train(block(regressor={"model": "line", "spread": True}, **settings))


@pytest.mark.parametrize("fault", ["raises", "none", "number", "incomplete", "metadata", "surrogate", "nan"])
def test_a_state_that_cannot_be_kept_is_refused_before_anything_is_written(tmp_path, fault):
    model = dovetail.train(block(regressor={"model": "line", "fault": fault}))
    with pytest.raises(PluginError, match="line"):
        model.save(tmp_path / "model")
    assert not (tmp_path / "model").exists()


def test_a_distribution_is_looked_at_while_training():
    with pytest.raises(PluginError, match="none today"):
        dovetail.train(block(regressor={"model": "line", "spread": True, "fault": "reports nothing"}))


def test_features_far_from_zero_keep_their_digits():
    near, far = (
        dovetail.train(block(samples=200, reducer={"model": "offset", "offset": offset}, regressor={"model": "line"}))
        for offset in (0.0, 1e9)
    )
    r2 = [model.evaluation.parameters["k"].r2 for model in (near, far)]
    assert r2[0] > 0.9
    assert r2[1] == pytest.approx(r2[0], abs=0.01)


def test_a_study_tries_values_of_an_option_that_is_not_printed(tmp_path):
    pytest.importorskip("optuna")
    description = described(regressor={"model": "line"}) | {"study": {"sweeps": {"regressor.scale": [1.0, 0.1]}}}
    study = dovetail_bench.study(dovetail.load(description, plugins=PLUGIN), tmp_path / "study", plugins=PLUGIN)
    assert len(set(study.sweeps[0].trials)) == 2


def test_a_changed_plugin_is_another_model(tmp_path):
    plugin = shutil.copy(PLUGIN, tmp_path / "plugin.py")
    assembly = dovetail.load(described(regressor={"model": "line"}), plugins=plugin)
    before = _key(assembly, [])
    plugin.write_text(plugin.read_text().replace("np.linalg.lstsq", "0.0 * np.linalg.lstsq"))
    assert _key(assembly, []) != before


def test_defaults_of_a_plugin_stand_before_those_that_ship(tmp_path):
    settings = dovetail.load(BLOCK, plugins=PLUGIN).description.identification
    assert settings.reducer.config.n_components == 7
    assert settings.regressor.name == "mlp"
    plugin = tmp_path / "plugin.py"
    plugin.write_text(
        PLUGIN.read_text().replace(
            '{"identification": {"reducer": {"model": "pca", "n_components": 7}}}', '{"identification": None}'
        )
    )
    with pytest.raises(PluginError, match="gave None for 'identification'"):
        dovetail.load(BLOCK, plugins=plugin)


def test_calibrate_takes_the_method_of_a_plugin_file(tmp_path):
    plugin, assembly = tmp_path / "plugin.py", tmp_path / "block.yaml"
    plugin.write_text(
        "import dovetail\nimport numpy as np\n\n\nclass Around(dovetail.IdentificationMethod):\n"
        "    name, summary = 'around', 'Around one place'\n\n"
        "    def identify(self, problem, *, seed, progress=dovetail.silent):\n"
        "        random = np.random.default_rng(seed)\n"
        "        return dovetail.Estimate(np.array([1e6, 30.0]), [1e6, 30.0] * random.uniform(0.9, 1.1, (60, 2)))\n\n\n"
        "@dovetail.hookimpl\ndef dovetail_components():\n    return [Around]\n"
    )
    assembly.write_text(yaml.safe_dump(BLOCK))
    command = ["--plugin", plugin, "calibrate", assembly, "--method", "around", "--cases", "1", "--workers", "1"]
    done = CliRunner().invoke(app, list(map(str, command)))
    assert done.exit_code == 0, done.output


@pytest.mark.parametrize(("kind", "name"), [("reducer", "true"), ("method", "estimate"), ("reader", "recorded_frf")])
def test_a_new_plugin_has_no_name_that_breaks_its_code(tmp_path, kind, name):
    done = CliRunner().invoke(app, ["new-plugin", kind, name, "-o", str(tmp_path / "package")])
    assert done.exit_code == 1
    assert "a name that the code of a plugin needs itself" in done.output
    assert not (tmp_path / "package").exists()


def test_a_reader_may_give_only_the_response(tmp_path):
    file = tmp_path / "a.one"
    file.write_text('{"response": "1-x"}')
    assert dovetail.read_frf(file, plugins=[PLUGIN]).values[0] == 1j
    with pytest.raises(MeasurementError, match="the file says"):
        dovetail.read_frf(file, plugins=[PLUGIN], dofs=("1+x", "1+x"))
    file.write_text('{"response": "tool tip"}')
    with pytest.raises(MeasurementError, match="the DOFs 'tool tip'"):
        dovetail.read_frf(file, plugins=[PLUGIN])
