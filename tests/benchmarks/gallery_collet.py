"""An end mill in a spring collet on a milling machine: fitted at two points, predicted at three others."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gallery_tables import frac, named, rows, sentence, word
from numpy.typing import NDArray
from processors import processor_time
from scipy.optimize import least_squares

import dovetail

DESCRIPTION = Path(__file__).parent / "measured_structures" / "collet.yaml"
FILES = tuple(f"Point_{point}_Channel_1_CH1.txt" for point in range(1, 6))
"""Receptances at the tip for impacts 0, 55, 90, 130 and 165 mm from it."""
IMPACTS: tuple[dict[str, str], ...] = (
    {},
    {"at": "tool", "position": "55 mm"},
    {"at": "holder", "position": "16.4 mm"},
    {"at": "holder", "position": "56.4 mm"},
    {"at": "holder", "position": "91.4 mm"},
)
FITTED = (0, 2)
POLES = (1072.0, 1249.0, 1978.0, 2611.0)
"""Natural frequencies [Hz] at which the poles that all FRFs share start, as published with the measurement."""
EVERY, STARTS, SEEDS = 8, 32, 4
"""Lines per fitted one, searches from random points, and how often these are drawn; the best fit of all counts."""
SHANK = 0.01905
"""Three quarters of an inch [m], the size of shanks next to the 18.8 mm that the photograph shows."""
CELLS = "H11, fitted|H13, fitted|H12|H14|H15|flute [mm]|shank [mm]|k [N/m²]|kr [N]"
HIGH_SPEED_STEEL = {"young": "215 GPa", "density": "8100 kg/m^3", "poisson": 0.3, "loss_factor": 0.005}


class Poles(NamedTuple):
    """Poles that all FRFs share, with free residues.

    Parameters
    ----------
    natural_frequency, damping_ratio : (n_modes,) array
        In Hz, and dimensionless.
    misfit : (n_frfs,) array
        Norm of the residual over that of each FRF.
    """

    natural_frequency: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    misfit: NDArray[np.float64]


class Fitted(NamedTuple):
    """A model with identified values, and its FRFs of all impacts, (n_frfs, n_freq)."""

    assembly: dovetail.Assembly
    result: dovetail.Identification
    models: NDArray[np.complex128]

    def cells(self, measured: NDArray[np.complex128]) -> list[str]:
        """Return the cells `CELLS`: the misfit of each FRF, and some identified values."""
        values, off = named(self.result, self.assembly), misfits(self.models, measured)
        diameters = [f"{1e3 * values.get(f'tool.sections.{section}.outer', SHANK):.1f}" for section in (0, 1)]
        stiffnesses = [f"{values[f'collet.{name}']:.2g}" for name in ("k", "kr")]
        return [*(f"{100 * off[point]:.1f} %" for point in (*FITTED, 1, 3, 4)), *diameters, *stiffnesses]


def fit_poles(frequency: NDArray[np.float64], frfs: NDArray[np.complex128], start: Sequence[float]) -> Poles:
    """Fit shared poles to FRFs (n_frfs, n_freq): complex residues, a constant and a term of inertia for each FRF."""
    omega, count = 2 * np.pi * frequency[:, np.newaxis], len(start)
    values = np.concatenate([frfs.real, frfs.imag], axis=1).T
    sizes = np.linalg.norm(values, axis=0)

    def residuals(poles: NDArray[np.float64]) -> NDArray[np.float64]:
        natural, ratio = 2 * np.pi * poles[:count], poles[count:]
        decay, ringing = ratio * natural, natural * np.sqrt(1 - ratio**2)
        one, other = (1 / (1j * (omega - sign * ringing) + decay) for sign in (1, -1))
        terms = np.concatenate([one + other, 1j * (one - other), np.ones_like(omega), -1 / omega**2], axis=1)
        columns = np.concatenate([terms.real, terms.imag])
        columns /= np.linalg.norm(columns, axis=0)
        return (values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]) / sizes

    first = np.concatenate([start, np.full(count, 0.03)])
    bounds = np.repeat([[100.0, 1e-3], [5000.0, 0.3]], count, axis=1)
    fit = least_squares(lambda poles: residuals(poles).ravel(), first, bounds=bounds, x_scale=first)
    return Poles(fit.x[:count], fit.x[count:], np.linalg.norm(residuals(fit.x), axis=0))


def column(points: Sequence[int], change: Callable[[dict[str, Any]], None] = lambda _: None) -> dovetail.Assembly:
    """Return the assembly with the FRFs of some impacts, the tip's being 0; `change` alters the description first."""
    description = json.loads(dovetail.load(DESCRIPTION).description.text)
    tip = {"at": "tool", "position": "0 mm", "direction": "x", "quantity": "receptance"}
    description["responses"] = [
        {**tip, "name": f"H1{point + 1}"} | ({"force": {**IMPACTS[point], "direction": "x"}} if point else {})
        for point in points
    ]
    change(description)
    return dovetail.load(description)


def of_steel(description: dict[str, Any]) -> None:
    """Make the tool of high-speed steel instead of cemented carbide."""
    description["substructures"]["tool"]["material"] = HIGH_SPEED_STEEL


def without_masses(description: dict[str, Any]) -> None:
    """Leave out the masses at the bearings."""
    for place in ("front", "rear"):
        del description["substructures"][f"{place}_mass"], description["joints"][f"{place}_spring"]


def steel_without_masses(description: dict[str, Any]) -> None:
    """Change both."""
    of_steel(description)
    without_masses(description)


def with_shank(description: dict[str, Any]) -> None:
    """Give the shank its diameter."""
    description["substructures"]["tool"]["sections"][1]["outer"] = SHANK


MODELS: Mapping[str, Callable[[dict[str, Any]], None]] = {
    "steel, spindle on two bearings": steel_without_masses,
    "carbide, spindle on two bearings": without_masses,
    "steel, and a mass on a spring at each bearing": of_steel,
    "carbide, and a mass on a spring at each bearing": lambda _: None,
    "the same, and the shank of three quarters of an inch": with_shank,
}


def misfits(models: NDArray[np.complex128], measured: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the norm of the difference over that of the measurement, of FRFs (n_frfs, n_freq)."""
    return np.asarray(np.linalg.norm(models - measured, axis=1) / np.linalg.norm(measured, axis=1))


def fits_of(
    change: Callable[[dict[str, Any]], None],
    points: Sequence[int],
    frequency: NDArray[np.float64],
    measured: NDArray[np.complex128],
) -> list[tuple[float, int, Fitted]]:
    """Fit the FRFs of some impacts from several draws of starts: sums of squares, draws, and fits, the best first."""
    assembly, whole = column(points, change), column(range(5), change).on(frequency)
    thinned = [dovetail.Frf(frequency[::EVERY], measured[point][::EVERY], "receptance") for point in points]
    fits = []
    for seed in range(SEEDS):
        options = {"objective": "frf", "starts": STARTS, "seed": seed, "cause_seconds": 0.0}
        result = dovetail.identify(assembly, thinned, "multistart", **options)
        models = whole.frfs(whole.vector(named(result, assembly)))
        left = float(np.sum(np.abs(models - measured)[list(points)] ** 2))
        fits.append((left, seed, Fitted(assembly, result, models)))
    return sorted(fits)


def collet(folder: Path) -> dict[str, str]:
    """Identify tool, collet and spindle from two FRFs, and predict the three others."""
    began = processor_time()
    frfs = [dovetail.read_frf(folder / name, columns=("frequency", "real", "imag"), unit="m/N") for name in FILES]
    band = column(FITTED).frequency[[0, -1]]
    inside = (frfs[0].frequency >= band[0]) & (frfs[0].frequency <= band[1])
    frequency, measured = frfs[0].frequency[inside], np.array([frf.values[inside] for frf in frfs])
    floor = fit_poles(frequency[::2], measured[:, ::2], POLES)
    few = [fit_poles(frequency[::4], measured[list(two), ::4], POLES) for two in combinations(range(len(frfs)), 2)]
    compared, best = [], []
    for name, change in MODELS.items():
        fits = fits_of(change, FITTED, frequency, measured)
        best.append(fits[0])
        compared.append(
            (name, str(len(fits[0][2].assembly.parameters)), *fits[0][2].cells(measured), word(fits[0][2].result))
        )
    assembly, result, models = min(best)[2]
    others = {"H11 and H15": (0, 4), "all five": range(len(frfs))}
    fitted = {name: fits_of(with_shank, points, frequency, measured)[0][2].models for name, points in others.items()}
    tables = {
        "collet_models": rows(f"model|unknowns|{CELLS}|verdict", compared),
        "collet_draws": rows(CELLS, [fit.cells(measured) for _, _, fit in fits]),
        "collet": table_of_frfs(models, measured, floor),
        "collet_all": table_of_fitted({"H11 and H13": models, **fitted}, measured, floor),
        "collet_modes": table_of_modes(assembly, result, floor, few),
        "collet_parts": table_of_parts(result, assembly),
        "collet_adequacy": sentence(result),
    }
    seconds = processor_time() - began
    return tables | {"collet_time": f"From the files to these tables: {seconds:.0f} s of one processor core.\n"}


def table_of_fitted(
    models: Mapping[str, NDArray[np.complex128]], measured: NDArray[np.complex128], floor: Poles
) -> str:
    """Return the misfit over the floor of all FRFs, by those that were fitted."""
    names = [f"H1{point + 1}" for point in range(len(measured))]
    lines = [
        (name, *(f"{ratio:.2f}" for ratio in misfits(frfs, measured) / floor.misfit)) for name, frfs in models.items()
    ]
    return rows("|".join(["fitted", *names]), lines)


def table_of_frfs(models: NDArray[np.complex128], measured: NDArray[np.complex128], floor: Poles) -> str:
    """Return for each FRF how like model and measurement are, next to what shared poles leave, and its best gain."""
    lines = []
    gains = np.sum(models.conj() * measured, axis=1).real / np.sum(np.abs(models) ** 2, axis=1)
    scaled = misfits(gains[:, np.newaxis] * models, measured) / floor.misfit
    for point, misfit in enumerate(misfits(models, measured)):
        fitted = "fitted" if point in FITTED else "predicted"
        ratio, least = misfit / floor.misfit[point], floor.misfit[point]
        likeness = frac(models[point], measured[point])
        cells = f"{likeness:.3f}", f"{100 * misfit:.1f} %", f"{100 * least:.1f} %", f"{ratio:.2f}"
        lines.append((f"H1{point + 1}", fitted, *cells, f"{gains[point]:.2f}", f"{scaled[point]:.2f}"))
    return rows("FRF||FRAC|misfit|floor|misfit over floor|best gain|over floor with it", lines)


def table_of_modes(
    assembly: dovetail.Assembly, result: dovetail.Identification, floor: Poles, few: Sequence[Poles]
) -> str:
    """Return the shared poles, where they are by two FRFs alone, and the nearest modes of the model."""
    modes = assembly.modes(assembly.vector(named(result, assembly)), 14)
    lines = []
    for number, (natural, ratio) in enumerate(zip(floor.natural_frequency, floor.damping_ratio, strict=True)):
        mode = min(modes, key=lambda mode: abs(mode.natural_frequency - natural))
        off = 100 * (mode.natural_frequency / natural - 1)
        found = f"{mode.natural_frequency:.0f} Hz", f"{off:+.1f} %", f"{100 * mode.damping_ratio:.1f} %"
        ends = [f"{end([poles.natural_frequency[number] for poles in few]):.0f}" for end in (min, max)]
        lines.append((f"{natural:.0f} Hz", f"{' to '.join(ends)} Hz", f"{100 * ratio:.1f} %", *found))
    return rows("shared pole|by two FRFs alone|damping|model|difference|damping", lines)


def table_of_parts(result: dovetail.Identification, assembly: dovetail.Assembly) -> str:
    """Return the identified values of tool and collet, and which are at an end of their range."""
    lines = []
    for row in result.table:
        if row.name.startswith(("tool.", "collet.")) and not row.tied_to:
            value = f"{1e3 * row.estimate:.1f} mm" if row.unit == "m" else f"{row.estimate:.3g} {row.unit}"
            lines.append((row.name, value, f"at the {row.best_fit_at} end" if row.best_fit_at else ""))
    return rows("parameter|value|place in its range", lines)
