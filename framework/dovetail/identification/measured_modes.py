"""A table of natural frequencies and damping ratios as the measurement of an assembly, and its result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import listing
from dovetail.identification.reconstruction import identified_parameters, known_parameters
from dovetail.identification.result import Identification, Mode
from dovetail.inference.adequacy import Adequacy
from dovetail.inference.fitting import Fit
from dovetail.measurement import ModalParameters
from dovetail.problem.modal_observations import ModalProblem


@dataclass(frozen=True, eq=False)
class MeasuredModes:
    """A table of modal parameters, and the assembly to which they belong.

    Parameters
    ----------
    described : Assembly
    table : ModalParameters
        Modes may be missing; what is there belongs to the model's nearest modes, each to a different one.
    """

    described: Assembly
    table: ModalParameters

    @property
    def record(self) -> dict[str, Any]:
        """What the provenance of a result records of the measurement."""
        return {"measurement": self.table.label, "measurement_note": "", "measured_quantity": "modal parameters"}

    @cached_property
    def problem(self) -> ModalProblem:
        """The problem of these modes."""
        return ModalProblem.from_table(self.described, self.table)

    def result(
        self,
        theta: NDArray[np.float64],
        *,
        method: str,
        provenance: Mapping[str, Any],
        fit: Fit,
        adequacy: Adequacy,
    ) -> Identification:
        """Build the result of identified parameter values (n_params,) [SI]."""
        modes = tuple(self._modes(theta))
        return Identification(
            method=method,
            parameters=identified_parameters(self.described, theta),
            known={name: at for name, at in known_parameters(self.described).items() if np.isfinite(at)},
            frf=None,
            measured=self.table,
            modes=modes,
            warnings=tuple(self._warnings(modes, adequacy)),
            provenance=provenance,
            fit=fit,
            adequacy=adequacy,
        )

    def _modes(self, theta: NDArray[np.float64]) -> Iterator[Mode]:
        """Yield the modes of the model, up to the last of the table, with those of the table."""
        ((poles, _),) = self.problem.model.poles(theta[np.newaxis])
        row_of = {int(pole): row for row, pole in enumerate(self.problem.model.matched(poles))}
        table = self.table
        columns = [[] if values is None else values.tolist() for values in (table.frequency, table.damping_ratio)]
        for pole, s in enumerate(poles[: max(row_of) + 1].tolist()):
            frequency, damping = (column[row_of[pole]] if pole in row_of and column else None for column in columns)
            natural = abs(s) / (2.0 * np.pi)
            yield Mode(natural, None, None, -s.real / abs(s), measured_frequency=frequency, measured_damping=damping)

    def _warnings(self, modes: tuple[Mode, ...], adequacy: Adequacy) -> Iterator[str]:
        """Yield the warnings that a reader of the result must know."""
        lacking = [f"{mode.natural_frequency:.6g}" for mode in modes if mode.measured_frequency is None]
        if lacking:
            yield f"The table lacks modes that the model has: {listing(lacking)} Hz."
        if not self.problem.observations.variance_known:
            error = adequacy.error_in_intervals
            damping = (
                "" if self.table.damping_ratio is None else f" and {100.0 * error.damping:.2g} % of a damping ratio"
            )
            size = f"{100.0 * error.natural_frequency:.2g} % of a natural frequency{damping}"
            yield f"The table does not give all its errors: {size} were assumed, by the residuals of the fit."
