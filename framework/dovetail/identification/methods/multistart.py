"""Many local searches from all over the ranges: the reference method's benchmark."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting import Objective, multistart
from dovetail.identification.foreign import examine
from dovetail.identification.provenance import provenance
from dovetail.identification.reconstruction import reconstruct
from dovetail.identification.result import Identification

if TYPE_CHECKING:
    from dovetail.identification.identifier import Identifier

__all__ = ["identify"]


def identify(
    assembly: Assembly,
    measured: tuple[Frf, ...],
    _identifier: Identifier | None = None,
    *,
    starts: int = 64,
    seconds: float | None = None,
    objective: Objective = "frf",
    seed: int | None = None,
) -> Identification:
    """Fit the joint to the measured FRF by many local searches.

    Parameters
    ----------
    assembly : Assembly
    measured : tuple of Frf
        One for each response, on the assembly's frequencies.
    _identifier : Identifier, optional
        Not asked.
    starts : int
        Points of the Latin hypercube.
    seconds : float, optional
        Time after which no further step is taken.
    objective : {"frf", "weighted"}
        Sum of the squared differences of the FRFs as they are, or over their random error.
    seed : int, optional
        Of the Latin hypercube; the description's by default.
    """
    fit = multistart(
        assembly,
        measured,
        starts=starts,
        seconds=seconds,
        objective=objective,
        seed=assembly.description.identification.seed if seed is None else seed,
    )
    origin = provenance(assembly, measured, None) | {"objective": objective}
    foreign = examine(assembly, measured, fit, name=False)
    return reconstruct(assembly, fit.theta, measured, method="multistart", provenance=origin, fit=fit, foreign=foreign)
