"""The accelerometer's mass at any DOF, compared with assemblies that model it as a part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.errors import MeasurementError
from dovetail.frf import Frf
from dovetail.frf.resonance_peaks import resonance_peaks
from dovetail.measurement import add_accelerometer_mass, complex_noise, remove_accelerometer_mass

MASS = 1.2e-3
TIP, MIDDLE, END = 0.0, 0.05, 0.1
LINE = 2.0


def beam(position: float | None) -> dovetail.Assembly:
    """A carbide tool, free, with the accelerometer at a position or without it."""
    material = {"young": "583.6 GPa", "density": "14451.3 kg/m^3", "poisson": 0.3, "loss_factor": 0.005}
    sections = [{"length": "100 mm", "outer": "10 mm", "elements": 10}]
    described = {
        "dovetail": 1,
        "name": "tool",
        "frequency": {"start": 100, "stop": 16000, "step": LINE},
        "substructures": {"tool": {"model": "timoshenko_beam", "material": material, "sections": sections}},
        "joints": {},
        "response": {"at": "tool", "position": 0, "quantity": "accelerance"},
    }
    if position is not None:
        described["substructures"]["accelerometer"] = {"model": "lumped", "masses": [{"mass": MASS}]}
        ends = {"a": {"to": "tool", "at": position}, "b": {"to": "accelerometer", "at": 0.0}}
        described["joints"]["wax"] = {"model": "rigid", "direction": "x", "connect": ends}
    return dovetail.load(described)


def frfs(assembly: dovetail.Assembly, *pairs: tuple[float, float]) -> list[Frf]:
    """FRFs (response, force) of the assembly, as receptances."""
    points = sorted({point for pair in pairs for point in pair})
    dofs = [("tool", point, "x") for point in points]
    values = assembly.receptance(None, dofs, dofs)
    return [
        Frf(assembly.frequency, values[:, points.index(i), points.index(j)], "receptance", label=f"{i} {j}")
        for i, j in pairs
    ]


@pytest.fixture(scope="module")
def bare() -> dovetail.Assembly:
    return beam(None)


@pytest.mark.parametrize(
    ("response", "force", "sensor"),
    [(TIP, TIP, TIP), (TIP, MIDDLE, TIP), (TIP, MIDDLE, MIDDLE), (TIP, MIDDLE, END), (TIP, TIP, END)],
    ids=["drive point", "at the response", "at the force", "at a third point", "drive point, elsewhere"],
)
@pytest.mark.parametrize("quantity", ["receptance", "accelerance"])
def test_frfs_corrected_for_the_accelerometer_are_those_of_the_bare_structure(
    bare, response: float, force: float, sensor: float, quantity: str
) -> None:
    pairs = [(response, force), (sensor, sensor), (response, sensor), (sensor, force)]
    without, *of_bare = (frf.to(quantity) for frf in frfs(bare, *pairs))
    loaded, *with_it = (frf.to(quantity) for frf in frfs(beam(sensor), *pairs))
    names = ("drive", "to_response", "from_force")
    others, bare_others = (dict(zip(names, some, strict=True)) for some in (with_it, of_bare))
    assert np.max(np.abs(loaded.values / without.values - 1)) > 0.05
    ways = [names]
    if sensor in (response, force):
        ways.append(names[:1])
    if response == force == sensor:
        ways.append(())
    for way in ways:
        removed = remove_accelerometer_mass(loaded, MASS, **{name: others[name] for name in way})
        added = add_accelerometer_mass(without, MASS, **{name: bare_others[name] for name in way})
        scale = np.abs(without.values)
        assert np.max(np.abs(removed.values - without.values) / scale) < 1e-9
        assert np.max(np.abs(added.values - loaded.values) / np.abs(loaded.values)) < 1e-9


def test_with_noise_the_frequency_shift_is_recovered_within_a_line(bare) -> None:
    (without,) = frfs(bare, (TIP, TIP))
    (loaded,) = frfs(beam(TIP), (TIP, TIP))
    accelerance = loaded.to("accelerance")
    true, shifted = resonance_peaks(without.to("accelerance")), resonance_peaks(accelerance)
    assert true.size == shifted.size == 2
    assert np.all(true - shifted > 20 * LINE)
    for seed in range(20):
        noisy = replace(accelerance, values=complex_noise(accelerance.values, 0.005, seed))
        found = resonance_peaks(remove_accelerometer_mass(noisy, MASS))
        near = [found[np.argmin(np.abs(found - frequency))] for frequency in true]
        np.testing.assert_allclose(near, true, atol=LINE)


def test_the_variance_goes_through_the_correction() -> None:
    frequency, generator = np.array([100.0, 200.0]), np.random.default_rng(0)
    true, drive = np.array([300 + 200j, -500 + 400j]), np.array([250 - 100j, 600 + 50j])
    scatter = np.array([3.0, 7.0])
    for others in ({}, {"drive": Frf(frequency, drive, "accelerance")}):
        samples = []
        for _ in range(4000):
            noise = scatter * (generator.standard_normal(2) + 1j * generator.standard_normal(2)) / np.sqrt(2)
            samples.append(
                remove_accelerometer_mass(Frf(frequency, true + noise, "accelerance"), MASS / 10, **others).values
            )
        given = Frf(frequency, true, "accelerance", variance=scatter**2)
        predicted = remove_accelerometer_mass(given, MASS / 10, **others).variance
        np.testing.assert_allclose(np.var(samples, axis=0), predicted, rtol=0.06)


def test_coherence_and_averages_become_a_variance() -> None:
    frf = Frf(np.array([1.0, 2.0]), [100j, 200j], "accelerance", coherence=[0.5, 0.9], averages=5)
    removed = remove_accelerometer_mass(frf, MASS)
    factor = np.abs(1 / (1 - MASS * frf.values)) ** 4
    np.testing.assert_allclose(removed.random_variance, frf.random_variance * factor)


def test_missing_or_unsuitable_frfs_for_the_mass_correction_are_refused(bare) -> None:
    drive, transfer = frfs(bare, (TIP, TIP), (TIP, MIDDLE))
    with pytest.raises(MeasurementError, match="the drive-point FRF at the accelerometer is missing"):
        remove_accelerometer_mass(transfer, MASS, to_response=drive)
    with pytest.raises(MeasurementError, match="needs the FRF to the response and the FRF from the force"):
        remove_accelerometer_mass(transfer, MASS, drive=drive, to_response=drive)
    short = Frf(drive.frequency[1:], drive.values[1:], "receptance", label="short")
    with pytest.raises(MeasurementError, match=r"short\n  its lines are not those of"):
        remove_accelerometer_mass(transfer, MASS, drive=short)
    with pytest.raises(MeasurementError, match="this is a rotation per moment"):
        remove_accelerometer_mass(transfer, MASS, drive=replace(drive, rotation=True))
    with pytest.raises(MeasurementError, match="this is an amplitude alone"):
        remove_accelerometer_mass(transfer, MASS, drive=replace(drive, values=drive.amplitude, has_phase=False))
