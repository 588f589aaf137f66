"""Figures, each drawn by one function, with colours for print and for colour-blind readers."""

from __future__ import annotations

import contextlib
import io
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.atomic_files import write_whole
from dovetail.frf import Frf
from dovetail.plain_text import terminal_text, unit_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 9.0
"""Width of figures in inches: 900 pixels at the usual 100 per inch."""

INK = "#1c2430"
"""Colour of texts."""
MUTED, GRID, AGREEMENT = "#56616d", "#e6eaee", "#9a4a00"
MEASURED = "#9aa4ae"
"""Colour of measured curves."""
RECONSTRUCTED = "#0b5fa5"
"""Colour of reconstructed curves."""
LINES = ("#6373c4", "#963f02", "#175a3a", "#813c71", "#12a3bb", "#aa8d13", INK)
"""Colours of several curves, distinguishable also without red, green or blue; those of the report for light pages."""
OCHRE = "#8a6d00"
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))
"""Line styles for more curves than there are colours."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""Markers of several curves."""

PHASE_CENTRE = {"receptance": -90.0, "mobility": 0.0, "accelerance": 90.0}
"""Middle of the phase axis [deg]; the phase of a passive drive point stays within 90 of it and is not wrapped."""


_TITLE_WIDTH = 110
"""Number of characters that fit into the width of a figure."""

_LABEL_WIDTH = 0.07
"""Width of the label of a natural frequency, relative to the frequency axis."""


def frf_figure(
    measured: Frf,
    reconstructed: Frf,
    coherence: ArrayLike | None = None,
    natural_frequencies: Iterable[float] = (),
    title: str = "",
    ax: Axes | Sequence[Axes] | None = None,
) -> Figure:
    """Draw a measured FRF with the reconstructed one over it, and the coherence of both below.

    Parameters
    ----------
    measured, reconstructed : Frf
        Of the same quantity. Without a measured phase, only the amplitudes are drawn.
    coherence : (n_freq,) array, optional
        On the frequencies of `reconstructed`.
    natural_frequencies : iterable of float
        Hz, marked in all panels; values that are not finite or beyond the axis are left out.
    title : str
        Above the figure, broken into lines if it is long.
    ax : Axes or sequence of them, optional
        Where amplitude, phase and coherence are drawn, as many as there are; in a new figure by default.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        The quantities differ.
    """
    if measured.quantity != reconstructed.quantity:
        raise ValueError(f"{measured.quantity} and {reconstructed.quantity} do not belong in one figure.")
    with_phase = measured.has_phase and reconstructed.has_phase
    figure, panels = _stacked(with_phase, coherence is not None, ax)
    curves = (
        (measured, {"color": MEASURED, "linewidth": 2.6, "label": "measured"}),
        (reconstructed, {"color": RECONSTRUCTED, "linewidth": 1.2, "label": "reconstructed"}),
    )
    amplitude, *remaining = panels
    for frf, style in curves:
        draw_amplitude(amplitude, frf, style)
    amplitude.legend(loc="lower right", ncols=2, fontsize=9.5)
    if with_phase and remaining:
        phase, *remaining = remaining
        for frf, style in curves:
            draw_phase(phase, frf, style)
    if coherence is not None and remaining:
        _draw_coherence(remaining[0], reconstructed.frequency, np.asarray(coherence, dtype=np.float64))
    _finish_frequency_axis(panels, reconstructed.frequency)
    _mark_frequencies(panels, natural_frequencies)
    if title:
        set_title(figure if ax is None else amplitude, title)
    return figure


def simulated_figure(
    frf: Frf, natural_frequencies: Iterable[float] = (), ax: Axes | Sequence[Axes] | None = None
) -> Figure:
    """Draw amplitude and phase of one FRF, with its label and its note above.

    Parameters
    ----------
    frf : Frf
    natural_frequencies : iterable of float
        Hz, marked; values that are not finite or beyond the axis are left out.
    ax : Axes or sequence of them, optional
        As in `frf_figure`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, panels = _stacked(frf.has_phase, False, ax)
    style = {"color": RECONSTRUCTED, "linewidth": 1.4}
    draw_amplitude(panels[0], frf, style)
    for phase in panels[1:]:
        draw_phase(phase, frf, style)
    _finish_frequency_axis(panels, frf.frequency)
    _mark_frequencies(panels, natural_frequencies)
    set_title(figure if ax is None else panels[0], frf.label, frf.note)
    return figure


def measured_figure(frfs: Sequence[Frf]) -> Figure:
    """Draw measured FRFs in common axes: amplitude, and phase and coherence if any of them has it.

    Parameters
    ----------
    frfs : sequence of Frf
        One or more; all are drawn in the quantity of the first.

    Returns
    -------
    matplotlib.figure.Figure
    """
    drawn = [frf if frf.rotation or frf.by_moment else frf.to(frfs[0].quantity) for frf in frfs]
    with_phase, with_coherence = any(frf.has_phase for frf in drawn), any(frf.coherence is not None for frf in drawn)
    figure, panels = _stacked(with_phase, with_coherence)
    for number, frf in enumerate(drawn):
        colour, dashes = LINES[number % len(LINES)], DASHES[number // len(LINES) % len(DASHES)]
        style = {"color": colour, "linestyle": dashes, "linewidth": 1.3}
        draw_amplitude(panels[0], frf, {**style, "label": terminal_text(frf.label).replace("$", r"\$")})
        if frf.has_phase:
            draw_phase(panels[1], frf, style)
        if frf.coherence is not None:
            panels[-1].plot(frf.frequency, frf.coherence, **style)
            _finish_coherence_axis(panels[-1])
    if len(drawn) == 1:
        set_title(figure, frfs[0].label, frfs[0].note)
    else:
        panels[0].legend(loc="best", fontsize=8.5)
    _finish_frequency_axis(panels, np.unique(np.concatenate([frf.frequency for frf in drawn])))
    return figure


def save_png(figure: Figure, path: str | Path, *, dpi: int = 200) -> Path:
    """Write a figure as PNG with its title in the metadata, atomically.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : str or Path
        An existing file is replaced.
    dpi : int
        Pixels per inch; with 200 the width is 1800 pixels.

    Returns
    -------
    Path

    Raises
    ------
    DovetailError
        The file cannot be written.
    """
    write_whole(Path(path), png_bytes(figure, figure.get_suptitle(), dpi=dpi), overwrite=True)
    return Path(path)


def png_bytes(figure: Figure, title: str, *, dpi: int = 200) -> bytes:
    """Return a figure as PNG, with a title in its metadata."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Title": title})
    return buffer.getvalue()


def _stacked(
    with_phase: bool, with_coherence: bool, ax: Axes | Sequence[Axes] | None = None
) -> tuple[Figure, list[Axes]]:
    """Return a figure and its panels for amplitude, phase and coherence, which share the frequency axis.

    Of axes that the caller gives, the first ones are the panels, as many as there are.
    """
    if ax is not None:
        panels = list(np.atleast_1d(np.asarray(ax, dtype=object)).ravel())[: 1 + with_phase + with_coherence]
        for axes in panels:
            style_axes(axes)
        return figure_of(panels[0]), panels
    heights = [2.6] + [1.5] * with_phase + [1.2] * with_coherence
    figure = new_figure(1.0 + sum(heights))
    grid = figure.subplots(len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights})
    panels = list(grid[:, 0])
    for axes in panels:
        style_axes(axes)
    return figure, panels


def figure_of(axes: Axes) -> Figure:
    """Return the figure that axes belong to, whatever subfigures are between."""
    figure = axes.get_figure(root=True)
    if figure is None:
        raise ValueError("the axes belong to no figure")
    return figure


def width_of(axes: Axes | None) -> float:
    """Return the width of axes in inches; without any, that of a page."""
    return WIDTH if axes is None else figure_of(axes).get_figwidth() * axes.get_position().width


def new_figure(height: float) -> Figure:
    """Return an empty figure of this height in inches."""
    load_matplotlib()
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height), layout="constrained", facecolor="white")


def panel_grid(
    count: int, columns: int, around: float, height: float, *, share_x: bool = False
) -> tuple[Figure, list[Axes]]:
    """Return a figure and so many panels in rows, each in the common style.

    Parameters
    ----------
    count, columns : int
    around, height : float
        Inches around all panels, and of one row of them.
    share_x : bool
        Whether all have one axis of abscissae.
    """
    rows = -(-count // columns)
    figure = new_figure(around + height * rows)
    panels = list(figure.subplots(rows, columns, sharex=share_x, squeeze=False).ravel())
    for axes in panels[count:]:
        axes.set_visible(False)
    for axes in panels[:count]:
        style_axes(axes)
    return figure, panels[:count]


def load_matplotlib() -> None:
    """Load matplotlib with its default settings, unless the caller has already loaded it.

    Otherwise it would read the file `matplotlibrc` in the current folder, which may make it run LaTeX.
    """
    if "matplotlib" in sys.modules:
        return
    with contextlib.chdir(Path(__file__).parent):
        import matplotlib
    defaults = {name: value for name, value in matplotlib.rcParamsDefault.items() if not name.startswith("backend")}
    matplotlib.rcParams.update(defaults)


def set_title(above: Figure | Axes, *lines: str) -> None:
    """Put lines of text above a figure or axes; empty ones are left out, long ones broken."""
    text = "\n".join(textwrap.fill(terminal_text(line), _TITLE_WIDTH) for line in lines if line)
    put = above.suptitle if hasattr(above, "suptitle") else above.set_title
    put(text, fontsize=11, color=INK, parse_math=False)


def style_axes(axes: Axes) -> None:
    """Apply the common style to a panel: a light grid, no box, muted ticks."""
    axes.set_axisbelow(True)
    axes.grid(color=GRID, linewidth=0.8)
    axes.tick_params(colors=MUTED, labelcolor=INK, labelsize=9, length=3)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(MUTED)
    for label in (axes.xaxis.label, axes.yaxis.label):
        label.set(color=INK, fontsize=9.5)


def draw_amplitude(axes: Axes, frf: Frf, style: Mapping[str, Any]) -> None:
    """Draw the amplitude of an FRF on a logarithmic scale."""
    axes.set_yscale("log", nonpositive="mask")
    axes.plot(frf.frequency, np.where(frf.amplitude > 0, frf.amplitude, np.nan), **style)
    axes.set_ylabel(f"{frf.quantity.capitalize()} [{unit_text(frf.unit)}]")


def draw_phase(axes: Axes, frf: Frf, style: Mapping[str, Any]) -> None:
    """Draw the phase of an FRF in degrees, wrapped where that of a passive drive point never is."""
    centre = PHASE_CENTRE[frf.quantity]
    phase = (np.rad2deg(frf.phase) - centre + 180.0) % 360.0 - 180.0 + centre
    axes.plot(*_broken_at_jumps(frf.frequency, phase), **style)
    drawn = np.concatenate([np.asarray(line.get_ydata(), dtype=np.float64) for line in axes.get_lines()])
    passive = bool(np.nanmax(np.abs(drawn - centre)) <= 110.0)
    reach = 110.0 if passive else 180.0
    axes.set_ylim(centre - reach, centre + reach)
    axes.set_yticks(np.arange(centre - 90.0 * (1 + (not passive)), centre + reach + 1.0, 90.0))
    axes.set_ylabel("Phase [°]")


def _broken_at_jumps(
    frequency: NDArray[np.float64], phase: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Insert a gap where the phase [deg] is wrapped."""
    jumps = np.flatnonzero(np.abs(np.diff(phase)) > 180.0) + 1
    return np.insert(frequency, jumps, frequency[jumps]), np.insert(phase, jumps, np.nan)


def _draw_coherence(axes: Axes, frequency: NDArray[np.float64], coherence: NDArray[np.float64]) -> None:
    mean = float(np.mean(coherence))
    axes.plot(frequency, coherence, color=AGREEMENT, linewidth=1.2)
    axes.axhline(mean, color=AGREEMENT, linewidth=0.9, linestyle=(0, (4, 3)))
    axes.text(0.995, 0.06, f"mean {mean:.3f} (dashed)", transform=axes.transAxes, ha="right", fontsize=9, color=INK)
    _finish_coherence_axis(axes)


def _finish_coherence_axis(axes: Axes) -> None:
    axes.set(ylim=(0.0, 1.03), yticks=[0.0, 0.5, 1.0], ylabel="Coherence [-]")


def _finish_frequency_axis(panels: Sequence[Axes], frequency: NDArray[np.float64]) -> None:
    for axes in panels if frequency.size > 1 else ():
        axes.set_xlim(float(frequency[0]), float(frequency[-1]))
    panels[-1].set_xlabel("Frequency [Hz]")
    figure_of(panels[0]).align_ylabels(panels)


def _mark_frequencies(panels: Sequence[Axes], frequencies: Iterable[float]) -> None:
    """Draw a dotted line at each frequency, with its value above; values that would overlap go into further rows."""
    low, high = panels[0].get_xlim()
    room = _LABEL_WIDTH * (high - low)
    rows: list[float] = []
    for frequency in sorted(float(f) for f in frequencies if np.isfinite(f) and low <= f <= high):
        for axes in panels:
            axes.axvline(frequency, color=MUTED, linewidth=0.9, linestyle=(0, (1, 2)), zorder=1.5)
        row = next((row for row, last in enumerate(rows) if frequency - last >= room), len(rows))
        rows[row : row + 1] = [frequency]
        panels[0].annotate(
            f"{frequency:.0f} Hz",
            (frequency, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 4 + 11 * row),
            textcoords="offset points",
            ha="center",
            fontsize=8.5,
            color=INK,
        )
