from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.report.figures import measured_figure

AXIS = np.linspace(1.0, 600.0, 600)


@pytest.fixture
def files(sdof, tmp_path):
    """Two measurements of other quantities, one with coherence."""
    first = dovetail.Frf(AXIS, sdof.frf([3e6, 40.0]), "accelerance", coherence=np.full(600, 0.98), averages=5)
    second = dovetail.Frf(AXIS, sdof.frf([4e6, 40.0]), "accelerance").to("receptance")
    for frf, name in ((first, "first.csv"), (second, "second.uff")):
        dovetail.write_frf(frf, tmp_path / name)
    return [tmp_path / "first.csv", tmp_path / "second.uff"]


def test_the_contents_of_the_files_are_printed(run, files):
    rows = [line.split() for line in run("plot", *files).stdout.splitlines()]
    assert rows[2] == ["first.csv", "accelerance", "600", "1", "to", "600", "0.980", "5"]
    assert rows[3] == ["second.uff", "receptance", "600", "1", "to", "600"]
    assert rows[-2:] == [["first.csv", "275.6"], ["second.uff", "318.3"]]


def test_figures_are_written(run, files, tmp_path):
    figures = [tmp_path / "new" / f"frfs{suffix}" for suffix in (".png", ".svg", ".html")]
    done = run("plot", *files, *(word for file in figures for word in ("-o", file)))
    assert done.stderr.endswith("".join(f"Written: {file}\n" for file in figures))
    png, svg, page = (file.read_bytes() for file in figures)
    assert png.startswith(b"\x89PNG")
    assert svg.startswith(b'<svg xmlns="http://www.w3.org/2000/svg" ')
    assert page.startswith(b"<!DOCTYPE html>")
    assert not re.search(rb"<script|https?://(?!www\.w3\.org)", page)
    assert "a file of this name already exists" in run("plot", *files, "-o", figures[0], code=1).stderr
    assert "Accepted: .png, .svg, .html" in run("plot", *files, "-o", tmp_path / "frfs.pdf", code=2).stderr


def test_the_figure_draws_the_measured_frf(files):
    frfs = [dovetail.read_frf(file) for file in files]
    amplitude, phase, coherence = measured_figure(frfs).axes
    for frf, line in zip(frfs, amplitude.get_lines(), strict=True):
        np.testing.assert_allclose(line.get_ydata(), frf.to("accelerance").amplitude, rtol=1e-12)
        assert line.get_label() == frf.label
    assert len(phase.get_lines()) == 2
    np.testing.assert_array_equal(coherence.get_lines()[0].get_ydata(), frfs[0].coherence)
    bare = replace(frfs[0], values=frfs[0].amplitude, has_phase=False, coherence=None)
    assert len(measured_figure([bare]).axes) == 1


def test_convert_draws_a_figure(run, files, tmp_path):
    run("convert", files[0], tmp_path / "first.png")
    assert (tmp_path / "first.png").read_bytes().startswith(b"\x89PNG")
    refused = run("convert", files[0], tmp_path / "other.png", "--to", "um/N", code=2).stderr
    assert "a figure is in SI units" in refused
