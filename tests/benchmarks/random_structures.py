"""Plausible structures at random, for the studies of identification: beams, masses and grounds, joined by every joint.

Unlike the assemblies of the tests of physics, which are as unusual as possible, these could stand in a laboratory:
resonances in the band, realistic damping, joints whose stiffness matters, ranges of half a decade to two decades.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, Literal, get_args

import numpy as np

import dovetail
from dovetail.measurement import complex_noise
from dovetail.synthesis.natural_frequencies import dense_modes
from dovetail.synthesis.reference import assembly_matrices

JOINTS = ("collet", "bolted", "interference_fit", "spring_damper", "bearing", "rigid")
Noise = Literal["multiplicative", "additive", "H1"]
NOISES: tuple[Noise, ...] = get_args(Noise)
_MESH = 0.01
"""Length of an element [m]."""
_FEWEST, _MOST = 3, 14
"""Unknowns of a structure."""
_LINES = 4000
"""Of the description's own axis, in the whole band."""
_COLLET = {
    "Dc": (26e-3, 40e-3),
    "dc": (10e-3, 18e-3),
    "mn1": (0.02, 0.20),
    "mn2": (0.02, 0.20),
    "kt_tc": (1e8, 2e9),
    "kr_tc": (2e3, 6e4),
    "ct_tc": (10.0, 1000.0),
    "cr_tc": (0.01, 5.0),
    "kt_hc": (3e8, 5e9),
    "kr_hc": (5e4, 2e6),
    "ct_hc": (10.0, 1000.0),
    "cr_hc": (0.01, 5.0),
}


@dataclass
class _Beam:
    """A beam, and what its joints are in proportion to.

    Parameters
    ----------
    name : str
    free : list of int
        Nodes without a joint, by their numbers.
    bending, mass, length : float
        EI [N m^2], [kg], [m].
    """

    name: str
    free: list[int]
    bending: float
    mass: float
    length: float

    @property
    def omega(self) -> float:
        """About the second natural frequency of the free beam [rad/s], where damping is set."""
        return 60.0 * float(np.sqrt(self.bending / (self.mass * self.length**3)))

    def take(self, count: int, rng: np.random.Generator, *, end: bool = False) -> list[int] | None:
        """Take consecutive nodes, at an end or anywhere, or return None if there are no such."""
        runs = [run for run in zip(*(self.free[i:] for i in range(count)), strict=False) if run[-1] - run[0] < count]
        if not runs:
            return None
        taken = list(runs[0 if rng.random() < 0.5 else -1] if end else runs[rng.integers(len(runs))])
        self.free = [node for node in self.free if node not in taken]
        return taken


class _Builder:
    """A structure that grows joint by joint."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.parts: dict[str, Any] = {}
        self.joints: dict[str, Any] = {}
        self.beams: list[_Beam] = []
        self.budget = int(rng.integers(_FEWEST, _MOST + 1))
        self.unknown = 0

    def between(self, low: float, high: float) -> float:
        """Draw a value, uniform in its logarithm."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def add_beam(self) -> _Beam:
        rng = self.rng
        young, density = [(206e9, 7850.0), (70e9, 2700.0), (583.6e9, 14451.3)][rng.choice(3, p=[0.6, 0.25, 0.15])]
        elements = int(rng.integers(12, 46))
        outer = elements * _MESH * self.between(0.04, 0.15)
        section: dict[str, Any] = {"length": elements * _MESH, "elements": elements}
        shape = rng.choice(["solid", "hollow", "rectangle"])
        if shape == "rectangle":
            section |= {"width": outer * rng.uniform(1.0, 3.0), "height": outer}
            area, moment = section["width"] * outer, section["width"] * outer**3 / 12.0
        else:
            inner = outer * rng.uniform(0.3, 0.8) if shape == "hollow" else 0.0
            section |= {"outer": outer, **({"inner": inner} if inner else {})}
            area, moment = np.pi / 4.0 * (outer**2 - inner**2), np.pi / 64.0 * (outer**4 - inner**4)
        name, length = f"beam{len(self.beams) + 1}", elements * _MESH
        material = {"young": young, "density": density, "poisson": 0.3, "loss_factor": self.between(1e-3, 1e-2)}
        self.parts[name] = {"model": "timoshenko_beam", "material": material, "sections": [section]}
        self.beams.append(_Beam(name, list(range(elements + 1)), young * moment, density * area * length, length))
        return self.beams[-1]

    def add_ground(self, position: float) -> dict[str, Any]:
        name = f"ground{len(self.parts)}"
        self.parts[name] = {"model": "ground", "positions": [position]}
        return {"to": name, "at": [position]}

    def add_mass(self, beam: _Beam) -> dict[str, Any]:
        name, mass = f"mass{len(self.parts)}", beam.mass * self.between(0.03, 0.5)
        inertia = mass * (beam.length * self.rng.uniform(0.03, 0.1)) ** 2
        self.parts[name] = {"model": "lumped", "masses": [{"position": 0.0, "mass": mass, "inertia": inertia}]}
        return {"to": name, "at": [0.0]}

    def join(self, model: str) -> None:
        """Add a joint of a model to one of the beams, and what stands on its other side."""
        beam = self.beams[self.rng.integers(len(self.beams))]
        count = {"collet": 3, "bolted": 4, "interference_fit": 5}.get(model, 1)
        nodes = beam.take(count, self.rng, end=count > 1 or self.rng.random() < 0.5)
        if nodes is None:
            return
        here = {"to": beam.name, "at": [node * _MESH for node in nodes]}
        there = self.other_side(model, beam, count, here)
        ports = {"collet": ("tool", "holder"), "interference_fit": ("shaft", "hub"), "bearing": ("shaft", "housing")}
        one, other = ports.get(model, ("a", "b"))
        section: dict[str, Any] = {"model": model, "connect": {one: here, other: there}}
        section |= getattr(self, f"{model}_options")(beam, there)
        section["parameters"] = {name: self.said(*window) for name, window in section["parameters"].items()}
        self.joints[f"joint{len(self.joints) + 1}"] = section

    def other_side(self, model: str, beam: _Beam, count: int, here: dict[str, Any]) -> dict[str, Any]:
        if count == 1:
            draw = self.rng.random()
            if model == "bearing" or draw < 0.4:
                return self.add_ground(here["at"][0])
            if draw < 0.7 or len(self.beams) >= 3:
                return self.add_mass(beam)
        added = self.add_beam()
        nodes = added.take(count, self.rng, end=True)
        assert nodes is not None
        return {"to": added.name, "at": [node * _MESH for node in nodes]}

    def said(self, low: float, high: float, scale: str) -> dict[str, Any]:
        """Say a range around some value of a window while there is room for unknowns, else the value."""
        value = self.between(low, high) if scale == "log" else self.rng.uniform(low, high)
        if self.unknown >= self.budget or self.rng.random() < 0.1:
            return {"value": float(value)}
        self.unknown += 1
        if scale == "linear":
            return {"range": [low, high], "scale": "linear"}
        decades = self.rng.uniform(0.5, 2.0)
        lower = value * 10.0 ** (-decades * self.rng.random())
        return {"range": [float(lower), float(lower * 10.0**decades)], "scale": "log"}

    # -- each joint: its options, and windows of its parameters in proportion to the beam's own stiffness ------------

    def collet_options(self, beam: _Beam, _there: dict[str, Any]) -> dict[str, Any]:
        material = {"young": 199.4e9, "density": 7711.5, "poisson": 0.3, "loss_factor": 0.003}
        windows = {name: (*window, "linear" if window[1] < 1.0 else "log") for name, window in _COLLET.items()}
        return {"material": material, "parameters": windows}

    def layer(self, beam: _Beam, span: float, names: Sequence[str]) -> dict[str, tuple[float, float, str]]:
        """Windows of two stiffnesses and two dampings: about as stiff as the beam over a span."""
        k, kr = beam.bending / span**3, beam.bending / span
        c, cr = k / beam.omega, kr / beam.omega
        windows = [(0.3 * k, 30.0 * k), (0.3 * kr, 30.0 * kr), (0.003 * c, 0.3 * c), (0.003 * cr, 0.3 * cr)]
        return {name: (*window, "log") for name, window in zip(names, windows, strict=True)}

    def bolted_options(self, beam: _Beam, _there: dict[str, Any]) -> dict[str, Any]:
        parameters = self.layer(beam, 0.15 * beam.length, ("kt", "kr", "ct", "cr"))
        bolt = 0.05 * beam.mass
        parameters["mb"] = (0.3 * bolt, bolt, "linear")
        return {"nodes": 4, "bolt_mass": True, "parameters": parameters}

    def interference_fit_options(self, beam: _Beam, _there: dict[str, Any]) -> dict[str, Any]:
        length = 4 * _MESH
        layer = self.layer(beam, 0.15 * beam.length, ("k", "kr", "c", "cr"))
        parameters = {name: (low / length, high / length, scale) for name, (low, high, scale) in layer.items()}
        return {"nodes": 5, "length": length, "parameters": parameters}

    def spring_damper_options(self, beam: _Beam, _there: dict[str, Any]) -> dict[str, Any]:
        layer = self.layer(beam, 0.4 * beam.length, ("k", "kr", "c", "cr"))
        if self.rng.random() < 0.5:
            return {"direction": "both", "parameters": layer}
        return {"direction": "x", "parameters": {name: layer[name] for name in ("k", "c")}}

    def bearing_options(self, beam: _Beam, _there: dict[str, Any]) -> dict[str, Any]:
        parameters = self.layer(beam, 0.3 * beam.length, ("k", "kr", "c", "cr"))
        ring = 0.1 * beam.mass
        inertia = ring * (0.1 * beam.length) ** 2
        return {"parameters": parameters | {"m": (0.3 * ring, ring, "linear"), "J": (0.1 * inertia, inertia, "log")}}

    def rigid_options(self, _beam: _Beam, there: dict[str, Any]) -> dict[str, Any]:
        grounded = self.parts[there["to"]]["model"] == "ground"
        return {"direction": "x" if grounded else "both", "parameters": {}}


def random_structure(rng: np.random.Generator, first: str | None = None) -> dict[str, Any]:
    """Return the description of a structure of one to four beams, with 3 to 14 unknown parameters.

    Parameters
    ----------
    rng : numpy.random.Generator
    first : str, optional
        Model of the first joint, one of `JOINTS`; drawn if not given. The others are drawn.

    Returns
    -------
    dict
        As `dovetail.load` takes it; SI values. Its band has 2 to 10 natural frequencies in the middle of the ranges.
    """
    while True:
        description = _built(rng, first)
        if description is not None:
            return description


def _built(rng: np.random.Generator, first: str | None) -> dict[str, Any] | None:
    """Return a structure, or None if it has too few unknowns or resonances, or no node without a joint."""
    builder = _Builder(rng)
    builder.add_beam()
    builder.join(first or str(rng.choice(JOINTS)))
    for _ in range(4):
        if builder.unknown < builder.budget and (builder.unknown < _FEWEST or rng.random() < 0.7):
            builder.join(str(rng.choice(JOINTS)))
    beam = builder.beams[0]
    if builder.unknown < _FEWEST or not beam.free:
        return None
    point = beam.free[0 if rng.random() < 0.6 else rng.integers(len(beam.free))]
    description = {
        "dovetail": 1,
        "name": "random-structure",
        "frequency": {"start": 10.0, "stop": 20.0, "lines": 2},
        "substructures": builder.parts,
        "joints": builder.joints,
        "response": {"at": beam.name, "position": point * _MESH, "direction": "x", "quantity": "accelerance"},
    }
    count = int(rng.integers(2, 11))
    modes = undamped_frequencies(dovetail.load(description), None, count + 1)
    if len(modes) <= count:
        return None
    start, stop = 0.4 * modes[0], np.sqrt(modes[-2] * modes[-1])
    description["frequency"] = {"start": float(start), "stop": float(stop), "lines": _LINES}
    return description


def undamped_frequencies(assembly: dovetail.Assembly, theta: np.ndarray | None, count: int) -> np.ndarray:
    """Return natural frequencies (<= count,) [Hz] without dampers, so that structures stay those of earlier studies."""
    matrices = assembly_matrices(assembly.graph, assembly.by_joint(assembly.vector(theta)))
    return np.array([frequency for frequency, _ in islice(dense_modes(matrices.K, matrices.M), count)])


def draw_theta(assembly: dovetail.Assembly, rng: np.random.Generator) -> np.ndarray:
    """Return parameters (n_params,) anywhere in their ranges, with 2 resonances in the band at least."""
    band = assembly.frequency[[0, -1]]
    for _ in range(100):
        theta: np.ndarray = assembly.from_unit(rng.random(len(assembly.parameters)))
        modes = undamped_frequencies(assembly, theta, 10)
        if np.count_nonzero((modes > band[0]) & (modes < band[1])) >= 2:
            return theta
    raise ValueError("no joint of this structure has two resonances in its band.")


def draw_axis(
    assembly: dovetail.Assembly, rng: np.random.Generator, lines: tuple[int, int] = (200, 50_000)
) -> np.ndarray:
    """Return the frequencies of a measurement: a start and a step of its own, so many lines of the band."""
    first, last = assembly.frequency[[0, -1]]
    start = first + rng.uniform(0.0, 0.05) * (last - first)
    stop = last - rng.uniform(0.0, 0.2) * (last - first)
    return np.linspace(start, stop, round(float(np.exp(rng.uniform(*np.log(lines))))))


def measure(
    assembly: dovetail.Assembly, theta: np.ndarray, noise: Noise, rng: np.random.Generator, *, variance_given: bool
) -> dovetail.Frf:
    """Return what a measurement of a joint gives on the assembly's lines.

    Parameters
    ----------
    assembly : Assembly
    theta : (n_params,) array
    noise : {"multiplicative", "additive", "H1"}
        1 % of each value; 1 % of the FRF's standard deviation; a response with noise, from 8 to 64 averages.
    rng : numpy.random.Generator
    variance_given : bool
        Whether the measurement shows its variance, or its coherence and averages.
    """
    clean = dovetail.Frf(assembly.frequency, assembly.frf(theta), assembly.description.response.quantity)
    if noise == "H1":
        return _averaged(clean, rng, variance_given)
    kind: Literal["proportional", "uniform"] = "proportional" if noise == "multiplicative" else "uniform"
    size = clean.amplitude if noise == "multiplicative" else np.full(len(clean.frequency), clean.values.std())
    values = complex_noise(clean.values, 0.01, rng, kind=kind)
    return replace(clean, values=values, variance=(0.01 * size) ** 2 if variance_given else None)


def _averaged(clean: dovetail.Frf, rng: np.random.Generator, variance_given: bool) -> dovetail.Frf:
    """Return H1 and the coherence, from spectra of a random force and of a response with 1 to 10 % of noise."""
    averages = int(rng.integers(8, 65))
    level = float(np.exp(rng.uniform(np.log(0.01), np.log(0.1)))) * clean.values.std()
    force_power, response_power, cross = 0.0, 0.0, np.zeros(len(clean.frequency), dtype=np.complex128)
    for _ in range(averages):
        force, error = (part[0] + 1j * part[1] for part in rng.standard_normal((2, 2, len(clean.frequency))))
        response = clean.values * force + level * error
        force_power = force_power + np.abs(force) ** 2
        response_power = response_power + np.abs(response) ** 2
        cross = cross + np.conj(force) * response
    coherence = np.abs(cross) ** 2 / (force_power * response_power)
    values = cross / force_power
    estimated = replace(clean, values=values)
    return replace(estimated, coherence=coherence, averages=averages) if variance_given else estimated
