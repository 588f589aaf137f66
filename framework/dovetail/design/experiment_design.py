"""Experiment design: the information on each parameter that the FRF of each point would give."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, AssemblySource, as_assembly, modes_in_band
from dovetail.dataset import latin_hypercube
from dovetail.description import Place
from dovetail.design.truncated_gaussian import RemainingUncertainty, remaining_uncertainty
from dovetail.errors import Fault, ParameterError
from dovetail.inference.posterior import PRIOR_PRECISION
from dovetail.interfaces import Progress, progress_reporter
from dovetail.problem.residuals import ModelFrfs
from dovetail.units import format_quantity

NOISE = 0.01
"""Noise of every line, the same at all points, over the standard deviation of the FRF at the described response."""

_HIDDEN = 0.01
"""A mode is hardly seen at a point whose amplitude there is this small a part of the largest of all points."""

_MOST_MODES = 10
"""Lowest modes of which nodes of vibration are named."""


@dataclass(frozen=True, eq=False)
class PlannedPoint:
    """One point and the information that its FRF would give.

    Parameters
    ----------
    substructure : str
    position : float
        m.
    label : str
        Of the node, where others have its position; else empty.
    gain : mapping of str to float
        Of each parameter: part of its prior variance that the FRF removes, on average over the prior.
    deviation : mapping of str to float
        Of each parameter: mean standard deviation that remains, in fractions of its range. The width of its interval is
        proportional to it.
    hidden : tuple of float
        Hz; natural frequencies of the middle of the ranges that have a node of vibration near this point.
    """

    substructure: str
    position: float
    label: str
    gain: dict[str, float]
    deviation: dict[str, float]
    hidden: tuple[float, ...]

    @property
    def mean_gain(self) -> float:
        """Mean gain of all parameters."""
        return float(np.mean(list(self.gain.values())))

    @property
    def place(self) -> str:
        """The node in words: ``"100 mm"``, or ``"100 mm (front)"`` where others have its position."""
        return f"{self.position * 1e3:g} mm{f' ({self.label})' if self.label else ''}"


@dataclass(frozen=True, eq=False)
class MeasurementPlan:
    """All points, the most informative first, and the gain from a second point.

    Parameters
    ----------
    points : tuple of PlannedPoint
    current : int
        Which of them the description's (first) response is.
    first : int
        Which of them is one of the two in `seconds`.
    seconds : tuple of PlannedPoint
        For each other point, the gain of its FRF and the first point's together, the most informative pair first.
    noise : float
    responses : str
        The description's section for the most informative pair, as YAML; empty if there is a single point.
    """

    points: tuple[PlannedPoint, ...]
    current: int
    first: int
    seconds: tuple[PlannedPoint, ...]
    noise: float
    responses: str

    @property
    def narrowing(self) -> dict[str, float]:
        """Width of each parameter's interval from the best pair of points, relative to that from `first` alone."""
        if not self.seconds:
            return {}
        alone, pair = self.points[self.first].deviation, self.seconds[0].deviation
        return {name: pair[name] / alone[name] for name in alone}

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, fit for JSON."""
        return {
            "noise": self.noise,
            "points": [_plain(point) for point in self.points],
            "current": _plain(self.points[self.current]),
            "first": _plain(self.points[self.first]),
            "with_the_first": [_plain(point) for point in self.seconds],
            "narrowing": self.narrowing,
            "responses": self.responses,
        }


def _plain(point: PlannedPoint) -> dict[str, Any]:
    return {
        "substructure": point.substructure,
        "position": point.position,
        "label": point.label,
        "mean_gain": point.mean_gain,
        "gain": dict(point.gain),
        "deviation": dict(point.deviation),
        "hidden_modes_Hz": list(point.hidden),
    }


def plan_measurements(
    assembly: AssemblySource,
    substructures: Sequence[str] = (),
    *,
    samples: int = 40,
    noise: float = NOISE,
    with_described: bool = False,
    seed: int = 0,
    progress: Progress | bool | None = None,
) -> MeasurementPlan:
    """Rank the nodes of an assembly, except those inside a joint, as points where force and response are measured.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description; with parameters to identify.
    substructures : sequence of str
        Whose nodes may be struck; all by default.
    samples : int
        Parameter vectors from the ranges over which the gain is averaged.
    noise : float
        Of every line, the same at all points, over the standard deviation of the FRF at the described response.
    with_described : bool
        Look for a second point in addition to the described response, which is measured already, not to the best point.
    seed : int
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as `Progress` says.

    Returns
    -------
    MeasurementPlan

    Raises
    ------
    ParameterError
        There is nothing to identify, no such substructure, or no noise.

    Notes
    -----
    The Fisher information of the complex FRF with the exact sensitivities, and a prior that ends at the ends of the
    ranges (`remaining_uncertainty`). Several responses of a description count one by one; the first says direction and
    quantity.
    """
    assembly = as_assembly(assembly)
    _check(assembly, noise, samples)
    candidates = _candidates(assembly, substructures)
    theta = latin_hypercube(assembly, samples, seed)
    natural = np.array([mode.natural_frequency for mode in modes_in_band(assembly, count=_MOST_MODES)[0]])
    deviation = noise * assembly.frf(theta).std(axis=1)
    with progress_reporter(progress) as report:
        information = _information_of_each(candidates, theta, deviation, report)
    amplitude = np.array([_amplitude_of_modes(candidate, natural) for candidate in candidates])
    hidden, truth = amplitude < _HIDDEN * np.max(amplitude, axis=0, initial=0.0), assembly.to_unit(theta)
    points = _points(candidates, remaining_uncertainty(information, truth, seed), [natural[modes] for modes in hidden])
    order = sorted(range(len(points)), key=lambda index: -points[index].mean_gain)
    described = assembly.description.response
    current = next(index for index in order if candidates[index].description.response == described)
    first = current if with_described else order[0]
    others = [index for index in order if index != first]
    seconds = _points(
        [candidates[index] for index in others],
        remaining_uncertainty(information[first] + information[others], truth, seed),
        [natural[hidden[index] & hidden[first]] for index in others],
    )
    seconds.sort(key=lambda point: -point.mean_gain)
    return MeasurementPlan(
        points=tuple(points[index] for index in order),
        current=order.index(current),
        first=order.index(first),
        seconds=tuple(seconds),
        noise=noise,
        responses=_section(assembly, points[first], seconds[0]) if seconds else "",
    )


def _check(assembly: Assembly, noise: float, samples: int) -> None:
    if not assembly.parameters:
        raise ParameterError(Fault(assembly.name, "all parameters are known: there is nothing to measure for."))
    if not noise > 0:
        raise ParameterError(Fault("noise", f"a noise of {noise:g} is not positive.", "more than 0"))
    if samples < 1:
        raise ParameterError(Fault("samples", f"{samples} are too few to average over.", "1 or more"))


def _candidates(assembly: Assembly, substructures: Sequence[str]) -> list[Assembly]:
    """Return the assembly with its response at each node, in the description's direction."""
    description = assembly.description
    available = description.substructures
    for name in substructures:
        if name not in available:
            raise ParameterError(Fault("substructures", f"there is no substructure '{name}'.", ", ".join(available)))
    chosen = list(substructures) or [name for name, substructure in available.items() if not substructure.grounded]
    response = description.response
    attachments = [port for joint in description.joints.values() for port in joint.connection.attachments]
    inside = {(port.substructure, node) for port in attachments for node in port.nodes}
    if response.substructure not in chosen:
        chosen.append(response.substructure)
    return [
        assembly.with_description(replace(description, responses=(description.moved(response, name, number),)))
        for name in chosen
        for number, node in enumerate(description.placed_parts[name].nodes)
        if {*response.directions} <= {*node.directions}
        and ((name, number) not in inside or (response.substructure, response.node) == (name, number))
    ]


def _information_of_each(
    candidates: Sequence[Assembly], theta: NDArray[np.float64], deviation: NDArray[np.float64], progress: Progress
) -> NDArray[np.float64]:
    """Return the Fisher information (n_candidates, n, p, p) of the parameter vectors at each point."""
    information = []
    for index, candidate in enumerate(candidates):
        progress("points", index, len(candidates))
        information.append(_information(candidate, theta, deviation))
    progress("points", len(candidates), len(candidates))
    return np.array(information)


def _information(assembly: Assembly, theta: NDArray[np.float64], deviation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Fisher information (n, p, p) of each parameter vector, in fractions of the ranges."""
    _, jacobian = ModelFrfs.of(assembly).frf_by_fractions(theta)
    weighted = jacobian * np.sqrt(2.0) / deviation[:, np.newaxis, np.newaxis]
    return np.asarray(np.real(weighted @ np.conj(weighted).transpose(0, 2, 1)))


def _amplitude_of_modes(assembly: Assembly, natural: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the amplitude of the point's accelerance at each natural frequency, in the middle of the ranges."""
    amplitude = assembly.accelerance_amplitude()
    nearest = np.searchsorted(assembly.frequency, natural).clip(0, len(amplitude) - 1)
    return np.asarray(amplitude[nearest], dtype=np.float64)


def _points(
    candidates: list[Assembly], remaining: RemainingUncertainty, hidden: list[NDArray[np.float64]]
) -> list[PlannedPoint]:
    """Return the candidates with the uncertainty that their FRFs leave and the natural frequencies they hide."""
    points, rows = [], zip(candidates, remaining.variance, remaining.deviation, hidden, strict=True)
    for candidate, variance, deviation, frequencies in rows:
        response, names = candidate.description.response, [parameter.name for parameter in candidate.parameters]
        position, label = _node(candidate, response)
        point = PlannedPoint(
            substructure=response.substructure,
            position=position,
            label=label,
            gain=dict(zip(names, (1.0 - PRIOR_PRECISION * variance).tolist(), strict=True)),
            deviation=dict(zip(names, deviation.tolist(), strict=True)),
            hidden=tuple(frequencies.tolist()),
        )
        points.append(point)
    return points


def _node(assembly: Assembly, place: Place) -> tuple[float, str]:
    """Return the position of a node [m], and its label where others have this position."""
    nodes = assembly.description.substructures[place.substructure].nodes
    node, positions = nodes[place.node], [other.position for other in nodes]
    return node.position, node.label if positions.count(node.position) > 1 else ""


def _position_text(position: float, label: str) -> str:
    """Return a node as the value of ``position:`` in a description."""
    return json.dumps(f"node {label}", ensure_ascii=False) if label else format_quantity(position, "m", 8)


def _section(assembly: Assembly, first: PlannedPoint, second: PlannedPoint) -> str:
    """Return the section of a description that has both points, with quantity and chain of the described response."""
    response = assembly.description.response
    keys = f"direction: {response.direction}, quantity: {response.quantity}"
    if force := response.force:
        at = _position_text(*_node(assembly, force))
        keys += f", force: {{at: {force.substructure}, position: {at}, direction: {force.direction}}}"
    section = json.loads(assembly.description.at(0).text)["response"]
    if chain := section.get("calibration"):
        keys += f", calibration: {json.dumps(chain, ensure_ascii=False)}"
    entries = [f"at: {p.substructure}, position: {_position_text(p.position, p.label)}" for p in (first, second)]
    return "responses:\n" + "".join(f"  - {{{entry}, {keys}}}\n" for entry in entries)
