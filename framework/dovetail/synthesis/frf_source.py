"""What gives FRFs of a graph: an engine at every line, or an interpolation between some of them."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dovetail.synthesis.joint_evaluation import Theta
from dovetail.synthesis.plan import FactorsLike


class FrfSource(Protocol):
    """FRFs between pairs of points and their magnitudes, with arguments and results as those of `Engine`."""

    def frfs(self, theta: Theta, factors: FactorsLike = None) -> NDArray[np.complex128]:
        """Return the FRFs (n, n_pairs, n_freq)."""
        ...

    def amplitudes(self, theta: Theta, factors: FactorsLike) -> NDArray[np.float32]:
        """Return the magnitudes of the FRFs (n, n_pairs, n_freq), in single precision."""
        ...
