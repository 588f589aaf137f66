"""Many local searches from all over the ranges, for comparison."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

import dovetail


class Multistart(dovetail.IdentificationMethod["dovetail.Problem"]):
    """Bounded local searches from the points of a Latin hypercube; the best minimum counts."""

    name = "multistart"
    summary = "Many local searches from points all over the ranges"
    fits_modes = True

    class Config(dovetail.ComponentConfig):
        """How it searches.

        Attributes
        ----------
        starts : int
            Number of searches.
        seconds : float, optional
            Time [s] after which no further step begins.
        objective : {"frf", "weighted"}
            Sum of the squared differences of the FRFs as they are, or over their random error.
        """

        starts: Annotated[int, Field(ge=1)] = 64
        seconds: Annotated[float, dovetail.InUnit("s"), Field(gt=0.0)] | None = None
        objective: Literal["frf", "weighted"] = "frf"

    def identify(
        self, problem: dovetail.Problem, *, seed: int, progress: dovetail.Progress = dovetail.silent
    ) -> dovetail.Estimate:
        """Search from all starting points."""
        options = self.config
        return dovetail.multistart(
            problem,
            starts=options.starts,
            seconds=options.seconds,
            objective=options.objective,
            seed=seed,
            progress=progress,
        )
