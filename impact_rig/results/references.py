"""What the measured values are held against, and which published cell is a misprint."""

import math
from dataclasses import dataclass

from impact_rig.core.setup.paper import (
    HAMMER_DAMPING_COEFFICIENT,
    HAMMER_STIFFNESS,
    PUBLISHED_SAMPLES,
    PublishedSample,
)
from impact_rig.core.setup.samples import Sample, SampleSet

NAN = math.nan
MASS_TOLERANCE = 1e-9
"""How alike the masses of a sample and of the paper's are [kg]: unit conversion, nothing more."""


@dataclass(frozen=True)
class Reference:
    """What is expected of a body; NaN: nothing.

    Attributes
    ----------
    contact_time : float
        tau_p [s].
    stiffness : float
        k [N/m].
    damping_coefficient : float
        c [N s/m].
    published : PublishedSample or None
        The sample's cell of the paper, if these values are from there.
    is_published : bool
        These values are the paper's.
    """

    contact_time: float = NAN
    stiffness: float = NAN
    damping_coefficient: float = NAN
    published: PublishedSample | None = None
    is_published: bool = False

    @property
    def is_misprinted(self) -> bool:
        """Whether the paper prints another contact time than the one held against."""
        return self.published is not None and self.published.is_misprinted


def find_published(sample: Sample) -> PublishedSample | None:
    """Return the paper's cell if `sample` is that one: same name, mass and contact time."""
    for cell in PUBLISHED_SAMPLES:
        if (
            cell.name == sample.name
            and abs(cell.mass - sample.mass) <= MASS_TOLERANCE
            and math.isclose(cell.contact_time, sample.reference_contact_time)
        ):
            return cell
    return None


def find_reference(samples: SampleSet, name: str) -> Reference:
    """Return what is expected of one sample; nothing at release angles of its own.

    What is expected holds for the rig's one impact speed.

    Raises
    ------
    ParameterError
        If the set has no such sample.
    """
    sample = samples.find(name)
    if sample.has_angle:
        return Reference()
    published = find_published(sample)
    return Reference(
        contact_time=sample.reference_contact_time,
        stiffness=sample.reference_stiffness,
        damping_coefficient=sample.reference_damping_coefficient,
        published=published,
        is_published=published is not None,
    )


def find_hammer_reference(samples: SampleSet) -> Reference:
    """Return what is expected of the hammer.

    With the paper's control sample the paper's values, else k1 = k2 of the control sample.
    """
    if not samples.control_sample:
        return Reference()
    control = samples.find(samples.control_sample)
    if control.has_angle:
        return Reference()
    if find_published(control) is not None:
        return Reference(
            stiffness=HAMMER_STIFFNESS,
            damping_coefficient=HAMMER_DAMPING_COEFFICIENT,
            is_published=True,
        )
    return Reference(stiffness=control.reference_stiffness)


def explain_misprint(cell: PublishedSample) -> str:
    """Return the footnote of a misprinted cell."""
    return (
        f"* Table 2 of the paper prints {cell.printed_contact_time * 1e6:.2f} µs for {cell.name},"
        f" a misprint: the masses and {cell.stiffness / 1e6:.2f} MN/m in Table 3 need"
        f" {cell.contact_time * 1e6:.1f} µs, which stands here instead."
    )
