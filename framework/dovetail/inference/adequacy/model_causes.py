"""Causes in the model: other points, exchanged responses, levels of the force, damping, ranges, missing resonances."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, islice

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from dovetail.assembly import Assembly
from dovetail.assembly.structure import PointReceptances
from dovetail.assembly.variants import (
    NodePlace,
    measured_at,
    motion_at,
    movable_nodes,
    with_range,
    with_responses_exchanged,
    with_structural_joints,
    with_viscous_joints,
)
from dovetail.errors import DovetailError
from dovetail.frf import conversion
from dovetail.frf.resonances import Resonances, fit_resonances
from dovetail.inference.adequacy.quick_fits import QuickFit, QuickFits
from dovetail.inference.fitting.lines import SearchLines
from dovetail.interfaces import Parameter
from dovetail.meanwhile import in_parts, in_turn
from dovetail.units import format_quantity


@dataclass(frozen=True)
class Settings:
    """Which points are compared, how resonances are added, and which windows are tried."""

    most_nodes: int = 24
    """Largest number of nodes that are compared first, evenly chosen; then those around the best of them follow."""
    points: tuple[int, int] = (2, 4)
    """Least and largest number of other points of response, and of force and response, that are fitted: those that come
    nearest."""
    less_similar: float = 1.2
    """Distance from the measured amplitudes, over that of the described point, beyond which only the least number is
    fitted."""
    neighbourhood: int = 2
    """Number of nodes within which two of these would be neighbours."""
    lines: int = 120
    """Of the FRF, evenly chosen."""
    samples: int = 16
    """Random joints whose FRFs are compared."""
    joints_apart: int = 5
    """Number of joints whose comparison is worth a process of its own."""
    most_difference: float = 1.0
    """Limit of the difference of logarithms of amplitudes at one line: a misplaced resonance makes larger ones."""
    most_exchanges: int = 15
    """Largest number of pairs of responses that are exchanged: all pairs of up to six responses."""
    most_resonances: int = 2
    """Largest number of missing resonances that are tried, the lowest first."""
    reach: float = 0.1
    """Relative distance from a missing resonance within which lines determine it."""
    fewest_lines: int = 8
    """Smallest number of such lines."""
    damping: float = 0.01
    """Loss factor at which its search starts."""
    dampings: tuple[float, float] = (1e-6, 1.0)
    """Bounds of its loss factor."""
    windows: tuple[float, ...] = (0.1, 0.3, 1.0, 3.0)
    """First values of the damping that a window adds, over that of the least damped resonance."""
    most_window: float = 100.0
    """Largest such value; larger ones are tried as long as the fit improves."""
    narrowings: int = 3
    """Number of times that the step between such values is halved."""
    promising: float = 0.05
    """Decrease of the misfit that the best of the first values must reach for others to be tried between them."""
    range_factors: tuple[float, ...] = (1e3, 10.0)
    """Factors by which the range of a parameter on a logarithmic scale is extended, the first that its model allows: a
    thousand, as of kN and N confused. Others grow by their width."""


_SETTINGS = Settings()

Candidate = tuple[str, str, QuickFit]
"""Kind and words of a cause, and the fit with it."""


def try_points(fits: QuickFits) -> Iterator[Candidate]:
    """Yield the fits with other points of response, and of force and response: the most similar, then their neighbours.

    The neighbours of the best node follow as long as they fit better, because amplitudes of wrong parameters locate a
    point only roughly.
    """
    nodes = [] if len(fits.target.frfs) > 1 else movable_nodes(fits.assembly)
    ends = dict[tuple[bool, NodePlace], QuickFit]()

    def fitted(place: tuple[NodePlace, bool, NDArray[np.float64]]) -> QuickFit:
        node, with_force, start = place
        moved = measured_at(fits.assembly, node, with_force=with_force)
        return fits.fit(fits.problem.with_assembly(moved), [fits.search(moved, fits.shape, start)])

    def at(places: list[tuple[NodePlace, bool, NDArray[np.float64]]]) -> Iterator[Candidate]:
        quick_fits = in_turn(fitted, places, lambda: fits.problem.limit.was_stopped)
        for (node, with_force, _), quick in zip(places, quick_fits, strict=True):
            ends[with_force, node] = quick
            which = "force and response" if with_force else "the response"
            yield "point", f"{which} {_words(fits.assembly, node)}", quick

    yield from at(_most_similar_points(fits, nodes) if nodes else [])
    while ends:
        (with_force, best), quick = min(ends.items(), key=lambda end: end[1].misfit)
        neighbours = [(best[0], best[1] + step) for step in (-1, 1)]
        untried = [node for node in neighbours if node in nodes and (with_force, node) not in ends]
        if not untried or quick.misfit >= fits.unchanged.misfit:
            return
        yield from at([(node, with_force, quick.theta) for node in untried])


def _most_similar_points(fits: QuickFits, nodes: list[NodePlace]) -> list[tuple[NodePlace, bool, NDArray[np.float64]]]:
    """Return nodes, whether the force is there too, and the parameters (p,) [SI] whose amplitudes are the closest."""
    assembly, amplitude = fits.assembly, fits.target.amplitude
    drawn = assembly.from_unit(np.random.default_rng(0).random((_SETTINGS.samples, len(assembly.parameters))))
    joints = np.concatenate([np.stack([fits.best, fits.shape]), drawn])
    step = -(-len(nodes) // _SETTINGS.most_nodes)
    if step > 1:
        coarse = nodes[::step]
        best = {
            step * i for kind in _distances(assembly, amplitude, joints, coarse) for i in _separate_nodes(kind, coarse)
        }
        nodes = [node for i, node in enumerate(nodes) if any(abs(i - j) < step for j in best)]
    response = assembly.description.response
    distances = _distances(assembly, amplitude, joints, [*nodes, (response.substructure, response.node)])
    described = distances[0][:, -1].min()
    kinds = [kind[:, :-1] for kind in distances]
    if fits.is_active or not response.is_drive_point:
        kinds = kinds[:1]
    chosen: list[tuple[float, int, int]] = []
    for with_force, kind in enumerate(kinds):
        ranked = [(float(kind[:, i].min()), with_force, i) for i in _separate_nodes(kind, nodes)]
        similar = [choice for choice in ranked if choice[0] < _SETTINGS.less_similar * described]
        chosen += ranked[: max(_SETTINGS.points[0], len(similar))]
    return [(nodes[i], bool(force), joints[np.argmin(kinds[force][:, i])]) for _, force, i in sorted(chosen)]


def _separate_nodes(distances: NDArray[np.float64], nodes: list[NodePlace]) -> list[int]:
    """Return the nodes with the smallest distances (n, n_nodes) at any parameters, none of them near a better one."""
    chosen: list[int] = []
    for index in np.argsort(distances.min(axis=0), kind="stable").tolist():
        part, number = nodes[index]
        if all(part != nodes[i][0] or abs(number - nodes[i][1]) > _SETTINGS.neighbourhood for i in chosen):
            chosen.append(index)
    return chosen[: _SETTINGS.points[1]]


def _distances(
    assembly: Assembly, amplitude: NDArray[np.float64], joints: NDArray[np.float64], places: list[NodePlace]
) -> list[NDArray[np.float64]]:
    """Return how amplitudes at places differ from the measured one, (n, n_places): force as described, and there."""
    lines = np.unique(np.linspace(0, len(amplitude) - 1, _SETTINGS.lines).round().astype(np.intp))
    few = assembly.on(assembly.frequency[lines])
    points, force = [motion_at(few, place) for place in places], few.description.response.force_point
    between = PointReceptances(few.graph, points, [force, *points])
    engine = few.engine_of(between.points)
    measured = np.log(np.maximum(amplitude[lines], np.finfo(float).tiny))
    power = np.log(np.abs(conversion(few.frequency, "receptance", few.description.response.quantity)))

    def distances(vector: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        receptance = between.at(engine, few.by_joint(vector[np.newaxis]))
        transfer, driven = receptance[:, :, 0], np.einsum("fpp->fp", receptance[:, :, 1:])
        amplitudes = np.maximum(np.abs(np.stack([transfer, driven])), np.finfo(float).tiny)
        differences = np.abs(np.log(amplitudes) + (power - measured)[:, np.newaxis])
        return list(np.minimum(differences, _SETTINGS.most_difference).mean(axis=1))

    def of_rows(rows: NDArray[np.intp]) -> list[list[NDArray[np.float64]]]:
        return [distances(vector) for vector in joints[rows]]

    every = chain.from_iterable(in_parts(of_rows, len(joints), _SETTINGS.joints_apart))
    return [np.stack(kind) for kind in zip(*every, strict=True)]


def _words(assembly: Assembly, place: NodePlace) -> str:
    node = assembly.description.substructures[place[0]].nodes[place[1]]
    return f"on the {place[0]} at {1e3 * node.position:.4g} mm"


def try_exchanges(fits: QuickFits) -> Iterator[Candidate]:
    """Yield the fits with the measurements of two responses exchanged, by exchanging the responses of the model."""
    labels = fits.assembly.description.response_labels
    for former, latter in islice(combinations(range(len(labels)), 2), _SETTINGS.most_exchanges):
        exchanged = with_responses_exchanged(fits.assembly, former, latter)
        if exchanged is not None:
            quick = fits.fit(fits.problem.with_assembly(exchanged), [fits.search(exchanged, fits.shape)])
            yield "order", f"the measurements at {labels[former]} and {labels[latter]} exchanged", quick


def try_missing_resonances(fits: QuickFits) -> Iterator[Candidate]:
    """Yield the fits with a resonance added where the measurement has one and the model has none."""
    theta = fits.unchanged.theta
    values, measured = fits.values(theta), fits.target.values
    if len(fits.target.frfs) > 1 or not fits.target.frfs[0].has_phase:
        return
    variance = fits.relative * np.abs(measured) ** 2
    missed = SearchLines(fits.target, variance).missed_resonances(variance, values)
    for frequency in np.sort(missed)[: _SETTINGS.most_resonances].tolist():
        added = _added_resonance(fits.target.frequency, measured, values, frequency)
        if added is not None:
            words = f"a resonance at {frequency:.4g} Hz that the model does not have"
            yield "resonance", words, fits.judged(theta, values + added)


def _added_resonance(
    frequency: NDArray[np.float64], measured: NDArray[np.complex128], values: NDArray[np.complex128], at: float
) -> NDArray[np.complex128] | None:
    """Return the FRF of a resonance that makes up for the difference of measured and model's values around it."""
    near = np.abs(frequency - at) < _SETTINGS.reach * at
    if np.count_nonzero(near) < _SETTINGS.fewest_lines:
        return None
    missing, size = (measured - values)[near], np.abs(measured[near])

    def shape(logarithms: NDArray[np.float64], axis: NDArray[np.float64]) -> NDArray[np.complex128]:
        natural, loss = np.exp(logarithms)
        return np.asarray(1.0 / (natural**2 * (1.0 + 1j * loss) - axis**2))

    def added(logarithms: NDArray[np.float64]) -> tuple[complex, NDArray[np.complex128]]:
        column = shape(logarithms, frequency[near]) / size
        residue = complex(np.vdot(column, missing / size) / np.vdot(column, column))
        return residue, missing / size - residue * column

    def residuals(logarithms: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(added(logarithms)[1].view(np.float64))

    start = np.log([at, _SETTINGS.damping])
    ends = np.log(at * (1.0 + _SETTINGS.reach * np.array([-1.0, 1.0])))
    bounds = np.stack([ends, np.log(_SETTINGS.dampings)], axis=1)
    found = least_squares(residuals, start, bounds=(bounds[0], bounds[1]), loss="soft_l1").x
    return np.asarray(added(found)[0] * shape(found, frequency))


def try_ranges(fits: QuickFits) -> Iterator[Candidate]:
    """Try wider ranges for the parameters that ended at an end of theirs."""
    assembly, fraction = fits.assembly, fits.assembly.to_unit(fits.unchanged.theta)
    for index in np.flatnonzero((fraction <= 0.0) | (fraction >= 1.0)).tolist():
        parameter = assembly.parameters[index]
        for lower, upper in _widened(parameter, at_upper=fraction[index] >= 1.0):
            try:
                widened = with_range(assembly, index, lower, upper)
                starts = [fits.unchanged.theta, fits.search(widened, fits.shape)]
                quick = fits.fit(fits.problem.with_assembly(widened), starts)
            except DovetailError:
                continue
            value = float(quick.theta[index])
            if not parameter.lower <= value <= parameter.upper:
                yield (
                    "range",
                    f"{parameter.name} at {format_quantity(value, parameter.unit)}, outside its range",
                    quick,
                )
            break


def _widened(parameter: Parameter, *, at_upper: bool) -> list[tuple[float, float]]:
    """Return the ends of a parameter's range after an extension, the widest first.

    On a logarithmic scale it is extended at both ends: where the value is far outside, the fit may end at the other.
    """
    lower, upper = parameter.lower, parameter.upper
    if parameter.scale == "log":
        return [(lower / factor, upper * factor) for factor in _SETTINGS.range_factors]
    return [(lower, upper + (upper - lower)) if at_upper else (max(lower - (upper - lower), min(lower, 0.0)), upper)]


def try_damping(fits: QuickFits) -> Iterator[Candidate]:
    """Yield the fits with structural damping in all joints, and with viscous damping in all, where either is new."""
    assembly, axis = fits.assembly, fits.target.frequency
    middle = float(f"{np.sqrt(axis.min() * axis.max()):.2g}")
    others = (
        (with_structural_joints(assembly, middle), f"structurally ('structural_damping: {middle:g} Hz' of each)"),
        (with_viscous_joints(assembly), "viscously (without 'structural_damping')"),
    )
    for damped, words in others:
        if damped is not None:
            starts = [fits.unchanged.theta, fits.search(damped, fits.unchanged.theta)]
            yield "damping", f"joints damped {words}", fits.fit(fits.problem.with_assembly(damped), starts)


def try_window(fits: QuickFits) -> Iterator[Candidate]:
    """Yield the fit without the damping that an exponential window adds equally to all resonances."""
    values = fits.target.split(fits.values(fits.unchanged.theta))
    resonances = fit_resonances(fits.target.frfs, values)
    if not len(resonances.poles):
        return

    def without(added: float) -> tuple[float, QuickFit]:
        return added, _without_window(fits, values, resonances, added)

    least = float(resonances.poles.imag.min())
    tried = [without(least * part) for part in _SETTINGS.windows]
    while tried[-1][1].misfit < tried[-2][1].misfit and tried[-1][0] < _SETTINGS.most_window * least:
        tried.append(without(3.0 * tried[-1][0]))
    if min(quick.misfit for _, quick in tried) > fits.unchanged.misfit - _SETTINGS.promising:
        return
    for halving in range(1, _SETTINGS.narrowings + 1):
        best = min(tried, key=lambda pair: pair[1].misfit)[0]
        step = 3.0 ** (0.5**halving)
        tried += [without(best / step), without(best * step)]
    added, quick = min(tried, key=lambda pair: pair[1].misfit)
    rate = 2.0 * np.pi * added
    yield "window", f"the damping of an exponential window, exp(-{rate:.3g} t/s), taken out", quick


def _without_window(
    fits: QuickFits, values: Sequence[NDArray[np.complex128]], resonances: Resonances, added: float
) -> QuickFit:
    """Fit the joint to the measurement corrected for a window's damping [Hz], by the resonances of the best fit."""
    frfs = []
    for frf, plain, near in zip(fits.target.frfs, values, resonances.near, strict=True):
        distance = frf.frequency - resonances.poles[:, np.newaxis]
        under_window, without = (conversion(frf.frequency - 1j * a, "receptance", frf.quantity) for a in (added, 0.0))
        damped = plain + (near * (distance / (distance - 1j * added) - 1.0)).sum(axis=0)
        frfs.append(replace(frf, values=frf.values * plain / damped * without / under_window))
    return fits.fit(fits.problem.with_frfs(frfs), [fits.unchanged.theta])
