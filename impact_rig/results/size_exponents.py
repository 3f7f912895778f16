"""How contact times go with the equivalent mass over the samples of a campaign."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.estimation.size_exponent import (
    HERTZ_EXPONENT,
    SPRING_EXPONENT,
    estimate_size_exponent,
)
from impact_rig.core.model.stiffness import estimate_equivalent_mass
from impact_rig.core.quantity import UNKNOWN, Quantity, describe
from impact_rig.results.campaign import Results


@dataclass(frozen=True)
class SampleSizes:
    """p of tau proportional to m_eq^p, one constant for each material; NaN: not determined.

    Attributes
    ----------
    material : str
        Of the samples; empty: all.
    by_contact_time, by_contact_law : Quantity
        p of tau_p, and of the durations by the contact laws [-].
    contact_time_residual_percent, contact_law_residual_percent : float
        RMS of what they leave of ln tau [%].
    hertz, linear_spring : float
        p of a Hertz contact, and of a linear spring whatever the size [-].
    """

    material: str
    by_contact_time: Quantity = field(default=UNKNOWN, metadata=describe())
    by_contact_law: Quantity = field(default=UNKNOWN, metadata=describe())
    contact_time_residual_percent: float = float("nan")
    contact_law_residual_percent: float = float("nan")
    hertz: float = HERTZ_EXPONENT
    linear_spring: float = SPRING_EXPONENT


def find_size_exponents(results: Results) -> tuple[SampleSizes, ...]:
    """Return p over all materials and for each, where three samples or more tell it."""
    known = [
        sample
        for sample in results.samples
        if sample.contact_time.is_known
        and sample.name in results.setup.samples.names
        and not results.setup.find_unknown_masses(sample.name)
        and results.setup.samples.find(sample.name).material
    ]
    materials = [results.setup.samples.find(sample.name).material for sample in known]
    groups = list(dict.fromkeys(materials))
    found = []
    for group in ("", *groups) if len(groups) > 1 else groups:
        chosen = [
            sample
            for sample, material in zip(known, materials, strict=True)
            if group in ("", material)
        ]
        times = _estimate(results, chosen, lambda sample: sample.contact_time)
        laws = _estimate(results, chosen, lambda sample: sample.contact_law.duration)
        if times[0].is_known or laws[0].is_known:
            found.append(SampleSizes(group, times[0], laws[0], times[1], laws[1]))
    return tuple(found)


def _estimate(
    results: Results,
    samples: Sequence[SampleEstimate],
    read: Callable[[SampleEstimate], Quantity],
) -> tuple[Quantity, float]:
    """Return p and what it leaves [%]."""
    setup = results.setup
    timed = [sample for sample in samples if read(sample).is_known]
    masses = [
        estimate_equivalent_mass(setup.hammer_mass, setup.samples.get_moving_mass(sample.name))
        for sample in timed
    ]
    struck = [setup.samples.find(sample.name) for sample in timed]
    # At one impact speed: each release angle has constants of its own.
    groups = [f"{item.material} {item.release_angle}" for item in struck]
    try:
        found = estimate_size_exponent(groups, masses, [read(sample).value for sample in timed])
    except NotDeterminedError:
        return UNKNOWN, float("nan")
    return found.exponent, 100.0 * found.residual
