"""emcee on the same likelihood, from a fit of scipy: ``python tests/peers/solve_emcee.py``."""

import emcee
import numpy as np
from problems import COLLETS, Scores, collet, measurement, one_mass, residuals
from scipy.optimize import least_squares

for problem, assembly, cases, steps in (("one mass", one_mass(), 20, 1000), ("collet", collet(), COLLETS, 2500)):
    scores, count, ratios = Scores(problem), len(assembly.parameters), []
    for seed in range(cases):
        truth, measured = measurement(assembly, seed)
        whitened = residuals(assembly, measured)
        # begin
        random = np.random.default_rng(seed)
        starts = random.uniform(0.05, 0.95, (16, count))
        fits = [least_squares(whitened, start, bounds=(0, 1), max_nfev=200) for start in starts]
        best = min(fits, key=lambda fit: fit.cost).x

        def log_probability(fraction, whitened=whitened):
            if np.any((fraction < 0) | (fraction > 1)):
                return -np.inf
            return -0.5 * np.sum(whitened(fraction) ** 2)

        walkers = np.clip(best + 1e-3 * random.standard_normal((4 * count, count)), 1e-6, 1 - 1e-6)
        sampler = emcee.EnsembleSampler(len(walkers), count, log_probability)
        sampler.run_mcmc(walkers, steps)
        samples = sampler.get_chain(discard=steps // 2, flat=True)
        ends = np.quantile(samples, [0.05, 0.95], axis=0)
        # end
        ratios.append(steps / np.max(sampler.get_autocorr_time(quiet=True)))
        scores.add(assembly, truth, samples.mean(axis=0), ends)
    scores.show(steps_over_autocorrelation=round(float(np.min(ratios)), 1))
