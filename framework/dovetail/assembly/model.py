"""An assembly: FRFs, their Jacobian and natural frequencies as functions of the identified parameters."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly.frf_model import FrfModel
from dovetail.assembly.parameters import AffineMap, ParameterSpace, ResponseFrfs
from dovetail.assembly.structure import PointReceptances, ResponsePairs, entries_at_response, graph_between, graph_of
from dovetail.assembly.theta import Theta
from dovetail.assembly.vibration_modes import SeenPoles, VibrationMode
from dovetail.description.checked import Description, Response
from dovetail.description.joints import find_point
from dovetail.errors import Fault, ParameterError
from dovetail.frf import Frf, checked_axis, same_axes
from dovetail.interfaces import Parameter
from dovetail.plain_text import html_table
from dovetail.synthesis import Engine, FrfSource, Graph, InterpolatedFrfs, Point, Within

_Axes: TypeAlias = Sequence[NDArray[np.float64]]
_STRUCTURE_SAMPLES = 5
"""Random parameter vectors that show, with the ends of the ranges, which entries of joints are filled."""
_INTERPOLATION_SAMPLES = 256
"""Random parameter vectors whose FRFs decide how many lines are computed exactly when the others are interpolated."""
_KEPT_ELSEWHERE = 2
"""Assemblies at other frequencies that one keeps, with their engines; more would take too much memory for spindles."""


class Assembly:
    """Substructures, joints and responses, made from a description; a single FRF is that of the first response.

    Parameters
    ----------
    description : Description
    rigid : bool
        Whether the contacts of the joints with identified parameters are rigid.
    interpolation : float, optional
        Relative error up to which FRFs are interpolated between exact lines; see `interpolated`.
    further_frequencies : sequence of (n_freq,) arrays, optional
        Hz; those of each response after the first, if they are others than the description's; see `on`.
    within : sequence of (n_freq,) arrays, optional
        Hz; lines of each response, of which its own are some. Parts are condensed at all of these at once.
    alone : iterable of str
        Parts that are condensed at the assembly's own lines only.
    """

    has_parts = True
    """Whether the description's parts are what is computed."""

    def __init__(
        self,
        description: Description,
        *,
        rigid: bool = False,
        interpolation: float | None = None,
        further_frequencies: _Axes = (),
        within: _Axes = (),
        alone: Iterable[str] = (),
    ) -> None:
        self.description = description
        self._connected = entries_at_response(description)
        tied = {name: entry for name, entry in self._connected.items() if name not in description.entries}
        self._space = ParameterSpace(description.entries, description.joints)
        self._map = AffineMap({**description.entries, **tied}, description.identified_parameters)
        self._added = {name: entry.ties for name, entry in tied.items()}
        self._rigid, self._interpolation, self.alone = rigid, interpolation, frozenset(alone)
        further = len(description.responses) - 1
        self._axes = (description.frequency, *(further_frequencies or [description.frequency] * further))
        self._within = tuple(within) or self._axes
        self._settings: dict[str, Any] = {"rigid": rigid, "interpolation": interpolation}
        self._settings |= {"within": self._within, "alone": self.alone}
        self._elsewhere: deque[Assembly] = deque(maxlen=_KEPT_ELSEWHERE)

    def __repr__(self) -> str:
        return f"Assembly({self.name!r}, {len(self.parameters)} parameters, {len(self.frequency)} lines)"

    def __reduce__(self) -> tuple[Any, ...]:  # without engines, which are compiled again elsewhere
        return partial(type(self), further_frequencies=self._axes[1:], **self._settings), (self.description,)

    def _repr_html_(self) -> str:
        return html_table(repr(self), self._space.rows)

    @property
    def name(self) -> str:
        """The description's name."""
        return self.description.name

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The identified parameters with units, ranges and scales."""
        return self._space.parameters

    @property
    def frequency(self) -> NDArray[np.float64]:
        """(n_freq,) Hz; those of the first response, if each has its own."""
        return self.description.frequency

    @cached_property
    def graph(self) -> Graph:
        """The substructures and their connections."""
        return graph_of(self.description, self._connected, rigid=self._rigid)

    @property
    def engine(self) -> Engine:
        """The synthesis engine of the first response."""
        return self._first.engine

    @property
    def interpolation(self) -> InterpolatedFrfs | None:
        """The interpolation of the first response's FRFs, or None if all lines are computed; see `interpolated`."""
        return self._first.source if isinstance(self._first.source, InterpolatedFrfs) else None

    @cached_property
    def _first(self) -> ResponseFrfs:
        return self._frfs_at(self.description.responses[:1])

    def combined(self, others: Sequence[FrfModel], /) -> ResponseFrfs | None:
        """Return the FRFs of the first responses of this and others by one elimination, if they see one structure."""
        for other in others:
            same = isinstance(other, Assembly) and (self._rigid, self._added) == (other._rigid, other._added)
            if not same or not np.array_equal(self.frequency, other.frequency):
                return None
        return self._frfs_at([each.description.response for each in (self, *others)]) if others else self._first

    def _frfs_at(self, responses: Sequence[Response]) -> ResponseFrfs:
        """Return the FRFs of responses that see the same structure as the first, at its frequencies."""
        pairs = ResponsePairs.from_responses(responses, self.graph)
        engine = self.engine_of(pairs.points, pairs.pairs)
        source: FrfSource = engine
        if self._interpolation is not None:
            drawn = np.random.default_rng(1).random((_INTERPOLATION_SAMPLES, len(self.parameters)))
            source = InterpolatedFrfs(engine, self._interpolation, self.by_joint(self.from_unit(drawn)))
        return ResponseFrfs(engine, source, self._map, responses, self.description.calibrations, pairs)

    @cached_property
    def _further(self) -> tuple[Assembly, ...]:
        return tuple(self.at(index) for index in range(1, len(self.description.responses)))

    @property
    def each_response(self) -> tuple[Assembly, ...]:
        """One assembly for each response, whose `frf` is that of this response; the first is this assembly itself."""
        return self, *self._further

    def at(self, index: int) -> Assembly:
        """Return the same assembly with one response only, by its number from 0, at that response's frequencies."""
        description = replace(self.description.at(index), frequency=self._axes[index])
        return self.with_description(description, within=self._within[index : index + 1])

    def engine_of(self, points: Sequence[Point], pairs: Sequence[tuple[int, int]] = ((0, 0),)) -> Engine:
        """Return a synthesis engine for FRFs between pairs of some points, by their numbers: output and input."""
        inside = np.random.default_rng(0).random((_STRUCTURE_SAMPLES, len(self.parameters)))
        ends = np.repeat([[0.0], [1.0]], len(self.parameters), axis=1)
        probe_theta = self.by_joint(self.from_unit(np.concatenate([inside, ends])))
        columns = {name: self._map.varying_columns(name) for name in self.graph.connections}
        within = Within(self._within[0], self.alone)
        graph = graph_between(self.graph, points)
        return Engine(graph, self.frequency, points, probe_theta, columns, pairs=pairs, within=within)

    def by_joint(self, theta: Theta = None) -> dict[str, NDArray[np.float64]]:
        """Split parameter vectors into all parameters of each joint and unknown part, fixed and tied ones included.

        Parameters
        ----------
        theta : as in `frf`

        Returns
        -------
        dict of str to (n_joint_params,) or (n, n_joint_params) array
            By the joint's name.
        """
        batch, single = self._space.batch(theta)
        by_owner = self._map.by_component(batch)
        return {name: by_owner[name][0] if single else by_owner[name] for name in self._connected}

    def from_unit(self, fraction: ArrayLike) -> NDArray[np.float64]:
        """Map fractions of the ranges, (..., n_params) from 0 to 1 on the parameters' scales, to SI values."""
        return self._space.from_unit(fraction)

    def to_unit(self, theta: Theta) -> NDArray[np.float64]:
        """Map SI values (..., n_params), or theta as in `frf`, to fractions of the ranges on the parameters' scales."""
        return self._space.to_unit(theta)

    def vector(self, theta: Theta) -> NDArray[np.float64]:
        """Return a parameter vector (n_params,) in SI from any form of `theta`.

        Raises
        ------
        ParameterError
            Wrong shape, unknown names, values that are not finite, or a batch.
        """
        batch, single = self._space.batch(theta)
        if not single:
            raise ParameterError(Fault("theta", f"one parameter vector is expected, not a batch of {len(batch)}."))
        return np.asarray(batch[0])

    def frf(self, theta: Theta = None) -> NDArray[np.complex128]:
        """FRF of the first response, in its quantity.

        Parameters
        ----------
        theta : (n_params,) or (n, n_params) array, mapping of names to values, or result, optional
            In SI; the values of a mapping may be texts with units. The middle of the ranges by default, and for
            parameters that a mapping does not name. An `Identification`, or its ``parameters``, which must be complete.

        Returns
        -------
        (n_freq,) or (n, n_freq) complex array
        """
        batch, single = self._space.batch(theta)
        values = self._first.frfs(batch)[:, 0]
        return values[0] if single else values

    def simulate(self, theta: Theta = None) -> Frf:
        """Return `frf` for one parameter vector as a measurement would be given."""
        values, label = self.frf(self.vector(theta)), f"{self.name}, simulated"
        return self.description.response.frf(self.frequency, values, label=label)

    def frfs(self, theta: Theta = None) -> NDArray[np.complex128]:
        """FRFs of all responses, each in its own quantity.

        Parameters
        ----------
        theta : as in `frf`

        Returns
        -------
        (n_responses, n_freq) or (n, n_responses, n_freq) complex array

        Raises
        ------
        ParameterError
            The responses have different frequencies.
        """
        if not same_axes(self._axes, self._axes[:1] * len(self._axes)):
            problem = "the responses have different frequencies, so that their FRFs make no array."
            raise ParameterError(Fault(self.name, problem, remedy="Take 'frf' of each of 'each_response'."))
        return np.stack([assembly.frf(theta) for assembly in self.each_response], axis=-2)

    def frf_jacobian(self, theta: Theta = None) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """FRF of the first response and its Jacobian with respect to the parameters, by the adjoint method.

        Parameters
        ----------
        theta : as in `frf`

        Returns
        -------
        frf : (n_freq,) or (n, n_freq) complex array
        jacobian : (n_freq, n_params) or (n, n_freq, n_params) complex array
            Derivatives in the response's quantity per SI unit of each parameter.
        """
        batch, single = self._space.batch(theta)
        values, jacobian = (array[:, 0] for array in self._first.jacobian(batch))
        return (values[0], jacobian[0].T) if single else (values, np.swapaxes(jacobian, 1, 2))

    def accelerance_amplitude(self, theta: Theta = None) -> NDArray[np.float32]:
        """Amplitude of the accelerance in single precision, for all responses, at `theta` as in `frf`.

        Returns
        -------
        (n_responses n_freq,) or (n, n_responses n_freq) float32 array
            m/(N s^2); the lines of the first response, then those of the second.
        """
        batch, single = self._space.batch(theta)
        amplitudes = [assembly._first.amplitudes(batch)[:, 0] for assembly in self.each_response]
        amplitude = amplitudes[0] if len(amplitudes) == 1 else np.concatenate(amplitudes, axis=1)
        return amplitude[0] if single else amplitude

    def receptance(
        self, theta: Theta, outputs: Sequence[tuple[str, float, str]], inputs: Sequence[tuple[str, float, str]]
    ) -> NDArray[np.complex128]:
        """Receptance between any points of the substructures, for one parameter vector.

        Parameters
        ----------
        theta : as in `frf`, without batches
        outputs, inputs : sequences of (substructure, position [m], direction)

        Returns
        -------
        (n_freq, n_out, n_in) complex array
            m or rad per N or N m.
        """
        vector = self.vector(theta)
        ends = [self.point(*p) for p in outputs], [self.point(*p) for p in inputs]
        between = PointReceptances(self.graph, *ends)
        return between.at(self.engine_of(between.points), self.by_joint(vector[None]))

    def point(self, substructure: str, position: float, direction: str = "x") -> Point:
        """Return the DOF of a substructure at a node's position.

        Raises
        ------
        ParameterError
            No such substructure, node or direction.
        """
        return find_point(self.description.placed_parts, substructure, position, direction)

    def natural_frequencies(self, theta: Theta = None, count: int = 3) -> NDArray[np.float64]:
        """Lowest natural frequencies (count,) or (n, count) [Hz] of the damped assembly; NaN where it has fewer.

        They are the magnitudes of its poles, without those of rigid-body and overdamped motions. A DovetailError is
        raised where a substructure is known by its FRFs only, or the structure is not stable.
        """
        batch, single = self._space.batch(theta)
        frequencies = self._poles.frequencies(self.by_joint(batch), len(batch), count)
        return frequencies[0] if single else frequencies

    def modes(self, theta: Theta = None, count: int = 3) -> tuple[VibrationMode, ...]:
        """Lowest modes of one parameter vector, with damping ratios and shapes, as `natural_frequencies`."""
        return self._poles.modes(self.by_joint(self.vector(theta)[None]), count)

    @cached_property
    def _poles(self) -> SeenPoles:
        return SeenPoles(self.graph)

    def on(self, frequency: ArrayLike, *further: ArrayLike, chosen: bool = False) -> Assembly:
        """Return the same assembly at other frequencies.

        Parameters
        ----------
        frequency, *further : (n_freq,) arrays
            Hz, positive and increasing; within the range of each substructure that is known by its FRFs. One axis for
            all responses, or one for each in the order of the description.
        chosen : bool
            Whether they are some of this assembly's, all of which will be needed: parts are then condensed at all.

        Returns
        -------
        Assembly
            ``each_response[i].frequency`` are those of a response. It is this assembly itself if the frequencies are
            its own. The last two of others are kept, so that an axis that comes again needs no preparation.

        Raises
        ------
        ParameterError
            There are more or fewer axes than responses, and not one; frequencies are not positive and increasing.
        """
        axes, count = tuple(map(checked_axis, (frequency, *further))), len(self._axes)
        if len(axes) not in (1, count):
            problem = f"{len(axes)} frequency axes were given for {count} response{'' if count == 1 else 's'}."
            raise ParameterError(Fault(self.name, problem, "one for all, or one for each"))
        axes = axes if len(axes) == count else axes * count
        within = self._within if chosen else axes
        for known in (self, *self._elsewhere):
            if same_axes(known._axes, axes) and (known is self or same_axes(known._within, within)):
                return known
        made = self.with_description(replace(self.description, frequency=axes[0]), axes[1:], within=within)
        made._elsewhere = deque(maxlen=0)  # whoever asks again, asks this assembly
        self._elsewhere.append(made)
        return made

    def rigid(self) -> Assembly:
        """Return the same assembly with the contacts of its identified joints rigid.

        The DOFs on both sides of a contact become one, so that contact stiffness and damping have no effect. The rest
        of a joint, such as the collet's beam and nut masses, stays, and so does the list of parameters.
        """
        return self.with_description(self.description, rigid=True)

    def interpolated(self, tolerance: float = 1e-9) -> Assembly:
        """Return the same assembly with FRFs interpolated between a few exact lines, which is fast for large batches.

        Parameters
        ----------
        tolerance : float
            Greatest estimated relative error of an FRF at any line: the difference of two rational functions of
            different degree through the exact lines, no bound. FRFs beyond it are computed at every line; so are
            batches of fewer than 32 FRFs, and Jacobians.

        Raises
        ------
        ParameterError
            The tolerance is not between 1e-12 and 1e-7.
        """
        if not 1e-12 <= tolerance <= 1e-7:
            raise ParameterError(Fault("interpolation", f"the tolerance is {tolerance:g}.", "1e-12 to 1e-7"))
        return self.with_description(self.description, interpolation=tolerance)

    def with_description(self, description: Description, further: _Axes | None = None, **changed: Any) -> Assembly:
        """Return the same assembly, on the same lines, with another description of the same responses or of one.

        Parameters
        ----------
        description : Description
        further : sequence of (n_freq,) arrays, optional
            Hz; the lines of each response after the first, if they are others than this assembly's.
        **changed
            Other settings of `Assembly`; those of this one by default.
        """
        further = self._axes[1 : len(description.responses)] if further is None else further
        return Assembly(description, **{**self._settings, **changed}, further_frequencies=further)
