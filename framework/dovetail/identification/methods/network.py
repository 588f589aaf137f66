"""The trained network's answer as it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dovetail.errors import MeasurementError, listing
from dovetail.frf import Frf
from dovetail.identification.provenance import provenance
from dovetail.identification.reconstruction import reconstruct
from dovetail.identification.result import Identification
from dovetail.measurement import on_grid

if TYPE_CHECKING:
    from dovetail.identification.identifier import Identifier

__all__ = ["identify"]


def identify(identifier: Identifier, measured: Frf) -> Identification:
    """Identify the joint from one measured FRF with the network alone.

    Raises
    ------
    MeasurementError
        The measurement does not cover the assembly's frequencies, or the network has no finite answer.
    """
    assembly = identifier.assembly
    on_axis = on_grid(measured.to("accelerance"), assembly.frequency)
    theta = identifier.predict_parameters(on_axis.amplitude[np.newaxis])[0]
    if not np.isfinite(theta).all():
        lost = [p.name for p, value in zip(assembly.parameters, theta, strict=True) if not np.isfinite(value)]
        raise MeasurementError(
            f"{measured.label}: the network has no finite value for {listing(lost)}: this FRF is far from all it was "
            "trained on. Check its quantity and units."
        )
    return reconstruct(
        assembly, theta, on_axis, method="network", provenance=provenance(assembly, measured, identifier.evaluation)
    )
