"""emcee on the same likelihood, from fits of scipy: ``python tests/peers/solve_emcee.py``."""

import emcee
import numpy as np
from problems import Scores, collet, measurement, one_mass, residuals
from scipy.optimize import least_squares

for problem, assembly, cases, steps in (("one mass", one_mass(), 20, 1000), ("collet", collet(), 4, 10000)):
    scores, count, ratios = Scores(problem), len(assembly.parameters), []
    for seed in range(cases):
        truth, measured = measurement(assembly, seed)
        whitened = residuals(assembly, measured)
        # begin
        random = np.random.default_rng(seed)
        starts = random.uniform(0.05, 0.95, (16, count))
        fits = [least_squares(whitened, start, bounds=(0, 1), max_nfev=200) for start in starts]
        fits.sort(key=lambda fit: fit.cost)

        def log_probability(fractions, whitened=whitened):
            outside = np.any((fractions < 0) | (fractions > 1), axis=1)
            return np.where(outside, -np.inf, -0.5 * np.sum(whitened(fractions) ** 2, axis=1))

        valley = np.array([fit.x for fit in fits if fit.cost < fits[0].cost + count])
        walkers = np.resize(valley, (4 * count, count)) + 1e-3 * random.standard_normal((4 * count, count))
        walkers = np.clip(walkers, 1e-6, 1 - 1e-6)
        moves = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)]
        sampler = emcee.EnsembleSampler(len(walkers), count, log_probability, moves=moves, vectorize=True)
        sampler.run_mcmc(walkers, steps)
        samples = sampler.get_chain(discard=steps // 2, flat=True)
        ends = np.quantile(samples, [0.05, 0.95], axis=0)
        # end
        ratios.append(steps / np.max(sampler.get_autocorr_time(quiet=True)))
        scores.add(assembly, truth, samples.mean(axis=0), ends)
    scores.show(steps=steps, steps_over_autocorrelation=round(float(np.min(ratios)), 1))
