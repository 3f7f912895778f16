"""What Figs. 3, 4 and 6 show, sample by sample: one source for every way to draw them."""

import math
from dataclasses import dataclass

from impact_rig.core.sample import SampleEstimate
from impact_rig.core.setup import SampleSet
from impact_rig.core.stiffness import estimate_equivalent_mass
from impact_rig.results.campaign import Results
from impact_rig.results.references import Reference, find_expected

FIGURE_5_SAMPLES = ("brass small", "steel medium", "aluminium large")
"""The three cases of the paper's Fig. 5, from top to bottom."""
PEAKS = {"hammer": "hammer_peak", "sample": "specimen_peak"}
"""What Fig. 4 shows over the pulse width: fields of `FigureRow`, by body."""
ERRORS = {"hammer": "mse_hammer_percent", "sample": "mse_sample_percent"}
"""What Fig. 6 shows: fields of `FigureRow`, by body."""
LARGEST_ERRORS_PERCENT = {"hammer": 0.25, "sample": 2.8}
"""Largest values of the paper's Fig. 6, as its text gives them, by body [%]."""


@dataclass(frozen=True)
class FigureRow:
    """One sample's place in the figures; NaN: not determined."""

    name: str  # of the sample
    material: str  # samples of one material share a colour
    relative_mass: float  # m1 m2 / (m1 + m2), equation (6a) [kg]
    contact_times: tuple[float, ...]  # tau_p of every hit in the mean [s]
    contact_time: float  # tau_p of the mean hit [s]
    contact_time_expanded: float  # half-width of its 95 % interval [s]
    hammer_peak: float  # of the mean trace [m/s^2]
    specimen_peak: float  # of the mean trace [m/s^2]
    # Mean square errors of the force-driven model [%].
    mse_hammer_percent: float
    mse_sample_percent: float
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


def _make_row(results: Results, sample: SampleEstimate) -> FigureRow:
    samples, hits = results.setup.samples, results.select_accepted(sample.name)
    reference = find_expected(results, sample.name)
    return FigureRow(
        name=sample.name,
        material=samples.find(sample.name).material or sample.name,
        relative_mass=_compute_relative_mass(results, samples, sample.name),
        contact_times=tuple(hit.contact_time for hit in hits if math.isfinite(hit.contact_time)),
        contact_time=sample.contact_time.value,
        contact_time_expanded=sample.contact_time.expanded,
        hammer_peak=sample.hammer_peak,
        specimen_peak=sample.specimen_peak,
        mse_hammer_percent=sample.mse_hammer_percent,
        mse_sample_percent=sample.mse_sample_percent,
        reference=reference,
    )


def _compute_relative_mass(results: Results, samples: SampleSet, name: str) -> float:
    masses = results.setup.hammer_mass, samples.get_moving_mass(name)
    if any(math.isnan(mass) for mass in masses):
        return math.nan
    return estimate_equivalent_mass(*masses)
