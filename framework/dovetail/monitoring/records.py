"""The record of a file: what the journal, the tables and the page say of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import Parameter
from dovetail.monitoring.arrivals import Arrival
from dovetail.monitoring.reference import Reference
from dovetail.monitoring.tracker import Step
from dovetail.problem.definition import bounds_reached, values_at

LEVEL = 0.9
"""Probability of the intervals."""
_QUANTILE = 1.6448536269514722
"""Of the standard normal distribution at 95 %, so that `LEVEL` lies between its negative and it."""
REFERENCE, PREDICTED, ALARM, SET_ASIDE, DUPLICATE = "reference", "as predicted", "alarm", "set aside", "duplicate"
"""What a file can be."""
MEASURED = (REFERENCE, PREDICTED, ALARM)
"""Files with a measurement that counts."""
_CLEAR = 3.0
"""Standard deviations from which a change is named."""


def record_of(arrival: Arrival, status: str, **more: Any) -> dict[str, Any]:
    """Return the record of a file without a measurement that counts."""
    return {
        "file": arrival.name,
        "status": status,
        "date": arrival.date,
        "sha256": arrival.digest,
        "size": arrival.version.size,
        "changed_ns": arrival.version.changed,
        **({"files": [_file(one) for one in arrival.each_response]} if arrival.each_response else {}),
        **more,
    }


def _file(arrival: Arrival) -> dict[str, Any]:
    return {"file": arrival.name, "size": arrival.version.size, "changed_ns": arrival.version.changed}


def measured_record(
    arrival: Arrival, step: Step, reference: Reference, covariates: Mapping[str, float], notes: Sequence[str]
) -> dict[str, Any]:
    """Return the record of a file with its parameters."""
    status = ALARM if step.alarm else REFERENCE if step.probability is None else PREDICTED
    belief, parameters = step.belief, reference.parameters
    ends = bounds_reached(parameters, belief.mean)
    at_ends = [f"{name} is at the {end} end of its range." for name, end in ends.items()]
    equivalent = {
        curve.covariate: curve.equivalent(belief, reference.common).to_dict()
        for curve in reference.curves
        if curve.covariate not in covariates
    }
    return record_of(
        arrival,
        status,
        number=step.state.files,
        covariates=dict(covariates),
        parameters=_parameters(parameters, step, reference.common),
        equivalent=equivalent,
        residual_level=step.level,
        probability=step.probability,
        evidence=step.evidence,
        reasons=_reasons(parameters, step) if step.alarm else [],
        notes=[*notes, *at_ends],
    )


def _parameters(parameters: Sequence[Parameter], step: Step, common: NDArray[np.float64]) -> dict[str, Any]:
    mean, rows = step.belief.mean, {}
    own, total = (_QUANTILE * step.belief.deviation(part) for part in (None, common))
    ends = [mean, mean - own, mean + own, mean - total, mean + total]
    for column, parameter in enumerate(parameters):
        value, low, high, lowest, highest = (
            float(values_at((parameter,), np.clip(end[[column]], 0.0, 1.0))[0]) for end in ends
        )
        rows[parameter.name] = {
            "unit": parameter.unit,
            "value": value,
            "low": low,
            "high": high,
            "low_total": lowest,
            "high_total": highest,
        }
    return rows


def _reasons(parameters: Sequence[Parameter], step: Step) -> list[str]:
    """Return what has changed, the clearest first, as sentences."""
    size = np.abs(step.change) / np.maximum(step.change_deviation, 1e-300)
    sentences = []
    for column in np.argsort(-size, kind="stable").tolist():
        if size[column] < _CLEAR:
            continue
        parameter = parameters[column]
        ends = step.belief.mean[column] + np.array([0.0, -step.change[column]])
        after, before = (float(values_at((parameter,), np.clip([end], 0.0, 1.0))[0]) for end in ends)
        part = 100.0 * (after / before - 1.0) if before else float("nan")
        verb = "fell" if after < before else "rose"
        text = f"{abs(part):.2g} %" if np.isfinite(part) else f"{abs(after - before):.3g} {parameter.unit}"
        sentences.append(f"{parameter.name} {verb} by {text}.")
    if step.level_deviation > _CLEAR:
        sentences.append(
            "The model explains the FRF less well than before: something changed that it does not have, "
            "or the file was read in a wrong unit or quantity."
        )
    return sentences or ["No single parameter has clearly changed; together they are unlike the prediction."]
