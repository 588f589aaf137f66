"""Every public figure function draws into axes that the caller gives."""

from __future__ import annotations

import inspect

import pytest
from matplotlib.figure import Figure

import dovetail
from support.small_joints import ASSEMBLIES


@pytest.fixture(scope="module")
def sdof():
    return dovetail.load(ASSEMBLIES / "sdof.yaml")


@pytest.fixture(scope="module")
def result(sdof):
    return dovetail.identify(sdof, dovetail.noisy_frf(sdof.simulate({"k": 3e6}), 0.01, 0), "refined")


def test_every_public_figure_function_takes_axes():
    plots = [name for name in dovetail.__all__ if name.startswith("plot_")]
    assert plots == ["plot_assembly", "plot_frf"]
    for name in plots:
        assert "ax" in inspect.signature(getattr(dovetail, name)).parameters


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_result_is_drawn_into_as_many_panels_as_there_are(result, count):
    figure = Figure()
    axes = figure.subplots(count, 2, squeeze=False)
    given = axes[0, 0] if count == 1 else axes[:, 0]
    assert dovetail.plot_frf(result, ax=given) is figure
    assert [bool(panel.lines) for panel in axes[:, 0]] == [True] * count
    assert not any(panel.lines for panel in axes[:, 1])
    labels = [panel.get_ylabel().split(" [")[0] for panel in axes[:, 0]]
    assert labels == ["Accelerance", "Phase", "Coherence"][:count]


def test_an_frf_is_drawn_into_given_axes_with_its_label_as_their_title(sdof):
    axes = Figure().subplots()
    dovetail.plot_frf(sdof.simulate(), ax=axes)
    assert axes.get_title() == "sdof, simulated"
    assert axes.get_figure().get_suptitle() == ""


def test_an_assembly_is_drawn_within_given_axes():
    figure = Figure(figsize=(12, 8))
    axes = figure.subplots(2, 2)
    assert dovetail.plot_assembly(ASSEMBLIES / "bt40_er32.yaml", ax=axes[1, 0]) is figure
    assert tuple(figure.get_size_inches()) == (12, 8)
    low, high = axes[1, 0].get_xlim()
    assert all(low <= x <= high for line in axes[1, 0].lines for x in line.get_xdata())
    assert axes[1, 0].get_title().startswith("bt40-er32-t0\n")
