"""Posteriors in the ArviZ that is installed, of either major version."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np
import pytest

import dovetail
from support.packages import skip_module_without

skip_module_without("arviz")
OLD = version("arviz").startswith("0.")
GROUPS = ["log_likelihood", "observed_data", "posterior", "posterior_predictive", "prior", "sample_stats"]


@pytest.fixture(scope="module")
def result(assemblies):
    assembly = dovetail.load(assemblies / "sdof.yaml")
    measured = dovetail.noisy_frf(assembly.simulate({"k": 3e6, "c": 40.0}), 0.01, 0)
    return dovetail.identify(assembly, measured, samples=60, cause_seconds=0.0)


def test_all_groups_are_there_with_dimensions_and_units(result):
    data = result.to_inferencedata()
    assert sorted(data.groups() if OLD else data.children) == GROUPS
    assert data["posterior"]["k"].attrs["units"] == "N/m"
    assert data["posterior_predictive"]["frf"].dims == ("chain", "draw", "frequency", "part")
    assert data["observed_data"]["frf"].dims == ("frequency", "part")
    np.testing.assert_allclose(data["observed_data"]["frf"].sel(part="real"), result.measured.values.real)


def test_a_summary_of_arviz_has_the_estimates(result):
    import arviz

    table = arviz.summary(result.to_inferencedata(), var_names=["k", "c"])
    means = [float(value) for value in table["mean"]]
    assert means == pytest.approx([row.estimate for row in result.table], rel=0.05)


def test_posteriors_are_equal_after_a_round_trip_through_a_file(result, tmp_path):
    """NetCDF for ArviZ before 1.0, which brings what writes it; Zarr for later ones, which do not."""
    data, file = result.to_inferencedata(), tmp_path / "posterior"
    if OLD:
        import arviz

        data.to_netcdf(file)
        read = arviz.from_netcdf(file)
    else:
        import xarray

        data.to_zarr(file)
        read = xarray.open_datatree(file, engine="zarr")
    for group in GROUPS:
        again, before = (each[group] if OLD else each[group].to_dataset() for each in (read, data))
        for name, values in before.data_vars.items():
            np.testing.assert_array_equal(again[name], values)
            assert again[name].attrs.get("units") == values.attrs.get("units")
    read.close()
