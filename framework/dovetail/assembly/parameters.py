"""The identified parameters, their mapping to joints, parts and measurement chains, and FRFs as functions of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly.measurement_chain import Chain
from dovetail.description.checked import ParameterEntry, Response, resolve
from dovetail.errors import Fault, ParameterError, UnitError, did_you_mean, listing
from dovetail.frf import conversion
from dovetail.interfaces import Parameter
from dovetail.synthesis import Engine, Point
from dovetail.units import format_quantity, to_si

Theta: TypeAlias = ArrayLike | Mapping[str, float | str] | None
"""Parameter values: a vector, a batch, a mapping of names to values (SI, or texts with units), or None.

Parameters that a mapping does not name take the middle of their ranges, and so do all of them for None."""


@dataclass(frozen=True)
class _Source:
    """The value of an entry's parameter: a constant, or a factor times an identified parameter."""

    factor: float
    column: int | None = None

    def of(self, batch: NDArray[np.float64]) -> NDArray[np.float64] | float:
        """Return the values for parameter vectors (n, n_params)."""
        if self.column is None:
            return self.factor
        return batch[:, self.column] if self.factor == 1.0 else self.factor * batch[:, self.column]


class ParameterSpace:
    """The identified parameters, in the order of their owners and of the owners' models.

    Parameters
    ----------
    entries : mapping of str to ParameterEntry
        Of each joint, substructure or response, by name.
    joints : collection of str
        Names of the joints among them.
    connected : collection of str
        Names of those on which the structure depends, joints included.
    tied : mapping of str to ParameterEntry
        Further entries, without identified parameters: all of theirs are known or tied.

    Notes
    -----
    With a single joint, its parameters have the names of its model; all others are named ``owner.parameter``.
    """

    def __init__(
        self,
        entries: Mapping[str, ParameterEntry],
        joints: Collection[str],
        connected: Collection[str],
        tied: Mapping[str, ParameterEntry],
    ) -> None:
        self._entries = entries
        self._connected = connected
        parametric = [name for name in joints if entries[name].parameters]
        self._bare = parametric[0] if len(parametric) == 1 else ""
        columns: dict[tuple[str, str], int] = {}
        parameters: list[Parameter] = []
        self._aliases: dict[str, str] = {}
        for owner, entry in entries.items():
            for parameter in entry.identified:
                full_name = f"{owner}.{parameter.name}"
                public_name = parameter.name if owner == self._bare else full_name
                self._aliases[full_name] = public_name
                columns[owner, parameter.name] = len(parameters)
                parameters.append(replace(parameter, name=public_name))
        self.parameters = tuple(parameters)
        self._sources = {
            owner: tuple(_source(entries, columns, owner, parameter.name, entry) for parameter in entry.parameters)
            for owner, entry in {**entries, **tied}.items()
        }

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

    def batch(self, theta: Theta) -> tuple[NDArray[np.float64], bool]:
        """Return theta as (n, n_params), and whether it was a single vector.

        Raises
        ------
        ParameterError
            Wrong shape, unknown names, values that are not finite.
        """
        if theta is None:
            return self.nominal[None, :], True
        if isinstance(theta, Mapping):
            return self._from_mapping(theta)[None, :], True
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
        if not np.isfinite(values).all():
            sample, column = np.argwhere(~np.isfinite(np.atleast_2d(values)))[0]
            raise ParameterError(Fault("theta", f"{self.names[column]} of vector {sample} is not finite."))
        return np.atleast_2d(values), values.ndim == 1

    def _from_mapping(self, theta: Mapping[str, float | str]) -> NDArray[np.float64]:
        faults, values = [], {}
        units = {parameter.name: parameter.unit for parameter in self.parameters}
        for key, value in theta.items():
            name = self._aliases.get(key, key)
            if name not in units:
                faults.append(self._unknown(key))
                continue
            try:
                values[name] = to_si(value.item() if isinstance(value, np.generic) else value, units[name])
            except UnitError as error:
                faults.append(Fault(f"parameter {key}", error.faults[0].problem))
        if faults:
            raise ParameterError(*faults)
        nominal = zip(self.names, self.nominal.tolist(), strict=True)
        return np.array([values.get(name, middle) for name, middle in nominal])

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

    def by_owner(self, batch: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return the values of all parameters of each owner, including known and tied ones, (n, n_owner)."""
        theta_of_owner = {}
        for name, sources in self._sources.items():
            values = np.empty((len(batch), len(sources)))
            for column, source in enumerate(sources):
                values[:, column] = source.of(batch)
            theta_of_owner[name] = values
        return theta_of_owner

    def varying_columns(self, owner: str) -> list[int]:
        """Return the columns of an owner's parameters that depend on identified ones."""
        return [column for column, source in enumerate(self._sources[owner]) if source.column is not None]

    def add_derivatives(self, owner: str, derivatives: NDArray[Any], total: NDArray[Any]) -> None:
        """Add derivatives by an owner's varying columns (..., n_columns) to those by the parameters (..., n_params)."""
        varying = [source for source in self._sources[owner] if source.column is not None]
        for column, source in enumerate(varying):
            total[..., source.column] += source.factor * derivatives[..., column]

    @cached_property
    def is_plain(self) -> bool:
        """Whether the derivatives by the engine's columns are those by the parameters: no ties, no chains."""
        varying = [source for sources in self._sources.values() for source in sources if source.column is not None]
        sought = [source for name in self._connected for source in self._sources[name] if source.column is not None]
        return len(varying) == len(self.parameters) == len(sought)


def _source(
    entries: Mapping[str, ParameterEntry],
    columns: Mapping[tuple[str, str], int],
    owner: str,
    parameter: str,
    entry: ParameterEntry,
) -> _Source:
    """Follow the ties of a parameter to a known value or an identified parameter."""
    factor = 1.0
    if parameter in entry.ties:
        tie = resolve(entries, entry.ties[parameter])
        factor, owner, parameter, entry = tie.ratio, tie.owner, tie.parameter, entries[tie.owner]
    if parameter in entry.fixed:
        return _Source(factor * entry.fixed[parameter])
    return _Source(factor, columns[owner, parameter])


def points_and_pairs(responses: Sequence[Response]) -> tuple[list[Point], list[tuple[int, int]]]:
    """Return the DOFs of all responses and forces, each once, and the indices of output and input of each response."""
    ends = [(response.point, response.force_point) for response in responses]
    points = list(dict.fromkeys(point for pair in ends for point in pair))
    return points, [(points.index(output), points.index(force)) for output, force in ends]


class ResponseFrfs:
    """FRFs of responses as measured through their chains, in the responses' quantities, and their derivatives.

    Parameters
    ----------
    engine : Engine
        With a pair for each response.
    space : ParameterSpace
    responses : sequence of Response
    calibrations : mapping of str to ParameterEntry
        Of responses, by their names.
    """

    def __init__(
        self,
        engine: Engine,
        space: ParameterSpace,
        responses: Sequence[Response],
        calibrations: Mapping[str, ParameterEntry],
    ) -> None:
        self.engine = engine
        self._space = space
        self._chains = [index for index, response in enumerate(responses) if response.name in calibrations]
        self._calibrations = calibrations
        self._responses = responses
        to_quantity = [conversion(engine.frequency, "receptance", response.quantity) for response in responses]
        self._to_quantity = engine.prepared(np.stack(to_quantity))
        self._to_accelerance = engine.prepared(conversion(engine.frequency, "receptance", "accelerance"))

    def frfs(self, batch: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return FRFs (n, n_responses, n_freq) of parameter vectors (n, n_params)."""
        by_owner = self._space.by_owner(batch)
        values = _for_each(batch, self.engine.frfs(by_owner, self._to_quantity))
        for index in self._chains:
            values[:, index] *= self._chain(index, by_owner).factor
        return values

    def amplitudes(self, batch: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return amplitudes of the accelerances (n, n_responses, n_freq) in single precision."""
        by_owner = self._space.by_owner(batch)
        values = _for_each(batch, self.engine.amplitudes(by_owner, self._to_accelerance))
        for index in self._chains:
            values[:, index] *= np.abs(self._chain(index, by_owner).factor)
        return values

    def jacobian(self, batch: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, n_responses, n_freq) and their derivatives, with a last axis n_params."""
        by_owner = self._space.by_owner(batch)
        values, derivatives = self.engine.frfs_jacobian(by_owner, self._to_quantity)
        values, jacobian = _for_each(batch, values), _for_each(batch, derivatives)
        if not self._space.is_plain:
            jacobian = self._by_parameter(jacobian)
        for index in self._chains:
            values[:, index] = self._calibrate(index, values[:, index], jacobian[:, index], by_owner)
        return values, jacobian

    def _chain(self, index: int, by_owner: Mapping[str, NDArray[np.float64]]) -> Chain:
        """Return the measurement chain of a response."""
        response = self._responses[index]
        entry = self._calibrations[response.name]
        return Chain(self.engine.frequency, response.quantity, entry, by_owner[response.name])

    def _by_parameter(self, derivatives: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return derivatives by the identified parameters, from those by all of the engine's varying columns."""
        jacobian = np.zeros((*derivatives.shape[:-1], len(self._space.parameters)), dtype=np.complex128)
        first = 0
        for name in self.engine.graph.connections:
            width = len(self._space.varying_columns(name))
            self._space.add_derivatives(name, derivatives[..., first : first + width], jacobian)
            first += width
        return jacobian

    def _calibrate(
        self,
        index: int,
        values: NDArray[np.complex128],
        jacobian: NDArray[np.complex128],
        by_owner: Mapping[str, NDArray[np.float64]],
    ) -> NDArray[np.complex128]:
        """Return the FRFs (n, n_freq) of a response after its chain; their derivatives are changed in place."""
        chain, name = self._chain(index, by_owner), self._responses[index].name
        jacobian *= chain.factor[..., np.newaxis]
        of_chain = [values * chain.derivative(column) for column in self._space.varying_columns(name)]
        if of_chain:
            self._space.add_derivatives(name, np.stack(of_chain, axis=-1), jacobian)
        return np.asarray(values * chain.factor)


def _for_each(batch: NDArray[np.float64], values: NDArray[Any]) -> NDArray[Any]:
    """Return values (n, ...) for a batch of n vectors; without joints the engine computes them once."""
    return values if len(values) == len(batch) else np.repeat(values, len(batch), axis=0)
