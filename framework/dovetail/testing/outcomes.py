"""The outcome of a check of the conformance kit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Outcome = Literal["passed", "warning", "failed", "not run", "not applicable"]


class Nonconformity(Exception):  # noqa: N818  not an error of the kit
    """A check found that a component does not fulfil its contract.

    Parameters
    ----------
    problem : str
        One sentence.
    remedy : str
        A sentence on what its author should do.
    """

    def __init__(self, problem: str, remedy: str = "") -> None:
        super().__init__(problem)
        self.problem = problem
        self.remedy = remedy


class Reservation(Nonconformity):
    """A check found something that may be intended: a warning, which does not count against the component."""


class NotApplicable(Exception):  # noqa: N818
    """A check does not apply to this component; the text gives the reason, and is printed."""


@dataclass(frozen=True)
class CheckResult:
    """The outcome of one check of one component.

    Parameters
    ----------
    component : str
        Kind and name of the component.
    name : str
        Of the check.
    outcome : 'passed', 'warning', 'failed', 'not run' or 'not applicable'
        A check is not run if a prerequisite has failed. A warning is about something that may be intended.
    problem : str
        A sentence on what is wrong; the reason if the check was not run or does not apply; what was measured, such as
        the time of a call, if it passed.
    remedy : str
        A sentence on what to do about it.
    """

    component: str
    name: str
    outcome: Outcome
    problem: str = ""
    remedy: str = ""

    @property
    def passed(self) -> bool:
        """Whether the check was run and found nothing wrong."""
        return self.outcome == "passed"

    @property
    def ok(self) -> bool:
        """Whether the component is accepted: passed, perhaps with a warning, or not applicable."""
        return self.outcome in ("passed", "warning", "not applicable")

    def __str__(self) -> str:
        line = f"{self.outcome:<15} {self.name.replace('_', ' ')}"
        if self.outcome not in ("warning", "failed"):
            return f"{line}: {self.problem}" if self.problem else line
        return "\n".join([line, *(f"{'':<15}   {text}" for text in (self.problem, self.remedy) if text)])
