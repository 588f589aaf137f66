"""A trained model: it identifies joint parameters from a measured FRF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.identification.foreign import Novelty
from dovetail.identification.identify import identify
from dovetail.identification.metrics import Evaluation
from dovetail.identification.network import Network
from dovetail.identification.result import Identification

__all__ = ["Identifier"]


@dataclass(frozen=True, eq=False)
class Identifier:
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

    def identify(self, measured: Frf | Sequence[Frf], method: str = "network", **options: Any) -> Identification:
        """Identify the joint from the measured FRF of the assembly's response point, or of each of its points.

        Parameters
        ----------
        measured : Frf or sequence of Frf
            One for each response, of any quantity; it must cover the assembly's frequencies.
        method : str
            ``"network"``: the trained network's answer as it is. ``"refined"``: a least-squares fit to the measured
            FRF that starts, among other points, there. ``"multistart"``: many local searches.
        **options
            Of the method, see `dovetail.identify`.

        Returns
        -------
        Identification

        Raises
        ------
        MeasurementError
            The measurement does not cover the assembly's frequencies, or lies so far from the training data that
            the network has no finite answer.
        ParameterError
            The method has no such option.
        ValueError
            `method` is not a method.
        """
        return identify(self.assembly, measured, method, model=self, **options)

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
        given = np.asarray(amplitude, dtype=np.float32)
        lines = len(self.assembly.description.responses) * len(self.assembly.frequency)
        if given.ndim != 2 or given.shape[0] == 0 or given.shape[1] != lines:
            raise MeasurementError(
                Fault("", f"the amplitudes have the shape {given.shape}.", f"(n_samples, {lines}), one row an FRF")
            )
        if not (np.isfinite(given).all() and np.all(given >= 0)):
            raise MeasurementError("an amplitude is negative or not finite.")
        return self.network.predict(given)

    def save(self, path: str | Path) -> Path:
        """Write the model as a bundle: a folder of JSON and safetensors, nothing pickled.

        Parameters
        ----------
        path : str or Path
            The folder; a model that is there already is replaced.

        Returns
        -------
        Path

        Raises
        ------
        BundleError
            Something else than a model is at `path`, or it cannot be written.
        """
        from dovetail.identification.bundle import save

        return save(self, path)
