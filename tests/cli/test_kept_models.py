"""Kept models: for their owner only, and never another user's or another assembly's."""

from __future__ import annotations

import os
import stat

import pytest

import dovetail
from dovetail.network.model_cache import _key

pytestmark = pytest.mark.skipif(os.name != "posix", reason="owners and rights are of POSIX")


@pytest.fixture
def trains_nothing(bench, monkeypatch):
    """Put the model of `bench` in the place of one that would be trained, and count."""
    calls = []

    def take(assembly, **_):
        calls.append(assembly.name)
        return dovetail.load_model(bench.model)

    monkeypatch.setattr(dovetail, "train", take)
    return calls


def test_the_folder_of_kept_models_is_made_for_its_owner_only(run, bench, tmp_path, trains_nothing):
    before = os.umask(0)
    try:
        run("identify", bench.description, bench.measured, "--method", "network")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "cache" / "models").stat().st_mode) == 0o700


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize("fault", ["other users can write", "belongs to another user"])
@pytest.mark.parametrize("is_link", [False, True])
def test_a_model_that_others_may_have_planted_is_not_used(
    run, bench, tmp_path, trains_nothing, monkeypatch, fault, is_link
):
    run("identify", bench.description, bench.measured, "--method", "network")
    models = tmp_path / "cache" / "models"
    if is_link:
        models.rename(tmp_path / "elsewhere")
        models.symlink_to(tmp_path / "elsewhere")
    if fault == "other users can write":
        models.chmod(0o777)
    else:
        owner = os.geteuid()
        monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
    for option in (["--method", "network"], ["--no-network"], ["--cause-seconds", "0"]):
        done = run("identify", bench.description, bench.measured, *option)
        assert done.stderr.count(f"The kept models in {models} are not used: ") == (option != ["--no-network"])
        assert (fault in done.stderr) == (option != ["--no-network"])
        assert "Using the model trained before" not in done.stderr
    assert len(trains_nothing) == 2
    assert len(list(models.iterdir())) == 1


def test_a_model_of_another_assembly_under_the_name_of_this_one_is_not_used(run, bench, tmp_path, trains_nothing):
    other = tmp_path / "other.yaml"
    other.write_text(f"extends: {bench.description}\nsubstructures: {{mass: {{masses: [{{mass: 2 kg}}]}}}}\n")
    run("identify", bench.description, bench.measured, "--method", "network")
    (kept,) = (tmp_path / "cache" / "models").iterdir()
    kept.rename(kept.with_name(_key(dovetail.load(other), [])))
    done = run("identify", other, bench.measured)
    assert "cannot be used; it is left out" in done.stderr
    assert "Using the model" not in done.stderr
