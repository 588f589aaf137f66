"""FRFs of responses that see the same structure on the same lines: one elimination gives them all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.calibration import chain_derivatives, chain_factor
from dovetail.assembly.description import ParameterEntry, Response
from dovetail.assembly.parameters import ParameterSpace
from dovetail.frf import conversion
from dovetail.synthesis import Engine, Point

__all__ = ["ResponseFrfs", "points_and_pairs"]


def points_and_pairs(responses: Sequence[Response]) -> tuple[list[Point], list[tuple[int, int]]]:
    """Return the DOFs where responses are measured and excited, each once, and output and input of each response."""
    ends = [(response.point, response.force_point) for response in responses]
    points = list(dict.fromkeys(point for pair in ends for point in pair))
    return points, [(points.index(output), points.index(force)) for output, force in ends]


class ResponseFrfs:
    """FRFs of responses and their derivatives, as the measurement chains show them, in the responses' quantities.

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
        self._chains = [(index, r.name) for index, r in enumerate(responses) if r.name in calibrations]
        self._calibrations = calibrations
        self._responses = responses
        self._conversions = np.stack([conversion(engine.frequency, "receptance", r.quantity) for r in responses])

    def frfs(self, batch: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return FRFs (n, n_responses, n_freq) of parameter vectors (n, n_params)."""
        by_owner = self._space.by_owner(batch)
        values = _for_each(batch, self.engine.frfs(by_owner, self._conversions))
        for index, name in self._chains:
            values[:, index] *= chain_factor(self.engine.frequency, self._calibrations[name], by_owner[name])
        return values

    def amplitudes(self, batch: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return amplitudes of the accelerances (n, n_responses, n_freq) in single precision."""
        by_owner, frequency = self._space.by_owner(batch), self.engine.frequency
        to_accelerance = np.tile(conversion(frequency, "receptance", "accelerance"), (len(self._responses), 1))
        values = _for_each(batch, self.engine.amplitudes(by_owner, to_accelerance))
        for index, name in self._chains:
            values[:, index] *= np.abs(chain_factor(frequency, self._calibrations[name], by_owner[name]))
        return values

    def jacobian(self, batch: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, n_responses, n_freq) and their derivatives, with a last axis n_params."""
        by_owner = self._space.by_owner(batch)
        values, derivatives = self.engine.frfs_jacobian(by_owner, self._conversions)
        values, jacobian = _for_each(batch, values), _for_each(batch, derivatives)
        if not self._space.is_plain:
            jacobian = self._by_parameter(jacobian)
        for index, name in self._chains:
            values[:, index] = self._calibrate(name, values[:, index], jacobian[:, index], by_owner[name])
        return values, jacobian

    def _by_parameter(self, derivatives: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return derivatives by the identified parameters, from those by all columns that the engine varies."""
        jacobian = np.zeros((*derivatives.shape[:-1], len(self._space.parameters)), dtype=np.complex128)
        first = 0
        for name in self.engine.graph.connections:
            width = len(self._space.varying_columns(name))
            self._space.add_derivatives(name, derivatives[..., first : first + width], jacobian)
            first += width
        return jacobian

    def _calibrate(
        self,
        name: str,
        values: NDArray[np.complex128],
        jacobian: NDArray[np.complex128],
        theta: NDArray[np.float64],
    ) -> NDArray[np.complex128]:
        """Return the FRFs (n, n_freq) of a response as its chain shows them; change their derivatives in place."""
        chain, frequency = self._calibrations[name], self.engine.frequency
        factor = chain_factor(frequency, chain, theta)
        jacobian *= factor[..., np.newaxis]
        of_chain = [
            values * chain_derivatives(frequency, chain, theta, chain.parameters[column].name)
            for column in self._space.varying_columns(name)
        ]
        if of_chain:
            self._space.add_derivatives(name, np.stack(of_chain, axis=-1), jacobian)
        return np.asarray(values * factor)


def _for_each(batch: NDArray[np.float64], values: NDArray[Any]) -> NDArray[Any]:
    """Return values (n, ...) for a batch of n vectors; without joints the engine computes them once."""
    return values if len(values) == len(batch) else np.repeat(values, len(batch), axis=0)
