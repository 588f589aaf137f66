"""What five torques reveal of one collet, compared with one FRF: widths of 90 % intervals, and whether they hold.

    python tests/benchmarks/five_torques.py [--cases 1] [--seed 0] [--samples 200] [--leave-one-out]

A collet is measured at five torques with 1 % noise, at 600 lines; the model is exact. Its four stiffnesses follow a law
over the torque, and all other parameters are shared. The widths are parts of the ranges, on average over the cases.

    python tests/benchmarks/five_torques.py --leave-one-out [--trained-on 12000]

predicts each test from the others instead, by the series and by the way of the publication: its network (UMAP and a
perceptron) identifies each torque alone, and each parameter is interpolated over the torque on its scale, or
extrapolated from the two nearest torques within its range.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from next_test import LINES, NOISE
from processors import processor_time
from scipy.special import ndtr

import dovetail
from dovetail.inference.posterior import sample_posterior, typical_model_error
from dovetail.network.bundle import TrainedNetwork
from dovetail.registry import installed_components
from dovetail.series.description import Covariate, Role, SeriesDescription, SeriesTest
from dovetail.series.fitted_tests import fit_test
from dovetail.series.fitting import fit_series
from dovetail.series.result import SeriesIdentification
from dovetail.series.sampling import sample_series
from dovetail.series.unknowns import SeriesUnknowns

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "campaign" / "h0_t0.yaml"
TORQUES = (20.0, 40.0, 60.0, 80.0, 100.0)
STIFFNESSES = ("kt_tc", "kr_tc", "kt_hc", "kr_hc")


def identified(
    number: int, seed: int, samples: int, torques: Sequence[float] = TORQUES, lines: np.ndarray = LINES
) -> tuple[SeriesIdentification, np.ndarray]:
    """Draw a series, identify it, and return it with the true unknowns (n_unknowns,) as normal quantiles."""
    random, model = np.random.default_rng([seed, number, 55]), dovetail.load(ASSEMBLY).on(lines)
    law = Role("law", installed_components().create("law", "linear"), "torque")
    tests = tuple(SeriesTest(f"T{torque:g}", model, (), {"torque": torque}) for torque in torques)
    covariates = {"torque": Covariate("torque", "N m")}
    described = SeriesDescription("collet", tests, covariates, dict.fromkeys(STIFFNESSES, law), Role("shared"))
    unknowns = SeriesUnknowns(described)
    z, fitted = random.uniform(-1.0, 1.0, (1, unknowns.count)), []
    for index, test in enumerate(tests):
        theta = model.from_unit(unknowns.maps[index].fractions(unknowns.for_test(index, z)))[0]
        frf = dovetail.noisy_frf(model.simulate(theta), NOISE, random)
        fitted.append(fit_test(test, [frf], number, 0.0))
    fit = fit_series(unknowns, fitted)
    posterior = sample_series(unknowns, fitted, fit, samples=samples, seed=number)
    return SeriesIdentification(described, tuple(fitted), unknowns, fit, posterior), z[0]


def case(number: int, seed: int, samples: int) -> dict[str, tuple[float, float, bool]]:
    """Return for each unknown the widths with one FRF and with five, and whether the interval of five holds the truth.

    The one FRF is that of the first torque.
    """
    result, z = identified(number, seed, samples)
    first, exact = result.tests[0], typical_model_error(0.0)
    alone = sample_posterior(
        first.problem, first.judged.fit, samples=samples, model_error=exact, seed=number
    ).interval()
    assert result.posterior is not None
    assert result.posterior.shared is not None
    found, together = {}, result.posterior.shared.interval()
    for column, unknown in enumerate(result.unknowns.shared):
        definition, ends = unknown.definition, together[unknown.definition.name]
        truth = float(definition.from_unit(ndtr(z[column])))
        of_one = (np.nan, np.nan) if definition.name.endswith(".last") else alone[unknown.parameter]
        widths = [float(np.diff(definition.to_unit(np.array(pair)))[0]) for pair in (of_one, ends)]
        found[definition.name] = (*widths, ends[0] <= truth <= ends[1])
    return found


def publication_network(samples: int) -> TrainedNetwork:
    """Train the network of the publication on FRFs at the lines of the tests."""
    described = {"extends": str(ASSEMBLY), "identification": {"samples": samples}}
    return dovetail.train(dovetail.load(described).on(LINES))


def interpolated(network: TrainedNetwork, result: SeriesIdentification, left_out: int) -> np.ndarray:
    """Return a test's parameters (n_params,) by the network's answers to the other tests."""
    model, others = network.assembly, [number for number in range(len(TORQUES)) if number != left_out]
    answers = [dovetail.identify(model, one.problem.measured[0], "network", model=network) for one in result.tests]
    positions = model.to_unit(np.array([answer.theta for answer in answers]))
    torques, place = np.array(TORQUES), int(np.clip(left_out - 1, 0, len(others) - 2))
    first, second = others[place : place + 2]
    share = (torques[left_out] - torques[first]) / (torques[second] - torques[first])
    return model.from_unit(np.clip(positions[first] + share * (positions[second] - positions[first]), 0.0, 1.0))


def predictions(cases: int, seed: int, samples: int, trained_on: int) -> None:
    """Print how well each test is predicted from the others."""
    network = publication_network(trained_on)
    print("| case | test | lines within the 90 % band | natural frequencies | those of the publication's way |")
    print("|---|---|---|---|---|")
    for number in range(cases):
        result, z = identified(number, seed, samples)
        for index, left in enumerate(dovetail.leave_one_out(result, samples=samples)):
            model = result.tests[index].test.assembly
            theta = model.from_unit(result.unknowns.maps[index].fractions(result.unknowns.for_test(index, z[None])))[0]
            exact = dovetail.natural_frequencies(model, theta)
            found = dovetail.natural_frequencies(model, interpolated(network, result, index))
            count = min(len(exact), len(found))
            error = np.max(np.abs(found[:count] / exact[:count] - 1.0))
            where = " (extrapolated)" if left.extrapolated else ""
            row = f"| {number} | {left.test}{where} | {left.coverage:.1%} | {left.frequency_error:.4%} | {error:.2%} |"
            print(row, flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for option, value in (("cases", 1), ("seed", 0), ("samples", 200)):
        parser.add_argument(f"--{option}", type=int, default=value)
    parser.add_argument("--leave-one-out", action="store_true")
    parser.add_argument("--trained-on", type=int, default=12_000, help="samples of the publication's network")
    options = parser.parse_args()
    if options.leave_one_out:
        predictions(options.cases, options.seed, options.samples, options.trained_on)
        return
    began, rows = processor_time(), defaultdict[str, list[tuple[float, float, bool]]](list)
    for number in range(options.cases):
        for name, row in case(number, options.seed, options.samples).items():
            rows[name].append(row)
    print("| parameter | width with one FRF | with five torques | hold the truth |\n|---|---|---|---|")
    for name, of_cases in rows.items():
        one, five = np.mean([row[:2] for row in of_cases], axis=0)
        held = sum(row[2] for row in of_cases)
        print(f"| `{name}` | {'' if np.isnan(one) else f'{one:.1%}'} | {five:.1%} | {held} of {len(of_cases)} |")
    print(f"{(processor_time() - began) / options.cases:.0f} s of processor time a case")


if __name__ == "__main__":
    main()
