"""Simulated campaigns, and every estimate of them beside the truth.

Masses, gains and clock of a campaign are drawn about the stated ones, by their uncertainties. The
laboratory knows the stated ones only.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from scipy.stats import binom

from impact_rig.core.estimates.equations import (
    estimate_damping_ratio_from_coefficient,
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
    estimate_sample_stiffness,
)
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.quantity import UNKNOWN, Quantity
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.session import Session
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.contact import make_nominal_contact
from impact_rig.devices.virtual.plants import make_published_model
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings

HITS = 10
"""Accepted hits on each sample of a campaign [-], the paper's."""
COVERAGE = 0.95
"""Of the intervals that the results state [-]."""
CHANCE = 1e-3
"""Probability that a figure without fault misses its goal [-], our choice."""

ESTIMATES: Mapping[str, Callable[[SampleEstimate], object]] = {
    "paper": attrgetter("paper"),
    "free decay": attrgetter("free_decay"),
    "contact law": attrgetter("contact_law"),
}
"""Where the results hold what each method says."""


@dataclass(frozen=True)
class Asked:
    """One number of one method."""

    method: str  # of `ESTIMATES`
    quantity: str  # of its attributes
    truth: str  # of `compute_truth`

    def __str__(self) -> str:
        """Return the name in words."""
        return f"{self.quantity.replace('_', ' ')}, {self.method}"

    def read(self, estimate: SampleEstimate) -> Quantity:
        """Return the number; what was not determined is unknown."""
        found: Quantity = getattr(ESTIMATES[self.method](estimate), self.quantity, UNKNOWN)
        return found


PAPER_STIFFNESS = "paper stiffness"
"""What equations (5) and (6b) make of the true masses and contact times."""
TAU, K2, C2, ZETA2 = "contact_time", "stiffness", "damping_coefficient", "damping_ratio"
PAPER = (
    Asked("paper", TAU, TAU),
    Asked("paper", K2, PAPER_STIFFNESS),
    Asked("paper", C2, C2),
    Asked("paper", ZETA2, ZETA2),
)
FREE_DECAY = tuple(Asked("free decay", name, name) for name in (C2, ZETA2))
LAW = tuple(Asked("contact law", name, name) for name in ("duration", "exponent", "restitution"))
ASKED = {
    Plant.PUBLISHED: (*PAPER, *FREE_DECAY),
    Plant.DYNAMICS: (*PAPER, *FREE_DECAY),
    Plant.CONTACT: (Asked("paper", TAU, "duration"), *LAW),
}
"""What is true on each plant, and so is asked of it. The published traces do not follow the model,
and bodies under a contact law have no k2 or c2."""


def compute_truth(plant: Plant, setup: RigSetup, name: str) -> dict[str, float]:
    """Return the true parameters of a sample, in SI units."""
    if plant is Plant.CONTACT:
        rig = VirtualRigSettings()
        contact = make_nominal_contact(setup, name, rig.contact_exponent, rig.restitution)
        return {
            "duration": contact.duration,
            "exponent": contact.exponent,
            "restitution": contact.restitution,
        }
    sample, samples = setup.samples.find(name), setup.samples

    def stiffen(other: str) -> float:
        mass = estimate_equivalent_mass(setup.hammer_mass, samples.get_moving_mass(other))
        return estimate_equivalent_stiffness(mass, samples.find(other).reference_contact_time)

    k2, c2 = sample.reference_stiffness, sample.reference_damping_coefficient
    if plant is Plant.PUBLISHED:
        c2 = make_published_model(setup, name).specimen.damping_coefficient
    hammer = estimate_hammer_stiffness(stiffen(samples.control_sample))
    return {
        TAU: sample.reference_contact_time,
        K2: k2,
        C2: c2,
        ZETA2: estimate_damping_ratio_from_coefficient(c2, k2, samples.get_moving_mass(name)),
        PAPER_STIFFNESS: estimate_sample_stiffness(stiffen(name), hammer),
    }


@dataclass(frozen=True)
class Outcome:
    """One number of one campaign, relative to the truth; NaN: not determined."""

    asked: Asked
    error: float  # [-]
    half_width: float  # [-], of the 95 % interval, towards the truth


def run_campaign(
    plant: Plant, setup: RigSetup, seed: int, number: int, hits: int = HITS
) -> list[Outcome]:
    """Strike the control sample and one sample, which take turns; compare with the truth."""
    names = setup.samples.names
    name = names[number % len(names)]
    generator = np.random.default_rng((seed, *plant.value.encode(), number))
    settings = VirtualRigSettings(plant, seed=int(generator.integers(2**63)), draws=True)
    rig, session = VirtualRig(setup, settings), Session(setup)
    for struck in dict.fromkeys((setup.samples.control_sample, name)):
        for impact in range(1, hits + 1):
            hit = rig.strike(HitLabel(struck, impact, impact))
            for block in hit.split(hit.hammer.output.size, stamp=0):
                session.feed(block)
    found = session.estimate_all()
    estimate = next(sample for sample in found.samples if sample.name == name)
    true = compute_truth(plant, rig.setup, name)
    outcomes = []
    for asked in ASKED[plant]:
        stated, value = asked.read(estimate), true[asked.truth]
        width = stated.compute_half_width(value) if stated.is_known else np.nan
        outcomes.append(Outcome(asked, stated.value / value - 1.0, width / value))
    return outcomes


@dataclass(frozen=True)
class Summary:
    """One number over many campaigns."""

    asked: Asked
    campaigns: int  # [-]
    covered: int  # [-], in which its interval covers the truth; not, where it was not determined
    bias: float  # [-], mean error over the mean half width of the interval


def summarize(outcomes: list[Outcome]) -> Iterator[Summary]:
    """Yield each number over the outcomes of many campaigns."""
    for asked in dict.fromkeys(outcome.asked for outcome in outcomes):
        found = [(one.error, one.half_width) for one in outcomes if one.asked == asked]
        errors, widths = np.array(found).T
        covered = int(np.count_nonzero(abs(errors) <= widths))
        bias = float(np.nanmean(errors) / np.nanmean(widths))
        yield Summary(asked, len(found), covered, bias)


def find_least(count: int, probability: float) -> int:
    """Return how many of `count` chance leaves at least, where each has a probability [-]."""
    return int(binom.ppf(CHANCE, count, probability))


def find_most(count: int, probability: float) -> int:
    """Return how many of `count` chance makes at most, where each has a probability [-]."""
    return int(binom.ppf(1.0 - CHANCE, count, probability))
