"""A plugin's code that changed after a dataset or model was made with it is noticed, never used silently."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail.assembly import FRF_TOLERANCE, largest_frf_difference
from dovetail.dataset import generation
from dovetail.errors import BundleError, DatasetError

SPRING = """\
import numpy as np
import dovetail


class Spring(dovetail.JointModel):
    name = "spring"
    summary = "A spring and a damper"
    parameters = (dovetail.Parameter("k", "N/m", 1e5, 1e7, "log"), dovetail.Parameter("c", "N s/m", 1.0, 100.0))
    ports = (dovetail.JointPort("a", 1), dovetail.JointPort("b", 1))

    def matrices(self, theta):
        joint = dovetail.StructuralMatrices.zeros(len(theta), 4)
        across = np.outer([1.0, 0.0, -1.0, 0.0], [1.0, 0.0, -1.0, 0.0])
        joint.K[:] = FACTOR * theta[:, 0, None, None] * across
        joint.C[:] = theta[:, 1, None, None] * across
        return joint


@dovetail.hookimpl
def dovetail_components():
    return [Spring]
"""

DESCRIPTION = {
    "dovetail": 1,
    "name": "sprung",
    "frequency": {"start": 1, "stop": 600, "step": 1},
    "substructures": {"mass": {"model": "lumped", "masses": [{"mass": 1}]}, "base": {"model": "ground"}},
    "joints": {"mount": {"model": "spring", "connect": {"a": {"to": "mass", "at": 0}, "b": {"to": "base", "at": 0}}}},
    "response": {"at": "mass", "position": 0},
    "identification": {
        "samples": 60,
        "reducer": {"model": "pca", "n_components": 3},
        "regressor": {"model": "mlp", "hidden": [4, 4], "max_epochs": 1},
    },
}


@pytest.fixture
def plugin(tmp_path):
    return tmp_path / "spring.py"


@pytest.fixture
def assembly(plugin):
    """Load the assembly with a stiffness that its code multiplies by a factor."""

    def loaded(factor: float = 1.0):
        plugin.write_text(SPRING.replace("FACTOR", str(factor)))
        return dovetail.load(DESCRIPTION, plugins=[plugin])

    return loaded


def interrupted(assembly, path, monkeypatch):
    """Generate a dataset in chunks of ten samples and stop it after thirty."""
    monkeypatch.setattr(generation, "_CHUNK_BYTES", 4 * 600 * 10)

    def stop(stage, done, total, note=""):
        if done >= 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        dovetail.generate(assembly, path, progress=stop)


def test_the_difference_is_relative(assembly):
    sound = assembly()
    theta = np.array([[1e6, 10.0], [3e6, 20.0]])
    kept = sound.accelerance_amplitude(theta)
    assert largest_frf_difference(sound, theta, kept) == 0
    kept[1, 300] *= 1.01
    assert largest_frf_difference(sound, theta, kept) == pytest.approx(0.01 / 1.01, rel=1e-3)
    kept[1, 300] = np.nan
    assert largest_frf_difference(sound, theta, kept) == np.inf
    assert largest_frf_difference(sound, theta[:0], kept[:0]) == 0


def test_a_dataset_is_not_resumed_with_other_code(assembly, tmp_path, monkeypatch):
    path = tmp_path / "data.zarr"
    interrupted(assembly(), path, monkeypatch)
    with pytest.raises(DatasetError, match=r"are not those that the assembly gives now \(they differ by up to .* %\)"):
        dovetail.generate(assembly(1.00001), path, resume=True)
    assert not dovetail.Dataset(path).complete
    assert dovetail.generate(assembly(), path, resume=True).complete


def test_a_dataset_of_other_code_is_not_trained_with(assembly, tmp_path):
    dataset = dovetail.generate(assembly(), tmp_path / "data.zarr")
    with pytest.raises(DatasetError, match="the code of a model has changed"):
        dovetail.train(assembly(1.001), dataset)
    dovetail.train(assembly(), dataset)


def test_a_dataset_without_written_chunks_is_resumed(assembly, tmp_path):
    def stop(stage, done, total, note=""):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        dovetail.generate(assembly(), tmp_path / "data.zarr", progress=stop)
    assert dovetail.generate(assembly(2.0), tmp_path / "data.zarr", resume=True).complete


def test_a_model_of_other_code_is_not_loaded(assembly, plugin, tmp_path):
    dovetail.train(assembly()).save(tmp_path / "model")
    dovetail.load_model(tmp_path / "model", plugins=[plugin])
    plugin.write_text(SPRING.replace("FACTOR", str(1 + 10 * FRF_TOLERANCE)))
    with pytest.raises(BundleError) as error:
        dovetail.load_model(tmp_path / "model", plugins=[plugin])
    (fault,) = error.value.faults
    assert fault.problem.startswith("the assembly has other FRFs than when the model was trained")
    assert "joint spring (spring.py)" in fault.remedy


def test_loading_a_model_reports_a_joint_that_fails(assembly, plugin, tmp_path):
    dovetail.train(assembly()).save(tmp_path / "model")
    plugin.write_text(SPRING.replace("FACTOR", "1 / 0"))
    with pytest.raises(dovetail.DovetailError, match="joint 'mount' \\(spring\\) failed: ZeroDivisionError"):
        dovetail.load_model(tmp_path / "model", plugins=[plugin])
