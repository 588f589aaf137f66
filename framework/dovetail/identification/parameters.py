"""Identified parameters, and the one table of them that terminal, report, CSV, JSON and data frames show.

Data frames of pandas are an extra.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dovetail.errors import require_package
from dovetail.inference.posterior.distribution import Posterior
from dovetail.inference.posterior.verdicts import NOT_TRUSTWORTHY, Group, Verdict
from dovetail.interfaces import Parameter, Prior, Scale
from dovetail.problem.definition import end_reached

ROUNDING = 1e-9
"""Part of its range by which a value may lie outside."""


def place_on_range(value: float, lower: float, upper: float, scale: Scale) -> float:
    """Return where a value lies on a range: 0 at the lower end, 1 at the upper, on its scale; NaN if nowhere."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(Parameter("value", "1", lower, upper, scale).to_unit(np.array(value, dtype=np.float64)))


def is_in_range(value: float, lower: float, upper: float, scale: Scale) -> bool:
    """Return whether a value lies in a range; one at an end does, whatever rounding makes of it."""
    return -ROUNDING <= place_on_range(value, lower, upper, scale) <= 1.0 + ROUNDING


@dataclass(frozen=True)
class TiedParameter:
    """A parameter that the description ties to one that was identified.

    Parameters
    ----------
    name : str
        ``owner.parameter``.
    ratio : float
        By which the identified value is multiplied.
    description, joint : str
        As in `IdentifiedParameter`.
    """

    name: str
    ratio: float
    description: str
    joint: str


@dataclass(frozen=True)
class IdentifiedParameter:
    """One identified parameter.

    Parameters
    ----------
    name : str
        As in ``assembly.parameters``.
    value : float
        SI, in `unit`: of the fit, or of the network, which may give one outside the range.
    unit : str
    lower, upper : float
        The range in which it was identified.
    scale : {"linear", "log"}
    in_range : bool
        Whether the value lies in the range.
    description : str
    joint : str
        The joint it belongs to; the substructure or the response of another one.
    prior : {"uniform", "normal"}
        As in `Parameter`.
    tied : tuple of TiedParameter
        The parameters that are tied to this one.
    """

    name: str
    value: float
    unit: str
    lower: float
    upper: float
    scale: Scale
    in_range: bool
    description: str
    joint: str
    prior: Prior = "uniform"
    tied: tuple[TiedParameter, ...] = ()

    @property
    def definition(self) -> Parameter:
        """The parameter with its range, as the assembly defines it."""
        return Parameter(self.name, self.unit, self.lower, self.upper, self.scale, self.description, self.prior)

    @property
    def bare_name(self) -> str:
        """The name without the owner's."""
        return self.name.removeprefix(f"{self.joint}.")

    def with_tied(self, value: float) -> dict[str, float]:
        """Return a value of this parameter and those of the parameters tied to it, by ``owner.parameter``."""
        values = {tied.name: tied.ratio * value for tied in self.tied}
        return {f"{self.joint}.{self.bare_name}": value, **values}


@dataclass(frozen=True)
class TableRow:
    """What is known of one parameter after an identification, in SI; None where the method does not say.

    Parameters
    ----------
    name : str
    estimate : float
        What to quote of this parameter by itself: the posterior mean, else the value of the fit or of the network.
    interval_low, interval_high : float or None
        Ends of the 90 % interval; None too where the result is not trustworthy.
    unit : str
    precision : str
        How far the true value may be from the estimate, with a probability of 90 %, as in `Verdict`: "±4 %"; empty if
        the method does not say.
    factor : float or None
        Largest ratio of the estimate to an end of the interval, or the reverse; None if the interval includes zero.
    verdict : str
        "identified", "weakly identified", "not identifiable", "not trustworthy"; empty if the method does not judge it.
    why : str
        The reason of the verdict, in a sentence.
    range_low, range_high : float
    scale : {"linear", "log"}
    in_range : bool
        Whether the estimate lies in the range.
    best_fit : float or None
        Of all parameters together, which fit the measurement best; None if that is the estimate. Where parameters
        trade with each other the two differ.
    best_fit_at : str
        The end of the range, "lower" or "upper", at which the value of the fit is within rounding; empty if at neither.
    best_fit_outside : bool or None
        Whether the best fit lies outside the 90 % interval; None without one of them.
    groups : tuple of Group or None
        The separate groups of the likely values, if there are several; the estimate is that of the likeliest.
    network : float or None
        The answer of a trained network, if one took part.
    joint, description : str
        As in `IdentifiedParameter`.
    is_trustworthy : bool
        As in `Identification`.
    tied_to : str
        The identified parameter to which the description ties this one; empty for identified parameters.
    """

    name: str
    estimate: float
    interval_low: float | None
    interval_high: float | None
    unit: str
    precision: str
    factor: float | None
    verdict: str
    why: str
    range_low: float
    range_high: float
    scale: Scale
    in_range: bool
    best_fit: float | None
    best_fit_at: str
    best_fit_outside: bool | None
    groups: tuple[Group, ...] | None
    network: float | None
    joint: str
    description: str
    is_trustworthy: bool
    tied_to: str = ""

    def tied_row(self, tied: TiedParameter) -> TableRow:
        """Return the row of a parameter that is tied to this one."""

        def times(*values: float | None) -> list[Any]:
            return [None if value is None else tied.ratio * value for value in values]

        ends = times(self.interval_low, self.interval_high), times(self.range_low, self.range_high)
        (low, high), (lower, upper) = (pair[::-1] if tied.ratio < 0 else pair for pair in ends)
        estimate, best_fit, network = times(self.estimate, self.best_fit, self.network)
        reversed_end = {"lower": "upper", "upper": "lower"}.get(self.best_fit_at, "")
        return replace(
            self,
            name=tied.name,
            estimate=estimate,
            interval_low=low,
            interval_high=high,
            range_low=lower,
            range_high=upper,
            best_fit=best_fit,
            best_fit_at=reversed_end if tied.ratio < 0 else self.best_fit_at,
            groups=self.groups and tuple(group.times(tied.ratio) for group in self.groups),
            network=network,
            joint=tied.joint,
            description=tied.description,
            tied_to=self.name,
        )


def parameter_table(
    parameters: Mapping[str, IdentifiedParameter],
    posterior: Posterior | None,
    network: Mapping[str, float] | None,
    warning: str,
    *,
    is_fitted: bool,
) -> tuple[TableRow, ...]:
    """Return a row for each parameter in their order, then for each that is tied to one of them.

    The warning is that of the result, whose values may be a fit.
    """
    intervals = {} if posterior is None or warning else posterior.interval()
    estimates = {} if posterior is None else dict(zip(posterior.names, posterior.estimate.tolist(), strict=True))
    verdicts = {} if posterior is None else posterior.verdicts
    groups = {} if posterior is None or warning else posterior.groups
    unreliable = () if posterior is None else posterior.unreliable
    unjudged = Verdict(NOT_TRUSTWORTHY, 0.0, warning) if warning else None
    rows = []
    for name, parameter in parameters.items():
        low, high = intervals.get(name, (None, None))
        estimate, judged = estimates.get(name, parameter.value), verdicts.get(name, unjudged)
        why = "" if judged is None else judged.reason
        limits = parameter.lower, parameter.upper, parameter.scale
        best_fit = parameter.value if is_fitted and name in estimates else None
        rows.append(
            TableRow(
                name=name,
                estimate=estimate,
                interval_low=low,
                interval_high=high,
                unit=parameter.unit,
                precision="" if judged is None else judged.precision,
                factor=None if judged is None or warning else judged.factor,
                verdict="" if judged is None else judged.word,
                why=f"{why} The interval is not to be trusted." if name in unreliable else why,
                range_low=parameter.lower,
                range_high=parameter.upper,
                scale=parameter.scale,
                in_range=is_in_range(estimate, *limits),
                best_fit=best_fit,
                best_fit_at=end_reached(parameter.value, *limits) if is_fitted else "",
                best_fit_outside=_is_outside(best_fit, low, high),
                groups=groups.get(name),
                network=None if network is None else network.get(name),
                joint=parameter.joint,
                description=parameter.description,
                is_trustworthy=not warning,
            )
        )
    pairs = zip(rows, parameters.values(), strict=True)
    return (*rows, *(row.tied_row(tied) for row, parameter in pairs for tied in parameter.tied))


def _is_outside(value: float | None, low: float | None, high: float | None) -> bool | None:
    return None if value is None or low is None or high is None else not low <= value <= high


def dataframe(rows: Sequence[Mapping[str, Any]], index: Sequence[str]) -> Any:
    """Return rows as a data frame with some of their columns as its index."""
    frame = require_package("pandas", "pandas", "to_dataframe").DataFrame.from_records(list(rows))
    return frame.set_index(list(index)) if len(frame) else frame
