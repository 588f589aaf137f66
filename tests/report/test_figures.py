"""Figures: what is drawn, where axes are cut off, and how files are written."""

from __future__ import annotations

import re
import subprocess
import sys
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from dovetail.errors import DovetailError
from dovetail.frf import Frf
from dovetail.identification import Identification
from dovetail.report import figures
from dovetail.report.figures import frf_figure, save_png, simulated_figure
from dovetail.report.pages import web_text
from dovetail.report.svg import inline_svg
from dovetail_bench.pages.robustness_figure import robustness_figure

TABLE = [
    {"model": model, "level": level, "r2": r2, "rmse": 0.1}
    for model in ("PCA-MLP", "UMAP_$1$")
    for level, r2 in ((0.2, 0.5), (0.0, 0.9), (0.1, None))
]


SEEN = {  # Machado, Oliveira, Fernandes, IEEE Trans. Vis. Comput. Graph. 15 (2009) 1291, severity 1, linear RGB
    "trichromat": np.eye(3),
    "protanope": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranope": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanope": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def palettes() -> list[dict[str, str]]:
    """The colours of the pages by name, on light and on dark paper."""
    return [
        dict(re.findall(r"--([a-z]+(?:-\d)?): (#[0-9a-f]{6})", part)) for part in web_text("charts.css").split("@media")
    ]


def linear(colour: str) -> np.ndarray:
    coded = np.array([int(colour[start : start + 2], 16) / 255.0 for start in (1, 3, 5)])
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)


def lab(colour: str, seen: np.ndarray) -> np.ndarray:
    """A colour as CIE L*a*b* after the eye's matrix."""
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = to_xyz @ np.clip(np.asarray(seen) @ linear(colour), 0.0, 1.0) / np.array([0.9505, 1.0, 1.089])
    root = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
    return np.array([116.0 * root[1] - 16.0, 500.0 * (root[0] - root[1]), 200.0 * (root[1] - root[2])])


@pytest.mark.parametrize("eye", SEEN)
@pytest.mark.parametrize("scheme", [0, 1])
def test_curves_differ_in_colour_blind_vision_too(scheme: int, eye: str) -> None:
    colours = palettes()[scheme]
    methods = [lab(colours[f"method-{index}"], SEEN[eye]) for index in range(len(figures.LINES))]
    roles = [lab(colours[role], SEEN[eye]) for role in ("measured", "model", "before")]
    for curves in (methods, roles):
        assert min(np.linalg.norm(a - b) for a, b in combinations(curves, 2)) > 20.0


@pytest.mark.parametrize("scheme", [0, 1])
def test_curves_stand_out_from_the_paper(scheme: int) -> None:
    """Three to one, as WCAG 2.2 asks of graphics."""
    colours, weights = palettes()[scheme], (0.2126, 0.7152, 0.0722)
    paper = linear(colours["paper"]) @ weights
    for role in ("model", "before", "agreement", *(f"method-{index}" for index in range(len(figures.LINES)))):
        low, high = sorted((paper, linear(colours[role]) @ weights))
        assert (high + 0.05) / (low + 0.05) >= 3.0, role


def test_pictures_have_the_colours_of_the_pages() -> None:
    colours = palettes()[0]
    assert [colours[f"method-{index}"] for index in range(len(figures.LINES))] == list(figures.LINES)
    for name in ("INK", "MUTED", "GRID", "MEASURED", "AGREEMENT"):
        assert colours[name.lower()] == getattr(figures, name)
    assert colours["model"] == figures.RECONSTRUCTED


def test_amplitude_phase_and_coherence_share_the_frequency_axis(result: Identification) -> None:
    figure = frf_figure(result.measured, result.frf, result.coherence, [1352.0])
    amplitude, phase, coherence = figure.axes
    assert [axes.get_ylabel() for axes in figure.axes] == ["Accelerance [m/(N·s²)]", "Phase [°]", "Coherence [-]"]
    assert coherence.get_xlabel() == "Frequency [Hz]"
    assert amplitude.get_yscale() == "log"
    assert {axes.get_xlim() for axes in figure.axes} == {(100.0, 9000.0)}
    phase.set_xlim(200.0, 300.0)
    assert amplitude.get_xlim() == coherence.get_xlim() == (200.0, 300.0)
    assert [text.get_text() for text in amplitude.get_legend().get_texts()] == ["measured", "reconstructed"]


def test_a_figure_has_no_panel_of_missing_data(result: Identification, amplitude_only: Identification) -> None:
    assert len(frf_figure(result.measured, result.frf).axes) == 2
    assert len(frf_figure(amplitude_only.measured, result.frf).axes) == 1
    assert len(simulated_figure(result.frf).axes) == 2
    assert len(simulated_figure(amplitude_only.measured).axes) == 1


def test_two_quantities_do_not_share_a_figure(result: Identification) -> None:
    with pytest.raises(ValueError, match="accelerance and receptance do not belong"):
        frf_figure(result.measured, result.frf.to("receptance"))


@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
def test_the_phase_of_a_drive_point_is_not_cut_where_it_lies(result: Identification, quantity: str) -> None:
    phase = simulated_figure(result.measured.to(quantity)).axes[1]  # 1 % noise about 0 and 180 degrees
    (line,) = phase.get_lines()
    drawn = np.asarray(line.get_ydata())
    assert np.isfinite(drawn).all()
    assert np.ptp(drawn) < 200.0
    low, high = phase.get_ylim()
    assert low < drawn.min()
    assert drawn.max() < high


def test_a_phase_that_turns_round_is_broken_where_it_leaves_the_window() -> None:
    frequency = np.linspace(10.0, 1000.0, 200)
    turning = Frf(frequency, np.exp(-0.05j * frequency), "accelerance")
    phase = simulated_figure(turning).axes[1]
    drawn = np.asarray(phase.get_lines()[0].get_ydata())
    assert np.isnan(drawn).sum() == 8  # 50 rad are eight turns
    assert np.nanmax(np.abs(np.diff(drawn))) < 180.0
    assert phase.get_ylim() == (-90.0, 270.0)


def test_only_natural_frequencies_on_the_axis_are_marked(result: Identification) -> None:
    figure = frf_figure(result.measured, result.frf, result.coherence, [6540.0, np.nan, 1352.0, 50.0, 12000.0])
    labels = [text.get_text() for text in figure.axes[0].texts]
    assert labels == ["1352 Hz", "6540 Hz"]
    dotted = [len(axes.get_lines()) for axes in figure.axes]
    assert dotted == [2 + 2, 2 + 2, 2 + 2]


def test_labels_of_natural_frequencies_do_not_overlap(result: Identification) -> None:
    figure = frf_figure(result.measured, result.frf, None, [1000.0, 1100.0, 1200.0, 1300.0, 1900.0, 2400.0])
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    assert len(boxes) == 6
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert all(box.x0 >= 0 and box.y1 <= figure.bbox.height for box in boxes)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("lines", [1, 2, 3])
def test_an_frf_of_zeros_or_of_one_line_can_be_drawn(lines: int, tmp_path: Path) -> None:
    zeros = Frf(np.arange(1.0, lines + 1), np.zeros(lines), "mobility")
    path = save_png(frf_figure(zeros, zeros, np.ones(lines), [1.0]), tmp_path / "zeros.png")
    assert path.read_bytes().startswith(b"\x89PNG")


def test_robustness_has_one_line_a_model_in_the_order_of_the_levels() -> None:
    r2, rmse = robustness_figure(TABLE).axes
    assert [line.get_label() for line in r2.get_lines()] == ["PCA-MLP", "UMAP_$1$"]
    np.testing.assert_array_equal(r2.get_lines()[0].get_xdata(), [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(r2.get_lines()[0].get_ydata(), [0.9, np.nan, 0.5])
    np.testing.assert_array_equal(rmse.get_lines()[1].get_ydata(), [0.1, 0.1, 0.1])
    first, second = r2.get_lines()
    assert first.get_color() != second.get_color()
    assert first.get_marker() != second.get_marker()
    assert first.get_linestyle() != second.get_linestyle()


def test_names_are_not_read_as_formulas(result: Identification, tmp_path: Path) -> None:
    odd = Frf(result.frf.frequency, result.frf.values, "accelerance", label=r"$\frac{")
    save_png(simulated_figure(odd), tmp_path / "odd.png", dpi=50)
    save_png(robustness_figure([{"model": r"$\frac{$", "level": 0.0, "r2": 1.0, "rmse": 0.0}]), tmp_path / "odd.png")


def test_a_png_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = save_png(robustness_figure(TABLE), tmp_path / "robustness.png", dpi=100)
    width = int.from_bytes(path.read_bytes()[16:20], "big")
    assert width == 900
    with pytest.raises(DovetailError, match="missing"):
        save_png(robustness_figure([]), tmp_path / "missing" / "robustness.png")
    assert [file.name for file in tmp_path.iterdir()] == ["robustness.png"]


def test_an_inline_svg_keeps_its_transforms_and_is_the_same_each_time(result: Identification, tmp_path: Path) -> None:
    first = inline_svg(frf_figure(result.measured, result.frf), "one", "FRF")
    assert first == inline_svg(frf_figure(result.measured, result.frf), "one", "FRF")
    assert first.startswith('<svg viewBox="0 0 648 ')
    frf_figure(result.measured, result.frf).savefig(tmp_path / "as_it_is.svg")
    transforms = r' transform="([^"]*)"'
    as_it_is = re.findall(transforms, (tmp_path / "as_it_is.svg").read_text(encoding="utf-8"))
    assert re.findall(transforms, first) == as_it_is


def test_figures_do_without_pyplot(tmp_path: Path) -> None:
    program = (
        "import sys, numpy as np\n"
        "from dovetail.frf import Frf\n"
        "from dovetail.report.figures import save_png, simulated_figure\n"
        "frf = Frf(np.arange(1.0, 9.0), np.arange(8.0) + 1j, 'receptance')\n"
        f"save_png(simulated_figure(frf), {str(tmp_path / 'frf.png')!r})\n"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
