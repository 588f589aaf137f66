"""The content of the explorer: FRFs for chosen parameters over measured ones, fits that start there, and files."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from dovetail.assembly import Assembly, VibrationMode, modes_in_band
from dovetail.errors import DovetailError, Fault, ParameterError
from dovetail.frf import Frf, coherence_with_model
from dovetail.identification import Identification, identify
from dovetail.identification.measured_lines import MeasuredLines
from dovetail.identification.reconstruction import reconstruct
from dovetail.interfaces import Progress, silent
from dovetail.plain_text import display_unit
from dovetail.problem.random_error import random_error_variance
from dovetail.provenance import provenance
from dovetail.report.content import VERDICT_MARKS, outside_sentence, verdict_on
from dovetail.report.drawing import mode_shapes
from dovetail.report.html_report import write_report
from dovetail.report.pages import chart_data, curve_data, packed, residual_over_noise

SAVED = {"json": "application/json", "yaml": "application/yaml", "html": "text/html"}
"""Media types of the files that can be saved, by suffix."""

_MODES = 6
"""Largest number of natural frequencies that are marked within the band."""
_CAUSE_SECONDS = 5.0
"""Time [s] for causes of a misfit, short because the user is waiting."""
_KEPT_FITS = 50
"""Latest fits, of all pages together, that can be saved."""
_BY_HAND = "by hand"


class Explorer:
    """An assembly, with its measured FRFs if there are any.

    Parameters
    ----------
    assembly : Assembly
        With parameters to choose.
    measured : sequence of Frf
        Empty, or one for each response; the assembly's FRFs are then computed on the measured lines within its band.

    Raises
    ------
    ParameterError
        The assembly has no parameters.
    MeasurementError
        There are more or fewer measurements than responses, or some have no lines within the band.
    """

    def __init__(self, assembly: Assembly, measured: Sequence[Frf] = ()) -> None:
        if not assembly.parameters:
            raise ParameterError(Fault(assembly.name, "all parameters are known: there is nothing to explore."))
        self._lines = MeasuredLines.of(assembly, measured) if measured else None
        self._assembly = assembly if self._lines is None else self._lines.assembly
        measured_frfs = () if self._lines is None else self._lines.problem.measured
        self._measured = tuple(replace(frf, variance=random_error_variance(frf)) for frf in measured_frfs)
        self._fits: dict[str, tuple[NDArray[np.float64], Identification]] = {}
        self._fit_numbers = count(1)
        self._computing = threading.Lock()  # an engine computes for one caller at a time
        self.frfs([p.from_unit(np.array(0.5)) for p in assembly.parameters], 0)  # compiles the engine

    @property
    def name(self) -> str:
        """The assembly's name."""
        return self._assembly.name

    def start(self) -> dict[str, Any]:
        """Return the data for a new page: parameters with units and ranges, and the charts of the responses."""
        middle = self._assembly.vector(None)
        parameters = []
        for parameter, value in zip(self._assembly.parameters, middle.tolist(), strict=True):
            shown = display_unit(parameter.unit, parameter.lower, parameter.upper)
            parameters.append(
                {
                    "name": parameter.name,
                    "description": parameter.description,
                    "unit": shown.text,
                    "factor": shown.factor,
                    "lower": parameter.lower,
                    "upper": parameter.upper,
                    "scale": parameter.scale,
                    "value": value,
                }
            )
        labels = self._assembly.description.response_labels
        return {
            "name": self.name,
            "measured": bool(self._measured),
            "parameters": parameters,
            "responses": list(labels),
            "charts": [self._chart(index, middle) for index in range(len(labels))],
        }

    def _chart(self, index: int, theta: NDArray[np.float64]) -> dict[str, Any]:
        simulated = self._assembly.each_response[index].simulate(theta)
        curves = {"measured": ("measured", self._measured[index])} if self._measured else {}
        label = self._assembly.description.response_labels[index]
        residual = residual_over_noise(self._measured[index], simulated.values) if self._measured else None
        both = {**curves, "model": ("model", simulated)}
        return chart_data(f"FRF at {label}", both, residual=residual, natural=self._natural(theta))

    def frfs(self, values: Sequence[Any], response: int) -> dict[str, Any]:
        """Return the FRF of a response for parameter values [SI], and its difference from the measured one.

        Raises
        ------
        ParameterError
            Wrong number of values, values that are not finite, or no such response.
        """
        theta = self._theta(values)
        if not 0 <= response < len(self._assembly.description.responses):
            raise ParameterError(Fault("response", f"there is no response {response + 1}."))
        with self._computing:
            frf = self._assembly.each_response[response].frf(theta)
        answer: dict[str, Any] = curve_data(frf)
        if self._measured:
            measured = self._measured[response]
            answer["coherence"] = float(coherence_with_model(measured, frf).mean())
            answer["misfit"] = _decibels(np.abs(frf), measured.amplitude)
            residual = residual_over_noise(measured, frf)
            answer["residual"], answer["noises"] = packed(residual), float(np.sqrt(np.mean(residual**2)))
        return answer

    def modes(self, values: Sequence[Any]) -> dict[str, Any]:
        """Return natural frequencies and mode shapes for parameter values [SI]; this takes longer than an FRF."""
        theta = self._theta(values)
        low, high = self._assembly.frequency[[0, -1]]
        shapes = [mode for mode in mode_shapes(self._assembly, theta, _MODES) if low <= mode["frequency"] <= high]
        return {"natural": [mode["frequency"] for mode in shapes] or self._natural(theta), "shapes": shapes}

    def _theta(self, values: Sequence[Any]) -> NDArray[np.float64]:
        if not isinstance(values, (list, tuple)) or any(isinstance(value, (str, bool)) for value in values):
            raise ParameterError(Fault("values", "a list of numbers is expected."))
        return self._assembly.vector(values)

    def _natural(self, theta: NDArray[np.float64]) -> list[float]:
        """Return the natural frequencies [Hz] within the band, to two decimals."""
        return [round(mode.natural_frequency, 2) for mode in self._in_band(theta)]

    def _in_band(self, theta: NDArray[np.float64]) -> tuple[VibrationMode, ...]:
        return modes_in_band(self._assembly, theta, count=_MODES)[0]

    def fit(self, values: Sequence[Any], locked: Sequence[str], progress: Progress = silent) -> dict[str, Any]:
        """Fit to the measured FRFs, starting from parameter values [SI], with a Gaussian for the intervals.

        Parameters
        ----------
        values : sequence of float
        locked : sequence of str
            Names of the parameters that keep their values.
        progress : Progress

        Returns
        -------
        dict
            ``fit``, by which the result can be saved; ``values`` [SI], ``intervals`` [SI] and ``verdicts`` by
            parameter, and a ``verdict`` in words.
        """
        if self._lines is None:
            raise DovetailError(Fault(self.name, "there is no measured FRF to fit to.", remedy="Give its file too."))
        assembly, names = self._lines.described, [parameter.name for parameter in self._assembly.parameters]
        chosen = dict(zip(names, self._theta(values).tolist(), strict=True))
        held = {name: value for name, value in chosen.items() if name in locked}
        owners = dict(zip(names, assembly.description.identified_parameters, strict=True))
        described = assembly.description.with_known({owners[name]: value for name, value in held.items()})
        own_assembly = assembly.with_description(described)  # of its own: an engine computes for one caller at a time
        start = [value for name, value in chosen.items() if name not in held]
        options: dict[str, Any] = {"form": "laplace", "cause_seconds": _CAUSE_SECONDS, "start": start}
        result = identify(own_assembly, self._lines.whole, "posterior", progress=progress, **options)
        origin = {**result.provenance, "start": chosen, "locked": held}
        result = replace(result, provenance=origin)
        fitted = {**chosen, **{name: parameter.value for name, parameter in result.parameters.items()}}
        number = str(next(self._fit_numbers))
        self._fits[number] = np.array(list(fitted.values())), result
        for oldest in list(self._fits)[:-_KEPT_FITS]:
            del self._fits[oldest]
        table, (mark, sentence) = result.table, verdict_on(result)
        return {
            "fit": number,
            "values": list(fitted.values()),
            "intervals": {
                row.name: [row.interval_low, row.interval_high] for row in table if row.interval_low is not None
            },
            "precisions": {row.name: row.precision for row in table},
            "verdicts": {row.name: row.verdict for row in table},
            "marks": {row.name: VERDICT_MARKS.get(row.verdict, "open") for row in table},
            "outside": [row.name for row in table if row.best_fit_outside and not row.tied_to],
            "explanation": outside_sentence(table),
            "mark": mark,
            "verdict": sentence,
            "warnings": list(result.warnings),
        }

    def saved(self, kind: str, values: Sequence[Any], fit: str | None = None) -> bytes:
        """Return a file of parameter values: JSON, a description in YAML with these values, or a report.

        Parameters
        ----------
        kind : str
            One of `SAVED`.
        values : sequence of float
            SI.
        fit : str, optional
            What `fit` called the fit that these values are the result of; by default they were chosen by hand.

        Raises
        ------
        DovetailError
            There is no report, since there are no measured FRFs; or the values are not those of the fit, or it is no
            longer kept.
        """
        theta = self._theta(values)
        result = None if fit is None else self._fitted(fit, theta)
        makers: dict[str, Callable[[], bytes]] = {
            "json": lambda: self._json(theta, result),
            "yaml": lambda: self._yaml(theta),
            "html": lambda: self._report(theta, result),
        }
        return makers[kind]()

    def _fitted(self, fit: str, theta: NDArray[np.float64]) -> Identification:
        """Return the result of a fit, if it has these values, limited to the ranges as the sliders limit them."""
        if fit not in self._fits:
            raise DovetailError(Fault("fit", "this fit is no longer kept.", remedy="Fit again, then save."))
        fitted, result = self._fits[fit]
        ends = np.array([[parameter.lower, parameter.upper] for parameter in self._assembly.parameters]).T
        if not np.allclose(theta, np.clip(fitted, *ends), rtol=1e-9, atol=0.0):
            problem = "the values are not those of the fit that the page shows."
            raise DovetailError(Fault("fit", problem, remedy="Fit again, then save."))
        return result

    def _json(self, theta: NDArray[np.float64], result: Identification | None) -> bytes:
        if result is not None:
            content = result.to_dict()
        else:
            content = {
                "name": self.name,
                "method": _BY_HAND,
                "parameters": {
                    parameter.name: {"value": value, "unit": parameter.unit}
                    for parameter, value in zip(self._assembly.parameters, theta.tolist(), strict=True)
                },
                "natural_frequencies_Hz": self._natural(theta),
                "damping_ratios": [mode.damping_ratio for mode in self._in_band(theta)],
            }
        return (json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()

    def _yaml(self, theta: NDArray[np.float64]) -> bytes:
        """Return the whole description with these values as known ones, and with full paths of its files."""
        description = self._assembly.description
        pairs = zip(description.identified_parameters, theta.tolist(), strict=True)
        whole = json.loads(description.with_known(dict(pairs)).text)
        for (*steps, last), file in description.files.items():
            section = whole
            for step in steps:
                section = section[step]
            section[last] = str(Path(file).resolve())
        head = "# Saved by 'dovetail explore': every parameter has the value that its slider had.\n"
        text: str = yaml.safe_dump(whole, sort_keys=False, allow_unicode=True, width=120)
        return (head + text).encode()

    def _report(self, theta: NDArray[np.float64], result: Identification | None) -> bytes:
        if self._lines is None:
            raise DovetailError(Fault(self.name, "there is no measured FRF to report on."))
        if result is None:
            described = self._lines.described
            origin = provenance(described, self._lines.record, described.description.identification.seed)
            problem, band = self._lines.problem, self._lines.band
            with self._computing:
                result = reconstruct(problem, theta, method=_BY_HAND, provenance=origin, band=band)
        with TemporaryDirectory() as folder:
            file = write_report(result, Path(folder) / "report.html", assembly=self._assembly)
            content: bytes = file.read_bytes()
        return content


def _decibels(model: NDArray[np.float64], measured: NDArray[np.float64]) -> float | None:
    """Return the root mean square of the difference of two amplitudes in dB, where both are positive."""
    both = (model > 0) & (measured > 0)
    if not both.any():
        return None
    return float(np.sqrt(np.mean((20.0 * np.log10(model[both] / measured[both])) ** 2)))
