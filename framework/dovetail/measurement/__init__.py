"""Measured FRFs: files of several formats, the accelerometer's mass, the assembly's frequency grid, noise."""

from dovetail.measurement.accelerometer import add_accelerometer_mass, remove_accelerometer_mass
from dovetail.measurement.files import read_frf, write_frf
from dovetail.measurement.noise import complex_noise, data_noise
from dovetail.measurement.resampling import on_grid

__all__ = [
    "add_accelerometer_mass",
    "complex_noise",
    "data_noise",
    "on_grid",
    "read_frf",
    "remove_accelerometer_mass",
    "write_frf",
]
