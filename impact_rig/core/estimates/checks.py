"""Momenta, mass and restitution from both traces of a sample, without a law of contact."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.estimates.equations import UncertainNumber
from impact_rig.core.estimates.uncertainty import (
    ASSUMED,
    ASSUMED_GAIN,
    LEAST_HITS,
    ONE_HIT,
    Known,
    RigNumbers,
    leave_out,
    make_ensemble,
    make_input,
    make_stated,
)
from impact_rig.core.given.findings import Finding, Note, Reason, Subject
from impact_rig.core.given.quantity import (
    INTERNAL,
    UNKNOWN,
    Comparable,
    Conformity,
    Quantity,
    describe,
    quantity_field,
)
from impact_rig.core.given.sensors import CHANNELS
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.hit.momenta import Hold, Passage, follow_momentum, weigh_sample
from impact_rig.core.hit.pulse_width import ZERO_AFTER
from impact_rig.core.mean.mean_hit import MeanHit, follow_mean
from impact_rig.core.mean.trends import check_hits, follow_series

BALANCED = 0.01
"""Difference of a momentum ratio from 1 that is nothing odd [-], our choice."""
ASSUMED_SPEED = 0.03
"""Standard uncertainty of a stated impact speed over it [-], our choice: nothing states one."""
OTHER_SPEED = 0.02
"""Difference of a law's impact speed from the stated one that is nothing odd [-], our choice."""
NEAR_SLIP = 0.05
"""Difference from the ratio of a usual slip [-], our choice."""


@dataclass(frozen=True)
class Checks(Comparable):
    """Momenta, mass and restitution of one sample without a contact law; NaN: not determined."""

    # m2 dv2 / (m1 dv1) [-]: 1 for two free bodies, right masses and right gains
    momentum_ratio: Quantity = quantity_field("", "m2Δv2/m1Δv1", "momentum ratio")
    # m1 dv1 [N s]
    impulse: Quantity = quantity_field("N s", "J", "impulse", shown="mN s")
    # v1 [m/s]: the mean of what was measured, else as stated
    impact_speed: Quantity = quantity_field("m/s", "v1", "impact speed", shown="cm/s")
    # J / (m_eq v1) - 1 by that speed [-]
    stated_restitution: Quantity = quantity_field(
        "", "J/(m v1) - 1", "restitution by the impact speed"
    )
    # (dv1 + dv2) / v1 - 1 by the same speed [-]: of both bodies, without their masses
    separation_restitution: Quantity = quantity_field(
        "", "(Δv1+Δv2)/v1 - 1", "restitution by both bodies"
    )
    # m2 with its accelerometer, by the traces [kg]
    traced_mass: Quantity = quantity_field("kg", "m2", "mass by the traces", shown="g")
    stated_mass: float = field(default=math.nan, metadata=describe("kg"))  # the same, stated
    # Mean velocity of the sample after the contact over J / m2 [-]: 0 on a spring, 1 where free
    persistence: float = math.nan
    hold: str = Hold.UNKNOWN.value  # what holds the sample, of `Hold`
    warnings: tuple[Note, ...] = field(default=(), metadata=INTERNAL)
    notes: tuple[Note, ...] = field(default=(), metadata=INTERNAL)


NO_CHECKS = Checks()
"""Where nothing was integrated."""


def check_momenta(mean: MeanHit, setup: RigSetup, rig: RigNumbers, sample: str) -> Checks:
    """Integrate both traces of a sample's hits; hold them against masses and impact speed."""
    stated = setup.samples.get_moving_mass(sample)
    found = follow_mean(mean, setup.find_chains(mean.sampling_rate))
    if found is None:
        note = "not determined, since the record does not hold all of the pulse"
        return Checks(stated_mass=stated, notes=(Note(Subject.MOMENTA, note),))
    restored, contact, whole = found
    cuts = (cut.astype(np.float64) for cut in restored.cut_hits())
    each = [follow_momentum(cut, contact, mean.sampling_rate) for cut in cuts]
    ratios = np.array([item.sample_change / item.hammer_change for item in each])
    course = follow_series(mean, ratios)
    # Momenta need no width.
    trending = rig.follow(replace(course, width_standard=0.0))
    reading = _Reading(setup, trending, mean, sample)
    # Of both changes of velocity by their zeros.
    means = np.abs(restored.traces[:, contact].mean(axis=1))
    zeros = restored.zero_uncertainty[: means.size] / np.where(means > 0.0, means, math.inf)
    checks = reading.state(whole, each, tuple(zeros.tolist()))
    checks = replace(checks, warnings=checks.warnings + course.warnings, notes=rig.notes)
    checks = _judge_chain(checks, setup, sample)
    told = {
        Hold.SPRING: "the sample is held, after the contact a spring brings it to rest: they do"
        " not balance, and e by v1 is that of free bodies",
        Hold.UNCLEAR: f"after the contact the sample moves on at {whole.persistence:.2f} of the"
        " velocity of a free one, neither 0 as on a spring nor 1: its mass is not told, nor"
        " whether the gains are right",
    }.get(whole.hold)
    if told is not None:
        return replace(checks, notes=(*checks.notes, Note(Subject.MOMENTA, told)))
    odd = check_hits(
        mean,
        ratios / np.median(ratios),
        BALANCED,
        "the momenta of {} balance otherwise than the others': a gain that changed, a trace that"
        " is clipped or does not come back to zero, or a sample that was held",
    )
    return replace(checks, warnings=checks.warnings + odd)


@dataclass(frozen=True)
class _Reading:
    """Computes numbers with their uncertainty from changes of velocity."""

    setup: RigSetup
    rig: RigNumbers
    mean: MeanHit
    sample: str

    def state(self, whole: Passage, each: Sequence[Passage], zeros: tuple[float, ...]) -> Checks:
        """Return the checks of a mean hit."""
        rig = self.rig
        hammer, ratio, mass, number = self._make_numbers(whole, each, zeros)
        stated = self.setup.samples.get_moving_mass(self.sample)
        m1, m2 = rig.hammer_mass, rig.moving_mass
        read = hammer * rig.clock * rig.gains[0]
        hammer_speed = rig.find_speed(read)
        balance = ratio * m2 / rig.load
        gained = ratio * hammer * rig.clock * rig.gains[1]
        traced = self._state(rig.load * mass * rig.gains[0] / rig.gains[1])
        # What is on a spring does not move on as free bodies do.
        free = [
            UNKNOWN if whole.hold is Hold.SPRING else self._state(each)
            for each in (
                balance * rig.gains[1] / rig.gains[0],
                hammer_speed * (m1 + m2) / (m2 * number) - 1.0,
                (hammer_speed + gained) / number - 1.0,
            )
        ]
        asked = ask_for_sample(traced.value, stated, float(np.nan_to_num(traced.expanded)))
        question = Note(Subject.MASS, asked) if asked else None
        if question is None and whole.hold in {Hold.FREE, Hold.UNKNOWN}:
            question = self._check_balance(balance)
        return Checks(
            momentum_ratio=free[0],
            impulse=self._state(rig.load * read),
            impact_speed=self._state(number),
            stated_restitution=free[1],
            separation_restitution=free[2],
            traced_mass=traced,
            stated_mass=stated,
            persistence=whole.persistence,
            hold=whole.hold.value,
            warnings=(question,) if question else (),
        )

    def _make_numbers(
        self, whole: Passage, each: Sequence[Passage], zeros: tuple[float, ...]
    ) -> tuple[UncertainNumber, ...]:
        """Return dv1 [m/s], dv2 / dv1 [-], m2 / m1 [-] and v1 [m/s] as the hits scatter."""
        setup, measured = self.setup, self.mean.impact_speeds
        speeds = measured if measured.size else np.full(len(each), setup.impact_speed)
        count, scatter = len(each), np.zeros((4, 4))
        figures = np.array([item.list_figures(whole.hold) for item in each])
        if count >= LEAST_HITS:
            # What was not measured does not scatter.
            rows = np.nan_to_num(np.column_stack((figures, speeds)))
            scatter = np.cov(rows, rowvar=False, ddof=1) / self.mean.count
        source = f"scatter of the hits on {self.sample}"
        hammer, ratio, mass, speed = make_ensemble(
            source, (*whole.list_figures(whole.hold), speeds.mean()), scatter, max(count - 1, 1)
        )
        if measured.size:
            common = self.mean.impact_speed_uncertainty / float(speeds.mean())
            speed = speed * make_input("measured impact speed", 1.0, common)
        else:
            standard = setup.impact_speed_uncertainty
            speed = make_stated("impact speed", setup.impact_speed, standard, ASSUMED_SPEED)
        lost = [make_input(ZERO_AFTER, 1.0, part) for part in zeros]
        if len(lost) > 1:
            ratio, mass = ratio * lost[1] / lost[0], mass * lost[0] / lost[1]
        return hammer * lost[0], ratio, mass, speed

    def _state(self, number: UncertainNumber) -> Quantity:
        if not math.isfinite(number.x):
            return UNKNOWN
        reasons = (ONE_HIT,) if len(self.mean.hits) < LEAST_HITS else ()
        return replace(Known(number, reasons).state(), number=None)  # of inputs of its own

    def _check_balance(self, balance: UncertainNumber) -> Note | None:
        """Warn of momenta that do not balance, by what is known of the gains, not assumed."""
        hammer, sample = (
            gain if self.setup.find_sensor(channel).sensitivity_uncertainty else 1.0
            for channel, gain in zip(CHANNELS, self.rig.gains, strict=True)
        )
        balance = balance * sample / hammer
        ratio = self._state(balance)
        away = abs(ratio.value - 1.0)
        if not away > max(np.nan_to_num(ratio.expanded), BALANCED):
            return None
        # One hit has no scatter, and claims no interval.
        within = f" ± {ratio.expanded:.3f}" if math.isfinite(ratio.expanded) else ", one hit"
        return Note(
            Subject.MOMENTA,
            "they do not balance: a gain, a mass or the zero after the impact is wrong, a"
            " trace is clipped, or the sample is not free or rings"
            f" (m2Δv2/m1Δv1 is {ratio.value:.3f}{within})",
        )


def ask_for_mass(hit: JudgedHit, setup: RigSetup) -> JudgedHit:
    """Return a hit with the sample's mass by its traces, and the question if it is another's."""
    if hit.filtered is None:
        return hit
    ratio = weigh_sample(hit.filtered, setup.find_chains(hit.filtered.sampling_rate))
    mass, stated = ratio * setup.hammer_load, setup.samples.get_moving_mass(hit.label.sample)
    hit = replace(hit, sample_mass=mass)
    if hit.label.sample == setup.samples.check_sample:
        found = check_chain(mass, stated)
        return replace(hit, rejections=(*hit.rejections, *found))
    question = ask_for_sample(mass, stated)
    if question is None:
        return hit
    finding = Finding(Reason.OTHER_SAMPLE, question, is_harmless=True)
    return replace(hit, findings=(*hit.findings, finding))


CHAIN_TOLERANCE = 0.05
"""Difference of force over acceleration of a free rigid mass from the mass [-], ISO 7626-1."""


def check_chain(traced: float, stated: float) -> tuple[Finding, ...]:
    """Return what a hit on a free rigid mass has against the chain, by both masses [kg]."""
    if abs(traced - stated) <= CHAIN_TOLERANCE * stated:
        return ()
    moves = "cannot be weighed by these traces"
    if math.isfinite(traced):
        moves = (
            f"moves as {traced * 1e3:.4g} g would, {100.0 * (traced / stated - 1.0):+.1f} %: more"
            f" than the {100.0 * CHAIN_TOLERANCE:g} % of ISO 7626-1"
        )
    text = f"the free mass of {stated * 1e3:.4g} g, accelerometer included, {moves}; see to"
    text += " sensitivities, masses, mounts and cables"
    return (Finding(Reason.OPERATIONAL_CHECK, text),)


def _judge_chain(checks: Checks, setup: RigSetup, sample: str) -> Checks:
    """Add what the operational check states, if the sample is its free rigid mass."""
    traced, stated = checks.traced_mass, checks.stated_mass
    if sample != setup.samples.check_sample or not traced.is_known:
        return checks
    reach = CHAIN_TOLERANCE * stated
    conformity = traced.judge(stated - reach, stated + reach)
    text = (
        f"{conformity.value}: the free mass of {stated * 1e3:.4g} g moves as"
        f" {traced.value * 1e3:.4g} ± {np.nan_to_num(traced.expanded) * 1e3:.2g} g would,"
        f" {100.0 * (traced.value / stated - 1.0):+.2f} %, where ISO 7626-1 allows"
        f" {100.0 * CHAIN_TOLERANCE:g} %"
    )
    if conformity is Conformity.PASSED:
        return replace(checks, notes=(*checks.notes, Note(Subject.OPERATIONAL_CHECK, text)))
    narrower = advise_check(setup) or "a calibrated sensor, or more hits, would narrow it"
    text += f"; the whole ± must lie within it: {narrower}"
    return replace(checks, warnings=(*checks.warnings, Note(Subject.OPERATIONAL_CHECK, text)))


def advise_check(setup: RigSetup) -> str | None:
    """Return why the operational check of a set-up can only end undecided; None: it need not."""
    stated = {it: setup.find_sensor(it).sensitivity_uncertainty for it in CHANNELS}
    expanded = 1.96 * math.hypot(*(standard or ASSUMED_GAIN for standard in stated.values()))
    if expanded < CHAIN_TOLERANCE:
        return None
    lines = " and ".join(f"[source.{it}]" for it, standard in stated.items() if not standard)
    return (
        "the check mass ends undecided"
        + (f" unless sensitivity_uncertainty stands in {lines} of the rig file" if lines else "")
        + f": the sensitivities alone make ±{100.0 * expanded:.2g} %, and"
        f" {100.0 * CHAIN_TOLERANCE:g} % are allowed"
    )


def ask_for_sample(traced: float, stated: float, expanded: float = 0.0) -> str | None:
    """Return the question whether the right sample is struck, by its masses [kg]; None: it is.

    Two gains that are 5 % off make a seventh: by more than that, and the uncertainty, our choice.
    """
    if not abs(traced - stated) > max(0.15 * stated, expanded):
        return None
    return (
        f"the sample moves as {traced * 1e3:.3g} g would, accelerometer included, where"
        f" {stated * 1e3:.3g} g are stated: another sample was struck, or a mass or sensitivity"
        " is not as stated"
    )


SLIPS = {
    2.0: "a sampling rate that is stated twice or half as high",
    9.81: "g read as m/s², or the reverse",
    10.0: "a gain of ten, or cm/s read as mm/s",
    1000.0: "mV read as V, or mm as m",
}
"""Usual slips, by how many times the stated speed v is by them, or the reverse."""


def use_measured_speed(setup: RigSetup, mean: MeanHit) -> RigSetup:
    """Return a set-up with the impact speed that was measured at the hits, if it was."""
    speeds = mean.impact_speeds
    if not speeds.size:
        return setup
    scatter = float(speeds.std(ddof=1)) / math.sqrt(speeds.size) if speeds.size > 1 else 0.0
    standard = math.hypot(scatter, mean.impact_speed_uncertainty)
    return replace(setup, impact_speed=float(speeds.mean()), impact_speed_uncertainty=standard)


def check_speed(
    speed: Quantity, restitution: Quantity, setup: RigSetup, speed_is: str
) -> Note | None:
    """Warn of a law's impact speed that is not the set-up's, beyond both uncertainties.

    Without a law the bodies' e by that speed, stated or measured, must lie between 0 and 1.
    """
    stated, standard = setup.impact_speed, setup.impact_speed_uncertainty
    if speed.is_known and math.isfinite(stated):
        low = high = speed.value / stated
        # What is assumed eases nothing.
        expanded = leave_out(speed, lambda source: source.endswith(ASSUMED)).expanded
        reach = math.hypot(np.nan_to_num(expanded), 2.0 * standard)
        is_other = abs(speed.value - stated) - reach > OTHER_SPEED * stated
    elif restitution.is_known:
        # Without loss the impulse is twice m v1, with e = 0 it is m v1.
        high = 1.0 + restitution.value
        low = high / 2.0
        is_other = abs(restitution.value - 0.5) > 0.5 + restitution.expanded
    else:
        return None
    if not is_other:
        return None
    near = [
        (abs(math.log(ratio**2 / (low * high))), text)
        for slip, text in SLIPS.items()
        for ratio in (slip, 1.0 / slip)
        if (1.0 - NEAR_SLIP) * low < ratio < (1.0 + NEAR_SLIP) * high
    ]
    why = "the sensitivity of a sensor, a mass, or that speed"
    if near:
        why = min(near)[1] + (f", or {why}" if low < high else "")
    shown = f"{low:.3g}" if low == high else f"{low:.2g} to {high:.2g}"
    return Note(
        Subject.IMPACT_SPEED,
        f"by the traces the impact speed is {shown} times the {100.0 * stated:.4g} cm/s that are"
        f" {speed_is}: {why}",
    )
