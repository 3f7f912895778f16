"""One simulated campaign: draw the truth, strike with it, judge by what is stated.

A laboratory weighs its masses and trusts its clock within stated uncertainties. So the true ones
are drawn about the stated ones, the hits are simulated with the true ones, and everything after
the digitizer knows the stated ones only.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impact_rig.core.damping.log_decrement import (
    estimate_damping_coefficient,
    estimate_damping_ratio_from_coefficient,
)
from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.model.stiffness import (
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
    estimate_sample_stiffness,
)
from impact_rig.core.session import Session
from impact_rig.core.setup.samples import RigSetup, Sample
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.devices.virtual.digitizer import DigitizerSettings
from impact_rig.devices.virtual.plants import HitPhysics, find_nominal_model, simulate_plant
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.study.cases import Case

MOST_ATTEMPTS = 5
"""At one impact, before a campaign is given up [-], our choice."""
PEAK_PART = 0.5
"""Peaks over full scale where the noise is a part of the peak [-], our choice."""


@dataclass(frozen=True)
class Truth:
    """What a campaign really is.

    Attributes
    ----------
    setup : RigSetup
        With the true masses; reference values are the true parameters.
    clock_error : float
        True sampling rate over the stated one, less 1 [-].
    """

    setup: RigSetup
    clock_error: float = 0.0

    def find_parameters(self, sample: str) -> dict[str, float]:
        """Return the true parameters of one sample, SI units.

        `contact_time`, `stiffness`, `damping_coefficient` and `damping_ratio` are those of the
        simulated body; `paper_stiffness` is what equations (5) and (6b) make of the true masses
        and contact times of this sample and the control sample.
        """
        chosen = self.setup.samples.find(sample)
        return {
            "contact_time": chosen.reference_contact_time,
            "stiffness": chosen.reference_stiffness,
            "damping_coefficient": chosen.reference_damping_coefficient,
            "damping_ratio": estimate_damping_ratio_from_coefficient(
                chosen.reference_damping_coefficient,
                chosen.reference_stiffness,
                self.setup.samples.find_moving_mass(sample),
            ),
            "paper_stiffness": estimate_sample_stiffness(
                self._find_equivalent_stiffness(sample),
                estimate_hammer_stiffness(
                    self._find_equivalent_stiffness(self.setup.samples.control_sample)
                ),
            ),
        }

    def _find_equivalent_stiffness(self, sample: str) -> float:
        mass = estimate_equivalent_mass(
            self.setup.hammer_mass, self.setup.samples.find_moving_mass(sample)
        )
        return estimate_equivalent_stiffness(
            mass, self.setup.samples.find(sample).reference_contact_time
        )


def draw_truth(stated: RigSetup, generator: np.random.Generator) -> Truth:
    """Draw true masses and a true clock, normal about the stated ones by their uncertainties.

    Takes the same number of draws whatever is stated: hammer, accelerometer, clock, then the
    samples in their order.
    """
    samples = stated.samples
    draws = generator.standard_normal(3 + len(samples.samples)).tolist()
    hammer, accelerometer, clock, *others = draws
    return Truth(
        setup=replace(
            stated,
            hammer_mass=stated.hammer_mass + stated.hammer_mass_uncertainty * hammer,
            samples=replace(
                samples,
                accelerometer_mass=samples.accelerometer_mass
                + samples.accelerometer_mass_uncertainty * accelerometer,
                samples=tuple(
                    replace(sample, mass=sample.mass + sample.mass_uncertainty * draw)
                    for sample, draw in zip(samples.samples, others, strict=True)
                ),
            ),
        ),
        clock_error=stated.clock_uncertainty * clock,
    )


def set_damping_ratio(setup: RigSetup, damping_ratio: float) -> RigSetup:
    """Return the set-up with every sample's reference damping at one zeta [-]."""

    def change(sample: Sample) -> Sample:
        return replace(
            sample,
            reference_damping_coefficient=estimate_damping_coefficient(
                damping_ratio,
                sample.reference_stiffness,
                setup.samples.find_moving_mass(sample.name),
            ),
        )

    return replace(
        setup,
        samples=replace(setup.samples, samples=tuple(map(change, setup.samples.samples))),
    )


def make_exact(setup: RigSetup) -> RigSetup:
    """Return the set-up with masses and clock known exactly."""
    samples = setup.samples
    return replace(
        setup,
        hammer_mass_uncertainty=0.0,
        clock_uncertainty=0.0,
        samples=replace(
            samples,
            accelerometer_mass_uncertainty=0.0,
            samples=tuple(replace(sample, mass_uncertainty=0.0) for sample in samples.samples),
        ),
    )


def adapt_ranges(case: Case, setup: RigSetup, sample: str) -> VirtualRigSettings:
    """Return the rig of a case; where its noise is a part of the peaks, with ranges that fit."""
    if math.isnan(case.noise_of_peak):
        return case.rig
    digitizer = case.rig.digitizer
    model = find_nominal_model(setup, sample, case.rig.hammer_damping)
    hammer, specimen = simulate_plant(
        case.rig.plant,
        HitPhysics(model),
        digitizer.sampling_rate,
        digitizer.count,
        -digitizer.pre_trigger,
    )
    ranged = replace(
        digitizer,
        hammer_full_scale=float(np.abs(hammer).max()) / PEAK_PART,
        specimen_full_scale=float(np.abs(specimen).max()) / PEAK_PART,
        noise=case.noise_of_peak * PEAK_PART,
    )
    return replace(case.rig, digitizer=ranged)


@dataclass(frozen=True)
class Campaign:
    """What was struck, and what the laboratory has of it.

    Attributes
    ----------
    case : Case
        Its conditions.
    sample : str
        That was struck.
    truth : Truth
        Unknown to the laboratory.
    session : Session
        With every hit judged, of the control sample too; its set-up is the stated one.
    hits : tuple of JudgedHit
        Of the sample, rejected ones too.
    rig : VirtualRigSettings
        As it struck, clock and seed apart.
    """

    case: Case
    sample: str
    truth: Truth
    session: Session
    hits: tuple[JudgedHit, ...]
    rig: VirtualRigSettings


class CampaignSource:
    """Campaigns of one case, each by its number alone.

    Parameters
    ----------
    case : Case
        Conditions.
    stated : RigSetup
        What the laboratory knows; its samples are struck in turn.
    entropy : tuple of int
        Of the case; the campaign's number is added.
    """

    def __init__(self, case: Case, stated: RigSetup, entropy: tuple[int, ...]) -> None:
        self._case = case
        self._entropy = entropy
        if not math.isnan(case.damping_ratio):
            stated = set_damping_ratio(stated, case.damping_ratio)
        self._stated = make_exact(stated) if case.is_exact else stated

    def run(self, number: int) -> Campaign:
        """Strike campaign `number`: the control sample first, where it is wanted.

        Raises
        ------
        NotDeterminedError
            If a hit was rejected `MOST_ATTEMPTS` times.
        """
        case, stated = self._case, self._stated
        names = stated.samples.names
        sample = names[number % len(names)]
        source = np.random.SeedSequence((*self._entropy, number))
        seed, truth_source = source.spawn(2)
        truth = draw_truth(stated, np.random.default_rng(truth_source))
        settings = adapt_ranges(case, stated, sample)
        rig = VirtualRig(
            truth.setup,
            replace(
                settings,
                seed=int.from_bytes(seed.generate_state(2).tobytes(), "little"),
                digitizer=shift_clock(settings.digitizer, truth.clock_error),
            ),
        )
        session = Session(stated)
        control = (stated.samples.control_sample,) if case.has_control else ()
        for name in dict.fromkeys((*control, sample)):
            hits = [
                hit
                for impact in range(1, case.hits + 1)
                for hit in _strike_until_accepted(rig, session, name, impact, settings.digitizer)
            ]
        return Campaign(case, sample, truth, session, tuple(hits), settings)


def shift_clock(digitizer: DigitizerSettings, clock_error: float) -> DigitizerSettings:
    """Return a digitizer whose clock runs fast by `clock_error` [-], with as many points."""
    rate = digitizer.sampling_rate * (1.0 + clock_error)
    return replace(digitizer, sampling_rate=rate, record_duration=digitizer.count / rate)


def strike(
    rig: VirtualRig, session: Session, label: HitLabel, block_size: int, stated_rate: float
) -> tuple[JudgedHit, ...]:
    """Strike once and judge; the blocks say the rate that the digitizer believes in [Hz]."""
    judged: list[JudgedHit] = []
    for block in rig.strike(label).split(block_size, stamp=0):
        stated: Block = replace(block, sampling_rate=stated_rate)
        judged.extend(session.feed(stated))
    return tuple(judged)


def _strike_until_accepted(
    rig: VirtualRig, session: Session, sample: str, impact: int, digitizer: DigitizerSettings
) -> list[JudgedHit]:
    judged: list[JudgedHit] = []
    for attempt in range(1, MOST_ATTEMPTS + 1):
        label = HitLabel(sample, impact, impact, attempt)
        judged += strike(rig, session, label, digitizer.count, digitizer.sampling_rate)
        if judged and judged[-1].accepted:
            return judged
    raise NotDeterminedError(
        f"a campaign on {sample!r}: impact {impact} was rejected {MOST_ATTEMPTS} times"
    )
