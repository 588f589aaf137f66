"""Public measured FRFs of simple structures: read from clones of their repositories, and altered on purpose.

Nothing of the data is part of this repository: neither the beam's nor the frame's repository has a licence. The
descriptions in the folder measured_structures, written from the dimensions that the sources state, are.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from numpy.typing import NDArray

import dovetail

DESCRIPTIONS = Path(__file__).with_name("measured_structures")
STANDARD_GRAVITY = 9.80665
BEAM_DELAY = 950e-6
"""Seconds by which the beam's sensors and data acquisition lag, from the phase between its resonances; +-30 us."""
BEAM_GAINS = (1315.0, 1268.0, 929.0)
"""Sensor voltage per actuator voltage over m/N, so that the beam of the description, 20 mm wide, fits each actuator's
drive-point FRF best. The sources state no unit: total mass and gain cannot be distinguished."""
BEAM_CHAIN = (0.0, BEAM_DELAY)
OSCILLATOR_GAIN = -25.2
"""Measured value over m/s^2/N for an oscillator of 1 kg; negative, since its phase is that of a reversed
accelerometer."""
OSCILLATOR_CHAIN = (0.699, 389e-6)
"""Lead [rad] and delay [s] of its measuring chain, from a fit from 180 to 250 Hz; together 10 degrees at the
resonance."""
NO_CHAIN = (0.0, 0.0)
_MAT_HEADER = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


@dataclass(frozen=True)
class Structure:
    """A structure with a measured drive-point FRF.

    Parameters
    ----------
    name : str
        Of the description.
    file : str
        Of the FRF.
    modes : tuple of float
        Natural frequencies [Hz] within the described band, from a fit of complex modes to the measured FRFs.
    other_points : tuple of str
        Files with FRFs of other points, under the same force or under one at the point itself.
    added_mass : float
        kg; lowers a natural frequency by some per cent. 0 where a mass at the point is unknown (the beam's coils), or
        cannot be distinguished from a gain (the oscillator).
    wrong_unit : tuple of (str, float)
        A unit that may be taken for the right one, and its size in the right one.
    chain : tuple of (float, float)
        Lead [rad] and delay [s] of the measuring chain, which the file no longer has.
    alterable : bool
        False where the description itself is wrong, so that a cause is named rightly before anything is altered.
    """

    name: str
    file: str
    modes: tuple[float, ...]
    other_points: tuple[str, ...]
    added_mass: float
    wrong_unit: tuple[str, float]
    chain: tuple[float, float] = NO_CHAIN
    alterable: bool = True

    def assembly(self) -> dovetail.Assembly:
        """The assembly of its description."""
        return dovetail.load(DESCRIPTIONS / f"{self.name}.yaml")


_FRAME_MODES, _FLOORS = (20.42, 71.23, 139.03), ("frame_floor2", "frame_floor3")
_BEAM_MODES = (32.74, 93.11, 105.6, 172.5, 183.75, 289.1)
_G, _MM = ("g", STANDARD_GRAVITY), ("mm", 1e-3)
STRUCTURES = (
    Structure("frame", "frame_floor1", _FRAME_MODES, _FLOORS, 0.2, _G, alterable=False),
    Structure("frame_fitted", "frame_floor1", _FRAME_MODES, _FLOORS, 0.2, _G),
    Structure("beam1", "beam_o1_i1", _BEAM_MODES, ("beam_o2_i1", "beam_o3_i1", "beam_o3_i2"), 0.0, _MM, BEAM_CHAIN),
    Structure("beam2", "beam_o3_i2", _BEAM_MODES, ("beam_o1_i2", "beam_o4_i2", "beam_o1_i1"), 0.0, _MM, BEAM_CHAIN),
    Structure("beam3", "beam_o5_i3", _BEAM_MODES, ("beam_o3_i3", "beam_o4_i3", "beam_o3_i2"), 0.0, _MM, BEAM_CHAIN),
    Structure("oscillator", "oscillator", (212.07,), (), 0.0, _G, OSCILLATOR_CHAIN),
)


def convert(clone: Path, data: Path) -> list[Path]:
    """Write the FRFs of a repository's clone, or of an unpacked package, as NPZ files.

    Parameters
    ----------
    clone : Path
        Of matthijsvandevosse/Structual-Model-Updating-TNO, Daniel-Sottovia/Grupo-6 or
        vibrationtoolbox/vibration_toolbox.
    data : Path
        Folder for the files; made if it is missing.

    Returns
    -------
    list of Path
        The files, each for `dovetail.read_frf`.

    Raises
    ------
    SystemExit
        The clone has none of the files.
    """
    sources: Mapping[str, Callable[[Path], dict[str, dovetail.Frf]]] = {
        "experimentele data/BeamModal_O12345I123.mat": read_beam,
        "FRF.csv": read_frame,
        "vibration_toolbox/data/case1.mat": read_oscillator,
    }
    frfs = {
        name: frf
        for file, read in sources.items()
        if (clone / file).exists()
        for name, frf in read(clone / file).items()
    }
    if not frfs:
        raise SystemExit(f"{clone} holds none of {', '.join(sources)}.")
    data.mkdir(parents=True, exist_ok=True)
    for name, frf in frfs.items():
        dovetail.write_frf(frf, data / f"{name}.npz", overwrite=True)
    return [data / f"{name}.npz" for name in frfs]


def read_beam(path: Path) -> dict[str, dovetail.Frf]:
    """Read the beam's 5 x 3 FRFs, sensor by actuator, with delay and gain removed.

    They are in a MATLAB object, which `loadmat` returns as the bytes of another file of MATLAB.
    """
    workspace = scipy.io.loadmat(path)["__function_workspace__"].tobytes()[8:]
    size = 8 + int.from_bytes(workspace[4:8], "little")
    inner = scipy.io.loadmat(io.BytesIO(_MAT_HEADER + workspace[:size]))["__function_workspace__"]
    arrays = [np.asarray(one) for one in inner["MCOS"][0, 0]["arr"].ravel()[0].ravel()]
    values = next(array for array in arrays if array.ndim == 3)
    frequency = next(array for array in arrays if array.shape == (values.shape[2], 1)).ravel() / (2 * np.pi)
    phase = chain_phase(frequency, BEAM_CHAIN)
    frfs = {}
    for sensor, actuator in np.ndindex(values.shape[:2]):
        receptance = values[sensor, actuator] / phase / BEAM_GAINS[actuator]
        name = f"beam_o{sensor + 1}_i{actuator + 1}"
        points = (f"beam:{sensor + 1}+x", f"beam:{2 * actuator + 1}+x")
        frfs[name] = _frf(frequency, receptance, "receptance", *points)
    return frfs


def read_frame(path: Path) -> dict[str, dovetail.Frf]:
    """Read the frame's accelerances at floors 1, 2 and 3 for a force at floor 1: H1, decimal commas, 0.5 Hz."""
    rows = [row.strip().replace(",", ".").split(";") for row in path.read_text(encoding="latin-1").splitlines()]
    table = np.array([[float(cell) for cell in row] for row in rows if len(row) == 7 and row[0][:1].isdigit()])
    return {
        f"frame_floor{floor}": _frf(
            table[:, 0],
            table[:, 2 * floor - 1] + 1j * table[:, 2 * floor],
            "accelerance",
            f"floor{floor}:1+x",
            "floor1:1+x",
        )
        for floor in (1, 2, 3)
    }


def read_oscillator(path: Path) -> dict[str, dovetail.Frf]:
    """Read the oscillator's FRF; its coherence, above 1 in places and 0.3 at the resonance, is not read."""
    arrays = scipy.io.loadmat(path)
    frequency = arrays["Freq_domain"].ravel().astype(np.float64)
    values = arrays["Hf_chan_2"].ravel() / OSCILLATOR_GAIN / chain_phase(frequency, OSCILLATOR_CHAIN)
    return {"oscillator": _frf(frequency, values, "accelerance", "mass:1+x", "mass:1+x")}


def chain_phase(frequency: NDArray[Any], chain: tuple[float, float]) -> NDArray[np.complex128]:
    """Return what a measuring chain with a lead [rad] and a delay [s] multiplies an FRF by."""
    lead, delay = chain
    return np.asarray(np.exp(1j * (lead - 2 * np.pi * frequency * delay)), dtype=np.complex128)


def _frf(frequency: NDArray[Any], values: NDArray[Any], quantity: Any, response: str, force: str) -> dovetail.Frf:
    """Return the FRF without its line at 0 Hz."""
    return dovetail.Frf(
        np.asarray(frequency[1:], dtype=np.float64),
        np.asarray(values[1:], dtype=np.complex128),
        quantity,
        response=response,
        force=force,
    )


def measured(data: Path) -> Iterator[tuple[Structure, dovetail.Frf]]:
    """Yield each structure whose drive-point FRF is in the folder, with that FRF."""
    for structure in STRUCTURES:
        if (path := data / f"{structure.file}.npz").exists():
            yield structure, dovetail.read_frf(path)


def altered(structure: Structure, frf: dovetail.Frf, data: Path) -> Iterator[tuple[str, dovetail.Frf]]:
    """Yield the FRF with each alteration, and what was altered: `cause`, or `cause: size`."""
    unit, size = structure.wrong_unit
    yield "sign", replace(frf, values=-frf.values)
    yield "gain: 1.2", replace(frf, values=1.2 * frf.values)
    yield f"unit: {unit}", replace(frf, values=frf.values / size)
    for delay in (20e-6, 200e-6):
        yield f"delay: {delay * 1e6:g} us", replace(frf, values=frf.values * chain_phase(frf.frequency, (0.0, delay)))
    if structure.chain != NO_CHAIN:
        lead, delay = structure.chain
        as_measured = frf.values * chain_phase(frf.frequency, structure.chain)
        yield f"delay as measured: {delay * 1e6:g} us, lead {lead:g}", replace(frf, values=as_measured)
    yield "conjugate", replace(frf, values=frf.values.conj())
    if structure.added_mass:
        yield f"mass: {structure.added_mass * 1e3:g} g", dovetail.add_accelerometer_mass(frf, structure.added_mass)
    for name in structure.other_points:
        other = dovetail.read_frf(data / f"{name}.npz")
        yield f"point: {other.response} from {other.force}", replace(other, response=frf.response, force=frf.force)


def with_overhang(structure: Structure, further: float) -> dovetail.Assembly:
    """Return a beam described with its coils, and the point that is measured, further along it [mm]."""
    description = json.loads(structure.assembly().description.text)
    sections = description["substructures"]["beam"]["sections"]
    sections[0]["length"], sections[2]["length"] = f"{50 + further} mm", f"{50 - further} mm"
    for number in (1, 2, 3):
        description["joints"][f"coil{number}"]["connect"]["shaft"]["at"] = f"{200 * number - 150 + further} mm"
    description["response"]["position"] = f"{200 * int(structure.name[-1]) - 150 + further} mm"
    return dovetail.load(description)


def cases(data: Path) -> Iterator[tuple[str, dovetail.Frf, dovetail.Assembly]]:
    """Yield every alterable measurement, unaltered and altered: `structure, unaltered` or `structure, cause: size`."""
    for structure, frf in measured(data):
        if not structure.alterable:
            continue
        assembly = structure.assembly()
        yield f"{structure.name}, unaltered", frf, assembly
        for change, other in altered(structure, frf, data):
            yield f"{structure.name}, {change}", other, assembly
        if structure.name.startswith("beam"):
            yield f"{structure.name}, overhang: 10 mm", frf, with_overhang(structure, 10.0)
