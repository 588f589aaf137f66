"""scipy's least squares on the same residuals, from 16 random starts: ``python tests/peers/solve_scipy.py``."""

import numpy as np
from problems import CASES, COLLETS, Scores, collet, measurement, one_mass, residuals
from scipy.optimize import least_squares

for problem, assembly, cases in (("one mass", one_mass(), CASES), ("collet", collet(), COLLETS)):
    scores, count = Scores(problem), len(assembly.parameters)
    for seed in range(cases):
        truth, measured = measurement(assembly, seed)
        whitened = residuals(assembly, measured)
        # begin
        starts = np.random.default_rng(seed).uniform(0.05, 0.95, (16, count))
        fits = [least_squares(whitened, start, bounds=(0, 1), max_nfev=200) for start in starts]
        best = min(fits, key=lambda fit: fit.cost)
        covariance = np.linalg.pinv(best.jac.T @ best.jac)
        width = 1.645 * np.sqrt(np.diag(covariance))
        ends = np.clip([best.x - width, best.x + width], 0, 1)
        # end
        scores.add(assembly, truth, best.x, ends)
    scores.show()
