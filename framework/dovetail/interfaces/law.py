"""The contract of a law: how a parameter depends on a covariate of the tests, such as a tightening torque."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, PluginError
from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.joint import Scale


@dataclass(frozen=True)
class LawUnknown:
    """An unknown of a law: a value of the parameter somewhere, or a number of the law's own.

    Parameters
    ----------
    name : str
    description : str
    lower, upper : float, optional
        Range of a number; without it, the unknown is a value of the parameter, and has the parameter's range, scale
        and prior.
    scale : {"linear", "log"}
        Of a number, over whose range the prior is uniform.
    unit : str

    Raises
    ------
    PluginError
        The range of a number is empty, not finite, or not positive on a logarithmic scale.
    """

    name: str
    description: str = ""
    lower: float | None = None
    upper: float | None = None
    scale: Scale = "linear"
    unit: str = "1"

    def __post_init__(self) -> None:
        if self.is_value:
            return
        ends = (self.lower, self.upper)
        numbers = all(isinstance(end, (int, float)) and np.isfinite(end) for end in ends)
        if not numbers or not self.lower < self.upper or (self.scale == "log" and self.lower <= 0):  # type: ignore[operator]
            problem = f"its range is from {self.lower} to {self.upper}."
            raise PluginError(Fault(f"unknown {self.name!r:.40} of a law", problem, "lower < upper, both finite"))

    @property
    def is_value(self) -> bool:
        """Whether it is a value of the parameter."""
        return self.lower is None and self.upper is None


class Law(Component):
    """A function of a covariate, on the scale of the parameter that obeys it.

    A value is a position on the parameter's scale: 0 at the lower end of its range, 1 at the upper end. On a
    logarithmic scale the law holds for the parameter's logarithm.
    """

    kind: ClassVar[Kind] = "law"

    @property
    @abstractmethod
    def unknowns(self) -> tuple[LawUnknown, ...]:
        """The unknowns, in the order of the columns of `unknowns` in `evaluate`."""

    @abstractmethod
    def evaluate(
        self, covariate: float, ends: tuple[float, float], unknowns: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the law's values (n,) at a covariate, and their derivatives (n, k) by the unknowns.

        Parameters
        ----------
        covariate : float
            SI.
        ends : (float, float)
            Smallest and largest covariate of the tests; they differ. Beyond them the law is extrapolated.
        unknowns : (n, k) array
            Positions on the parameter's scale, and numbers.
        """

    def objection(self, covariates: NDArray[np.float64]) -> str:  # noqa: ARG002
        """Return why the law cannot be used with these covariates (n,) of the tests, as a sentence; empty if it can."""
        return ""
