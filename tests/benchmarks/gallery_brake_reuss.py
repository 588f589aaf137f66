"""The Brake-Reuss beam: damping of a bolted joint from four levels of vibration, predicted at others and for others."""

from __future__ import annotations

import tempfile
import textwrap
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import brake_reuss
import numpy as np
from gallery_tables import frac, rows
from numpy.typing import NDArray
from processors import processor_time
from scipy.optimize import brentq, minimize_scalar

import dovetail
from dovetail.registry import installed_components
from dovetail.series import SeriesDescription, read_series
from dovetail.series.description import Role, SeriesTest
from dovetail.series.fitted_tests import FittedTest, fit_tests
from dovetail.series.fitting import fit_series
from dovetail.series.prediction import drawn_fractions
from dovetail.series.result import SeriesIdentification
from dovetail.series.unknowns import SeriesUnknowns

FITTED = (0, 2, 4, 6)
"""Levels that are fitted, of eight; the last one predicted lies beyond them."""
STIFFNESS, DAMPING = ("shared", "linear", "varying"), ("shared", "linear", "power")
SAMPLES, DRAWS, SEED = 400, 2000, 1
LEVELS = (2.0, 5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0)
"""m/s^2, between which the law is interpolated for the sweeps with a constant force."""
MASS = "mode.masses.0.mass"


class Mode(NamedTuple):
    """Stiffness [N/m], damping [N s/m] and mass [kg] of the mode at a level."""

    k: float
    c: float
    m: float

    def accelerance(self, frequency: NDArray[np.float64] | float) -> NDArray[np.complex128]:
        """Return the accelerance at frequencies [Hz]."""
        omega = 2.0 * np.pi * np.asarray(frequency)
        return np.asarray(-(omega**2) / (self.k - omega**2 * self.m + 1j * omega * self.c))

    @property
    def natural_frequency(self) -> float:
        """Hz."""
        return float(np.sqrt(self.k / self.m) / (2.0 * np.pi))


def role(name: str) -> Role:
    """Return the role of a parameter by the name of a law, or "shared" or "varying"."""
    if name in ("shared", "varying"):
        return Role(name)  # type: ignore[arg-type]
    return Role("law", installed_components().create("law", name), "level")  # type: ignore[arg-type]


def misfit(model: NDArray[np.complex128], measured: NDArray[np.complex128]) -> float:
    """Return the norm of the difference over that of the measurement."""
    return float(np.linalg.norm(model - measured) / np.linalg.norm(measured))


def brake_reuss_page(folder: Path) -> dict[str, str]:
    """Identify the joint's mode from four levels, and predict the FRFs of four others and four sweeps."""
    began = processor_time()
    levels = brake_reuss.levels(folder)
    with tempfile.TemporaryDirectory() as place:
        whole = read_series(brake_reuss.write_series(folder, Path(place)))
        series = replace(whole, tests=tuple(whole.tests[number] for number in FITTED))
        tests, every = fit_tests(series), fit_tests(whole)
        table, chosen = compared_laws(series, tests)
        roles = dict(zip(("k", "c"), map(role, chosen), strict=True))
        result = dovetail.identify_series(series.with_roles(roles), samples=SAMPLES, seed=SEED)
        alone = dovetail.identify_series(whole.with_roles({"k": Role("free")}), samples=SAMPLES, seed=SEED)
    tables = {
        "brake_reuss_laws": table,
        "brake_reuss_identified": identified(result, levels),
        "brake_reuss": predicted_levels(result, levels, every, alone),
        "brake_reuss_sweeps": predicted_sweeps(result, folder),
        "brake_reuss_adequacy": verdict(result),
    }
    seconds = processor_time() - began
    return tables | {"brake_reuss_time": f"From the file to these tables: {seconds:.0f} s of one processor core.\n"}


def compared_laws(series: SeriesDescription, tests: tuple[FittedTest, ...]) -> tuple[str, tuple[str, str]]:
    """Return the table of laws, and those with the largest marginal likelihood of the fitted levels."""
    comparison = dovetail.compare_models(series, roles={"k": STIFFNESS, "c": DAMPING}, samples=SAMPLES // 2, seed=SEED)
    lines, laws = [], list(product(STIFFNESS, DAMPING))
    for (stiffness, damping), model in zip(laws, comparison.models, strict=True):
        unknowns = SeriesUnknowns(series.with_roles({"k": role(stiffness), "c": role(damping)}))
        fit = fit_series(unknowns, tests)
        evidence = "unknown" if model.evidence is None else f"{model.evidence.log:.1f}"
        squares = f"{fit.squares.sum():.1f}", f"{fit.contradiction:.1g}"
        lines.append((stiffness, damping, str(unknowns.count), *squares, evidence))
    chosen = laws[comparison.models.index(comparison.ranking[0])]
    return rows("stiffness|damping|unknowns|sum of squares|by chance|log Z", lines), chosen


def identified(result: SeriesIdentification, levels: list[tuple[float, dovetail.Frf]]) -> str:
    """Return the identified values at each fitted level."""
    lines = []
    for test, number in enumerate(FITTED):
        found = {row.name: row for row in result.rows_of(test)}
        cells = [f"{row.estimate:.3g} ({row.low:.3g} to {row.high:.3g})" for row in (found["c"], found[MASS])]
        lines.append((f"{levels[number][0]:.1f}", f"{fitted_mode(result, test).natural_frequency:.2f}", *cells))
    return rows("level [m/s²]|natural frequency [Hz]|c [N s/m], 90 %|mass [kg], 90 %", lines)


def fitted_mode(result: SeriesIdentification, test: int) -> Mode:
    """Return the identified mode of a test of the series."""
    found = {row.name: row.estimate for row in result.rows_of(test)}
    return Mode(*(found[name] for name in ("k", "c", MASS)))


def mode_at(result: SeriesIdentification, level: float) -> tuple[Mode, tuple[float, float]]:
    """Return the predicted mode at a level, and the ends of the 90 % interval of its damping.

    The middle of the natural frequencies is taken, which is far better known than stiffness and mass alone.
    """
    assembly = result.tests[0].test.assembly
    test = SeriesTest("prediction", assembly, (), {"level": level})
    drawn = assembly.from_unit(drawn_fractions(result, test, DRAWS, np.random.default_rng(SEED)))
    named = dict(zip((parameter.name for parameter in assembly.parameters), drawn.T, strict=True))
    m, c, natural = np.median([named[MASS], named["c"], np.sqrt(named["k"] / named[MASS])], axis=1)
    low, high = np.quantile(named["c"], [0.05, 0.95]).tolist()
    return Mode(float(m * natural**2), float(c), float(m)), (low, high)


def predicted_levels(
    result: SeriesIdentification,
    levels: list[tuple[float, dovetail.Frf]],
    every: tuple[FittedTest, ...],
    alone: SeriesIdentification,
) -> str:
    """Return how like prediction and measurement are at each level, next to the fit of that level alone."""
    lines = []
    for number, (level, frf) in enumerate(levels):
        mode, (low, high) = mode_at(result, level)
        shown = fitted_mode(result, FITTED.index(number)) if number in FITTED else mode
        own = {row.name: row for row in alone.rows_of(number)}["c"]
        floor = misfit(alone_mode(every[number]).accelerance(frf.frequency), frf.values)
        model, (shift, moved) = shown.accelerance(frf.frequency), best_shift(shown, frf)
        cells = f"{frac(model, frf.values):.3f}", *(f"{100 * one:.0f} %" for one in (misfit(model, frf.values), floor))
        damping = f"{mode.c:.1f} ({low:.1f} to {high:.1f})", f"{own.estimate:.1f} ({own.low:.1f} to {own.high:.1f})"
        kind = "fitted" if number in FITTED else "predicted"
        lines.append((f"{level:.1f}", kind, *cells, f"{shift:+.2f} Hz", f"{100 * moved:.0f} %", *damping))
    header = (
        "level [m/s²]||FRAC|misfit|floor|moved by|then misfit|c by the law [N s/m], 90 %|c of this level alone, 90 %"
    )
    return rows(header, lines)


def best_shift(mode: Mode, frf: dovetail.Frf) -> tuple[float, float]:
    """Return by how many Hz another stiffness alone would move a mode to fit an FRF best, and the misfit then."""

    def left(factor: float) -> float:
        return misfit(mode._replace(k=mode.k * factor).accelerance(frf.frequency), frf.values)

    best = minimize_scalar(left, bounds=(0.99, 1.01), method="bounded")
    return mode.natural_frequency * (float(np.sqrt(best.x)) - 1.0), float(best.fun)


def alone_mode(fitted: FittedTest) -> Mode:
    """Return the mode that fits one level best."""
    assembly = fitted.test.assembly
    values = dict(zip((p.name for p in assembly.parameters), fitted.problem.from_unit(fitted.fraction), strict=True))
    return Mode(*(float(values[name]) for name in ("k", "c", MASS)))


def law_of(result: SeriesIdentification) -> Callable[[float], Mode]:
    """Return the predicted mode as a function of the level."""
    modes = np.log([mode_at(result, level)[0] for level in LEVELS])
    return lambda level: Mode(*np.exp([np.interp(level, LEVELS, column) for column in modes.T]).tolist())


def level_under(force: float, frequency: float, law: Callable[[float], Mode]) -> float:
    """Return the amplitude [m/s^2] under a force [N], at which the mode has the damping of this amplitude."""

    def excess(level: float) -> float:
        return level - force * float(np.abs(law(level).accelerance(frequency)))

    return float(brentq(excess, 1e-3, 1e3))


def predicted_sweeps(result: SeriesIdentification, folder: Path) -> str:
    """Return the amplitudes of sweeps with a nearly constant force, measured and predicted."""
    law, lines = law_of(result), []
    for test in brake_reuss.sweeps(folder, "ForceControl"):
        amplitude = np.array([level_under(f, at, law) for f, at in zip(test.force, test.frequency, strict=True)])
        highest, at = (float(one) for one in (test.amplitude.max(), test.frequency[np.argmax(test.amplitude)]))
        found = float(amplitude.max())
        off = np.linalg.norm(amplitude - test.amplitude) / np.linalg.norm(test.amplitude)
        force = float(np.median(test.force))
        peak_at = float(test.frequency[np.argmax(amplitude)])
        cells = f"{highest:.1f}", f"{found:.1f}", f"{100 * (found / highest - 1):+.0f} %", f"{at:.2f}", f"{peak_at:.2f}"
        lines.append((f"{force:.2f}", *cells, f"{100 * off:.0f} %"))
    header = "force [N]|highest amplitude [m/s²]|predicted|difference|at [Hz]|predicted|misfit of amplitudes"
    return rows(header, lines)


def verdict(result: SeriesIdentification) -> str:
    """Return what the program says of the model of each fitted level, and of the series."""
    said = [
        f"- level {fitted.test.covariates['level']:.1f} m/s²: {fitted.judged.adequacy.sentence}"
        for fitted in result.tests
    ]
    series = result.warning or "The levels do not contradict the law."
    lines = [*said, f"- series: {series}"]
    return "".join(textwrap.fill(line, 118, subsequent_indent="  ") + "\n" for line in lines)
