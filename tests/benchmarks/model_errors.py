"""How wrong is the model, and does the program say so? Errors of known kinds and sizes in structures at random.

    python tests/benchmarks/model_errors.py [--cases 10] [--seed 0] [--sizes 0.2,1] [--kinds young,spring]
    python tests/benchmarks/model_errors.py --causes [--cases 25] [--seed 0] [--alterations sign,gain]
    python tests/benchmarks/model_errors.py --foreign [--cases 20] [--seed 0]

Each case is a structure, parameters, a frequency axis and noise as in `genuine_measurements.py`, but the structure
that is measured differs from the model: a modulus, density, mass, length or section of a part is off, or a spring to
the ground is missing, by as much as makes its natural frequencies, at equal parameters, differ by a wanted size (root
mean square over the resonances that are visible in the band). Further kinds are as they are: a mesh four times as fine
("mesh"), a loss factor 30 % lower ("loss"), joints that are damped by another law ("law").

Parameters absorb a part of the error. What is left is the difference between the natural frequencies of the structure
and of the model that fits its FRF best without any noise, weighted as the measurement is, or with errors of the known
size allowed, whichever is nearer. "seen" counts the cases whose residuals without noise are large enough for a test of
chi-squared to find them. Sizes are those of natural frequencies, but of damping ratios for "loss" and "law", which
hardly move natural frequencies. Of what is seen, the table counts the sizes reported that are within a factor of two of
the residual size, of the size at equal parameters, or between them; of the others, those that are reported as fitted to
the noise, or within a factor of two of the residual size all the same; and of all, those that are right as the seen
ones are, or not seen and reported as fitted to the noise. Intervals count that hold the true value; their width is in
parts of the range.

With `--causes` the measurements are altered, with and without an error of the model, and the cause that is named first
is counted. Where the joint imitates an alteration down to the noise it is hidden: nothing in the measurement shows it.

With `--foreign` the FRF is that of another of the structures, and the words are counted: none should fit.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from processors import processor_time
from random_structures import JOINTS, NOISES, draw_axis, draw_theta, measure, random_structure
from wrong_structures import ALTERATIONS, KINDS, SCALED, Poles, altered, dampers, pole_errors, wrong_structure

import dovetail
from dovetail.inference.adequacy.causes import CAUSE_SECONDS
from dovetail.inference.adequacy.error_effects import ErrorEffects
from dovetail.inference.adequacy.judgement import is_noise
from dovetail.inference.adequacy.model_error_size import estimate_model_error, fit_with_error
from dovetail.inference.adequacy.verdict import Adequacy, word_for
from dovetail.inference.fitting import Fit, fit_at, refine
from dovetail.inference.posterior import laplace_posterior, sample_posterior, typical_model_error
from dovetail.problem import Problem

STRUCTURES = 25
MOST_LINES = 5000
SIZES = 5e-4, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2
WITH_CAUSES = 0.0, 3e-3, 1e-2
"""Errors of the model with which altered measurements are judged."""
DAMPING = "loss", "law"
"""Kinds whose size is that of damping ratios."""
FOREIGN_LINES = 1500
SIGNIFICANT = 5.0
"""Standard deviations of chi-squared by which residuals exceed noise, if they are seen."""
RIGHT = {
    "unaltered": ("",),
    "unit": ("unit", "gain"),
    "thousand": ("unit",),
    "overhang": ("overhang", "part"),
    "point": ("point", "overhang"),
}
"""Kinds of causes that are right for an alteration, where they are others than its name."""
POSTERIORS = {"posterior": sample_posterior, "laplace": laplace_posterior}


@dataclass(frozen=True)
class Case:
    """What became of one measurement of a structure that differs from the model.

    Parameters
    ----------
    number : int
    kind : str
    wanted : float
        Size of the error, 0 for a kind that is not scaled.
    known, left, reported : float
        Relative errors of natural frequencies: at equal parameters, at the best fit, and as the program says.
    known_damping, left_damping, reported_damping : float
        The same of damping ratios.
    seen : bool
        Whether residuals exceed the noise.
    word : str
    chi_squared : float
    lines, unknowns, resonances : int
    held : tuple of bool
        Whether each interval holds the true value.
    widths : tuple of float
        Of the intervals, in parts of the ranges.
    seconds : float
    """

    number: int
    kind: str
    wanted: float
    known: float
    left: float
    reported: float
    known_damping: float
    left_damping: float
    reported_damping: float
    seen: bool
    word: str
    chi_squared: float
    lines: int
    unknowns: int
    resonances: int
    held: tuple[bool, ...]
    widths: tuple[float, ...]
    seconds: float

    @property
    def sizes(self) -> tuple[float, float, float]:
        """Known, left and reported, of what the error changes."""
        if self.kind in DAMPING:
            return self.known_damping, self.left_damping, self.reported_damping
        return self.known, self.left, self.reported

    def near(self, *sizes: float) -> bool:
        """Whether what is reported is in a range, within a factor of two, or nothing where nothing is seen."""
        reported = self.sizes[2]
        return bool(min(sizes) / 2.0 <= reported <= 2.0 * max(sizes)) or (not self.seen and reported == 0.0)

    @property
    def as_left(self) -> bool:
        """Whether the size that is left is reported."""
        return self.near(self.sizes[1])

    @property
    def as_known(self) -> bool:
        """Whether the size at equal parameters is reported."""
        return self.near(self.sizes[0])

    @property
    def between(self) -> bool:
        """Whether a size between them is reported: how much of an error the parameters absorb cannot be seen."""
        return self.near(*self.sizes[:2])

    def describe(self) -> str:
        """Return a line with all figures."""
        sizes = " ".join(f"{1e2 * size:.3g}" for size in (self.known, self.left, self.reported))
        damping = " ".join(f"{size:.2g}" for size in (self.known_damping, self.left_damping, self.reported_damping))
        return (
            f"{self.number:5d} {self.kind:8s} known, left, reported {sizes} %; damping {damping}; "
            f"{'seen' if self.seen else 'not seen'}, '{self.word}', chi-squared {self.chi_squared:.3g}; "
            f"{self.unknowns} unknowns, {self.resonances} resonances, {self.lines} lines; "
            f"{sum(self.held)} of {len(self.held)} held; {self.seconds:.1f} s"
        )


@lru_cache(maxsize=STRUCTURES)
def structure(number: int, seed: int) -> dovetail.Assembly:
    """Return one of the structures; the joints take turns in coming first."""
    return dovetail.load(random_structure(np.random.default_rng([seed, number]), JOINTS[number % len(JOINTS)]))


def drawn(number: int, seed: int, rng: np.random.Generator) -> tuple[dovetail.Assembly, np.ndarray]:
    """Return the model of a case on the measurement's lines, and the true parameters."""
    assembly = structure(number % STRUCTURES, seed)
    theta = draw_theta(assembly, rng)
    axis = draw_axis(assembly, rng)
    return assembly.on(axis[:: 1 + len(axis) // MOST_LINES]), theta


def judged(work: tuple[int, str, float], seed: int, method: str) -> Case | None:
    """Draw a case of a kind and size, and judge it; None if the structure cannot be wrong in this way."""
    number, kind, wanted = work
    rng = np.random.default_rng([seed, STRUCTURES, number])
    assembly, theta = drawn(number, seed, rng)
    truth = wrong_structure(assembly, theta, kind, wanted, rng)
    if truth is None:
        return None
    noise, variance_given = NOISES[number // 2 % len(NOISES)], number % 2 == 0
    measured = measure(truth, theta, noise, rng, variance_given=variance_given)
    assembly.frf_jacobian(theta)
    began = time.perf_counter()
    fit = refine(Problem.of(assembly, measured))
    adequacy, refitted = told_of(assembly, measured, fit)
    held, widths = _intervals(assembly, measured, refitted, adequacy, theta, kind, method)
    seconds = time.perf_counter() - began
    poles = Poles.of(truth, theta)
    known = pole_errors(poles, Poles.of(assembly, theta))
    exact = replace(measured, values=truth.frf(theta), variance=fit.variance, coherence=None, averages=None)
    best = refine(Problem.of(assembly, exact), [theta, refitted.theta])
    forgiving = best_fit_with_error(assembly, exact, theta, known[0])
    left = min(pole_errors(poles, Poles.of(assembly, point)) for point in (best.theta, forgiving))
    reported = adequacy.size
    return Case(
        number=number,
        kind=kind,
        wanted=wanted if kind in SCALED else 0.0,
        known=known[0],
        left=left[0],
        reported=0.0 if reported is None else reported.natural_frequency,
        known_damping=known[1],
        left_damping=left[1],
        reported_damping=0.0 if reported is None else reported.damping,
        seen=best.chi_squared > SIGNIFICANT * np.sqrt(2.0 / best.degrees_of_freedom),
        word=adequacy.word,
        chi_squared=fit.chi_squared,
        lines=len(measured.frequency),
        unknowns=len(theta),
        resonances=len(poles.values),
        held=held,
        widths=widths,
        seconds=seconds,
    )


def told_of(assembly: dovetail.Assembly, measured: dovetail.Frf, fit: Fit) -> tuple[Adequacy, Fit]:
    """Return what `assess` does, without the search for causes, which takes much longer."""
    problem = Problem.of(assembly, measured)
    if is_noise(problem, fit):
        return Adequacy("to the noise"), fit
    found = estimate_model_error(ErrorEffects(problem, fit))
    refitted = replace(fit, theta=assembly.from_unit(found.fraction), information=found.information)
    return Adequacy(word_for(found.size), found.size), refitted


def best_fit_with_error(
    assembly: dovetail.Assembly, exact: dovetail.Frf, theta: np.ndarray, known: float
) -> np.ndarray:
    """Return the parameters that fit best from the true ones, if errors of the known size are allowed."""
    problem = Problem.of(assembly, exact)
    start = replace(fit_at(problem, assembly.to_unit(theta)), variance=exact.variance)
    return assembly.from_unit(fit_with_error(ErrorEffects(problem, start), typical_model_error(known)).fraction)


def _intervals(
    assembly: dovetail.Assembly,
    measured: dovetail.Frf,
    fit: Fit,
    adequacy: dovetail.Adequacy,
    theta: np.ndarray,
    kind: str,
    method: str,
) -> tuple[tuple[bool, ...], tuple[float, ...]]:
    """Return which intervals of the parameters that structure and model share hold the truth, and their widths."""
    if method == "refined":
        return (), ()
    posterior = POSTERIORS[method](Problem.of(assembly, measured), fit, model_error=adequacy.error_in_intervals)
    low, high = np.array(list(posterior.interval().values())).T
    widths = assembly.to_unit(high) - assembly.to_unit(low)
    shared = ~dampers(assembly) if kind == "law" else np.ones(len(theta), dtype=bool)
    held = (low <= theta) & (theta <= high)
    return tuple(held[shared].tolist()), tuple(widths[shared].tolist())


def works(cases: int, sizes: Iterable[float], kinds: Sequence[str], first: int = 0) -> list[tuple[int, str, float]]:
    """Return the cases, more than are wanted of each size since not all can be made: number, kind and size."""
    scaled, others = [k for k in kinds if k in SCALED], [k for k in kinds if k not in SCALED]
    works = []
    for index, size in enumerate(sizes if scaled else ()):
        numbers = (first + 1000 * index + case for case in range(cases))
        works += [(number, scaled[(number + number // len(scaled)) % len(scaled)], size) for number in numbers]
    for index, kind in enumerate(others):
        works += [(first + 100_000 + 1000 * index + case, kind, 0.0) for case in range(cases)]
    return works


HEADER = (
    "| error | cases | seen | as the residual | as at equal parameters | between | of those not seen | between, of all "
    "| intervals that hold | median width | words | median time |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
)


def row(name: str, cases: Sequence[Case]) -> str:
    """Return one line of the table."""
    seen = [case for case in cases if case.seen]
    hidden = [case for case in cases if not case.seen]
    held = [flag for case in cases for flag in case.held]
    words = {word: sum(case.word == word for case in cases) for word in sorted({case.word for case in cases})}
    cells = [
        name,
        str(len(cases)),
        str(len(seen)),
        *(f"{sum(getattr(case, name) for case in seen)} of {len(seen)}" for name in ("as_left", "as_known", "between")),
        f"{sum(case.as_left for case in hidden)} of {len(hidden)}",
        f"{sum(case.between for case in cases)} of {len(cases)}",
        f"{sum(held)} of {len(held)} ({np.mean(held):.0%})" if held else "-",
        f"{np.median([width for case in cases for width in case.widths]):.3f}" if held else "-",
        ", ".join(f"{count} {word}" for word, count in words.items()),
        f"{np.median([case.seconds for case in cases]):.1f} s",
    ]
    return f"| {' | '.join(cells)} |"


def study(
    works: Sequence[tuple[int, str, float]],
    seed: int,
    method: str,
    processes: int,
    report: Callable[[str], object] = print,
) -> list[Case]:
    """Judge the cases, and print them and the tables by size and by kind."""
    cases = []
    for case in _each(partial(judged, seed=seed, method=method), works, processes):
        if case is not None:
            cases.append(case)
            report(case.describe())
    report(HEADER)
    for size in sorted({case.wanted for case in cases if case.wanted}):
        report(row(f"{size:.2%}", [case for case in cases if case.wanted == size]))
    for kind in KINDS:
        chosen = [case for case in cases if case.kind == kind]
        if chosen:
            report(row(kind, chosen))
    report(row("all", cases))
    return cases


def _each(function: Callable[[Any], Any], works: Sequence[Any], processes: int) -> Iterator[Any]:
    if processes == 1:
        yield from map(function, works)
        return
    with ProcessPoolExecutor(processes) as pool:
        yield from pool.map(function, works)


# -- causes ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Named:
    """What was said of one altered measurement.

    Parameters
    ----------
    number : int
    alteration : str
    size : float
        Error of the model.
    word : str
        How well the model fits.
    causes : tuple of str
        Their kinds, the first one first.
    words : str
        Of the first one.
    seconds : float
        Of processor time.
    """

    number: int
    alteration: str
    size: float
    word: str
    causes: tuple[str, ...]
    words: str
    seconds: float

    @property
    def first(self) -> str:
        """Kind of the first cause, empty if there is none."""
        return self.causes[0] if self.causes else ""

    @property
    def right(self) -> bool:
        """Whether the first cause is the alteration."""
        return self.first in RIGHT.get(self.alteration, (self.alteration,))

    @property
    def hidden(self) -> bool:
        """Whether the joint imitates the alteration down to the noise, so that nothing shows it."""
        return self.word == "to the noise" and self.alteration != "unaltered"

    def describe(self) -> str:
        """Return a line with all figures."""
        causes = ", ".join(self.causes) or "none"
        return (
            f"{self.number:3d} {self.alteration:10s} {self.size:.2%}: '{self.word}', {causes}: {self.words}; "
            f"{self.seconds:.1f} s"
        )


def caused(work: tuple[int, str, float], seed: int, limit: float) -> Named | None:
    """Return the causes named after `limit` seconds of search; None if the measurement cannot be altered so."""
    number, alteration, size = work
    rng = np.random.default_rng([seed, STRUCTURES, number])
    assembly, theta = drawn(number, seed, rng)
    truth: dovetail.Assembly | None = assembly
    if size:
        kinds = list(SCALED)
        tries = (wrong_structure(assembly, theta, kinds[(number + i) % len(kinds)], size, rng) for i in range(4))
        truth = next((made for made in tries if made is not None), None)
    changed = None if truth is None else altered(truth, theta, alteration, rng)
    if changed is None:
        return None
    measured = measure(changed, theta, NOISES[number // 2 % len(NOISES)], rng, variance_given=number % 2 == 0)
    began = processor_time()
    adequacy = dovetail.identify(assembly, measured, "refined", cause_seconds=limit).adequacy
    causes = adequacy.causes
    words = causes[0].words if causes else "-"
    names = tuple(cause.name for cause in causes)
    return Named(number, alteration, size, adequacy.word, names, words, processor_time() - began)


def study_causes(
    cases: int,
    sizes: Sequence[float],
    seed: int,
    limit: float,
    processes: int,
    report: Callable[[str], object] = print,
    alterations: Sequence[str] = ALTERATIONS,
) -> None:
    """Alter measurements, and count which cause is named first."""
    works = [(case, alteration, size) for size in sizes for case in range(cases) for alteration in alterations]
    found = []
    for outcome in _each(partial(caused, seed=seed, limit=limit), works, processes):
        if outcome is not None:
            found.append(outcome)
            report(outcome.describe())
    columns = [*(f"model error {size:.1%}" for size in sizes), "hidden", "otherwise named"]
    report(f"| alteration | {' | '.join(columns)} |")
    report("|---|" + "---|" * (len(sizes) + 2))
    for alteration in alterations:
        of = [named for named in found if named.alteration == alteration]
        shown = [named for named in of if not named.hidden]
        wrong = [named.first or "none" for named in shown if not named.right]
        cells = []
        for size in sizes:
            right = [named.right for named in shown if named.size == size]
            cells.append(f"{sum(right)} of {len(right)}")
        others = ", ".join(f"{wrong.count(name)} {name}" for name in sorted(set(wrong)))
        report(f"| {alteration} | {' | '.join(cells)} | {len(of) - len(shown)} | {others or '-'} |")
    seconds = [named.seconds for named in found]
    report(f"Processor time: median {np.median(seconds):.1f} s, at most {max(seconds):.1f} s.")


# -- other structures ------------------------------------------------------------------------------------------------


def foreign(number: int, seed: int) -> str:
    """Return the word for the FRF of another structure, seven farther on."""
    rng = np.random.default_rng([seed, number])
    assembly, other = (structure(index % STRUCTURES, seed) for index in (number, number + 7))
    axis = draw_axis(assembly, rng)
    axis = axis[:: 1 + len(axis) // FOREIGN_LINES]
    measured = measure(other.on(axis), draw_theta(other, rng), "multiplicative", rng, variance_given=True)
    return dovetail.identify(assembly.on(axis), measured, "refined", cause_seconds=0.0).adequacy.word


def study_foreign(cases: int, seed: int, processes: int, report: Callable[[str], object] = print) -> None:
    """Count the words for FRFs of other structures."""
    words = list(_each(partial(foreign, seed=seed), range(cases), processes))
    report(", ".join(f"{words.count(word)} {word}" for word in sorted(set(words))))


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=10, help="of each size and kind; some cannot be made")
    parser.add_argument("--seed", type=int, default=0, help="of structures, parameters, axes, errors and noise")
    parser.add_argument("--sizes", default=None, help="in per cent, with commas between")
    parser.add_argument("--kinds", default=",".join(KINDS), help="with commas between")
    parser.add_argument("--method", choices=("posterior", "laplace", "refined"), default="posterior")
    parser.add_argument("--causes", action="store_true", help="alter the measurements, and name the causes")
    parser.add_argument("--alterations", default=",".join(ALTERATIONS), help="with commas between")
    parser.add_argument("--foreign", action="store_true", help="measure other structures, and count the words")
    parser.add_argument("--cause-seconds", type=float, default=CAUSE_SECONDS, help="in which they are searched for")
    parser.add_argument("--processes", type=int, default=1)
    options = parser.parse_args()
    given = None if options.sizes is None else [float(size) / 100.0 for size in options.sizes.split(",")]
    report = partial(print, flush=True)
    if options.causes:
        sizes = given or WITH_CAUSES
        alterations = options.alterations.split(",")
        study_causes(options.cases, sizes, options.seed, options.cause_seconds, options.processes, report, alterations)
        return
    if options.foreign:
        study_foreign(options.cases, options.seed, options.processes, report)
        return
    chosen = works(options.cases, given or SIZES, options.kinds.split(","))
    study(chosen, options.seed, options.method, options.processes, report)


if __name__ == "__main__":
    main()
