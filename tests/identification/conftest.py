"""A small trained model on the SDOF assembly, shared by the tests of identification."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import dovetail

WithSettings = Callable[..., dovetail.Assembly]


@pytest.fixture(scope="session")
def with_settings(sdof: dovetail.Assembly) -> WithSettings:
    """The SDOF assembly with other identification settings."""

    def changed(**identification: Any) -> dovetail.Assembly:
        description = json.loads(sdof.description.text)
        description["identification"].update(identification)
        return dovetail.load(description)

    return changed


@pytest.fixture(scope="session")
def small(with_settings: WithSettings) -> dovetail.Assembly:
    """Settings that train in seconds."""
    return with_settings(
        samples=1500,
        reducer={"model": "pca", "n_components": 20},
        regressor={"model": "mlp", "hidden": [64, 32], "dropout": 0.0, "max_epochs": 150},
    )


@pytest.fixture(scope="session")
def dataset(small: dovetail.Assembly, tmp_path_factory: pytest.TempPathFactory) -> dovetail.Dataset:
    return dovetail.generate(small, tmp_path_factory.mktemp("dataset") / "sdof.zarr")


@pytest.fixture(scope="session")
def model(small: dovetail.Assembly, dataset: dovetail.Dataset) -> dovetail.Identifier:
    return dovetail.train(small, dataset)


@pytest.fixture(scope="session")
def truth() -> np.ndarray:
    """Stiffness [N/m] and damping [N s/m] of the joint that the tests measure."""
    return np.array([4e6, 60.0])


@pytest.fixture(scope="session")
def measured(small: dovetail.Assembly, truth: np.ndarray) -> dovetail.Frf:
    return dovetail.Frf(small.frequency, small.frf(truth), "accelerance", label="measured.csv")
