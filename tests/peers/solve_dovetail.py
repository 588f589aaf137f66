"""Dovetail on the five problems: ``python tests/peers/solve_dovetail.py``."""

import time

import numpy as np
from interface import directions, positions, recorded, relative_error
from problems import CASES, COLLETS, Scores, collet, measurement, one_mass

import dovetail

for problem, assembly, cases in (("one mass", one_mass(), CASES), ("collet", collet(), COLLETS)):
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

began = time.process_time()
# begin
dofs = dovetail.MeasuredDofs(tuple("123456789"), positions, directions)
point = dovetail.VirtualPoint((0.0, 0.0, 0.0), tuple(range(9)), tuple(range(9)))
frfs = dovetail.VirtualPoints(dofs, dofs, {"point": point}).transformed(recorded)
# end
seconds = round(time.process_time() - began, 2)
Scores("virtual point").show(program="Dovetail", relative_error=relative_error(frfs), cpu_seconds=seconds)
