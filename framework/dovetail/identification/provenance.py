"""The provenance of a result: versions, description, components, seed, and how well a network predicts.

That is R2, RMSE and MAE of each parameter, and the time of each stage of its training.
"""

from __future__ import annotations

import hashlib
import inspect
import platform
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.interfaces import Component, Parameter, logged
from dovetail.measurement import ModalParameters
from dovetail.registry import installed_components

_PACKAGES = ("dovetail-frf", "numpy", "scipy", "scikit-learn", "umap-learn", "torch")


_FIRST_SHARE, _LEAST_SHARE = 0.45, 0.1
"""Of the regressors' time, which the first one takes if others correct it, and which each of these takes at least."""
_FRF_SHARE = 0.75
"""Of a correction's time, which its FRFs take at most."""


@dataclass(frozen=True)
class ParameterMetrics:
    """Errors of one parameter over the test part.

    Parameters
    ----------
    r2 : float or None
        Coefficient of determination on the scale on which the parameter is sampled (linear or logarithmic); None
        where the test values do not vary.
    rmse, mae : float
        Root-mean-square and mean absolute error on that scale, as a fraction of the parameter's range; for a
        normal prior, of its probability.
    rmse_si, mae_si : float
        The same errors of the value itself, in `unit`.
    unit : str
    """

    r2: float | None
    rmse: float
    mae: float
    rmse_si: float
    mae_si: float
    unit: str


@dataclass(frozen=True)
class Evaluation:
    """The errors of a trained network on samples that it was not trained on, and the cost of its training.

    Parameters
    ----------
    parameters : mapping of str to ParameterMetrics
    training_samples, test_samples : int
    seed : int
    seconds : mapping of str to float
        Wall-clock time of each stage of training [s].
    """

    parameters: Mapping[str, ParameterMetrics]
    training_samples: int
    test_samples: int
    seed: int
    seconds: Mapping[str, float]

    @property
    def mean_r2(self) -> float:
        """Mean of the R2 that are defined, each on its parameter's sampling scale; NaN if none is."""
        defined = [metrics.r2 for metrics in self.parameters.values() if metrics.r2 is not None]
        return float(np.mean(defined)) if defined else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, fit for JSON."""
        return asdict(self)


def parameter_metrics(
    parameters: Sequence[Parameter], truth: NDArray[np.float64], predicted: NDArray[np.float64]
) -> dict[str, ParameterMetrics]:
    """Compare predicted with true parameter values.

    Parameters
    ----------
    parameters : sequence of n_params Parameter
    truth, predicted : (n_samples, n_params) arrays
        SI values.

    Returns
    -------
    dict of str to ParameterMetrics
        By the parameter's name.
    """
    return {
        parameter.name: _metrics(parameter, truth[:, column], predicted[:, column])
        for column, parameter in enumerate(parameters)
    }


def _metrics(parameter: Parameter, truth: NDArray[np.float64], predicted: NDArray[np.float64]) -> ParameterMetrics:
    true = parameter.to_unit(truth)
    error, error_si = parameter.to_unit(predicted) - true, predicted - truth
    total = np.sum((true - true.mean()) ** 2)
    return ParameterMetrics(
        r2=float(1.0 - np.sum(error**2) / total) if true.max() > true.min() else None,
        rmse=_rms(error),
        mae=float(np.mean(np.abs(error))),
        rmse_si=_rms(error_si),
        mae_si=float(np.mean(np.abs(error_si))),
        unit=parameter.unit,
    )


def _rms(error: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(error**2)))


def package_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that numbers depend on."""
    return {"python": platform.python_version(), **{name: text for name in _PACKAGES if (text := _version(name))}}


@cache
def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def description_hash(text: str) -> str:
    """Return the SHA-256 of a description's text, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def file_hash(file: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def component_sources(assembly: Assembly) -> dict[str, str]:
    """Return the source of each component: ``"joint collet": "dovetail-frf 0.1.0"``, or a file's name."""
    description = assembly.description
    components: list[Component] = [
        *description.substructures.values(),
        *(joint.connection.model for joint in description.joints.values()),
        description.identification.reducer,
        description.identification.regressor,
    ]
    return {f"{component.kind} {component.name}": source_of(component) for component in components}


def provenance(
    assembly: Assembly, measured: Sequence[Frf | ModalParameters], evaluation: Evaluation | None, seed: int
) -> dict[str, Any]:
    """Return what is needed to reproduce a result, as plain values; `evaluation` is None if no network took part."""
    description, first = assembly.description, measured[0]
    further = {"further_measurements": [frf.label for frf in measured[1:]]} if len(measured) > 1 else {}
    return {
        "assembly": description.name,
        "description_sha256": description_hash(description.text),
        "measurement": first.label,
        "measurement_note": first.note if isinstance(first, Frf) else "",
        "measured_quantity": first.quantity if isinstance(first, Frf) else "modal parameters",
        **further,
        "seed": seed,
        "components": component_sources(assembly),
        "packages": package_versions(),
        "evaluation": {} if evaluation is None else evaluation.to_dict(),
        "description": description.text,
    }


def source_of(component: Component) -> str:
    """Return who offers a component: a distribution with its version, or the name of its file."""
    return installed_components().source_of(type(component)) or Path(inspect.getfile(type(component))).name


@dataclass
class StageTimer:
    """Wall-clock seconds of each stage of a training.

    Parameters
    ----------
    module : str
        In whose name they are logged.
    limit : float, optional
        Those that the regressors may take at most.
    seconds : dict of str to float
        By the name of the stage.
    """

    module: str
    limit: float | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def first_share(self) -> float | None:
        """Seconds for a first regressor that others correct."""
        return None if self.limit is None else _FIRST_SHARE * self.limit

    def share_of_the_rest(self, rounds: int) -> float | None:
        """Return the seconds for the next of so many corrections."""
        if self.limit is None:
            return None
        used = [seconds for name, seconds in self.seconds.items() if name == "regressor" or "correction" in name]
        return max((self.limit - sum(used)) / rounds, _LEAST_SHARE * self.limit)

    def while_there_is_time(self, blocks: Iterable[slice], rounds: int) -> Iterator[slice]:
        """Yield the blocks of FRFs for the next of so many corrections, the first and those for which there is time."""
        limit, start = self.share_of_the_rest(rounds), time.perf_counter()
        for done, block in enumerate(blocks):
            expected = (time.perf_counter() - start) * (done + 1) / max(done, 1)
            if limit is not None and done and expected > _FRF_SHARE * limit:
                return
            yield block

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure a stage."""
        start = time.perf_counter()
        with logged(self.module, f"training, {name}"):
            yield
        self.seconds[name] = time.perf_counter() - start
