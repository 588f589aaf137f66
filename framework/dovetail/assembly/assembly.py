"""An assembly: FRFs, sensitivities and natural frequencies as functions of the sought parameters."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly.description import Description
from dovetail.assembly.parameters import ParameterSpace, Theta
from dovetail.assembly.reader import read_description
from dovetail.errors import Fault, ParameterError, did_you_mean, listing
from dovetail.frf import conversion
from dovetail.interfaces import DIRECTIONS, Parameter
from dovetail.registry import Registry, installed_components
from dovetail.synthesis import Engine, Graph, InterpolatedEngine, Point, assembly_matrices, elastic_frequencies

__all__ = ["Assembly", "load"]

PluginPaths: TypeAlias = str | os.PathLike[str] | Iterable[str | os.PathLike[str]]
"""One plugin file, or several."""

_PROBES = 5
_TRIALS = 256
"""FRFs by which the number of exact lines is chosen, between which the others are interpolated."""


class Assembly:
    """Substructures, joints and one or more response points, made from a description.

    What gives a single FRF gives that of the first response; `frfs` gives those of all.

    Parameters
    ----------
    description : Description
    rigid : bool
        Whether the contacts of the joints with sought parameters are taken as rigid.
    interpolation : float, optional
        Interpolate FRFs between exact lines up to this relative error, as `interpolated` does.
    """

    def __init__(self, description: Description, *, rigid: bool = False, interpolation: float | None = None) -> None:
        self.description = description
        self._space = ParameterSpace(description.joints)
        self._rigid = rigid
        self._interpolation = interpolation

    def __repr__(self) -> str:
        return f"Assembly({self.name!r}, {len(self.parameters)} parameters, {len(self.frequency)} lines)"

    @property
    def name(self) -> str:
        """The description's name."""
        return self.description.name

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The sought parameters with units, ranges and scales."""
        return self._space.parameters

    @property
    def frequency(self) -> NDArray[np.float64]:
        """(n_freq,) Hz."""
        return self.description.frequency

    @cached_property
    def graph(self) -> Graph:
        """The parts and how they are connected."""
        connections = {
            name: replace(joint.connection, rigid=self._rigid and len(joint.fixed) < len(joint.parameters))
            for name, joint in self.description.joints.items()
        }
        return Graph(self.description.substructures, connections)

    @cached_property
    def engine(self) -> Engine:
        """The synthesis engine of the response point."""
        return self._engine([self.drive_point], self._interpolation)

    @cached_property
    def _further(self) -> tuple[Assembly, ...]:
        """The same assembly at each response but the first."""
        return tuple(self.at(index) for index in range(1, len(self.description.responses)))

    @property
    def each_response(self) -> tuple[Assembly, ...]:
        """For each response an assembly whose `frf` is that of this response; the first is this one itself."""
        return self, *self._further

    def at(self, index: int) -> Assembly:
        """Return the same assembly with one of its responses alone.

        Parameters
        ----------
        index : int
            From 0, in the order of the description.
        """
        return Assembly(self.description.at(index), rigid=self._rigid, interpolation=self._interpolation)

    @property
    def drive_point(self) -> Point:
        """Where the structure is struck and its motion is read."""
        response = self.description.response
        return response.substructure, len(DIRECTIONS) * response.node + DIRECTIONS.index(response.direction)

    @cached_property
    def _conversion(self) -> NDArray[np.complex128]:
        """What turns a receptance into the response's quantity."""
        return conversion(self.frequency, "receptance", self.description.response.quantity)

    def _engine(self, points: Sequence[Point], interpolation: float | None = None) -> Engine:
        random = np.random.default_rng(0).random((_PROBES, len(self.parameters)))
        probe = self._by_joint(self.from_unit(random))
        sought = {name: self._space.sought_columns(name) for name in self.graph.connections}
        if interpolation is None:
            return Engine(self.graph, self.frequency, points, probe, sought)
        trial = self._by_joint(self.from_unit(np.random.default_rng(1).random((_TRIALS, len(self.parameters)))))
        return InterpolatedEngine(
            self.graph, self.frequency, points, probe, sought, tolerance=interpolation, trial=trial
        )

    def _by_joint(self, batch: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        return self._space.by_joint(batch)

    def from_unit(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map fractions of the ranges, (..., n_params) from 0 to 1 on the parameters' scales, to SI values."""
        columns = [p.from_unit(fraction[..., i]) for i, p in enumerate(self.parameters)]
        return np.stack(columns, axis=-1) if columns else np.empty(fraction.shape)

    def to_unit(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map SI values (..., n_params) to fractions of the ranges on the parameters' scales."""
        columns = [p.to_unit(theta[..., i]) for i, p in enumerate(self.parameters)]
        return np.stack(columns, axis=-1) if columns else np.empty(theta.shape)

    def vector(self, theta: Theta) -> NDArray[np.float64]:
        """Return one parameter vector (n_params,) from whatever form it is given in.

        Raises
        ------
        ParameterError
            Wrong shape, unknown or missing names, values that are not finite, or a batch.
        """
        batch, single = self._space.batch(theta)
        if not single:
            raise ParameterError(Fault("theta", f"one parameter vector is expected, not a batch of {len(batch)}."))
        vector: NDArray[np.float64] = batch[0]
        return vector

    def frf(self, theta: Theta = None) -> NDArray[np.complex128]:
        """Drive-point FRF of the (first) response, in its quantity.

        Parameters
        ----------
        theta : (n_params,) or (n, n_params) array, or mapping of names to values, optional
            In SI; a mapping's values may be texts with units. The middle of the ranges when it is left out.

        Returns
        -------
        (n_freq,) or (n, n_freq) complex array

        Raises
        ------
        ParameterError
        """
        batch, single = self._space.batch(theta)
        values = self.engine.drive_point(self._by_joint(batch), self._conversion)
        return values[0] if single else values

    def frfs(self, theta: Theta = None) -> NDArray[np.complex128]:
        """FRFs of all responses, each in its own quantity.

        Parameters
        ----------
        theta : as in `frf`

        Returns
        -------
        (n_responses, n_freq) or (n, n_responses, n_freq) complex array
        """
        return np.stack([one.frf(theta) for one in self.each_response], axis=-2)

    def frf_jacobian(self, theta: Theta = None) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Drive-point FRF and its derivatives by every parameter, by the adjoint.

        Parameters
        ----------
        theta : as in `frf`

        Returns
        -------
        frf : (n_freq,) or (n, n_freq) complex array
        jacobian : (n_freq, n_params) or (n, n_freq, n_params) complex array
            Per unit of each parameter.
        """
        batch, single = self._space.batch(theta)
        values, jacobian = self.engine.jacobian(self._by_joint(batch), self._conversion)
        return (values[0], jacobian[0]) if single else (values, jacobian)

    def accelerance_amplitude(self, theta: Theta = None) -> NDArray[np.float32]:
        """Amplitude of the accelerance in single precision, all responses side by side.

        Parameters
        ----------
        theta : as in `frf`

        Returns
        -------
        (n_responses n_freq,) or (n, n_responses n_freq) float32 array
            m/(N s^2); the lines of a second response stand behind those of the first.
        """
        batch, single = self._space.batch(theta)
        factor = conversion(self.frequency, "receptance", "accelerance")
        parts = [one.engine.amplitude(self._by_joint(batch), factor) for one in self.each_response]
        amplitude = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
        return amplitude[0] if single else amplitude

    def receptance(
        self, theta: Theta, outputs: Sequence[tuple[str, float, str]], inputs: Sequence[tuple[str, float, str]]
    ) -> NDArray[np.complex128]:
        """Receptance between any points of the substructures, for one parameter vector.

        Parameters
        ----------
        theta : (n_params,) array or mapping of names to values, or None
        outputs, inputs : sequences of (substructure, position [m], "x" or "rz")

        Returns
        -------
        (n_freq, n_out, n_in) complex array
            m or rad per N or N m.
        """
        vector = self.vector(theta)
        rows, columns = [self.point(*p) for p in outputs], [self.point(*p) for p in inputs]
        engine = self._engine(list(dict.fromkeys([*rows, *columns])))
        return engine.receptance(self._by_joint(vector[None, :]), rows, columns)

    def point(self, substructure: str, position: float, direction: str = "x") -> Point:
        """Return the DOF of a substructure at a node's position.

        Raises
        ------
        ParameterError
            No such substructure, node or direction.
        """
        parts = self.description.substructures
        if substructure not in parts:
            hint = did_you_mean(substructure, parts)
            raise ParameterError(Fault("point", f"there is no substructure '{substructure}'.", listing(parts), hint))
        if direction not in DIRECTIONS:
            raise ParameterError(Fault("point", f"'{direction}' is not a direction.", listing(DIRECTIONS)))
        nodes = parts[substructure].nodes
        nearest = min(range(len(nodes)), key=lambda index: abs(nodes[index].position - position))
        if abs(nodes[nearest].position - position) > 1e-9 + 1e-6 * abs(position):
            raise ParameterError(
                Fault(
                    "point",
                    f"'{substructure}' has no node at {position * 1e3:g} mm.",
                    remedy=f"The nearest is at {nodes[nearest].position * 1e3:g} mm.",
                )
            )
        return substructure, len(DIRECTIONS) * nearest + DIRECTIONS.index(direction)

    def natural_frequencies(self, theta: Theta = None, count: int = 3) -> NDArray[np.float64]:
        """Lowest natural frequencies of the undamped assembly, rigid-body modes left out.

        Parameters
        ----------
        theta : as in `frf`
        count : int

        Returns
        -------
        (count,) or (n, count) array
            Hz; NaN where the model has fewer elastic modes.

        Raises
        ------
        DovetailError
            A substructure is known by its FRFs only.
        """
        batch, single = self._space.batch(theta)
        found = np.full((len(batch), count), np.nan)
        for row, vector in zip(found, batch, strict=True):
            by_joint = {name: values[0] for name, values in self._by_joint(vector[None, :]).items()}
            modes = elastic_frequencies(assembly_matrices(self.graph, by_joint), count)
            row[: len(modes)] = modes
        return found[0] if single else found

    def on(self, frequency: ArrayLike) -> Assembly:
        """Return the same assembly on other frequencies.

        Parameters
        ----------
        frequency : (n_freq,) array
            Hz, positive and increasing; within the range of substructures that are known by their FRFs.
        """
        description = replace(self.description, frequency=np.asarray(frequency, dtype=np.float64))
        return Assembly(description, rigid=self._rigid)

    def rigid(self) -> Assembly:
        """Return the same assembly with the contacts of its identified joints rigid.

        Facing DOFs become one, so that contact stiffness and damping no longer act; what else a joint has (the
        collet's beam and nut masses) stays, and so does the list of parameters.
        """
        return Assembly(self.description, rigid=True, interpolation=self._interpolation)

    def interpolated(self, tolerance: float = 1e-9) -> Assembly:
        """Return the same assembly with FRFs that are interpolated between a few exact lines, for large batches.

        Parameters
        ----------
        tolerance : float
            Greatest relative error of an FRF at any line, as estimated: the difference of two rational functions of
            different degree through the exact lines. An FRF beyond it is computed at every line; so are calls for
            fewer than 32 FRFs, and sensitivities. The estimate is no bound.

        Raises
        ------
        ParameterError
            The tolerance is not between 1e-12 and 1e-7.
        """
        if not 1e-12 <= tolerance <= 1e-7:
            raise ParameterError(Fault("interpolation", f"the tolerance is {tolerance:g}.", "1e-12 to 1e-7"))
        return Assembly(self.description, rigid=self._rigid, interpolation=tolerance)


def load(source: str | os.PathLike[str] | Mapping[str, Any], *, plugins: PluginPaths = ()) -> Assembly:
    """Read an assembly description.

    Parameters
    ----------
    source : path or mapping
        A YAML file, or the same as a dict.
    plugins : path or iterable of paths
        Plugin files to take in beside the installed ones. They run with the rights of the caller.

    Returns
    -------
    Assembly

    Raises
    ------
    DescriptionError
        Everything that is wrong with the description, at once.
    PluginError
        A plugin file cannot be loaded.
    """
    return Assembly(read_description(source, components(plugins)))


def components(plugins: PluginPaths = ()) -> Registry:
    """Return the installed components, with those of plugin files beside them."""
    given = [plugins] if isinstance(plugins, (str, os.PathLike)) else plugins
    files = [Path(plugin) for plugin in given]
    if not files:
        return installed_components()
    registry = Registry()
    registry.load_entry_points()
    for file in files:
        registry.load_file(file)
    return registry
