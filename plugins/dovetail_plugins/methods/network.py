"""The estimate of a trained network as it is, which is the method of the publication."""

from __future__ import annotations

import dovetail


class Network(dovetail.IdentificationMethod["dovetail.Problem"]):
    """The answer of a trained network; it needs milliseconds, and no fit."""

    name = "network"
    summary = "The estimate of a trained network, without a fit"
    fits_lines = False

    def identify(
        self,
        problem: dovetail.Problem,
        *,
        seed: int,  # noqa: ARG002
        progress: dovetail.Progress = dovetail.silent,
    ) -> dovetail.Estimate:
        """Return the network's estimate, with samples if it predicts a distribution.

        Raises
        ------
        ParameterError
            There is no network.
        """
        if problem.network is None:
            fault = "the method 'network' needs a trained model."
            remedy = "Train one with dovetail.train, or use 'refined'."
            raise dovetail.ParameterError(dovetail.Fault(problem.assembly.name, fault, remedy=remedy))
        progress("network", 0, 1)
        return problem.network()
