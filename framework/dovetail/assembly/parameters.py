"""The identified parameters of an assembly, and their mapping to the parameters of each joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly.description import JointEntry
from dovetail.errors import Fault, ParameterError, UnitError, did_you_mean, listing
from dovetail.interfaces import Parameter
from dovetail.units import to_si

__all__ = ["ParameterSpace", "Theta"]

Theta: TypeAlias = ArrayLike | Mapping[str, float | str] | None
"""Parameter values: a vector, a batch, a mapping of names to values (SI, or texts with units), or None."""


class ParameterSpace:
    """The identified parameters, in the order of the joints and of their models.

    Parameters
    ----------
    joints : mapping of str to JointEntry

    Notes
    -----
    With a single joint, parameters have the names of its model; with several, they are named ``joint.parameter``.
    """

    def __init__(self, joints: Mapping[str, JointEntry]) -> None:
        self._joints = joints
        parametric = [name for name, joint in joints.items() if joint.parameters]
        self._bare = len(parametric) <= 1
        self._columns: dict[str, list[int]] = {}
        parameters: list[Parameter] = []
        self._aliases: dict[str, str] = {}
        for name, joint in joints.items():
            self._columns[name] = []
            for parameter in joint.parameters:
                if parameter.name in joint.fixed:
                    continue
                full_name = f"{name}.{parameter.name}"
                public_name = parameter.name if self._bare else full_name
                self._aliases[full_name] = public_name
                self._columns[name].append(len(parameters))
                parameters.append(replace(parameter, name=public_name))
        self.parameters = tuple(parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the identified parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def nominal(self) -> NDArray[np.float64]:
        """(n_params,) middle of each range on the scale of the parameter."""
        return np.array([float(parameter.from_unit(np.array(0.5))) for parameter in self.parameters])

    def batch(self, theta: Theta) -> tuple[NDArray[np.float64], bool]:
        """Return theta as (n, n_params), and whether it was a single vector.

        Raises
        ------
        ParameterError
            Wrong shape, unknown or missing names, values that are not finite.
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
        missing = [name for name in self.names if name not in values]
        if missing and not faults:
            faults.append(Fault("theta", f"no value is given for {listing(missing)}."))
        if faults:
            raise ParameterError(*faults)
        return np.array([values[name] for name in self.names])

    def _unknown(self, name: str) -> Fault:
        for joint, entry in self._joints.items():
            for parameter, value in entry.fixed.items():
                if name in (f"{joint}.{parameter}", parameter if self._bare else ""):
                    return Fault(f"parameter {name}", f"it is fixed to {value:g} in the description.")
        hint = did_you_mean(name, self.names)
        return Fault(f"parameter {name}", "the assembly has no such parameter.", listing(self.names, 20), hint)

    def by_joint(self, batch: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return all parameters of each joint, the known ones included, as (n, parameters of the joint)."""
        theta_of_joint = {}
        for name, joint in self._joints.items():
            values = np.empty((len(batch), len(joint.parameters)))
            identified = iter(self._columns[name])
            for column, parameter in enumerate(joint.parameters):
                known = joint.fixed.get(parameter.name)
                values[:, column] = batch[:, next(identified)] if known is None else known
            theta_of_joint[name] = values
        return theta_of_joint

    def identified_columns(self, joint: str) -> list[int]:
        """Return the columns of a joint's theta that hold identified parameters."""
        entry = self._joints[joint]
        return [column for column, parameter in enumerate(entry.parameters) if parameter.name not in entry.fixed]
