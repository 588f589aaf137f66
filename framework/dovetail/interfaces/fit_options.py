"""Options of the fits and posteriors that ship, which a method of a plugin may take over."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from dovetail.interfaces.component import ComponentConfig


class FitOptions(ComponentConfig):
    """How a least-squares fit searches, and when it ends.

    Attributes
    ----------
    tolerance : float
        Decrease of the sum of squared residuals in one step that ends a fit; 1 is a standard deviation of a parameter.
    steps : int
        Largest number of steps of a fit.
    first_starts : int
        Number of searches in the first batch, if no starts are given.
    batches : int
        Largest number of further batches of searches, which follow while no fit reaches the noise.
    """

    tolerance: Annotated[float, Field(gt=0.0)] = 0.02
    steps: Annotated[int, Field(ge=1)] = 100
    first_starts: Annotated[int, Field(ge=1)] = 4
    batches: Annotated[int, Field(ge=0)] = 4


FIT_OPTIONS = FitOptions()
"""Those of a fit without any."""


class PosteriorOptions(FitOptions):
    """How the best fit is found, and how the posterior is represented.

    Attributes
    ----------
    form : {"samples", "laplace"}
        Samples of the posterior, or a Gaussian about its mode, which is faster but cannot follow a curved posterior. If
        the model does not fit, intervals are not to be trusted, and the Gaussian is used in any case.
    samples : int
        Number of samples, 20 at least, for intervals of 90 %.
    """

    form: Literal["samples", "laplace"] = "samples"
    samples: Annotated[int, Field(ge=20)] = 400
