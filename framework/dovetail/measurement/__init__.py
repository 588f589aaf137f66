"""Measured FRFs and modal parameters: files, the accelerometer's mass, lines within a band, resampling, noise."""

from dovetail.measurement.accelerometer import add_accelerometer_mass, remove_accelerometer_mass
from dovetail.measurement.frf_files import frf_suffixes, read_frf, write_frf
from dovetail.measurement.impact_test.frf_estimation import EstimatedFrf, frf_from_signals, without_window_damping
from dovetail.measurement.lines import check_cover, find_gaps, find_missing_ends, within_band
from dovetail.measurement.modal_parameters import ModalParameters, is_modal_table, read_modal_parameters
from dovetail.measurement.noise import complex_noise, data_noise, noisy_frf
from dovetail.measurement.resampling import on_grid

__all__ = [
    "EstimatedFrf",
    "ModalParameters",
    "add_accelerometer_mass",
    "check_cover",
    "complex_noise",
    "data_noise",
    "find_gaps",
    "find_missing_ends",
    "frf_from_signals",
    "frf_suffixes",
    "is_modal_table",
    "noisy_frf",
    "on_grid",
    "read_frf",
    "read_modal_parameters",
    "remove_accelerometer_mass",
    "within_band",
    "without_window_damping",
    "write_frf",
]
