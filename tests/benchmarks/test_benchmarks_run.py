"""The benchmarks run, and print a ratio or a slope for each route; the speed itself is not tested."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import genuine_measurements
import pytest

from dovetail.inference.fitting import refine
from dovetail.problem import Problem
from support.scripts import run_script


def start(script, *arguments) -> str:
    """Run a benchmark as its reader does."""
    command = [sys.executable, str(Path(__file__).parent / script), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def run(script, *arguments) -> str:
    """Run a benchmark in this process, which spares its start."""
    return run_script(Path(__file__).parent / script, *arguments)


def cells(printed: str) -> list[list[str]]:
    rows = [line.strip("|").split("|") for line in printed.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row] for row in rows]


@pytest.mark.parametrize(
    ("options", "measured"), [(["--no-first"], 9), pytest.param([], 11, marks=pytest.mark.slow)], ids=["", "first"]
)
def test_the_synthesis_benchmark_prints_each_route_and_what_is_aimed_at(tmp_path, options, measured):
    printed = run("synthesis.py", "--samples", 4, "--rounds", 1, "--written", 64, "-o", tmp_path, *options)
    table = cells(printed)
    routes = [row for row in table if row[0].startswith(("literal", "engine, "))]
    assert len(routes) in (5, 9)
    assert routes[0][3] == "1"
    for _, milliseconds, rate, ratio, core in routes:
        assert abs(float(milliseconds) * float(rate) / 1000 - 1) < 0.2
        assert int(ratio) >= 1
        assert float(core) > 0
    assert len([row for row in table if re.search(r"\d (times|s|GB)$", row[1])]) == measured
    assert cells((tmp_path / "comparison.md").read_text()) == table


def test_the_benchmark_of_several_frfs_has_a_row_for_each_route():
    rows = cells(run("several_frfs.py", "--samples", 2, "--rounds", 1))[2:]
    assert [row[0] for row in rows] == ["one", "fifteen, one at a time", "fifteen together"]
    assert rows[0][2] == rows[0][4] == "1.00"
    for _, milliseconds, over_one, with_jacobian, jacobian_over_one in rows:
        assert abs(float(milliseconds) / float(rows[0][1]) - float(over_one)) < 0.05 * float(over_one)
        assert abs(float(with_jacobian) / float(rows[0][3]) - float(jacobian_over_one)) < 0.05 * float(
            jacobian_over_one
        )


def test_the_synthesis_in_torch_agrees_with_the_engine_in_double_precision():
    rows = cells(run("gpu_synthesis.py", "--samples", 4, "--lines", 400, "--device", "cpu"))[3:]
    assert [row[0] for row in rows] == ["torch on cpu, double", "torch on cpu, single"]
    double, single = (float(row[3]) for row in rows)
    assert double < 1e-9
    assert double < 1e-3 * single


def test_the_cost_benchmark_prints_a_slope_for_each_quantity(tmp_path):
    printed = run("cost.py", "--points", 2, "--rounds", 1, "-o", tmp_path)
    slopes = {
        row[0]: float(row[2]) for row in cells(printed)[1:] if len(row) == 4 and re.fullmatch(r"-?\d+\.\d\d", row[2])
    }
    assert {*slopes} == {"lines", "samples", "joint DOFs", "boundary DOFs"}
    assert (tmp_path / "cost.md").exists()
    assert (tmp_path / "cost.png").read_bytes().startswith(b"\x89PNG")


def test_the_study_of_interpolation_prints_errors_and_times_by_number_of_lines(tmp_path):
    rows = cells(run("interpolation.py", "--samples", 8, "-o", tmp_path))
    errors = {int(row[0]): float(row[4]) for row in rows if row[0].isdigit()}
    assert errors[13] > 1e3 * errors[33] > 0
    assert float(rows[-1][8].split()[0]) > 0
    assert (tmp_path / "interpolation.png").read_bytes().startswith(b"\x89PNG")


def test_the_noise_floor_is_reached_in_a_case():
    rows = cells(run("noise_floor.py", "--cases", 1, "--every", 12))[2:]
    assert [row[2] for row in rows[:3]] == ["refined", "multistart, frf", "multistart, weighted"]
    assert len(rows) == 12
    assert all(row[3] == "1 of 1" for row in rows if row[1:3] == ["complex", "refined"])


def test_genuine_measurements_of_random_structures_reach_the_noise():
    few = "--lines", "200,2000"
    printed = run("genuine_measurements.py", "--cases", 4, "--seed", 3, *few)
    rows = {row[0]: row[1:] for row in cells(printed)[2:]}
    assert rows["all"][2] == "4 of 4", printed
    assert {name for name in rows if "additive" in name} == {"additive, variance given", "additive, variance unknown"}
    alone = cells(run("genuine_measurements.py", "--only", 2, "--seed", 3, *few))[2:]
    assert [row[0] for row in alone] == ["additive, variance given", "all"]


def test_two_close_resonances_are_distinguished():
    """1 % apart, with a narrow way between a minimum in which both are one and the right one."""
    rows = cells(run("genuine_measurements.py", "--only", 59, "--seed", 79, "--lines", "4451,4451"))[2:]
    assert rows[-1][:4] == ["all", "1 of 1", "1 of 1", "1 of 1"]


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize(("case", "seed"), [(7, 9137), (30, 9406), (354, 9402)])
def test_a_resonance_that_hardly_shows_is_looked_for_along_profiles(case, seed):
    """All other searches end in minima that lack it, at a chi-squared of 2 or 1.05; the last needs smoothing."""
    rows = cells(run("genuine_measurements.py", "--only", case, "--seed", seed))[2:]
    assert rows[-1][:4] == ["all", "1 of 1", "1 of 1", "1 of 1"]


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize(("case", "seed"), [(242, 777), (69, 202614), (194, 202614)])
def test_parameters_that_ran_away_to_ends_of_their_ranges_are_brought_back(case, seed):
    """With them at the ends, the residuals are noise by all tests, and only other minima are better."""
    rows = cells(run("genuine_measurements.py", "--only", case, "--seed", seed))[2:]
    assert rows[-1][:4] == ["all", "1 of 1", "1 of 1", "1 of 1"]


def test_residuals_that_are_hardly_noise_get_further_searches():
    """A chi-squared of 1.09 on 285 lines might be noise, but 0.99 is there too; less than half of the seeds find it."""
    problem = Problem.of(*genuine_measurements.drawn(16, 9405, (200, 50_000))[:2])
    fits = [refine(problem, seed=seed) for seed in range(8)]
    assert min(fit.starts for fit in fits) > 16
    assert sum(fit.chi_squared < 1.0 for fit in fits) >= 2


def test_fits_of_a_wrong_model_are_compared_by_seed():
    machine, whole = cells(run("wrong_minima.py", "--cases", 1, "--seed", 104, "--fits", 2))[2:]
    assert machine[:3] == ["104", "2 of 2", "1.00"]
    assert whole[:3] == ["all", "2 of 2", ""]


@pytest.mark.slow
def test_the_benchmark_of_a_second_point_prints_prediction_and_achievement():
    table = cells(run("second_point.py", "--cases", 1))[2:]
    assert len(table) == 12
    for _, alone, both, ratio, planned, quotient in table:
        assert 0 < float(both) < 2 * float(alone)
        assert abs(float(ratio) / float(planned) - float(quotient)) < 0.1 * float(quotient) + 0.05


@pytest.mark.parametrize(
    "names",
    [
        ("bt40_er32", "shaft_hub"),
        pytest.param(("bt40_er32", "bolted_lap_beam", "shaft_hub", "spindle_bt40_er32"), marks=pytest.mark.slow),
    ],
    ids=len,
)
def test_the_study_of_mesh_errors_has_a_row_for_each_assembly(names):
    rows = cells(run("mesh_errors.py", "--joints", 2, "--finer-mesh", 2, "--assemblies", *names))[2:]
    assert [row[0] for row in rows] == [f"`{name}`" for name in names]
    assert all(1e-6 < float(row[1]) < 1e-2 for row in rows)
    assert float(rows[0][3]) > 3.0  # modal constants err more than natural frequencies
    assert all(0.0 < float(row[5]) < 2.0 for row in rows)  # the joint is not displaced by more than is allowed for


def test_the_benchmark_of_intervals_counts_those_that_hold_the_truth():
    printed = run("interval_coverage.py", "--cases", 2, "--structures", 2, "--samples", 20)
    (everything,) = (row for row in cells(printed) if row[0] == "all" and row[1] != "intervals")
    held, low, high = (float(cell.split("%")[0]) for cell in everything[2:])
    assert int(everything[1]) >= 6
    assert held + low + high == pytest.approx(100.0, abs=0.2)


@pytest.mark.slow
def test_the_benchmark_of_structures_in_space_has_a_row_for_each_assembly():
    rows = cells(run("space_speed.py", "--samples", 2, "--rounds", 1))[2:]
    assert [row[:2] for row in rows] == [
        ["two beams and a bushing, in space", "12"],
        ["the collet, in a plane", "12"],
    ]
    for _, _, milliseconds, rate, _ in rows:
        assert float(milliseconds) * float(rate) == pytest.approx(1e3, rel=0.1)


def test_the_benchmark_of_bushings_counts_the_intervals_of_twelve_unknowns():
    printed = run("bushing_coverage.py", "--cases", 1, "--structures", 1, "--samples", 20)
    (everything,) = (row for row in cells(printed) if row[0] == "all" and row[1] != "intervals")
    assert int(everything[1]) == 12


@pytest.mark.slow
def test_the_study_of_the_gaussian_form_has_a_row_for_each_parameter():
    printed = run("laplace_coverage.py", "--cases", 1, "--sampled", 1)
    assert len(cells(printed)[2:]) == 13
    assert re.search(r"Processor time after the fit: median \d+ ms", printed)


@pytest.mark.slow
def test_the_study_of_verdicts_counts_every_parameter_by_each_route(tmp_path):
    rows = cells(run("verdicts.py", "--only", 1, "--workers", 1, "-o", tmp_path / "verdicts.json"))
    tables = [rows[first : first + 5] for first in (0, 5)]
    assert all(sum(int(cell) for row in table[2:] for cell in row[1:]) == 12 for table in tables)
    reported = json.loads((tmp_path / "verdicts.json").read_text())[0]["parameters"]
    assert (
        reported["kr_tc"]["posterior"] == reported["kr_tc"]["fisher"] == reported["kr_tc"]["profile"] == "0.9 or more"
    )


@pytest.mark.slow
def test_the_study_of_the_next_test_compares_predicted_and_achieved_intervals():
    printed = run("next_test.py", "--cases", 1, "--samples", 60)
    rows = cells(printed)
    assert len(rows[2:]) == 12
    assert all(float(row[4]) > 0.0 for row in rows[2:])
    assert re.search(r"Achieved over predicted: mean \d\.\d+, from", printed)


def test_the_study_of_the_choice_of_models_counts_each_comparison():
    printed = run("model_choice.py", "--comparisons", 1, "--samples", 40)
    different, coinciding = re.findall(r": (\{.*\})", printed)
    assert sum(int(n) for n in re.findall(r"'(?:right|wrong|none)': (\d+)", different)) == 1
    assert sum(int(n) for n in re.findall(r"'(?:right|wrong|none)': (\d+)", coinciding)) == 1


@pytest.mark.slow
def test_the_study_of_wrong_models_of_a_series_counts_shared_values_and_laws():
    rows = cells(run("series_model_errors.py", "--series", 1, "--samples", 40))[2:]
    assert [int(row[1]) for row in rows] == [3, 2, 4]


def test_planning_anew_is_timed_and_right():
    rows = dict(cells(run("replanning.py", "--rounds", 1))[2:])
    assert {*rows} == {
        "first",
        "next",
        "with a wider plan",
        "next, with a wider plan",
        "error above the stop, against the direct solve",
    }
    assert float(rows["error above the stop, against the direct solve"]) < 1e-8


def test_the_benchmark_of_forecasts_compares_each_time_with_its_forecast():
    (row,) = cells(run("forecast.py", "--cases", 1, "--seed", 3))[2:]
    assert row[0] == "1"
    assert 0.05 < float(row[1]) <= float(row[3]) < 20.0


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize(("seed", "case"), [(20261127, 34), (9001, 96), (7001, 47)])
def test_a_fit_in_a_wrong_minimum_is_left_even_if_it_reaches_the_noise(seed, case):
    """These searches ended elsewhere as long as the first fit down to the noise was taken."""
    printed = run("genuine_measurements.py", "--seed", seed, "--only", case, "--lines", "200,3000")
    assert cells(printed)[-1][:4] == ["all", "1 of 1", "1 of 1", "1 of 1"]
