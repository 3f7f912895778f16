"""Simulated campaigns, what each estimator makes of them, and the least that it can scatter.

The Cramer-Rao bound of the white noise of one hit, sensors and quantiser, with the masses known.
The mean of n hits that scatter by s cannot be known better than s / sqrt(n), whatever the
estimator; and stated masses and clock err by their uncertainties. These parts are independent.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from impact_rig.core.damping.log_decrement import (
    estimate_damping_coefficient,
    estimate_damping_ratio_from_coefficient,
)
from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.estimation.contact_law import look_at_law
from impact_rig.core.estimation.fits import estimate_decay, estimate_fitted_body
from impact_rig.core.estimation.law_fit import compute_law_bound
from impact_rig.core.estimation.paper_method import (
    BodyEstimate,
    ContactEstimate,
    estimate_bodies,
)
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.identification.cramer_rao import compute_model_bound
from impact_rig.core.identification.identification import identify_model
from impact_rig.core.model.pulses import VERSED_SINE
from impact_rig.core.model.stiffness import (
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
    estimate_sample_stiffness,
)
from impact_rig.core.quantity import UNKNOWN, Quantity
from impact_rig.core.session import Session
from impact_rig.core.setup.samples import RigSetup, Sample
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.contact import make_nominal_contact
from impact_rig.devices.virtual.plants import make_nominal_model, simulate_plant
from impact_rig.devices.virtual.rig import (
    DigitizerSettings,
    VirtualRig,
    VirtualRigSettings,
    compute_scale,
    make_nominal_physics,
)
from impact_rig.study.cases import (
    CONTACT_LAW,
    FREE_DECAY,
    IDENTIFICATION,
    LAWS,
    PAPER,
    Case,
)

UNIFORM_VARIANCE = 12.0
"""A step of the quantiser is uniform noise of step^2 / 12."""
SPEED_STEP = 0.01
"""Relative change of the impact speed for a derivative [-], our choice."""
NO_BOUND: Mapping[str, float] = MappingProxyType({})


@lru_cache(maxsize=256)
def compute_bounds(
    case: Case, rig: VirtualRigSettings, setup: RigSetup, sample: str
) -> Mapping[str, float]:
    """Return the bounds of a campaign's results, relative to the truth [-], by quantity.

    Parameters
    ----------
    rig : VirtualRigSettings
        As it strikes this sample.
    setup : RigSetup
        As stated.

    Returns
    -------
    mapping of str to float
        Empty where the driven model of a versed-sine is not the truth, or there is no noise.
    """
    digitizer = rig.digitizer
    if rig.plant is Plant.CONTACT and digitizer.noise:
        return _compute_law_bounds(case, rig, setup, sample)
    if rig.plant is not Plant.DYNAMICS or rig.pulse_shape is not VERSED_SINE:
        return NO_BOUND
    noise = [
        _compute_noise(digitizer, full_scale)
        for full_scale in (digitizer.hammer_full_scale, digitizer.specimen_full_scale)
    ]
    model = make_nominal_model(setup, sample, rig.hammer_damping)
    try:
        bound = compute_model_bound(
            model,
            digitizer.sampling_rate,
            digitizer.count,
            digitizer.pre_trigger,
            (noise[0], noise[1]),
        )
    except NotDeterminedError:
        return NO_BOUND

    true = {
        "tau_p": model.contact_time,
        "k2": model.specimen.stiffness,
        "c2": model.specimen.damping_coefficient,
    }

    def covary(first: str, second: str) -> float:
        place = bound.names.index(first), bound.names.index(second)
        return float(bound.covariance[place]) / (true[first] * true[second])

    mass, clock = _compute_stated_variances(setup, sample)
    variances = {
        "contact_time": (covary("tau_p", "tau_p") + rig.contact_time_scatter**2) / case.hits
        + clock,
        # k2 goes with the mass and the clock's square, c2 with the mass and the clock.
        "stiffness": covary("k2", "k2") / case.hits + mass + 4.0 * clock,
        "damping_coefficient": covary("c2", "c2") / case.hits + mass + clock,
        # zeta = c / (2 sqrt(k m)): mass and clock cancel.
        "damping_ratio": (covary("c2", "c2") + covary("k2", "k2") / 4.0 - covary("c2", "k2"))
        / case.hits,
    }
    return MappingProxyType({name: math.sqrt(value) for name, value in variances.items()})


def _compute_noise(digitizer: DigitizerSettings, full_scale: float) -> float:
    """Return the noise of sensor and steps [m/s^2]."""
    step = compute_scale(full_scale, digitizer.bits)
    return math.hypot(digitizer.noise * full_scale, step / math.sqrt(UNIFORM_VARIANCE))


def _compute_law_bounds(
    case: Case, rig: VirtualRigSettings, setup: RigSetup, sample: str
) -> Mapping[str, float]:
    """Return the bounds of the contact law from the hammer's trace."""
    contact = make_nominal_contact(setup, sample, rig.contact_exponent, rig.restitution)
    digitizer = rig.digitizer
    unit = (
        contact.impact_speed * contact.equivalent_mass / (contact.hammer_mass * contact.time_unit)
    )
    bound = compute_law_bound(
        contact.exponent,
        contact.damping * contact.impact_speed,
        contact.time_unit,
        np.arange(digitizer.count) / digitizer.sampling_rate - digitizer.pre_trigger,
        _compute_noise(digitizer, digitizer.hammer_full_scale) / unit,
    )
    _, clock = _compute_stated_variances(setup, sample)
    # Each hit has its own speed, and with it its own duration and restitution.
    faster = contact.scatter(1.0, 1.0 + SPEED_STEP)
    by_speed = [
        rig.amplitude_scatter * (moved / value - 1.0) / SPEED_STEP
        for moved, value in (
            (faster.duration, contact.duration),
            (faster.restitution, contact.restitution),
        )
    ]
    durations = bound.duration / contact.duration, rig.contact_time_scatter, by_speed[0]
    restitutions = bound.restitution / contact.restitution, by_speed[1]
    variances = {
        CONTACT_TIME: math.hypot(*durations) ** 2 / case.hits + clock,
        EXPONENT: (bound.exponent / contact.exponent) ** 2 / case.hits,
        RESTITUTION: math.hypot(*restitutions) ** 2 / case.hits,
    }
    return MappingProxyType({name: math.sqrt(value) for name, value in variances.items()})


def _compute_stated_variances(setup: RigSetup, sample: str) -> tuple[float, float]:
    """Return the relative variances of the moving mass and of the clock [-]."""
    samples = setup.samples
    mass = math.hypot(
        samples.find(sample).mass_uncertainty, samples.accelerometer_mass_uncertainty
    )
    return (mass / samples.get_moving_mass(sample)) ** 2, setup.clock_uncertainty**2


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

    def compute_parameters(
        self, sample: str, rig: VirtualRigSettings | None = None
    ) -> dict[str, float]:
        """Return the true parameters of one sample, SI units.

        On a rig with a contact law its duration, exponent and restitution; otherwise:

        `contact_time`, `stiffness`, `damping_coefficient` and `damping_ratio` are those of the
        simulated body; `paper_stiffness` is what equations (5) and (6b) make of the true masses
        and contact times of this sample and the control sample.
        """
        if rig is not None and rig.plant is Plant.CONTACT:
            contact = make_nominal_contact(
                self.setup, sample, rig.contact_exponent, rig.restitution
            )
            return {
                CONTACT_TIME: contact.duration,
                EXPONENT: contact.exponent,
                RESTITUTION: contact.restitution,
            }
        chosen = self.setup.samples.find(sample)
        return {
            "contact_time": chosen.reference_contact_time,
            "stiffness": chosen.reference_stiffness,
            "damping_coefficient": chosen.reference_damping_coefficient,
            "damping_ratio": estimate_damping_ratio_from_coefficient(
                chosen.reference_damping_coefficient,
                chosen.reference_stiffness,
                self.setup.samples.get_moving_mass(sample),
            ),
            "paper_stiffness": estimate_sample_stiffness(
                self._compute_equivalent_stiffness(sample),
                estimate_hammer_stiffness(
                    self._compute_equivalent_stiffness(self.setup.samples.control_sample)
                ),
            ),
        }

    def _compute_equivalent_stiffness(self, sample: str) -> float:
        mass = estimate_equivalent_mass(
            self.setup.hammer_mass, self.setup.samples.get_moving_mass(sample)
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
                setup.samples.get_moving_mass(sample.name),
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
    hammer, specimen = simulate_plant(
        case.rig.plant,
        make_nominal_physics(setup, sample, case.rig),
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
        if case.varies_law:
            # Every law meets every sample.
            exponent, restitution = LAWS[(number + number // len(names)) % len(LAWS)]
            changed = replace(case.rig, contact_exponent=exponent, restitution=restitution)
            case = replace(case, rig=changed)
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


CONTACT_TIME = "contact_time"
STIFFNESS = "stiffness"
DAMPING_COEFFICIENT = "damping_coefficient"
DAMPING_RATIO = "damping_ratio"
EXPONENT = "exponent"
RESTITUTION = "restitution"


@dataclass(frozen=True)
class Outcome:
    """One estimate of one quantity, relative to the truth; NaN: not determined.

    Attributes
    ----------
    estimator, quantity : str
        As named in this module.
    error : float
        Estimate over truth, less 1 [-].
    half_width : float
        Expanded uncertainty over truth [-].
    bound : float
        Least standard deviation of an unbiased estimator over truth [-].
    """

    estimator: str
    quantity: str
    error: float
    half_width: float
    bound: float = math.nan


@dataclass(frozen=True)
class _Evidence:
    """What the estimators are given: the mean hit, and the paper's estimates from it."""

    mean: MeanHit
    setup: RigSetup
    sample: str
    contact: ContactEstimate
    body: BodyEstimate


Estimator = Callable[[_Evidence], dict[str, Quantity]]


def evaluate(campaign: Campaign) -> tuple[Outcome, ...]:
    """Return every estimate of a campaign beside its truth."""
    case, sample, setup = campaign.case, campaign.sample, campaign.session.setup
    truth = campaign.truth.compute_parameters(sample, campaign.rig)
    bounds = compute_bounds(case, campaign.rig, setup, sample)
    mean = campaign.session.compute_mean(sample)
    if mean is None:
        raise NotDeterminedError(f"a campaign on {sample!r}: no hit was accepted")
    bodies = estimate_bodies(mean, setup, sample, campaign.session.estimate_hammer())
    evidence = _Evidence(mean, setup, sample, *bodies)
    outcomes = []
    for name in case.estimators:
        try:
            found = _ESTIMATORS[name](evidence)
        except NotDeterminedError:
            found = {}
        for quantity in ESTIMATED[name]:
            if name == PAPER and quantity in NEEDS_CONTROL and not case.has_control:
                continue
            if quantity not in truth:
                continue
            is_paper_stiffness = (name, quantity) == (PAPER, STIFFNESS)
            true = truth["paper_stiffness" if is_paper_stiffness else quantity]
            value = found.get(quantity, UNKNOWN)
            bound = math.nan if is_paper_stiffness else bounds.get(quantity, math.nan)
            error, half_width = value.value / true - 1.0, value.expanded / true
            outcomes.append(Outcome(name, quantity, error, half_width, bound))
    return tuple(outcomes)


def _estimate_by_paper(evidence: _Evidence) -> dict[str, Quantity]:
    return {
        CONTACT_TIME: evidence.contact.contact_time,
        STIFFNESS: evidence.body.stiffness,
        DAMPING_RATIO: evidence.body.damping_ratio,
        DAMPING_COEFFICIENT: evidence.body.damping_coefficient,
    }


def _estimate_by_free_decay(evidence: _Evidence) -> dict[str, Quantity]:
    contact_time = evidence.contact.contact_time.value
    return vars(estimate_decay(evidence.mean, evidence.setup, evidence.sample, contact_time))


def _identify(evidence: _Evidence) -> dict[str, Quantity]:
    mean, setup, sample = evidence.mean, evidence.setup, evidence.sample
    fitted = identify_model(mean, setup, sample)
    return vars(estimate_fitted_body(fitted, setup, sample, mean.count))


def _estimate_law(evidence: _Evidence) -> dict[str, Quantity]:
    law = look_at_law(evidence.mean, evidence.setup, evidence.sample)
    return {CONTACT_TIME: law.duration, EXPONENT: law.exponent, RESTITUTION: law.restitution}


ESTIMATED = {
    PAPER: (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT, DAMPING_RATIO),
    FREE_DECAY: (STIFFNESS, DAMPING_COEFFICIENT, DAMPING_RATIO),
    IDENTIFICATION: (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT, DAMPING_RATIO),
    CONTACT_LAW: (CONTACT_TIME, EXPONENT, RESTITUTION),
}
"""What each estimator determines."""
NEEDS_CONTROL = (STIFFNESS, DAMPING_COEFFICIENT)
"""What the paper's method gets from the control sample's k1."""
_ESTIMATORS: dict[str, Estimator] = {
    PAPER: _estimate_by_paper,
    FREE_DECAY: _estimate_by_free_decay,
    IDENTIFICATION: _identify,
    CONTACT_LAW: _estimate_law,
}
