from __future__ import annotations

import json
import shlex
import signal
import subprocess

import numpy as np
import pytest

import dovetail
from support.waiting import PATIENCE, wait_until


def test_generate_takes_number_and_seed_from_the_command_line(run, bench, tmp_path):
    folder = tmp_path / "data.zarr"
    done = run("generate", bench.description, "-o", folder, "--samples", 20, "--seed", 3)
    dataset = dovetail.Dataset(folder)
    assert (len(dataset), dataset.seed, dataset.complete) == (20, 3, True)
    said = f"{folder}: 20 samples of 2 parameters, 600 lines each, seed 3"
    assert "".join(done.stdout.split()) == "".join(said.split())  # wherever a narrow terminal breaks the lines


def test_generate_never_changes_existing_files(run, bench, tmp_path):
    taken = tmp_path / "mine"
    taken.mkdir()
    (taken / "notes.txt").write_text("mine")
    assert (
        "a file or folder of this name already exists" in run("generate", bench.description, "-o", taken, code=1).stderr
    )
    assert (taken / "notes.txt").read_text() == "mine"


def test_resume_of_another_seed_is_refused(run, bench, tmp_path):
    folder = tmp_path / "data.zarr"
    run("generate", bench.description, "-o", folder, "--samples", 20)
    arguments = ["generate", bench.description, "-o", folder, "--samples", 20, "--resume"]
    assert "begun with seed 0, not 1" in run(*arguments, "--seed", 1, code=1).stderr
    run(*arguments)


def test_complex_storage_is_chosen_on_the_command_line_and_trains(run, bench, tmp_path):
    folder = tmp_path / "data.zarr"
    arguments = ["generate", bench.description, "-o", folder, "--samples", 100]
    run(*arguments, "--storage", "complex")
    assert dovetail.Dataset(folder).accelerance.shape == (100, 600)
    assert "begun with storage complex, not amplitude" in run(*arguments, "--resume", code=1).stderr
    run(*arguments, "--resume", "--storage", "complex")
    assert "--storage" in run(*arguments, "--storage", "half", code=2).stderr


def test_a_tolerance_of_interpolation_that_means_nothing_is_one_block(run, bench, tmp_path):
    said = run("generate", bench.description, "-o", tmp_path / "d", "--interpolation", 0.1, code=1).stderr
    assert "the tolerance is 0.1." in said
    assert "Accepted: 1e-12 to 1e-7" in said
    assert not (tmp_path / "d").exists()


def test_a_damaged_chunk_is_one_block_on_the_terminal(run, bench, tmp_path):
    folder = tmp_path / "data.zarr"
    run("generate", bench.description, "-o", folder, "--samples", 100)
    chunk = folder / "amplitude" / "c" / "0" / "0"
    chunk.write_bytes(chunk.read_bytes()[:1000])
    done = run("train", bench.description, "--data", folder, "-o", tmp_path / "model", code=1)
    said = " ".join(done.stderr.split())
    assert "this chunk holds samples 0 to 99, and it has 1000 bytes instead of 240004." in said
    assert "Continue with --resume to compute it again." in said
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "model").exists()


@pytest.mark.parametrize("arguments", [["--samples", "0"], ["--samples", "many"], ["--seed", "-1"]])
def test_generate_refuses_impossible_numbers(run, bench, tmp_path, arguments):
    assert arguments[0] in run("generate", bench.description, "-o", tmp_path / "d", *arguments, code=2).stderr


SLOW = """
import time
import dovetail
from dovetail_plugins.joints.spring_damper import SpringDamper


class Slow(SpringDamper):
    name = "slow"
    summary = "A spring and damper that takes its time"

    def matrices(self, theta):
        time.sleep(0.2 if len(theta) > 100 else 0.0)
        return super().matrices(theta)


@dovetail.hookimpl
def dovetail_components():
    return [Slow]
"""


def test_ctrl_c_leaves_a_dataset_to_go_on_with(command, interruptible, environment, assemblies, tmp_path):
    folder, plugin, description = tmp_path / "data.zarr", tmp_path / "slow.py", tmp_path / "slow.yaml"
    plugin.write_text(SLOW)
    description.write_text((assemblies / "sdof.yaml").read_text().replace("spring_damper", "slow"))
    arguments = ["generate", str(description), "-o", str(folder), "--samples", "6000"]
    arguments += ["--storage", "complex", "--interpolation", "1e-09", "--plugin", str(plugin)]
    process = interruptible(*arguments)
    wait_until((folder / "written" / "c" / "0").exists, process)
    process.send_signal(signal.SIGINT)
    printed, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, said
    assert printed == ""
    assert "Traceback" not in said
    assert not dovetail.Dataset(folder).complete
    resumed = said.splitlines()[-1].strip()
    assert resumed == f"dovetail {shlex.join(arguments)} --resume"
    done = subprocess.run(
        [command, *shlex.split(resumed)[1:]], capture_output=True, text=True, env=environment, timeout=PATIENCE
    )
    assert done.returncode == 0, done.stderr
    dataset = dovetail.Dataset(folder)
    assert dataset.complete
    assert np.isfinite(dataset.amplitude[:]).all()
    assert (dataset.storage, dataset.attributes["interpolation"]) == ("complex", 1e-9)


def test_train_prints_how_well_the_network_does(bench):
    rows = [line.split() for line in bench.trained.stdout.splitlines()]
    model = dovetail.load_model(bench.model)
    (k,) = [row for row in rows if row[:1] == ["k"]]
    metrics = model.evaluation.parameters["k"]
    assert k[1:4] == [f"{metrics.r2:.3f}", f"{100 * metrics.mae:.1f}", f"{100 * metrics.rmse:.1f}"]
    assert k[5] == "MN/m"
    assert f"Mean R2 {model.evaluation.mean_r2:.3f}; trained on 160 samples, seed 0." in bench.trained.stdout
    assert bench.trained.stderr == f"Written: {bench.model}\n"


def test_train_uses_a_given_dataset(run, bench, tmp_path):
    data, folder = tmp_path / "data.zarr", tmp_path / "model"
    run("generate", bench.description, "-o", data, "--samples", 40)
    found = json.loads(run("train", bench.description, "--data", data, "-o", folder, "--json").stdout)
    assert (found["training_samples"], found["test_samples"]) == (32, 8)
    assert found["mean_r2"] == pytest.approx(dovetail.load_model(folder).evaluation.mean_r2)


def test_train_refuses_a_dataset_of_another_assembly(run, bench, tmp_path):
    data, other = tmp_path / "data.zarr", tmp_path / "other.yaml"
    other.write_text(
        f"extends: {bench.description}\nname: stiffer\njoints: {{mount: {{parameters: {{k: {{value: 1e6}}}}}}}}\n"
    )
    run("generate", other, "-o", data, "--samples", 10)
    message = run("train", bench.description, "--data", data, "-o", tmp_path / "model", code=1).stderr
    assert "made from another description ('stiffer')" in message
    assert not (tmp_path / "model").exists()


def test_train_looks_at_the_place_before_it_works(run, bench, tmp_path, monkeypatch):
    monkeypatch.setattr(dovetail, "train", lambda *_, **__: pytest.fail("it trained"))
    taken = tmp_path / "mine"
    taken.mkdir()
    (taken / "notes.txt").write_text("mine")
    assert "this path exists and is not a model" in run("train", bench.description, "-o", taken, code=1).stderr
    assert (taken / "notes.txt").read_text() == "mine"


def test_train_says_what_the_range_of_a_normal_prior_is(run, bench, tmp_path):
    description = json.loads(dovetail.load(bench.description).description.text)
    description["identification"] = {"samples": 100, "reducer": {"model": "pca", "n_components": 5}}
    said = "Of a parameter with a normal prior the range is that of its probability"
    for prior, reported in (({"range": [1e5, 1e7]}, False), ({"about": 5e6, "sd": 1e6}, True)):
        description["joints"]["mount"]["parameters"]["k"] = prior
        (tmp_path / "assembly.yaml").write_text(json.dumps(description))
        arguments = [
            "train",
            tmp_path / "assembly.yaml",
            "--data",
            tmp_path / f"{reported}.zarr",
            "-o",
            tmp_path / f"{reported}",
        ]
        run("generate", tmp_path / "assembly.yaml", "--samples", 100, "-o", tmp_path / f"{reported}.zarr")
        assert (said in " ".join(run(*arguments).stdout.split())) is reported
