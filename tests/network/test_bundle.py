"""The model bundle: what is saved comes back, and what was tampered with does not."""

from __future__ import annotations

import hashlib
import json
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

import dovetail
from dovetail import atomic_files
from dovetail.errors import BundleError, PluginError
from dovetail.network.manifest import manifest_hash

PLUGIN = """
import numpy as np
import dovetail


class FittedEveryOther(dovetail.FittedReducer):
    def __init__(self, step):
        self.step = step

    def transform(self, features):
        return features[:, :: self.step].copy()

    def state(self):
        return {"step": self.step}


class EveryOther(dovetail.Reducer):
    name = "every_other"
    summary = "every other line"

    def fit(self, features, *, seed):
        return FittedEveryOther(2)

    def restore(self, state):
        return FittedEveryOther(state["step"])


@dovetail.hookimpl
def dovetail_components():
    return [EveryOther]
"""


@pytest.fixture(scope="module")
def saved(model: dovetail.Identifier, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return model.save(tmp_path_factory.mktemp("bundle") / "model")


@pytest.fixture
def bundle(saved: Path, tmp_path: Path) -> Path:
    """A copy to be tampered with."""
    return Path(shutil.copytree(saved, tmp_path / "model"))


def change_manifest(bundle: Path, change: Callable[[dict[str, Any]], object]) -> None:
    manifest = json.loads((bundle / "manifest.json").read_text())
    change(manifest)
    if "sha256" in manifest:  # as a thorough forger would
        manifest["sha256"] = manifest_hash(manifest)
    (bundle / "manifest.json").write_text(json.dumps(manifest))


def change_arrays(bundle: Path, part: str, arrays: dict[str, np.ndarray]) -> None:
    """Rewrite a part's arrays and make the manifest agree, as a thorough forger would."""
    file = bundle / f"{part}.safetensors"
    merged = {**load_file(file), **arrays}
    save_file(merged, file)

    def agree(manifest: dict[str, Any]) -> None:
        entry = manifest["files"][part]
        entry["sha256"] = hashlib.sha256(file.read_bytes()).hexdigest()
        entry["arrays"] = {name: f"{array.dtype.name}{list(array.shape)}" for name, array in merged.items()}

    change_manifest(bundle, agree)


def test_a_loaded_model_gives_the_same_answers(
    model: dovetail.Identifier, saved: Path, dataset: dovetail.Dataset, measured: dovetail.Frf
) -> None:
    loaded = dovetail.load_model(saved)
    amplitude = np.array(dataset.amplitude[:100])
    np.testing.assert_array_equal(loaded.predict_parameters(amplitude), model.predict_parameters(amplitude))
    np.testing.assert_array_equal(
        loaded.identify(measured, "network").frf.values, model.identify(measured, "network").frf.values
    )
    assert loaded.evaluation == model.evaluation
    assert loaded.assembly.description.text == model.assembly.description.text


def answer_of_a_new_process(bundle: Path, amplitude: np.ndarray, folder: Path) -> np.ndarray:
    np.save(folder / "amplitude.npy", amplitude)
    program = (
        "import sys, dovetail, numpy as np\n"
        "model = dovetail.load_model(sys.argv[1])\n"
        "np.save(sys.argv[3], model.predict_parameters(np.load(sys.argv[2])))\n"
    )
    files = [str(bundle), str(folder / "amplitude.npy"), str(folder / "theta.npy")]
    subprocess.run([sys.executable, "-c", program, *files], check=True)
    return np.load(folder / "theta.npy")


def test_a_new_process_gives_the_same_answer(
    model: dovetail.Identifier, saved: Path, dataset: dovetail.Dataset, tmp_path: Path
) -> None:
    amplitude = np.array(dataset.amplitude[:20])
    theta = answer_of_a_new_process(saved, amplitude, tmp_path)
    np.testing.assert_allclose(theta, model.predict_parameters(amplitude), rtol=1e-12)


@pytest.mark.slow  # the reducer alone is held to it in tests/plugins/test_reducers.py
def test_umap_predictions_agree_in_batches_and_in_a_new_process(
    with_settings: Callable[..., dovetail.Assembly], dataset: dovetail.Dataset, tmp_path: Path
) -> None:
    assembly = with_settings(
        reducer={"model": "umap", "n_components": 5, "n_epochs": 20},
        regressor={"model": "mlp", "hidden": [16, 16], "max_epochs": 5},
        test_fraction=0.8,
    )
    model = dovetail.train(assembly, dataset)
    saved = model.save(tmp_path / "model")
    amplitude = np.array(dataset.amplitude[:30])
    batch = model.predict_parameters(amplitude)
    alone = np.concatenate([model.predict_parameters(row[np.newaxis]) for row in amplitude])
    np.testing.assert_allclose(alone, batch, rtol=1e-5)
    np.testing.assert_allclose(answer_of_a_new_process(saved, amplitude, tmp_path), batch, rtol=1e-12)


def test_nothing_in_a_bundle_is_pickled(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert {file.suffix for file in saved.iterdir()} == {".json", ".safetensors"}
    assert len({file.stat().st_mode for file in saved.iterdir()}) == 1
    for file in saved.glob("*.safetensors"):
        content = file.read_bytes()
        length = int.from_bytes(content[:8], "little")
        assert "__metadata__" not in json.loads(content[8 : 8 + length])

    def forbidden(*_: object, **__: object) -> None:
        raise AssertionError("something was unpickled")

    for name in ("load", "loads", "Unpickler", "_Unpickler"):
        monkeypatch.setattr(pickle, name, forbidden)
    dovetail.load_model(saved)


def test_a_model_takes_the_place_of_an_older_one(model: dovetail.Identifier, bundle: Path) -> None:
    (bundle / "reducer.safetensors").unlink()
    model.save(bundle)
    dovetail.load_model(bundle)
    assert [entry.name for entry in bundle.parent.iterdir()] == ["model"]


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_nothing_else_is_overwritten(model: dovetail.Identifier, tmp_path: Path, kind: str) -> None:
    thesis = tmp_path / "model"
    if kind == "folder":
        thesis.mkdir()
        thesis = thesis / "thesis.tex"
    thesis.write_text("mine")
    with pytest.raises(BundleError, match="exists and is not a model"):
        model.save(tmp_path / "model")
    assert thesis.read_text() == "mine"


def test_a_save_that_fails_leaves_the_old_model(
    model: dovetail.Identifier, bundle: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import safetensors.numpy

    def full(_: dict[str, np.ndarray], file: Path) -> None:
        Path(file).write_bytes(b"half")
        raise OSError("no space left on device")

    monkeypatch.setattr(safetensors.numpy, "save_file", full)
    with pytest.raises(BundleError, match="no space left"):
        model.save(bundle)
    dovetail.load_model(bundle)
    assert [entry.name for entry in bundle.parent.iterdir()] == ["model"]


def test_an_old_model_comes_back_if_the_new_one_cannot_take_its_place(
    model: dovetail.Identifier, bundle: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rename = Path.rename

    def refuse_the_new(self: Path, target: Path) -> Path:
        if self.suffix == ".part":
            raise OSError("the folder is in use")
        return rename(self, target)

    monkeypatch.setattr(atomic_files, "_exchange", lambda *_: False)  # as on Windows
    monkeypatch.setattr(Path, "rename", refuse_the_new)
    with pytest.raises(BundleError, match="in use"):
        model.save(bundle)
    dovetail.load_model(bundle)


def test_a_state_that_is_more_than_values_is_refused(model: dovetail.Identifier, tmp_path: Path) -> None:
    class Hoarder(dovetail.FittedReducer):
        def __init__(self, value: object) -> None:
            self.value = value

        def transform(self, features: np.ndarray) -> np.ndarray:
            return model.network.reducer.transform(features)

        def state(self) -> dict[str, Any]:
            return {"tree": self.value}

    for value in (object(), np.array([None]), {"a": 1}, np.array(["text"])):
        hoarder = replace(model, network=replace(model.network, reducer=Hoarder(value)))
        with pytest.raises(PluginError, match="'tree' is"):
            hoarder.save(tmp_path / "model")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_or_manifest_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="no such model folder"):
        dovetail.load_model(tmp_path / "nowhere")
    with pytest.raises(BundleError, match=r"has no manifest\.json"):
        dovetail.load_model(tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "cannot be read"),
        ("{", "cannot be read"),
        ("[" * 100_000, "cannot be read"),
        ("[]", "not a JSON object"),
        ("{}", "not a model of dovetail"),
        ('{"format": "keras"}', "its format is 'keras'"),
        ('{"format": "dovetail-model"}', "Field required"),
        ('{"format": "dovetail-model", "version": 0}', "Input should be 3"),
    ],
)
def test_a_damaged_or_unrelated_manifest_is_refused(bundle: Path, text: str, message: str) -> None:
    (bundle / "manifest.json").write_text(text)
    with pytest.raises(BundleError, match=message):
        dovetail.load_model(bundle)


def test_a_binary_manifest_is_refused(bundle: Path) -> None:
    (bundle / "manifest.json").write_bytes(b"\x80\x04\x95\xff")
    with pytest.raises(BundleError, match="cannot be read"):
        dovetail.load_model(bundle)


def test_a_newer_format_is_refused(bundle: Path) -> None:
    change_manifest(bundle, lambda manifest: manifest.update(version=4, surprise=True))
    with pytest.raises(BundleError, match="format version 4") as caught:
        dovetail.load_model(bundle)
    assert "Upgrade dovetail-frf" in str(caught.value)


def test_a_model_without_statistics_of_its_training_cannot_judge(
    bundle: Path, measured: dovetail.Frf, model: dovetail.Identifier
) -> None:
    def without_novelty(manifest: dict[str, Any]) -> None:
        del manifest["files"]["novelty"], manifest["values"]["novelty"]

    change_manifest(bundle, without_novelty)
    (bundle / "novelty.safetensors").unlink()
    loaded = dovetail.load_model(bundle)
    result = loaded.identify(measured, "network")
    assert result.adequacy is None
    assert any("cannot judge whether the measurement" in warning for warning in result.warnings)
    np.testing.assert_array_equal(result.theta, model.identify(measured, "network").theta)
    assert loaded.save(bundle) == bundle
    assert dovetail.load_model(bundle).novelty is None


def test_the_evaluation_is_covered_by_the_hash(bundle: Path) -> None:
    file = bundle / "manifest.json"
    manifest = json.loads(file.read_text())
    assert manifest["evaluation"]["parameters"]["k"]["r2"] < 1
    manifest["evaluation"]["parameters"]["k"]["r2"] = 1.0
    file.write_text(json.dumps(manifest))
    with pytest.raises(BundleError, match="the manifest is not the one that was written with the model") as caught:
        dovetail.load_model(bundle)
    assert caught.value.faults[0].where == str(file)


def test_a_manifest_without_its_hash_is_refused(bundle: Path) -> None:
    file = bundle / "manifest.json"
    manifest = json.loads(file.read_text())
    del manifest["sha256"]
    file.write_text(json.dumps(manifest))
    with pytest.raises(BundleError, match="the manifest is not the one that was written with the model"):
        dovetail.load_model(bundle)


@pytest.mark.parametrize("part", ["reducer", "feature_scaling", "regressor", "target_scaling", "check", "novelty"])
def test_a_missing_or_truncated_file_is_an_error(bundle: Path, part: str) -> None:
    file = bundle / f"{part}.safetensors"
    content = file.read_bytes()
    file.write_bytes(content[:-7])
    with pytest.raises(BundleError, match="does not match the manifest"):
        dovetail.load_model(bundle)
    file.unlink()
    with pytest.raises(BundleError, match="missing"):
        dovetail.load_model(bundle)


def test_a_truncated_file_with_a_matching_checksum_is_refused(bundle: Path) -> None:
    file = bundle / "regressor.safetensors"
    file.write_bytes(file.read_bytes()[:-7])
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    change_manifest(bundle, lambda manifest: manifest["files"]["regressor"].update(sha256=digest))
    with pytest.raises(BundleError, match="cannot be read"):
        dovetail.load_model(bundle)


def test_arrays_with_other_shapes_than_in_the_manifest_are_refused(bundle: Path) -> None:
    change_manifest(bundle, lambda m: m["files"]["regressor"]["arrays"].update(weight0="float32[1, 64]"))
    with pytest.raises(BundleError, match="other shapes than in the manifest"):
        dovetail.load_model(bundle)


@pytest.mark.parametrize(
    ("part", "arrays"),
    [
        ("feature_scaling", {"mean": np.zeros(7), "deviation": np.ones(7)}),
        ("target_scaling", {"lower": np.zeros(3), "upper": np.ones(3), "logarithmic": np.zeros(3, bool)}),
        ("target_scaling", {"lower": np.array([np.nan, 0.0])}),
        ("reducer", {"components": np.zeros((20, 10), np.float32)}),
        ("regressor", {"weight1": np.zeros((3, 3), np.float32)}),
        ("regressor", {"bias2": np.full(2, np.inf, np.float32)}),
        ("check", {"amplitude": np.zeros((3, 10), np.float32)}),
    ],
)
def test_inconsistent_arrays_are_refused(bundle: Path, part: str, arrays: dict[str, np.ndarray]) -> None:
    change_arrays(bundle, part, arrays)
    with pytest.raises(BundleError, match="cannot be rebuilt from its arrays"):
        dovetail.load_model(bundle)


def test_a_part_that_lacks_an_array_is_refused(bundle: Path) -> None:
    file = bundle / "regressor.safetensors"
    file.write_bytes((bundle / "reducer.safetensors").read_bytes())
    change_manifest(bundle, lambda manifest: manifest["files"].update(regressor=manifest["files"]["reducer"]))
    with pytest.raises(BundleError, match="cannot be rebuilt from its arrays"):
        dovetail.load_model(bundle)


def test_changed_weights_are_detected(bundle: Path) -> None:
    weight = load_file(bundle / "regressor.safetensors")["weight2"]
    change_arrays(bundle, "regressor", {"weight2": weight[:, ::-1].copy()})
    with pytest.raises(BundleError, match="predictions differ from those after its training"):
        dovetail.load_model(bundle)


def test_a_part_that_the_manifest_does_not_list_is_refused(bundle: Path) -> None:
    change_manifest(bundle, lambda manifest: manifest["files"].pop("regressor"))
    with pytest.raises(BundleError, match="does not list the regressor"):
        dovetail.load_model(bundle)


def test_a_file_outside_the_bundle_cannot_be_named(bundle: Path) -> None:
    change_manifest(bundle, lambda m: m["files"].update({"../../secret": m["files"]["reducer"]}))
    with pytest.raises(BundleError, match="secret"):
        dovetail.load_model(bundle)


def test_a_broken_description_or_one_of_other_parameters_is_refused(bundle: Path) -> None:
    change_manifest(bundle, lambda manifest: manifest.update(parameters=["k", "kr"]))
    with pytest.raises(BundleError, match=r"parameters \(k, kr\) are not those of its description"):
        dovetail.load_model(bundle)
    change_manifest(bundle, lambda manifest: manifest.update(description="{"))
    with pytest.raises(BundleError, match="description is not JSON"):
        dovetail.load_model(bundle)
    change_manifest(bundle, lambda manifest: manifest.update(description="[]"))
    with pytest.raises(BundleError, match="description is not a JSON object"):
        dovetail.load_model(bundle)
    change_manifest(bundle, lambda manifest: manifest.update(description='{"extends": "/etc/hostname"}'))
    with pytest.raises(BundleError, match="refers to a file outside the model"):
        dovetail.load_model(bundle)
    change_manifest(bundle, lambda manifest: manifest.update(description='{"dovetail": 1}'))
    with pytest.raises(BundleError, match=r"manifest\.json  "):
        dovetail.load_model(bundle)


def test_a_model_of_a_plugin_needs_the_plugin(
    sdof: dovetail.Assembly, dataset: dovetail.Dataset, tmp_path: Path
) -> None:
    plugin = tmp_path / "every_other.py"
    plugin.write_text(PLUGIN)
    description = json.loads(sdof.description.text)
    description["identification"].update(
        reducer={"model": "every_other"}, regressor={"model": "mlp", "hidden": [8, 8], "max_epochs": 2}
    )
    model = dovetail.train(dovetail.load(description, plugins=[plugin]), dataset)
    model.save(tmp_path / "model")
    with pytest.raises(BundleError, match="'every_other' is not a reducer model") as caught:
        dovetail.load_model(tmp_path / "model")
    assert "reducer every_other (every_other.py)" in str(caught.value)
    loaded = dovetail.load_model(tmp_path / "model", plugins=[plugin])
    amplitude = np.array(dataset.amplitude[:5])
    np.testing.assert_array_equal(loaded.predict_parameters(amplitude), model.predict_parameters(amplitude))
