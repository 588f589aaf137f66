"""Figures of results, for a notebook or a page of one's own; matplotlib is loaded with this module."""

from __future__ import annotations

import numpy as np

from dovetail.assembly import AssemblySource, as_assembly
from dovetail.frf import Frf
from dovetail.identification import Identification
from dovetail.report.drawing import assembly_figure
from dovetail.report.figures import frf_figure, load_matplotlib, simulated_figure

load_matplotlib()
from matplotlib.figure import Figure  # noqa: E402

__all__ = ["plot_assembly", "plot_frf"]


def plot_frf(result: Identification | Frf, response: int = 0) -> Figure:
    """Draw an FRF; of an identification the measured and the reconstructed one, with their coherence beneath.

    Parameters
    ----------
    result : Identification or Frf
    response : int
        Which response of an identification, from 0.

    Returns
    -------
    matplotlib.figure.Figure
        Its ``savefig`` writes it, its ``axes`` can be changed; the natural frequencies of an identification are marked,
        and its caveat, if it has one, is the title.

    Raises
    ------
    IndexError
        The identification has no such response.
    """
    if isinstance(result, Frf):
        return simulated_figure(result)
    natural = [mode.natural_frequency for mode in result.modes if np.isfinite(mode.natural_frequency)]
    at_point = result.responses[response]
    return frf_figure(at_point.measured, at_point.frf, at_point.coherence, natural, result.caveat)


def plot_assembly(assembly: AssemblySource) -> Figure:
    """Draw an assembly: parts, nodes, joints, and where force and response are.

    Parts that give their outline are drawn as a section along the axis, to scale, a part inside the bore of another
    where it belongs. Others are boxes around their nodes. What would overlap is drawn side by side. What is stretched
    across the axis is said in the title.

    Parameters
    ----------
    assembly : Assembly, str or Path
        Or its description's file.

    Returns
    -------
    matplotlib.figure.Figure
        Its ``savefig`` writes it, its ``axes`` can be changed.
    """
    return assembly_figure(as_assembly(assembly))
