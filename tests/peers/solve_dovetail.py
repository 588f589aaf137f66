"""Dovetail on the five problems: ``python tests/peers/solve_dovetail.py``."""

import numpy as np
from problems import CASES, Scores, collet, measurement, one_mass

import dovetail

for problem, assembly, cases in (("one mass", one_mass(), CASES), ("collet", collet(), 2)):
    for program, error in (("Dovetail", 0.0), ("Dovetail, model allowed its usual errors", None)):
        scores = Scores(problem)
        for seed in range(cases):
            truth, measured = measurement(assembly, seed)
            # begin
            result = dovetail.identify(assembly, measured, model_error=error, cause_seconds=0.0)
            # end
            ends = np.transpose([result.interval[parameter.name] for parameter in assembly.parameters])
            scores.add(assembly, truth, assembly.to_unit(result.posterior.estimate), assembly.to_unit(ends))
        scores.show(program=program)
    scores = Scores(problem)
    for seed in range(cases):
        truth, measured = measurement(assembly, seed)
        fit = dovetail.identify(assembly, measured, "refined", cause_seconds=0.0)
        scores.add(assembly, truth, assembly.to_unit(fit.theta))
    scores.show(program="Dovetail, fit alone")
