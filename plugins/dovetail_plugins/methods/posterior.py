"""The refined fit, with the posterior of the parameters: intervals, correlations and verdicts."""

from __future__ import annotations

import dovetail
from dovetail_plugins.methods.refined import Refined


class PosteriorMethod(Refined):
    """The refined fit, then samples of the posterior; the default method."""

    name = "posterior"
    summary = "The refined fit, with intervals and a verdict for each parameter"
    gives_posterior = True
    references = ("Bardsley et al., SIAM J. Sci. Comput. 36 (2014) A1895",)

    class Config(dovetail.PosteriorOptions, Refined.Config):
        """How the best fit is found, and how the posterior is represented."""

    @property
    def evaluations(self) -> tuple[float, float]:
        """Of the fit and of the samples, medians like those of the fit; half of the latter's time finds the modes."""
        fit, _ = super().evaluations
        return fit, 0.0 if self.config.form == "laplace" else 490.0 * (1.0 + self.config.samples / 400.0)

    def sample(
        self,
        problem: dovetail.Problem,
        judged: dovetail.JudgedFit,
        *,
        seed: int,
        progress: dovetail.Progress = dovetail.silent,
    ) -> dovetail.Posterior:
        """Return the posterior, with the errors that the model turned out to have allowed for."""
        draw = dovetail.laplace_posterior if self.config.form == "laplace" else dovetail.sample_posterior
        return (draw if judged.is_trustworthy else dovetail.laplace_posterior)(
            problem,
            judged.fit.allowing_for_unknown_noise(problem.observations),
            samples=self.config.samples,
            model_error=judged.adequacy.error_in_intervals,
            seed=seed,
            progress=progress,
        )
