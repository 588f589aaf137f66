"""The result of an identification: parameters, reconstructed FRFs and their agreement with the measurement."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import AssemblySource
from dovetail.errors import DovetailError, Fault, by_importance
from dovetail.frf import Frf
from dovetail.identification.inference_groups import InferenceGroups
from dovetail.identification.parameters import IdentifiedParameter, TableRow, dataframe, parameter_table
from dovetail.inference.adequacy.verdict import Adequacy, AtPoint, plain_frf
from dovetail.inference.fitting.fit import Fit
from dovetail.inference.posterior.distribution import Posterior
from dovetail.interfaces import CutShort
from dovetail.measurement import ModalParameters
from dovetail.plain_text import html_table, terminal_text
from dovetail.units import format_quantity

_MISFIT = "The model does not fit the measurement: do not trust the numbers."
_NOT_JUDGED = "The time ended before the fit was judged: do not trust the numbers."
"""At most 80 characters of ASCII, the length of an id line in UFF."""


@dataclass(frozen=True)
class Mode:
    """A natural frequency of the identified model, with its resonance peaks.

    Parameters
    ----------
    natural_frequency : float
        Hz: the magnitude of the pole over 2 pi. NaN for a peak that belongs to no mode.
    reconstructed_peak, measured_peak : float or None
        Hz; where the amplitudes of the two accelerances peak, which damping shifts by some per cent from the natural
        frequency: compare the two, at the first response where both have one. None where the mode has no clear peak.
    damping_ratio : float or None
        Of the critical damping. None for a peak that belongs to no mode.
    measured_frequency, measured_damping : float or None
        Of the mode in a measured table of modal parameters, in Hz and of the critical damping; None where there is no
        table, or it lacks the mode or the damping.
    """

    natural_frequency: float
    reconstructed_peak: float | None
    measured_peak: float | None
    damping_ratio: float | None = None
    measured_frequency: float | None = None
    measured_damping: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """The result of identifying a joint from one measured FRF, from one for each response, or from a table of modes.

    Parameters
    ----------
    method : str
    parameters : mapping of str to IdentifiedParameter
        By name, in the order of ``assembly.parameters``.
    known : mapping of str to float
        SI values of the parameters that the description fixes, as ``joint.parameter``.
    frf : Frf or None
        Reconstructed from the parameters, on the measured lines within the band, in the response's quantity; None where
        the measurement is a table of modal parameters.
    measured : Frf or ModalParameters
        The measurement on these lines, as it was given, in the same quantity; or the table. If there are several
        responses, `frf` and `measured` belong to the first; `responses` has all of them, each on its own lines.
    modes : tuple of Mode
        Of the identified model, within the band, or up to the last one of the table.
    warnings : tuple of str
        What a reader must know before relying on the numbers.
    provenance : mapping
        Versions, description, measurement and seed; plain values.
    fit : Fit or None
        How good the fit is; None if nothing was fitted, and in a result that was read from a file.
    posterior : Posterior or None
        Samples of the parameters and their uncertainty; None if the method has no uncertainty.
    point : str
        Where the first response is.
    further : tuple of AtPoint
        The other responses, if there are several.
    adequacy : Adequacy or None
        How well the model explains the measurement; None if the method does not judge it.
    band : (float, float) or None
        The description's first and last frequency [Hz]; None if they are not known.
    network : mapping of str to float, or None
        The answer of a trained network [SI] by parameter, if one took part.
    peaks_without_mode : tuple of Mode
        Measured peaks that belong to no mode, with the reconstructed ones near by; without natural frequencies.
    is_fitted : bool
        Whether the parameters were fitted to the measurement, and not only estimated by a network.
    cut_short : CutShort or None
        What was left out because of a time limit or of Ctrl-C; None if the result is complete.
    stored_fit : mapping or None
        What a file says of the fit, as `Fit.to_dict` wrote it.

    Notes
    -----
    Whatever shows or passes on a result takes its words from `is_trustworthy` and `warning`. The warning is handed to
    the posterior, whose verdicts then read "not trustworthy", and to the reconstructed FRFs as their note.
    """

    method: str
    parameters: Mapping[str, IdentifiedParameter]
    known: Mapping[str, float]
    frf: Frf | None
    measured: Frf | ModalParameters
    modes: tuple[Mode, ...]
    warnings: tuple[str, ...]
    provenance: Mapping[str, Any]
    fit: Fit | None = None
    posterior: Posterior | None = None
    point: str = ""
    further: tuple[AtPoint, ...] = ()
    adequacy: Adequacy | None = None
    band: tuple[float, float] | None = None
    network: Mapping[str, float] | None = None
    peaks_without_mode: tuple[Mode, ...] = ()
    is_fitted: bool = True
    cut_short: CutShort | None = None
    stored_fit: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        """Make mappings read-only, order the warnings, and hand the warning to what may be used by itself.

        These are the posterior, which also gets the parameters that causes move, and the reconstructed FRFs. The bands
        of a model that does not fit are those in which its FRFs and the measured ones agree poorly.
        """
        self.__setstate__(dict(self.__dict__))
        object.__setattr__(self, "warnings", by_importance(self.warnings))
        if self.posterior is not None:
            definitions = [parameter.definition for parameter in self.parameters.values()]
            moved = (
                {}
                if self.adequacy is None
                else self.adequacy.parameters_moved_by_causes(self.posterior.interval(), definitions)
            )
            object.__setattr__(self, "posterior", replace(self.posterior, warning=self.warning, moved_by_causes=moved))
        if self.adequacy is not None and not self.is_trustworthy:
            bands = tuple(band for response in self.responses for band in response.poor_bands)
            object.__setattr__(self, "adequacy", replace(self.adequacy, bands=bands))
        further = tuple(replace(at_point, frf=replace(at_point.frf, note=self.warning)) for at_point in self.further)
        object.__setattr__(self, "frf", self.frf and replace(self.frf, note=self.warning))
        object.__setattr__(self, "further", further)

    def __repr__(self) -> str:
        """Return assembly, measurement and parameters in one line, the warning before all numbers."""
        values = ", ".join(f"{row.name}={format_quantity(row.estimate, row.unit)}" for row in self.table)
        return terminal_text(
            f"<{type(self).__name__}: {self._head}: {f'{self.warning} ' if self.warning else ''}{values}>"
        )

    @property
    def is_trustworthy(self) -> bool:
        """Whether the numbers can be trusted, as far as the method judges that: False if the model does not fit."""
        return self.adequacy is None or self.adequacy.fits

    @property
    def warning(self) -> str:
        """Sentence that must accompany every number of this result; empty if it is trustworthy."""
        if self.adequacy is None or self.is_trustworthy:
            return ""
        return _NOT_JUDGED if self.adequacy.word == "not judged" else _MISFIT

    @property
    def table(self) -> tuple[TableRow, ...]:
        """What is known of each parameter, the same wherever it is shown: a row for each, in their order."""
        fitted = self.is_fitted
        return parameter_table(self.parameters, self.posterior, self.network, self.warning, is_fitted=fitted)

    @property
    def _head(self) -> str:
        words = self.provenance.get("assembly", ""), self.measured.label, self.method
        return ", ".join(dict.fromkeys(filter(None, words)))

    @property
    def interval(self) -> Mapping[str, tuple[float, float]] | None:
        """The 90 % interval of each parameter [SI] by name; None without a posterior."""
        return None if self.posterior is None else self.posterior.interval()

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for pickling, which read-only mappings refuse."""
        fields = self.__dict__.items()
        return {name: dict(value) if isinstance(value, MappingProxyType) else value for name, value in fields}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Set the fields, mappings as read-only ones."""
        for name, value in state.items():
            object.__setattr__(self, name, MappingProxyType(value) if isinstance(value, dict) else value)

    def _repr_html_(self) -> str:
        rows = []
        for row in self.table:
            ends = [end for end in (row.interval_low, row.interval_high) if end is not None]
            interval = " to ".join(format_quantity(end, row.unit) for end in ends)
            words = row.precision, row.verdict, row.why
            rows.append((row.name, format_quantity(row.estimate, row.unit), interval, *words))
        head = f"<Identification: {self._head}> {self.warning}"
        return html_table(head, [("parameter", "estimate", "90 % interval", "precision", "verdict", "why"), *rows])

    @property
    def responses(self) -> tuple[AtPoint, ...]:
        """The measured and the reconstructed FRF at each response, in the description's order; empty for a table."""
        if self.frf is None or not isinstance(self.measured, Frf):
            return ()
        return AtPoint(self.point, self.frf, self.measured), *self.further

    @property
    def theta(self) -> NDArray[np.float64]:
        """(n_params,) SI values, in the order of ``assembly.parameters``."""
        return np.array([parameter.value for parameter in self.parameters.values()])

    @property
    def coherence(self) -> NDArray[np.float64]:
        """(n_freq,) coherence of reconstruction and measurement at the first response, as in `AtPoint`; or empty."""
        return self.responses[0].coherence if self.responses else np.empty(0)

    @property
    def mean_coherence(self) -> float:
        """Mean of `coherence` over the frequencies; NaN without FRFs."""
        return self.responses[0].mean_coherence if self.responses else np.nan

    def to_inferencedata(self, draws: int = 1000, seed: int = 0, assembly: AssemblySource | None = None) -> Any:
        """Return posterior, predictive values, measured values and more for ArviZ (an extra).

        Parameters
        ----------
        draws : int
            Samples of equal weight, in one chain; those of the posterior are drawn by their weights.
        seed : int
        assembly : Assembly or path, optional
            In which the joint was identified; by default it is made from the description in the result.

        Returns
        -------
        arviz.InferenceData or xarray.DataTree
            A DataTree from ArviZ 1.0 on. `posterior` and `prior`; `observed_data`: the measured FRF of each response,
            with real and imaginary part as dimension ``part``, or the table of modes; `posterior_predictive`: the same
            of the model, with the errors that it is allowed and the random error; `log_likelihood` of the whole
            measurement; `sample_stats`: the weight of each sample and its log posterior density ``lp``.

        Raises
        ------
        DovetailError
            The result has no posterior, or ArviZ is not installed.
        """
        if self.posterior is None:
            problem = f"the method '{self.method}' gives no posterior."
            raise DovetailError(Fault(self.measured.label, problem, remedy='Identify with the method "posterior".'))
        data = InferenceGroups(
            self.posterior,
            [parameter.definition for parameter in self.parameters.values()],
            self.measured if isinstance(self.measured, ModalParameters) else [at.measured for at in self.responses],
            self.known,
            None if self.fit is None else self.fit.variance,
        )
        described = assembly if assembly is not None else self.provenance.get("description", "")
        about = {"warning": self.warning, "measurement": self.measured.label}
        return data.to_arviz(draws, seed, described, about)

    def to_dataframe(self) -> Any:
        """Return `table` as a data frame of pandas (an extra), with the names as index."""
        return dataframe([asdict(row) for row in self.table], ["name"])

    def _plain_fit(self) -> dict[str, Any] | None:
        if self.fit is not None:
            return self.fit.to_dict()
        return None if self.stored_fit is None else dict(self.stored_fit)

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, fit for JSON."""
        first, *_ = self.responses or (None,)
        measured = self.measured
        return {
            "method": self.method,
            "is_trustworthy": self.is_trustworthy,
            "warning": self.warning,
            "adequacy": None if self.adequacy is None else self.adequacy.to_dict(),
            "parameters": {name: asdict(parameter) for name, parameter in self.parameters.items()},
            "table": [asdict(row) for row in self.table],
            "known": dict(self.known),
            "mean_coherence": None if first is None else first.mean_coherence,
            "poor_bands_Hz": [] if first is None else [list(band) for band in first.poor_bands],
            "modes": [asdict(mode) for mode in self.modes],
            "peaks_without_mode": [
                {"reconstructed_peak": peak.reconstructed_peak, "measured_peak": peak.measured_peak}
                for peak in self.peaks_without_mode
            ],
            "warnings": list(self.warnings),
            "cut_short": None if self.cut_short is None else asdict(self.cut_short),
            "interval": None if self.interval is None else {name: list(ends) for name, ends in self.interval.items()},
            "posterior": None if self.posterior is None else self.posterior.to_dict(),
            "fit": self._plain_fit(),
            "network": None if self.network is None else dict(self.network),
            "provenance": dict(self.provenance),
            "band_Hz": None if self.band is None else list(self.band),
            "frequency_Hz": None if self.frf is None else self.frf.frequency.tolist(),
            "point": self.point,
            "quantity": None if self.frf is None else self.frf.quantity,
            "frf": None if self.frf is None else plain_frf(self.frf),
            "measured": plain_frf(measured) if isinstance(measured, Frf) else measured.to_dict(),
            "coherence": self.coherence.tolist(),
            "further_responses": [response.to_dict() for response in self.further],
        }


def joined_warnings(results: Iterable[tuple[str, Identification | None]]) -> str:
    """Return the `warning` of several results, each once and after the names of those that have it."""
    names: dict[str, list[str]] = {}
    for name, result in results:
        if result is not None and result.warning:
            names.setdefault(result.warning, []).append(name)
    return " ".join(f"{', '.join(named)}: {warning}" for warning, named in names.items())
