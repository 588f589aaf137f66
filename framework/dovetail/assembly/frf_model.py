"""What gives FRFs as functions of the identified parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly.parameters import ResponseFrfs
from dovetail.assembly.theta import Theta
from dovetail.description.checked import Description
from dovetail.interfaces import Parameter


class FrfModel(Protocol):
    """FRFs of responses as functions of the identified parameters, such as those of an `Assembly`.

    Its methods take and return what those of `Assembly` do.
    """

    @property
    def description(self) -> Description:
        """The description, whose first response is that of `frf`."""
        ...

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The identified parameters."""
        ...

    @property
    def frequency(self) -> NDArray[np.float64]:
        """(n_freq,) Hz, of the first response."""
        ...

    @property
    def each_response(self) -> tuple[FrfModel, ...]:
        """One model for each response."""
        ...

    def from_unit(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map fractions of the ranges to SI values."""
        ...

    def to_unit(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map SI values to fractions of the ranges."""
        ...

    def frf(self, theta: Theta = None) -> NDArray[np.complex128]:
        """Return the FRF of the first response, (n_freq,) or (n, n_freq)."""
        ...

    def frf_jacobian(self, theta: Theta = None) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the FRF and its derivatives, with a last axis n_params."""
        ...

    def on(self, frequency: ArrayLike, *further: ArrayLike, chosen: bool = False) -> FrfModel:
        """Return the same model at other frequencies, which may be chosen from its own."""
        ...

    def combined(self, others: Sequence[FrfModel], /) -> ResponseFrfs | None:
        """Return the FRFs of the first responses of this and others by one elimination; None if it takes several."""
        ...
