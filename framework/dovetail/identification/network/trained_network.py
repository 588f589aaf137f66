"""A trained network as a value: what training gives, a bundle holds, and the methods of identification pass on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, MeasurementError
from dovetail.identification.network.network import Network
from dovetail.identification.network.novelty import Novelty
from dovetail.identification.provenance import Evaluation

__all__ = ["TrainedNetwork"]


@dataclass(frozen=True, eq=False)
class TrainedNetwork:
    """A trained network together with the assembly it was trained for.

    Parameters
    ----------
    assembly : Assembly
    network : Network
    evaluation : Evaluation
        How well it does on the test part of its dataset.
    novelty : Novelty or None
        What is usual for the FRFs that it was trained on; None with a model of an earlier version.
    """

    assembly: Assembly
    network: Network
    evaluation: Evaluation
    novelty: Novelty | None = None

    def predict_parameters(self, amplitude: ArrayLike) -> NDArray[np.float64]:
        """Predict parameters from the amplitude of the accelerance, on the assembly's frequencies.

        Parameters
        ----------
        amplitude : (n_samples, n_responses n_freq) array
            m/(N s^2); the lines of a second response stand behind those of the first.

        Returns
        -------
        (n_samples, n_params) array
            SI values, in the order of ``assembly.parameters``; not confined to their ranges.

        Raises
        ------
        MeasurementError
            The shape is another, or values are negative or not finite.
        """
        return self.network.predict(self._checked(amplitude))

    def predict_samples(self, amplitude: ArrayLike) -> NDArray[np.float64] | None:
        """Predict how far parameters are known from the amplitude of one FRF's accelerance.

        Parameters
        ----------
        amplitude : (n_responses n_freq,) array
            m/(N s^2), as a row of those that `predict_parameters` takes.

        Returns
        -------
        (n_draws, n_params) array or None
            SI values of equal weight; None where the regressor gives values alone.

        Raises
        ------
        MeasurementError
            As of `predict_parameters`.
        """
        return self.network.predict_samples(self._checked(np.asarray(amplitude)[np.newaxis])[0])

    def _checked(self, amplitude: ArrayLike) -> NDArray[np.float32]:
        rows = np.asarray(amplitude, dtype=np.float32)
        lines = len(self.assembly.description.responses) * len(self.assembly.frequency)
        if rows.ndim != 2 or rows.shape[0] == 0 or rows.shape[1] != lines:
            raise MeasurementError(
                Fault("", f"the amplitudes have the shape {rows.shape}.", f"(n_samples, {lines}), one row an FRF")
            )
        if not (np.isfinite(rows).all() and np.all(rows >= 0)):
            raise MeasurementError("an amplitude is negative or not finite.")
        return rows
