"""The campaign's figures in the paper's manner: Figs. 3 to 6."""

from collections.abc import Sequence

from impact_rig.reporting.figures.figure import ReportFigure
from impact_rig.reporting.figures.figure_3 import draw_figure_3
from impact_rig.reporting.figures.figure_4 import draw_figure_4
from impact_rig.reporting.figures.figure_5 import draw_figure_5
from impact_rig.reporting.figures.figure_6 import draw_figure_6
from impact_rig.results.campaign import Results
from impact_rig.results.figure_rows import make_figure_rows
from impact_rig.results.sample_traces import SampleTraces


def draw_campaign_figures(
    results: Results, samples: Sequence[SampleTraces], *, prefix: str = ""
) -> tuple[ReportFigure, ...]:
    """Draw Figs. 3 to 6 of the paper for one campaign.

    Parameters
    ----------
    results : Results
        What was found.
    samples : sequence of SampleTraces
        Mean hits and models; empty where only results are known.
    prefix : str
        Put before every figure's name: a page with several campaigns needs one for each.

    Returns
    -------
    tuple of ReportFigure
        Figs. 3, 4, 5, 6. One for which there is nothing to draw has an empty `svg`, and its
        caption says why.

    Raises
    ------
    ParameterError
        If the results name a sample that is not in their set-up.
    """
    rows = make_figure_rows(results)
    return (
        draw_figure_3(rows, prefix=prefix),
        draw_figure_4(rows, prefix=prefix),
        draw_figure_5(samples, prefix=prefix),
        draw_figure_6(rows, prefix=prefix),
    )
