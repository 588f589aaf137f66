"""A model that is a function: its FRF as a function of frequency and parameters, without parts and joints."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly.frf_model import FrfModel
from dovetail.assembly.loading import load
from dovetail.assembly.model import Assembly
from dovetail.assembly.parameters import ResponseFrfs
from dovetail.description.checked import Description, JointEntry, Place
from dovetail.errors import Fault, ParameterError, listing
from dovetail.frf import QUANTITIES, Quantity, conversion
from dovetail.interfaces import Parameter
from dovetail.interfaces.differentiation import differences

_BAND = {"start": "1 Hz", "stop": "2 Hz", "step": "1 Hz"}
_POINTS = {"model": "lumped", "masses": [{"mass": "1 kg"}, {"mass": "1 kg", "position": "1 m"}]}
_CONNECTED = {"a": {"to": "structure", "at": "0 m"}, "b": {"to": "structure", "at": "1 m"}}
_FRAME = {
    "dovetail": 1,
    "name": "function",
    "frequency": _BAND,
    "substructures": {"structure": _POINTS},
    "joints": {"function": {"model": "spring_damper", "connect": _CONNECTED}},
    "response": {"at": "structure", "position": "0 m", "direction": "x", "quantity": "receptance"},
}
"""A description whose settings a function takes; its parts are never computed."""


class CallableModel(Assembly):
    """A function that gives an FRF, in the place of an assembly: `identify` and all its methods take it.

    Parameters
    ----------
    function : callable
        ``function(frequency, **values)`` returns the FRF (n_freq,) for frequencies (n_freq,) [Hz] and a value [SI] of
        each parameter, by name: ``def frf(frequency, k, c)``.
    parameters : sequence of Parameter
        Those to identify, with their ranges.
    frequency : (n_freq,) array
        Hz; measured lines between the first and the last of them are compared.
    quantity : {"receptance", "mobility", "accelerance"}
        What `function` returns.
    drive_point : bool
        Whether force and motion are at the same point, where a structure only takes power up.
    name : str, optional
        That of the function by default.

    Raises
    ------
    ParameterError
        `function` does not take the parameters, or does not return an FRF; the frequencies do not increase.

    Notes
    -----
    Derivatives are differences of fourth order. A function has no parts: no cause of a misfit is looked for in them,
    and there are no modes.

    Examples
    --------
    >>> import dovetail, numpy as np
    >>> def mount(frequency, k, c):
    ...     s = 2j * np.pi * frequency
    ...     return 1.0 / (s**2 + c * s + k)
    >>> ranges = dovetail.Parameter("k", "N/m", 1e5, 1e7, "log"), dovetail.Parameter("c", "N s/m", 1.0, 100.0, "log")
    >>> model = dovetail.CallableModel(mount, ranges, np.arange(10.0, 600.0))
    >>> model.frf({"k": 1e6, "c": 20.0}).shape
    (590,)
    """

    has_parts = False

    def __init__(
        self,
        function: Callable[..., ArrayLike],
        parameters: Sequence[Parameter],
        frequency: ArrayLike,
        *,
        quantity: Quantity = "receptance",
        drive_point: bool = True,
        name: str | None = None,
    ) -> None:
        self.function = function
        title = name or str(getattr(function, "__name__", type(function).__name__))
        axis = np.asarray(frequency, dtype=np.float64)
        _check(function, parameters, axis, quantity, title)
        super().__init__(_described(title, tuple(parameters), axis, quantity, drive_point=drive_point))
        self._values_at(self.from_unit(np.full((1, len(parameters)), 0.5)))  # faults show before any work

    def __repr__(self) -> str:
        return f"CallableModel({self.name!r}, {len(self.parameters)} parameters, {len(self.frequency)} lines)"

    def __reduce__(self) -> tuple[Any, ...]:
        response = self.description.response
        given: dict[str, Any] = {
            "quantity": response.quantity,
            "drive_point": response.is_drive_point,
            "name": self.name,
        }
        return partial(type(self), **given), (self.function, self.parameters, self.frequency)

    def with_description(self, description: Description, *_further: Any, **_changed: Any) -> Assembly:
        """Return the same function with another description, as on other lines."""
        return _restored(self.function, description)

    def interpolated(self, tolerance: float = 1e-9) -> Assembly:  # noqa: ARG002
        """Return the same model: a function is computed at every line."""
        return self

    def combined(self, others: Sequence[FrfModel], /) -> ResponseFrfs | None:
        """Return the FRF of the function, which has one response; None together with others."""
        return None if others else self._first

    def _frfs_at(self, _responses: object) -> ResponseFrfs:
        return _CalledFrfs(self)

    def _values_at(self, batch: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return FRFs (n, n_freq) of parameter vectors (n, n_params)."""
        names, rows = [parameter.name for parameter in self.parameters], []
        for theta in batch.tolist():
            values = np.asarray(self.function(self.frequency, **dict(zip(names, theta, strict=True))))
            if values.shape != self.frequency.shape or values.dtype.kind not in "cfi":
                problem = f"the function returns an array of the shape {values.shape} and the type {values.dtype}."
                raise ParameterError(Fault(self.name, problem, f"complex values ({len(self.frequency)},), one a line"))
            rows.append(values.astype(np.complex128))
        return np.stack(rows)

    def _refuse(self, *_args: Any, **_named: Any) -> NoReturn:
        problem = "it is a function, which has no parts, joints and modes."
        raise ParameterError(Fault(self.name, problem, remedy="Describe an assembly for them."))

    rigid = receptance = natural_frequencies = modes = engine_of = _refuse


class _CalledFrfs(ResponseFrfs):
    """FRFs of a function in the place of those of an engine.

    Parameters
    ----------
    model : CallableModel
    """

    def __init__(self, model: CallableModel) -> None:
        self._model = model
        quantity = model.description.response.quantity
        self._factor = np.abs(conversion(model.frequency, quantity, "accelerance"))
        self._times = np.ones((1, len(model.frequency)))

    def times(self, factors: NDArray[np.float64]) -> _CalledFrfs:
        """Return these FRFs multiplied by factors (1, n_freq)."""
        other = copy(self)
        other._times = factors * self._times
        return other

    def frfs(self, batch: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return FRFs (n, 1, n_freq)."""
        return self._model._values_at(batch)[:, np.newaxis] * self._times

    def amplitudes(self, batch: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return amplitudes of the accelerances (n, 1, n_freq)."""
        return np.asarray(np.abs(self.frfs(batch)) * self._factor, dtype=np.float32)

    def jacobian(
        self, batch: NDArray[np.float64], scales: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, 1, n_freq) and their derivatives (n, 1, n_params, n_freq), times `scales` (n, n_params)."""
        lower, upper = np.transpose([(p.lower, p.upper) for p in self._model.parameters])
        columns = range(len(self._model.parameters))
        slopes = differences(self._model._values_at, batch, columns, lower, upper)
        factors = self._times if scales is None else self._times * scales[:, np.newaxis, :, np.newaxis]
        return self.frfs(batch), np.asarray(np.swapaxes(slopes, 0, 1)[:, np.newaxis] * factors, dtype=np.complex128)


def _check(
    function: Callable[..., ArrayLike],
    parameters: Sequence[Parameter],
    frequency: NDArray[np.float64],
    quantity: str,
    name: str,
) -> None:
    if not callable(function):
        raise ParameterError(Fault("function", f"{function!r:.40} cannot be called."))
    if not parameters or not all(isinstance(parameter, Parameter) for parameter in parameters):
        raise ParameterError(Fault("parameters", f"{parameters!r:.60}.", "dovetail.Parameter objects, one or more"))
    names = [parameter.name for parameter in parameters]
    if len(set(names)) < len(names):
        raise ParameterError(Fault("parameters", f"a name occurs twice: {listing(names)}."))
    if frequency.ndim != 1 or len(frequency) < 2 or not np.all(np.diff(frequency, prepend=0.0) > 0.0):
        raise ParameterError(Fault("frequency", "it is not a list of increasing positive frequencies.", "(n_freq,) Hz"))
    if quantity not in QUANTITIES:
        raise ParameterError(Fault("quantity", f"'{quantity}' is not a quantity.", listing(QUANTITIES)))
    try:
        inspect.signature(function).bind(frequency, **dict.fromkeys(names, 0.0))
    except TypeError as error:
        raise ParameterError(Fault(name, f"it cannot be called with the parameters: {error}.")) from None
    except ValueError:  # a function of C code, whose arguments are unknown
        pass


def _described(
    name: str,
    parameters: tuple[Parameter, ...],
    frequency: NDArray[np.float64],
    quantity: Quantity,
    *,
    drive_point: bool,
) -> Description:
    """Return a description that holds the parameters and the response of a function."""
    frame = load(_FRAME).description
    (joint,) = frame.joints.values()
    entries = {"function": JointEntry(parameters=parameters, connection=joint.connection)}
    force = None if drive_point else Place("structure", 1, "x", frame.response.dofs)
    ranges = {p.name: {"lower": p.lower, "upper": p.upper, "unit": p.unit, "scale": p.scale} for p in parameters}
    content = {"dovetail": 1, "name": name, "function": name, "parameters": ranges, "quantity": quantity}
    return replace(
        frame,
        name=name,
        source=f"<function {name}>",
        text=json.dumps(content, indent=2, ensure_ascii=False),
        frequency=frequency,
        joints=entries,
        responses=(replace(frame.response, quantity=quantity, force=force),),
    )


def _restored(function: Callable[..., ArrayLike], description: Description) -> CallableModel:
    """Return a model of a function whose description exists."""
    model = CallableModel.__new__(CallableModel)
    model.function = function
    Assembly.__init__(model, description)
    return model
