"""The trained network's answer as it is."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dovetail.assembly import Assembly
from dovetail.errors import Fault, MeasurementError, ParameterError, listing
from dovetail.frf import Frf
from dovetail.identification.features import accelerance_amplitudes
from dovetail.identification.provenance import provenance
from dovetail.identification.reconstruction import reconstruct
from dovetail.identification.result import Identification

if TYPE_CHECKING:
    from dovetail.identification.identifier import Identifier

__all__ = ["identify"]

_CANNOT_TELL = (
    "This model cannot tell whether the measurement is like what it was trained on, since it is of an earlier version "
    "or takes several responses: use the method 'refined' to be sure."
)


def identify(assembly: Assembly, measured: tuple[Frf, ...], identifier: Identifier | None = None) -> Identification:
    """Identify the joint from one measured FRF with the network alone.

    Raises
    ------
    ParameterError
        There is no network.
    MeasurementError
        The network has no finite answer.
    """
    if identifier is None:
        found = "the method 'network' needs a trained model."
        raise ParameterError(Fault(assembly.name, found, remedy="Train one with dovetail.train, or use 'refined'."))
    theta = identifier.predict_parameters(accelerance_amplitudes(measured))[0]
    if not np.isfinite(theta).all():
        lost = [p.name for p, value in zip(assembly.parameters, theta, strict=True) if not np.isfinite(value)]
        raise MeasurementError(
            f"{measured[0].label}: the network has no finite value for {listing(lost)}: this FRF is far from all it "
            "was trained on. Check its quantity and units."
        )
    origin = provenance(assembly, measured, identifier.evaluation)
    foreign = None
    if identifier.novelty is not None:
        foreign = identifier.novelty.examine(measured[0], assembly.accelerance_amplitude(theta).astype(np.float64))
    result = reconstruct(assembly, theta, measured, method="network", provenance=origin, foreign=foreign)
    return result if foreign is not None else replace(result, warnings=(*result.warnings, _CANNOT_TELL))
