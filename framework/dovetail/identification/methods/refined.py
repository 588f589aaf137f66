"""The network's answer, refined by least squares on the measured FRF."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dovetail.frf import Frf
from dovetail.identification.provenance import provenance
from dovetail.identification.reconstruction import reconstruct
from dovetail.identification.refinement import refine
from dovetail.identification.result import Identification
from dovetail.measurement import on_grid

if TYPE_CHECKING:
    from dovetail.identification.identifier import Identifier

__all__ = ["identify"]


def identify(identifier: Identifier, measured: Frf) -> Identification:
    """Identify the joint by a fit that starts, among other points, at the network's answer.

    Raises
    ------
    MeasurementError
        The measurement does not cover the assembly's frequencies.
    """
    assembly = identifier.assembly
    on_axis = on_grid(measured.to("accelerance"), assembly.frequency)
    guess = identifier.predict_parameters(on_axis.amplitude[np.newaxis])[0]
    fitted = refine(assembly, on_axis, [guess] if np.isfinite(guess).all() else (), identifier.evaluation.seed)
    origin = provenance(assembly, measured, identifier.evaluation) | {"misfit": fitted.misfit}
    return reconstruct(assembly, fitted.theta, on_axis, method="refined", provenance=origin)
