"""Figures of results for notebooks and other pages; matplotlib is loaded with this module."""

from __future__ import annotations

from collections.abc import Sequence

from dovetail.assembly import AssemblySource, as_assembly
from dovetail.frf import Frf
from dovetail.identification import Identification
from dovetail.report.drawing import assembly_figure
from dovetail.report.figures import frf_figure, load_matplotlib, simulated_figure

load_matplotlib()
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402


def plot_frf(result: Identification | Frf, response: int = 0, *, ax: Axes | Sequence[Axes] | None = None) -> Figure:
    """Draw an FRF, or the measured and the reconstructed one of an identification with their coherence below.

    Parameters
    ----------
    result : Identification or Frf
    response : int
        Index of the response of an identification.
    ax : matplotlib Axes, or a sequence of them, optional
        Where to draw: one for the amplitude alone, two for amplitude and phase, three for these and the coherence. A
        new figure has all that the FRF has.

    Returns
    -------
    matplotlib.figure.Figure
        That of `ax`, or a new one. Its ``savefig`` writes it, its ``axes`` can be changed. The natural frequencies of
        an identification are marked, and its warning, if there is one, is the title.

    Raises
    ------
    IndexError
        The identification has no such response.
    """
    if isinstance(result, Frf):
        return simulated_figure(result, ax=ax)
    natural = [mode.natural_frequency for mode in result.modes]
    at_point = result.responses[response]
    return frf_figure(at_point.measured, at_point.frf, at_point.coherence, natural, result.warning, ax)


def plot_assembly(assembly: AssemblySource, *, ax: Axes | None = None) -> Figure:
    """Draw an assembly: parts, nodes, joints, forces and responses.

    Parts with an outline are drawn as a section along the axis, to scale, if necessary inside the bore of another part.
    Others are boxes around their nodes. Parts that would overlap are drawn side by side. The title says if the drawing
    is stretched across the axis.

    Parameters
    ----------
    assembly : Assembly, str or Path
        An assembly, or the file of its description.
    ax : matplotlib Axes, optional
        Where to draw, with millimetres along and across; in a new figure of fitting size by default.

    Returns
    -------
    matplotlib.figure.Figure
        That of `ax`, or a new one. Its ``savefig`` writes it, its ``axes`` can be changed.
    """
    return assembly_figure(as_assembly(assembly), ax)
