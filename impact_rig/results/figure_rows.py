"""What Figs. 3, 4 and 6 show, sample by sample: one source for every way to draw them."""

import math
from dataclasses import dataclass

from impact_rig.core.sample import SampleEstimate
from impact_rig.core.stiffness import estimate_equivalent_mass
from impact_rig.results.campaign import Results
from impact_rig.results.references import Reference, find_expected

FIGURE_5_SAMPLES = ("brass small", "steel medium", "aluminium large")
"""The three cases of the paper's Fig. 5, from top to bottom."""
PEAKS = {"hammer": "hammer_peak", "sample": "specimen_peak"}
"""What Fig. 4 shows over the pulse width: fields of `SampleEstimate`, by body."""
ERRORS = {"hammer": "mse_hammer_percent", "sample": "mse_sample_percent"}
"""What Fig. 6 shows: fields of `SampleEstimate`, by body."""
LARGEST_ERRORS_PERCENT = {"hammer": 0.25, "sample": 2.8}
"""Largest values of the paper's Fig. 6, as its text gives them, by body [%]."""


@dataclass(frozen=True)
class FigureRow:
    """One sample's place in the figures."""

    estimate: SampleEstimate
    material: str  # samples of one material share a colour
    relative_mass: float  # m1 m2 / (m1 + m2), equation (6a) [kg]; NaN: not known
    contact_times: tuple[float, ...]  # tau_p of every hit in the mean [s]
    reference: Reference


def make_figure_rows(results: Results) -> tuple[FigureRow, ...]:
    """Return the samples of a campaign as the figures show them, in the order of the results.

    Raises
    ------
    ParameterError
        If the results name a sample that is not in their set-up.
    """
    return tuple(_make_row(results, sample) for sample in results.samples)


def sort_as_figure_5(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return names of samples, the paper's three cases first, the others in their order."""
    first = [name for name in FIGURE_5_SAMPLES if name in names]
    return (*first, *(name for name in names if name not in first))


def _make_row(results: Results, estimate: SampleEstimate) -> FigureRow:
    name, samples = estimate.name, results.setup.samples
    masses = results.setup.hammer_mass, samples.get_moving_mass(name)
    times = (hit.contact_time for hit in results.select_accepted(name))
    return FigureRow(
        estimate,
        material=samples.find(name).material or name,
        relative_mass=math.nan if math.isnan(sum(masses)) else estimate_equivalent_mass(*masses),
        contact_times=tuple(filter(math.isfinite, times)),
        reference=find_expected(results, name),
    )
