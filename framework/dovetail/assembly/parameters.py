"""The identified parameters theta; the values of all components, and FRFs of responses, as functions of theta."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly.measurement_chain import Chain, chain_rule
from dovetail.assembly.structure import ResponsePairs
from dovetail.assembly.theta import HoldsParameters, Theta, values_by_name
from dovetail.description.checked import ParameterEntry, Response, Tie, resolve
from dovetail.errors import Fault, ParameterError, did_you_mean, listing
from dovetail.frf import conversion
from dovetail.interfaces import Parameter
from dovetail.interfaces.joint import Prior, RangeMap, Scale
from dovetail.synthesis import Engine, FrfSource
from dovetail.synthesis.plan import Factors
from dovetail.units import format_quantity


class ParameterMap(ABC):
    """The parameters of all components as functions of the identified parameters theta.

    A component is a joint, a substructure with unknown options, a measurement chain or a sensor. Its values are all
    parameters of its model, known ones included, in the model's order. A component takes them as they are, whatever
    function of theta they may be.

    Attributes
    ----------
    columns : mapping of str to slice
        The columns of each component among all values, by its name.
    varying : (n_values,) bool array
        Which values depend on theta.
    """

    columns: Mapping[str, slice]
    varying: NDArray[np.bool_]

    @abstractmethod
    def values(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values (n, n_values) in SI for vectors theta (n, n_params) in SI."""

    @abstractmethod
    def jacobian(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (n, n_values, n_params), or (1, ...) if they are constant; zero for known values."""

    def by_component(self, theta: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return the values of each component, (n, n_component), by its name."""
        values = self.values(theta)
        return {name: np.ascontiguousarray(values[:, columns]) for name, columns in self.columns.items()}

    def varying_columns(self, component: str) -> list[int]:
        """Return which of a component's own values depend on theta."""
        return [int(column) for column in np.flatnonzero(self.varying[self.columns[component]])]


class AffineMap(ParameterMap):
    """A map whose values are known, or a factor times an identified parameter: those of a description.

    A tie gives the factor, its ratio; all other identified parameters have the factor 1.

    Parameters
    ----------
    components : mapping of str to ParameterEntry
    identified : sequence of (str, str)
        Component and name there of each identified parameter, in the order of theta.
    """

    def __init__(self, components: Mapping[str, ParameterEntry], identified: Sequence[tuple[str, str]]) -> None:
        ends = np.cumsum([0, *(len(entry.parameters) for entry in components.values())]).tolist()
        self.columns = {name: slice(*pair) for name, pair in zip(components, pairwise(ends), strict=True)}
        self._known = np.zeros(ends[-1])
        self._slopes = np.zeros((ends[-1], len(identified)))
        places = [(name, parameter.name) for name, entry in components.items() for parameter in entry.parameters]
        for row, (owner, parameter) in enumerate(places):
            tie = resolve(components, Tie(owner, parameter))
            known = components[tie.owner].fixed.get(tie.parameter)
            if known is None:
                self._slopes[row, identified.index((tie.owner, tie.parameter))] = tie.ratio
            else:
                self._known[row] = tie.ratio * known
        self._rows, self._sources = np.nonzero(self._slopes)
        self._factors = self._slopes[self._rows, self._sources]
        self.varying = np.any(self._slopes, axis=1)

    def values(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values as `ParameterMap.values` does."""
        values = np.tile(self._known, (len(theta), 1))
        values[:, self._rows] = theta[:, self._sources] * self._factors
        return values

    def jacobian(self, _theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives as `ParameterMap.jacobian` does."""
        return self._slopes[np.newaxis]


class ParameterScales:
    """The maps of several parameters; those with the same scale and prior are computed together.

    Parameters
    ----------
    parameters : sequence of Parameter
        In the order of the last axis of all arrays.
    """

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        same_kind: dict[tuple[Scale, Prior], list[int]] = {}
        for column, parameter in enumerate(parameters):
            same_kind.setdefault((parameter.scale, parameter.prior), []).append(column)
        self._groups: list[tuple[list[int] | slice, RangeMap]] = []
        for (scale, prior), columns in same_kind.items():
            lower, upper = np.transpose([(parameters[column].lower, parameters[column].upper) for column in columns])
            rows = slice(None) if len(same_kind) == 1 else columns
            self._groups.append((rows, RangeMap.of(lower, upper, scale, prior)))

    def from_unit(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return SI values (..., n_params) for fractions of the ranges."""
        return self._each(fraction, RangeMap.from_unit)

    def to_unit(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return fractions of the ranges (..., n_params) for SI values."""
        return self._each(theta, RangeMap.to_unit)

    def slopes(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (..., n_params) of SI values by the fractions."""
        return self._each(theta, RangeMap.slope)

    def _each(
        self, values: NDArray[np.float64], function: Callable[[RangeMap, NDArray[np.float64]], NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        mapped = np.empty(values.shape)
        for columns, range_map in self._groups:
            mapped[..., columns] = function(range_map, values[..., columns])
        return mapped


class ParameterSpace:
    """The identified parameters, in the order of their owners and of the owners' models.

    Parameters
    ----------
    entries : mapping of str to ParameterEntry
        Of each joint, substructure or response, by name.
    joints : collection of str
        Names of the joints among them.

    Attributes
    ----------
    parameters : tuple of Parameter
        The identified ones.
    scales : ParameterScales

    Notes
    -----
    With a single joint, its parameters have the names of its model; all others are named ``owner.parameter``.
    """

    def __init__(self, entries: Mapping[str, ParameterEntry], joints: Collection[str]) -> None:
        self._entries = entries
        parametric = [name for name in joints if entries[name].parameters]
        self._bare = parametric[0] if len(parametric) == 1 else ""
        parameters: list[Parameter] = []
        self._aliases: dict[str, str] = {}
        for owner, entry in entries.items():
            for parameter in entry.identified:
                full_name = f"{owner}.{parameter.name}"
                self._aliases[full_name] = parameter.name if owner == self._bare else full_name
                parameters.append(replace(parameter, name=self._aliases[full_name]))
        self.parameters = tuple(parameters)
        self.scales = ParameterScales(self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the identified parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """A table of the identified parameters as texts, with a header."""
        texts = [(p.name, format_quantity(p.lower, p.unit), format_quantity(p.upper, p.unit)) for p in self.parameters]
        scales = [(p.scale, p.prior, p.description) for p in self.parameters]
        head = ("parameter", "from", "to", "scale", "prior", "description")
        return [head, *(text + scale for text, scale in zip(texts, scales, strict=True))]

    @property
    def nominal(self) -> NDArray[np.float64]:
        """(n_params,) middle of each range on the scale of the parameter."""
        return np.array([float(parameter.from_unit(np.array(0.5))) for parameter in self.parameters])

    def from_unit(self, fraction: ArrayLike) -> NDArray[np.float64]:
        """Return SI values (..., n_params) for fractions of the ranges; a ParameterError refuses another last axis."""
        values = np.asarray(fraction, dtype=np.float64)
        if values.shape[-1:] != (len(self.parameters),):
            problem = f"the shape {values.shape} does not fit {len(self.parameters)} parameters."
            raise ParameterError(Fault("fraction", problem, f"(..., {len(self.parameters)})"))
        return self.scales.from_unit(values)

    def to_unit(self, theta: Theta) -> NDArray[np.float64]:
        """Return fractions of the ranges (..., n_params) for SI values, or for what `batch` takes."""
        if isinstance(theta, np.ndarray):
            return self.scales.to_unit(theta)
        values, single = self.batch(theta)
        fractions = self.scales.to_unit(values)
        return fractions[0] if single else fractions

    def batch(self, theta: Theta) -> tuple[NDArray[np.float64], bool]:
        """Return theta as (n, n_params), and whether it was a single vector.

        Raises
        ------
        ParameterError
            Wrong shape, unknown names, other units, values that are not finite; a result that lacks parameters.
        """
        if not isinstance(theta, np.ndarray) and isinstance(theta, HoldsParameters):
            theta = theta.parameters
        if theta is None:
            return self.nominal[None, :], True
        if isinstance(theta, Mapping):
            values_of = values_by_name(theta, self.parameters, self._aliases, self._unknown)
            named = zip(self.names, self.nominal.tolist(), strict=True)
            return np.array([[values_of.get(name, middle) for name, middle in named]]), True
        try:
            values = np.array(theta, dtype=np.float64)
        except (TypeError, ValueError):
            raise ParameterError(Fault("theta", f"{theta!r} is not an array of numbers.")) from None
        if values.ndim not in (1, 2) or values.shape[-1] != len(self.parameters):
            raise ParameterError(
                Fault(
                    "theta",
                    f"the shape {values.shape} does not fit {len(self.parameters)} parameters.",
                    f"({len(self.parameters)},) or (n, {len(self.parameters)}), in the order {listing(self.names)}",
                )
            )
        hidden = (
            np.ma.getmaskarray(np.ma.asarray(theta))
            if np.ma.is_masked(theta)
            else np.zeros(values.shape, dtype=np.bool_)
        )
        if not np.isfinite(values).all() or hidden.any():
            sample, column = np.argwhere(np.atleast_2d(hidden | ~np.isfinite(values)))[0]
            problem = "masked" if np.atleast_2d(hidden)[sample, column] else "not finite"
            raise ParameterError(Fault("theta", f"{self.names[column]} of vector {sample} is {problem}."))
        return np.atleast_2d(values), values.ndim == 1

    def _unknown(self, name: str) -> Fault:
        for owner, entry in self._entries.items():
            for parameter in entry.parameters:
                if name not in (f"{owner}.{parameter.name}", parameter.name if owner == self._bare else ""):
                    continue
                if parameter.name in entry.fixed:
                    known = entry.fixed[parameter.name]
                    return Fault(f"parameter {name}", f"it is fixed to {known:g} in the description.")
                tie = entry.ties[parameter.name]
                return Fault(f"parameter {name}", f"the description ties it to '{tie.owner}.{tie.parameter}'.")
        hint = did_you_mean(name, self.names)
        return Fault(f"parameter {name}", "the assembly has no such parameter.", listing(self.names, 20), hint)


class ResponseFrfs:
    """FRFs of responses as measured through their chains, in the responses' quantities, and their derivatives.

    Parameters
    ----------
    engine : Engine
        With the pairs of the responses, which differentiates by all values that depend on theta.
    source : FrfSource
        The same engine, or one that interpolates its FRFs.
    parameter_map : ParameterMap
    responses : sequence of Response
    calibrations : mapping of str to ParameterEntry
        Of responses, by their names.
    pairs : ResponsePairs, optional
        The engine's pairs; by default those of the responses.
    """

    def __init__(
        self,
        engine: Engine,
        source: FrfSource,
        parameter_map: ParameterMap,
        responses: Sequence[Response],
        calibrations: Mapping[str, ParameterEntry],
        pairs: ResponsePairs | None = None,
    ) -> None:
        self.engine = engine
        self.source = source
        self._map = parameter_map
        self._chains = [
            index
            for index, response in enumerate(responses)
            if response.name in calibrations and not Chain.is_identity(calibrations[response.name])
        ]
        self._calibrations = calibrations
        self._responses, self._pairs = responses, pairs or ResponsePairs.from_responses(responses, engine.graph)
        to_quantity = [conversion(engine.frequency, "receptance", response.quantity) for response in responses]
        to_accelerance = [conversion(engine.frequency, "receptance", "accelerance")] * len(responses)
        self._in_quantity, self._in_accelerance = np.stack(to_quantity), np.stack(to_accelerance)
        self._to_quantity, self._to_accelerance = map(self._prepared, (self._in_quantity, self._in_accelerance))

    def _prepared(self, factors: NDArray[np.complex128]) -> Factors:
        """Return the engine's factors: those of the responses if each is a pair."""
        return self.engine.prepared(factors if self._pairs.weights is None else None)

    def times(self, factors: NDArray[np.float64]) -> ResponseFrfs:
        """Return these FRFs, without their amplitudes, multiplied by factors (n_responses, n_freq)."""
        other = copy(self)
        other._in_quantity = factors * self._in_quantity
        other._to_quantity = self._prepared(other._in_quantity)
        return other

    def frfs(self, batch: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return FRFs (n, n_responses, n_freq) of parameter vectors (n, n_params)."""
        by_owner = self._map.by_component(batch)
        values = _for_each(batch, self._pairs.summed(self.source.frfs(by_owner, self._to_quantity), self._in_quantity))
        for index in self._chains:
            values[:, index] *= self._chain(index, by_owner).factor
        return values

    def amplitudes(self, batch: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return amplitudes of the accelerances (n, n_responses, n_freq) in single precision."""
        by_owner = self._map.by_component(batch)
        if self._pairs.weights is None:
            amplitudes = self.source.amplitudes(by_owner, self._to_accelerance)
        else:
            frfs = self.source.frfs(by_owner, self._to_accelerance)
            amplitudes = np.abs(self._pairs.summed(frfs, self._in_accelerance)).astype(np.float32)
        values = _for_each(batch, amplitudes)
        for index in self._chains:
            values[:, index] *= np.abs(self._chain(index, by_owner).factor)
        return values

    def jacobian(
        self, batch: NDArray[np.float64], scales: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, n_responses, n_freq) and their derivatives (n, n_responses, n_params, n_freq).

        Parameters
        ----------
        batch : (n, n_params) array
        scales : (n, n_params) array, optional
            Factors of the derivatives, such as derivatives of the parameters by fractions of their ranges.
        """
        by_owner, slopes = self._map.by_component(batch), self._map.jacobian(batch)
        scales = np.ones(batch.shape) if scales is None else scales
        of_graph = slopes[:, self._graph_columns]
        in_place = _slopes_in_place(of_graph)
        factors = None if in_place is None else in_place * scales
        values, derivatives = (
            self._pairs.summed(jacobians, self._in_quantity)
            for jacobians in self.engine.frfs_jacobian(by_owner, self._to_quantity, factors)
        )
        values, jacobian = _for_each(batch, values), _for_each(batch, np.swapaxes(derivatives, 2, 3))
        if in_place is None:
            jacobian = chain_rule(jacobian, of_graph * scales[:, np.newaxis])
        for index in self._chains:
            chain, name = self._chain(index, by_owner), self._responses[index].name
            by_chain = [values[:, index] * chain.derivative(c) for c in self._map.varying_columns(name)]
            jacobian[:, index] *= chain.factor[:, np.newaxis]
            if by_chain:
                of_chain = slopes[:, self._columns_of([name])] * scales[:, np.newaxis]
                jacobian[:, index] += chain_rule(np.stack(by_chain, axis=1), of_chain)
            values[:, index] *= chain.factor
        return values, jacobian

    @cached_property
    def _graph_columns(self) -> list[int]:
        """Columns of the values on which the structure depends."""
        return self._columns_of(self.engine.graph.connections)

    def _columns_of(self, components: Iterable[str]) -> list[int]:
        """Return the columns of some components' values that depend on theta, among all values."""
        pairs = ((self._map.columns[name].start, self._map.varying_columns(name)) for name in components)
        return [first + column for first, columns in pairs for column in columns]

    def _chain(self, index: int, by_owner: Mapping[str, NDArray[np.float64]]) -> Chain:
        """Return the measurement chain of a response."""
        response = self._responses[index]
        entry = self._calibrations[response.name]
        return Chain(self.engine.frequency, response.quantity, entry, by_owner[response.name])


def _for_each(batch: NDArray[np.float64], values: NDArray[Any]) -> NDArray[Any]:
    """Return values (n, ...) for a batch of n vectors; without joints the engine computes them once."""
    return values if len(values) == len(batch) else np.repeat(values, len(batch), axis=0)


def _slopes_in_place(slopes: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the slopes (n, n_params) if each parameter is the source of the value in its place and of no other."""
    _, count, parameters = slopes.shape
    others = ~np.eye(count, parameters, dtype=np.bool_)
    return None if count != parameters or slopes[:, others].any() else np.einsum("nii->ni", slopes)
