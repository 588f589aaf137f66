"""The identified parameters of an assembly: names across joints, and vectors to and from the joints' own."""

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
    """The parameters that are sought, in the order of the joints and of their models.

    Parameters
    ----------
    joints : mapping of str to JointEntry

    Notes
    -----
    A single joint's parameters bear their own names; those of several joints are told apart as ``joint.parameter``.
    """

    def __init__(self, joints: Mapping[str, JointEntry]) -> None:
        self._joints = joints
        parametric = [name for name, joint in joints.items() if joint.parameters]
        self._bare = len(parametric) <= 1
        self._columns: dict[str, list[int]] = {}
        found: list[Parameter] = []
        self._aliases: dict[str, str] = {}
        for name, joint in joints.items():
            self._columns[name] = []
            for parameter in joint.parameters:
                if parameter.name in joint.fixed:
                    continue
                full = f"{name}.{parameter.name}"
                shown = parameter.name if self._bare else full
                self._aliases[full] = shown
                self._columns[name].append(len(found))
                found.append(replace(parameter, name=shown))
        self.parameters = tuple(found)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sought parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def nominal(self) -> NDArray[np.float64]:
        """(n_params,) middle of each range on the parameter's scale."""
        return np.array([float(parameter.from_unit(np.array(0.5))) for parameter in self.parameters])

    def batch(self, theta: Theta) -> tuple[NDArray[np.float64], bool]:
        """Return theta as (n, n_params), and whether one vector was given.

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
        for given, value in theta.items():
            name = self._aliases.get(given, given)
            if name not in units:
                faults.append(self._unknown(given))
                continue
            try:
                values[name] = to_si(value.item() if isinstance(value, np.generic) else value, units[name])
            except UnitError as error:
                faults.append(Fault(f"parameter {given}", error.faults[0].problem))
        missing = [name for name in self.names if name not in values]
        if missing and not faults:
            faults.append(Fault("theta", f"no value is given for {listing(missing)}."))
        if faults:
            raise ParameterError(*faults)
        return np.array([values[name] for name in self.names])

    def _unknown(self, given: str) -> Fault:
        if self._fixed_value(given) is not None:
            return Fault(f"parameter {given}", f"it is fixed to {self._fixed_value(given):g} in the description.")
        return Fault(
            f"parameter {given}", "the assembly has no such parameter.", listing(self.names, 20),
            did_you_mean(given, self.names),
        )  # fmt: skip

    def _fixed_value(self, given: str) -> float | None:
        for name, joint in self._joints.items():
            for parameter, value in joint.fixed.items():
                if given in (f"{name}.{parameter}", parameter if self._bare else ""):
                    return value
        return None

    def by_joint(self, batch: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Split (n, n_params) into all parameters of each joint, (n, all of its parameters), fixed ones filled in."""
        split = {}
        for name, joint in self._joints.items():
            values = np.empty((len(batch), len(joint.parameters)))
            sought = iter(self._columns[name])
            for column, parameter in enumerate(joint.parameters):
                known = joint.fixed.get(parameter.name)
                values[:, column] = batch[:, next(sought)] if known is None else known
            split[name] = values
        return split

    def sought_columns(self, joint: str) -> list[int]:
        """Return which of a joint's own parameters are sought, as columns of its theta."""
        entry = self._joints[joint]
        return [column for column, parameter in enumerate(entry.parameters) if parameter.name not in entry.fixed]
