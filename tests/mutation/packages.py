"""The packages that are mutated, and the tests that cover them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Package:
    """Files that are mutated, the tests that are to notice, and words in the names of tests that are left out.

    Tests are left out that take longer than a mutant is worth, and those that cannot run on mutated files.
    """

    mutated: tuple[str, ...]
    tests: tuple[str, ...]
    without: tuple[str, ...] = ()

    def files(self, source: Path) -> Iterator[Path]:
        """Yield the files that are mutated, in a fixed order."""
        for pattern in self.mutated:
            yield from sorted(source.glob(pattern.replace("*", "**/*.py")))


SLOW = (
    "campaign",
    "quick",
    "two_points",
    "test_one_vector_equals_the_direct_solve_at_every_line",
    "test_the_worst_files_take_bounded_time_and_memory",
    "test_random_assemblies_equal_the_dense_solve",
)
"""Most are repetitions in tests/synthesis/test_exactness.py; each of the others takes half a minute or more."""

SLOW_POSTERIORS = (
    "five_torques",
    "as_often_as_they_say",
    "band_of_another_tool",
    "the_shipped_measurement",
    "highest_peak",
    "bands_of_both_forms",
    "many_searches_are_judged",
    "modulus_that_is_off",
    "mass_that_is_two_per_cent_off",
    "sets_the",
    "every_error_can_be_allowed",
)
"""Whole identifications by `posterior`: 17 minutes of the 20 that its tests take on a busy core."""


def _in(folder: str, *names: str) -> tuple[str, ...]:
    return tuple(f"tests/{folder}/test_{name}.py" for name in names)


PACKAGES = {
    "synthesis": Package(("dovetail/synthesis/*",), ("tests/synthesis", *_in("plugins", "measured")), SLOW),
    "plugins": Package(
        ("dovetail_plugins/*",),
        ("tests/plugins", *_in("synthesis", "joints", "beam", "imported_solid", "shipped_assemblies")),
        SLOW,
    ),
    "frf": Package(
        ("dovetail/frf/*",),
        (
            *_in("frf", "frf", "random_variance", "resonance_peaks"),
            *_in("measurement", "csv_files", "accelerometer_mass", "resampling", "noise"),
            *_in("measurement", "tables_with_units", "npz_files", "uff_files", "round_trip"),
            *_in("coupling", "receptance_coupling"),
            *_in("synthesis", "synthesis"),
            *_in("identification", "identify_result"),
        ),
        SLOW,
    ),
    "measurement": Package(
        (
            "dovetail/units.py",
            "dovetail/measurement/frf_units.py",
            "dovetail/measurement/accelerometer.py",
            "dovetail/measurement/noise.py",
            "dovetail/measurement/resampling.py",
            "dovetail/measurement/impact_test/*",
        ),
        (
            *_in("measurement", "frf_from_signals", "accelerometer_mass", "accelerometer_anywhere", "resampling"),
            *_in("measurement", "tables_with_units", "csv_files", "cutpro_files", "npz_files", "uff_files"),
            *_in("measurement", "noise", "round_trip", "signal_limits", "uff_dofs"),
            *_in("frf", "random_variance"),
            *_in("description", "sections_of_a_beam", "valid_descriptions", "faults_of_parameters", "json_schema"),
            *_in("cli", "command_convert_and_frf"),
        ),
        SLOW,
    ),
    "fitting": Package(
        ("dovetail/inference/fitting/*",),
        (
            *_in("inference", "fitting", "fit_limits", "genuine_fits", "adequacy", "laplace"),
            *_in("network", "scaling"),
            *_in("identification", "several_responses"),
        ),
        SLOW,
    ),
    "posterior": Package(
        ("dovetail/inference/posterior/*",),
        (
            *_in("inference", "posterior", "posterior_limits", "sampling_weights", "laplace"),
            *_in("inference", "model_errors", "model_error_size"),
            *_in("problem", "frequency_average"),
        ),
        (*SLOW, *SLOW_POSTERIORS),
    ),
}
