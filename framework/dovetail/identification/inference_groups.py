"""The groups of ArviZ: samples, what the model predicts from them, and what was measured; ArviZ is an extra."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, AssemblySource, as_assembly, load
from dovetail.errors import DovetailError, require_package
from dovetail.frf import Frf
from dovetail.inference.posterior import Posterior, with_model_error
from dovetail.inference.posterior.likelihood import normal_from_unit
from dovetail.interfaces import Parameter
from dovetail.measurement import ModalParameters

_PARTS = ["real", "imag"]


@dataclass(frozen=True, eq=False)
class InferenceGroups:
    """What the groups are made from.

    Parameters
    ----------
    posterior : Posterior
    parameters : sequence of Parameter
        In the order of the posterior's.
    measured : sequence of Frf, or ModalParameters
        The lines of each response within the band.
    known : mapping of str to float
        Parameters that the description fixes, and signs that the measurement determined.
    variance : (n_lines,) array or None
        E|error|^2 of each measured value, if the fit has one for each line.
    """

    posterior: Posterior
    parameters: Sequence[Parameter]
    measured: Sequence[Frf] | ModalParameters
    known: Mapping[str, float]
    variance: NDArray[np.float64] | None

    def to_arviz(self, draws: int, seed: int, assembly: AssemblySource | str, about: Mapping[str, str]) -> Any:
        """Return the groups with samples of equal weight, as one chain.

        Parameters
        ----------
        draws, seed : int
        assembly : Assembly, path, or the text of a description as JSON
            If it cannot be read, there are no predictive values, and an attribute says why.
        about : mapping of str to str
            Attributes.
        """
        arviz = require_package("arviz", "arviz", "to_inferencedata")
        random, posterior, notes = np.random.default_rng([seed, 6]), self.posterior, dict(about)
        chosen = posterior.draw(draws, random)
        groups: dict[str, dict[str, Any]] = {
            "posterior": {name: posterior.theta[np.newaxis, chosen, n] for n, name in enumerate(posterior.names)},
            "prior": {p.name: p.from_unit(random.random(draws))[np.newaxis] for p in self.parameters},
        }
        stats = {"weight": posterior.weight[np.newaxis, chosen]}
        if posterior.log_likelihood is not None:
            groups["log_likelihood"] = {"frf": posterior.log_likelihood[np.newaxis, chosen]}
            stats["lp"] = (posterior.log_likelihood + self._log_prior)[np.newaxis, chosen]
        groups["sample_stats"] = stats
        groups["observed_data"] = self._observed
        try:
            groups["posterior_predictive"] = self._predictive(_read(assembly), posterior.theta[chosen], random)
        except (DovetailError, ValueError) as error:
            notes["no_posterior_predictive"] = " ".join(str(error).split())
        groups = {name: group for name, group in groups.items() if group}
        coords, dims = self._axes
        if arviz.__version__.startswith("0."):
            data = arviz.from_dict(**groups, coords=coords, dims=dims, attrs=notes)
        else:
            data = arviz.from_dict(groups, coords=coords, dims=dims, attrs={"/": notes})
        self._add_units(data, groups)
        return data

    @property
    def _log_prior(self) -> NDArray[np.float64]:
        """(n,) logarithm of the prior density of each sample on the parameters' scales, up to a constant."""
        normal = [name in self.posterior.normal for name in self.posterior.names]
        return np.asarray(-0.5 * np.sum(normal_from_unit(self.posterior.fraction[:, normal]) ** 2, axis=1))

    @property
    def _names(self) -> list[str]:
        frfs = () if isinstance(self.measured, ModalParameters) else self.measured
        return ["frf", *(f"frf_{number}" for number in range(2, len(frfs) + 1))][: len(frfs)]

    @property
    def _observed(self) -> dict[str, Any]:
        if isinstance(self.measured, ModalParameters):
            table = {"natural_frequency": self.measured.frequency, "damping_ratio": self.measured.damping_ratio}
            return {name: np.asarray(values) for name, values in table.items() if values is not None}
        return {name: _parts(frf.values) for name, frf in zip(self._names, self.measured, strict=True)}

    def _predictive(
        self, assembly: Assembly, theta: NDArray[np.float64], random: np.random.Generator
    ) -> dict[str, Any]:
        """Return the FRF of each response (1, draws, n_freq, 2) as it would be measured."""
        if isinstance(self.measured, ModalParameters):
            return {}
        names = assembly.description.unknown_signs
        signs = {name: self.known[f"{name}.sign"] for name in names if f"{name}.sign" in self.known}
        described = assembly.with_description(assembly.description.with_signs(signs)) if signs else assembly
        seen = described.on(*(frf.frequency for frf in self.measured)).each_response
        values = np.concatenate([alone.frf(theta) for alone in seen], axis=1)
        middle = [alone.frf(self.posterior.estimate) for alone in seen]
        typical = [replace(frf, values=at, has_phase=True) for frf, at in zip(self.measured, middle, strict=True)]
        values = with_model_error(values, typical, self.posterior.model_error, random)
        if self.variance is not None and self.variance.shape == values.shape[1:]:
            noise = random.standard_normal((*values.shape, 2)) @ [1.0, 1.0j] / np.sqrt(2.0)
            values = values + np.sqrt(self.variance) * noise
        parts = np.split(values, np.cumsum([len(frf.values) for frf in self.measured])[:-1], axis=1)
        shown = [part if frf.has_phase else np.abs(part) for part, frf in zip(parts, self.measured, strict=True)]
        return {name: _parts(part)[np.newaxis] for name, part in zip(self._names, shown, strict=True)}

    @property
    def _axes(self) -> tuple[dict[str, Any], dict[str, list[str]]]:
        """Return coordinates and dimensions of the measured and the predicted values."""
        if isinstance(self.measured, ModalParameters):
            mode = np.arange(1, len(self.measured.frequency) + 1)
            return {"mode": mode}, {"natural_frequency": ["mode"], "damping_ratio": ["mode"]}
        coords: dict[str, Any] = {"part": _PARTS}
        dims = {}
        for name, frf in zip(self._names, self.measured, strict=True):
            axis = name.replace("frf", "frequency")
            coords[axis], dims[name] = frf.frequency, [axis, "part"]
        return coords, dims

    def _add_units(self, data: Any, groups: Mapping[str, Mapping[str, Any]]) -> None:
        for name, parameter in zip(self.posterior.names, self.parameters, strict=True):
            for group in ("posterior", "prior"):
                data[group][name].attrs["units"] = parameter.unit
        frfs = () if isinstance(self.measured, ModalParameters) else self.measured
        for name, frf in zip(self._names, frfs, strict=True):
            for group in ("observed_data", "posterior_predictive"):
                if group in groups:
                    data[group][name].attrs["units"] = frf.unit
        if isinstance(self.measured, ModalParameters):
            data["observed_data"]["natural_frequency"].attrs["units"] = "Hz"


def _read(assembly: AssemblySource | str) -> Assembly:
    """Return an assembly as it is, or from a file or from the text of its description."""
    if isinstance(assembly, str) and (not assembly or assembly.lstrip().startswith("{")):
        return load(json.loads(assembly))
    return as_assembly(assembly)


def _parts(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return real and imaginary parts along a last axis, of which ArviZ can compute quantiles."""
    return np.stack([np.real(values), np.imag(values)], axis=-1)
