"""The contact law of a sample, from the shape of the hammer's pulses."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from impact_rig.core.estimates.damping import SMALLEST_SIGNAL, fit_decay
from impact_rig.core.estimates.law_fit import (
    COUNT,
    EXPONENT,
    HEIGHT,
    LOSS,
    NEAREST,
    OFFSET,
    PULL,
    START,
    TIME,
    FittedLoss,
    Noise,
    evaluate_laws,
    fit_losses,
    fit_models,
    weigh_losses,
)
from impact_rig.core.estimates.law_pulses import LossForm, compute_pulses, find_places
from impact_rig.core.estimates.pulse_shape import (
    PulseWindow,
    WindowFit,
    compute_unexplained,
    cut_window,
    fit_shapes,
)
from impact_rig.core.estimates.uncertainty import (
    LEAST_HITS,
    RigNumbers,
    Source,
    list_variances,
    make_quantity,
    make_rig_numbers,
)
from impact_rig.core.given.errors import NotDeterminedError, RigError
from impact_rig.core.given.filtering import Chain
from impact_rig.core.given.findings import Note, Subject
from impact_rig.core.given.quantity import (
    INTERNAL,
    NOT_NEGATIVE,
    POSITIVE,
    Comparable,
    Quantity,
    describe,
    quantity_field,
)
from impact_rig.core.given.records import FloatArray
from impact_rig.core.given.sensors import Sensor, SensorResponse
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.momenta import Hold
from impact_rig.core.hit.pulse_width import ZERO_AFTER, PulseWidth, measure_pulse
from impact_rig.core.hit.pulses import VERSED_SINE
from impact_rig.core.hit.tail import compute_share
from impact_rig.core.mean.mean_hit import MeanHit, follow_mean
from impact_rig.core.mean.trends import check_hits, follow_series

FEWEST_POINTS = 6
"""In w50 [-], our choice: a dozen in the contact for six parameters."""
OPPOSED_POINTS = 100
"""In w50 [-], our choice: from there on two losses of opposite sign are distinguished."""
MARGINS = (1.0, 1.5)
"""Before and behind a tenth of the peak [w50], our choice."""
NEARER = 1.1
"""How much less a better model leaves [-], our choice: 10 in BIC of some 50 points (Kass and
Raftery 1995)."""
MUCH_NEARER = 2.0
"""The same where the better one is beyond the tables [-], our choice."""
STEP = 1e-4
"""Step of n and B for derivatives [-], our choice."""
GAIN = 1e-3
"""By which e may exceed 1 [-], our choice: the fit itself may be wrong by so much."""
SMALL_PART = 0.15
"""Probability below which a form of loss is not named [-], our choice."""
TERM = 1.0 / 7.0
"""How probable a second term is before the pulse is seen, over one [-]: that of Bayes' information
criterion with some 50 points (Kass and Raftery 1995)."""
RINGING = 0.01
"""Standard uncertainty of a resonance that is found behind a pulse, over it [-], our choice."""
UNSTATED = "; state resonance and upper_corner of the hammer's sensor, if it may be that"
LARGEST_LOST = 0.01
"""Of J that a support may take within the contact, by the sample's part of the approach [-], our
choice: by so much v is off."""

LARGEST_PLAIN = 100.0
"""Of n, e and the losses [-], our choice: far above those of any contact."""
PLAIN = describe(least=-LARGEST_PLAIN, most=LARGEST_PLAIN)
"""Metadata of a loss."""


@dataclass(frozen=True)
class ContactLaw(Comparable):
    """The law of one contact and what follows from it; not known: see the notes."""

    # n [-]: 3/2 is Hertz, 1 a linear spring
    exponent: Quantity = quantity_field("", "n", "exponent", least=POSITIVE, most=LARGEST_PLAIN)
    # N/m^n, the k of k δⁿ
    stiffness: Quantity = quantity_field("N/m^n", "k", "stiffness")
    # alpha [s/m] of a loss k alpha δⁿ δ'
    damping: Quantity = quantity_field("s/m", "alpha", "damping")
    # of the bodies towards each other at first touch, v [m/s]
    impact_speed: Quantity = quantity_field("m/s", "v", "impact speed", shown="cm/s")
    # from first touch to separation [s]
    duration: Quantity = quantity_field("s", "τ", "contact duration", shown="µs")
    # speed of separation over impact speed, e [-]
    restitution: Quantity = quantity_field("", "e", "restitution", least=0.0, most=LARGEST_PLAIN)
    # largest, N
    peak_force: Quantity = quantity_field("N", "F", "peak force")
    # largest approach of the bodies after first touch [m]
    peak_indentation: Quantity = quantity_field("m", "δ", "peak indentation", shown="µm")
    # [N s]
    impulse: Quantity = quantity_field("N s", "J", "impulse", shown="mN s")
    # in J
    energy_loss: Quantity = quantity_field("J", "ΔE", "energy lost", shown="µJ")
    # of the linear spring with this duration between these masses [N/m]
    equivalent_stiffness: Quantity = quantity_field(
        "N/m", "k_eq", "linear stiffness", shown="MN/m"
    )
    form: str = ""  # of the loss, of `LossForm`
    # [-] of `impact_rig.core.estimates.law_pulses`
    loss: float = field(default=math.nan, metadata=PLAIN)
    pull: float = field(default=math.nan, metadata=PLAIN)
    # RMS of what the best law leaves, over the peak [%]
    residual_percent: float = field(default=math.nan, metadata=NOT_NEGATIVE)
    notes: tuple[Note, ...] = ()  # what is not determined, or not distinguished, and why
    # Of the relative errors of `SCALED`, by sources that no other sample has: masses and clock,
    # which all share, change no exponent; pairs of a source and an array of shape (4, 4).
    own_covariances: tuple[tuple[Source, FloatArray], ...] = field(
        default=(), compare=False, repr=False, metadata=INTERNAL
    )
    warnings: tuple[Note, ...] = field(default=(), metadata=INTERNAL)
    separation: float = field(default=0.0, metadata=INTERNAL)  # from the pulse's middle [s]
    excludes_versed_sine: bool = field(default=False, metadata=INTERNAL)  # the data allow none

    @property
    def is_known(self) -> bool:
        """Whether a law describes the contact."""
        return self.duration.is_known


NO_LAW = ContactLaw()
"""Where it is not determined."""
_QUANTITIES = tuple(item.name for item in fields(ContactLaw) if item.type is Quantity)
"""Results of the hammer's trace alone, in the order of `_describe_law`."""

LIKE_CONTACT = "no law of contact describes the pulse"
CRUSHED = "; the pulse falls faster than it rises, as of a body that is crushed"
SCALED = ("impact_speed", "duration", "peak_force", "restitution")
"""Results that depend on the impact speed, itself first."""


def estimate_contact_law(mean: MeanHit, setup: RigSetup, sample: str) -> ContactLaw:
    """Estimate the contact law of one sample, hit by hit.

    Of one hit or more: type A is the scatter of the hits, or of one hit its noise. Without a mass
    duration, e and n are known, with the hammer's also force and impulse.

    Raises
    ------
    NotDeterminedError
        If the pulse has too few points, or does not come down on both sides.
    SignalError
        If there is no pulse.
    """
    masses = make_rig_numbers(setup, sample).follow(follow_series(mean))
    exponent = setup.analysis.contact_exponent or None
    chain = setup.find_chains(mean.sampling_rate)[0]
    without = ContactLaw(warnings=_check_pulses(mean))
    reason = _find_support(mean, setup, sample)
    if reason is not None:
        return replace(without, notes=(Note(Subject.CONTACT_LAW, reason),))
    fits, sensor = _fit_law(mean, chain, exponent), setup.find_sensor("hammer")
    told: tuple[Note, ...] = ()
    for response in _find_resonance(mean, fits, chain):
        refitted = _fit_law(mean, replace(chain, response=response), exponent)
        if NEARER * refitted.residual < fits.residual:
            fits, chain = refitted, replace(chain, response=response)
            sensor = replace(sensor, resonance_uncertainty=RINGING * response.resonance)
            text = f"a sensor that rings at {response.resonance * 1e-3:.3g} kHz is found"
            told = (Note(Subject.CONTACT_LAW, text),)
    without = replace(without, residual_percent=100.0 * fits.residual)
    changes = _change_sensor(mean, fits, sensor, chain)
    is_worse, excludes_versed_sine = _compare_with_versed_sine(mean, chain, fits)
    help_needed = "" if chain.response.resonance and chain.response.upper_corner else UNSTATED
    reason = _find_misfit(fits, changes, help_needed, is_worse=is_worse)
    # By the impact speed e is right all the same.
    if reason is None and not (mean.impact_speeds.size or math.isfinite(setup.impact_speed)):
        reason = _find_relaxing(fits)
    if reason is not None:
        return replace(without, notes=(Note(Subject.CONTACT_LAW, reason),))
    scatter = Source(f"scatter of the hits on {sample}", max(len(fits.points) - 1.0, 1.0))
    quantities, own = _compute_quantities(
        fits, _list_sources(mean, fits, changes), masses, (scatter, mean.count)
    )
    e = quantities["restitution"]
    # Of contacts without loss one in ten exceeds 1 by so much.
    if e.value - 1.0 > max(1.25 * e.standard, GAIN):
        reason = (
            f"{LIKE_CONTACT}: e would be {e.value:.3f} ± {e.expanded:.3f}, above 1, and free"
            f" bodies gain no energy{CRUSHED}"
        )
        return replace(without, notes=(Note(Subject.CONTACT_LAW, reason),))
    touch = fits.unit * float(fits.points[:, START].mean())
    return ContactLaw(
        **quantities,
        residual_percent=without.residual_percent,
        form=fits.losses[fits.best].name,
        loss=float(fits.points[:, LOSS].mean()),
        pull=float(fits.points[:, PULL].mean()),
        own_covariances=own,
        separation=touch + quantities["duration"].value,
        notes=_list_notes(exponent, masses, fits) + told,
        warnings=without.warnings + _check_rest(fits, help_needed),
        excludes_versed_sine=excludes_versed_sine,
    )


@dataclass(frozen=True)
class _LawFits:
    """The models of the loss fitted to the mean pulse, and the best of them to every hit."""

    pulse: PulseWidth  # of the mean
    window: PulseWindow
    unit: float  # [s] of w50
    noise: Noise  # of the mean
    losses: list[FittedLoss]  # of the mean
    best: int  # of the losses
    restitution: float  # e of the mean by the best
    points: FloatArray  # (k, 7), parameters of the hits whose fit ended
    left: FloatArray  # (n,), what the best model leaves of all hits together, over the peak
    chances: FloatArray  # (losses,), how probable each is by what it leaves
    is_inside: bool  # of most hits a fit ended

    @property
    def fit(self) -> WindowFit:
        """Fit of the best model to the mean."""
        return self.losses[self.best].fit

    @property
    def scales(self) -> FloatArray:
        """Scales of the parameters: SI units over the window's."""
        return np.array([1.0, self.unit, abs(self.pulse.peak), 1.0, 1.0, 1.0, 1.0])

    @property
    def residual(self) -> float:
        """RMS of what the forms leave, over the peak [-]."""
        return math.sqrt(self.left @ self.left / (self.left.size - COUNT))

    @property
    def unexplained(self) -> float:
        """Residual beyond the noise, over the peak [-]."""
        points = self.left.size / float(
            2.0 * self.noise.correlation @ self.noise.correlation - 1.0
        )
        return compute_unexplained(self.residual, self.noise.level, points)

    @property
    def slow(self) -> float:
        """Residual beyond the noise, averaged over some of the pulse, over the peak [-]."""
        time = self.window.time
        # Over a quarter of w50, our choice: a sensor rings faster.
        count = round(0.25 * (time.size - 1) / (time[-1] - time[0]))
        weights = np.hanning(count + 2)[1:-1]
        left = np.convolve(self.left, weights / weights.sum(), "same")
        return compute_unexplained(float(np.std(left)), self.noise.level)


def _fit_law(mean: MeanHit, chain: Chain, exponent: float | None) -> _LawFits:
    pulse = measure_pulse(mean.traces[0])
    width, peak = pulse.half_amplitude_width, abs(pulse.peak)
    if width < FEWEST_POINTS:
        raise NotDeterminedError(
            f"{width:.2g} points in the pulse's width at half amplitude do not tell"
            f" it, {FEWEST_POINTS} may; sample faster"
        )
    window = cut_window(mean.traces[0], pulse, chain, MARGINS)
    correlation = chain.correlate_noise(window.step)
    correlation = correlation[correlation.size // 2 :]
    level = float(mean.compute_raw_noise()[0]) * math.sqrt(correlation[0]) / peak
    noise = Noise(level, correlation / correlation[0])
    losses = fit_losses(window, exponent, noise)
    before, restitution = _guess(losses, width)
    left = np.array([loss.fit.fitted - window.measured for loss in losses])
    chances = weigh_losses(left, before, noise)
    # One hit hardly tells how fast something relaxes: of two that are alike it is the other.
    share = [
        1.0 if loss.form is not LossForm.MEMORY else 0.5 * loss.fit.is_inside for loss in losses
    ]
    best = int(np.argmax(chances * share))
    hits, measured = _fit_hits(mean, window, pulse, losses[best], exponent)
    # Models differ of the mean as they do of each hit.
    pooled = np.mean([fit.fitted - trace for fit, trace in zip(hits, measured, strict=True)], 0)
    inside = [fit.parameters for fit in hits if fit.is_inside]
    return _LawFits(
        pulse=pulse,
        window=window,
        unit=width / mean.sampling_rate,
        noise=noise,
        losses=losses,
        best=best,
        restitution=restitution[best],
        points=np.array(inside or [fit.parameters for fit in hits]),
        left=pooled,
        chances=weigh_losses(pooled + left - left[best], before, noise),
        is_inside=losses[best].fit.is_inside and 2 * len(inside) > len(hits),
    )


def _guess(losses: Sequence[FittedLoss], width: float) -> tuple[FloatArray, FloatArray]:
    """Return how probable each model is before what it leaves is looked at, and its e."""
    exponent, loss, pull = np.array([item.fit.parameters for item in losses])[
        :, [EXPONENT, LOSS, PULL]
    ].T
    pulses = compute_pulses(exponent, loss, pull, find_places(item.form for item in losses))
    is_mixed = np.array([item.is_mixed for item in losses])
    # Each of two losses may be negative, as one that stands for a form between them.
    takes = (pulses.restitution <= 1.0 + GAIN) & (pulses.is_passive | ~is_mixed)
    # Of few points two that are opposed mend the corner at touch and release, and tell nothing.
    takes &= (np.minimum(loss, pull) >= 0.0) | (width >= OPPOSED_POINTS) | ~is_mixed
    takes &= [item.fit.is_inside for item in losses]
    residuals = np.where(takes, [item.fit.residual for item in losses], math.inf)
    # A plate is nearly what relaxes slowly, whose search between both may not end: it leaves this
    # much at most.
    if losses[int(np.argmin(residuals))].form is LossForm.PLATE:
        takes |= [item.form is LossForm.MEMORY for item in losses]
    # A loss that is left out counts only where all are left out.
    return np.where(takes, np.where(is_mixed, TERM, 1.0), 1e-30), pulses.restitution


def _fit_hits(
    mean: MeanHit,
    window: PulseWindow,
    pulse: PulseWidth,
    best: FittedLoss,
    exponent: float | None,
) -> tuple[list[WindowFit], FloatArray]:
    """Fit one model to every hit, from where it describes the mean; return their pulses, too."""
    if len(mean.hits) < LEAST_HITS:
        return [best.fit], window.measured[np.newaxis]
    measured = mean.read_hits(0, window.points) / pulse.peak
    pulses = np.array([(hit.pulse.half_amplitude_width, hit.pulse.peak) for hit in mean.hits])
    wider, higher = pulses.T / [[pulse.half_amplitude_width], [pulse.peak]]
    start = np.tile(best.fit.parameters, (len(measured), 1))
    start[:, [START, TIME]] *= wider[:, np.newaxis]
    start[:, HEIGHT] *= higher
    models = [(best.form, best.held)] * len(measured)
    return fit_models(window, measured, models, start, exponent), measured


def _check_pulses(mean: MeanHit) -> tuple[Note, ...]:
    """Warn of hits whose pulse is no mean pulse of another height, width, place and zero."""
    pulse = measure_pulse(mean.traces[0])
    reach = pulse.half_amplitude_width
    part = slice(max(int(pulse.rise - reach), 0), int(pulse.fall + reach) + 1)
    shape = mean.traces[0, part] / pulse.peak
    slope = np.gradient(shape)
    rows = np.stack((shape, slope, slope * np.arange(shape.size), np.ones(shape.size)))
    hits = mean.read_hits(0, part).reshape(-1, shape.size) / pulse.peak
    left = hits - hits @ np.linalg.pinv(rows) @ rows
    # A hundredth of the peak more than the others leave.
    told = "the pulse of {} is of another contact than the others': look at it"
    return check_hits(mean, left.std(axis=1), 0.01, told)


def _find_support(mean: MeanHit, setup: RigSetup, sample: str) -> str | None:
    """Say why the bodies are not free within the contact; None: they are, or it is not known."""
    found = follow_mean(mean, setup.find_chains(mean.sampling_rate))
    if found is None or found[-1].hold is not Hold.SPRING:
        return None
    lost, mass = found[-1].lost, setup.samples.get_moving_mass(sample)
    # The heavier the sample, the less of the approach is its own motion.
    if not lost * setup.hammer_mass / (setup.hammer_mass + mass) > LARGEST_LOST:
        return None
    return (
        f"the sample's support takes {lost:.2g} times the impulse within the contact, and a law of"
        " contact is that of two free bodies"
    )


def _find_misfit(
    fits: _LawFits, changes: Sequence[tuple[str, FloatArray]], help_needed: str, *, is_worse: bool
) -> str | None:
    """Return why no law describes the pulse; None: one does.

    Parameters
    ----------
    changes : sequence of (str, ndarray)
        What the hammer's sensor may change of the pulse, over its peak [-].
    help_needed : str
        What to state of the sensor, with a semicolon before; empty: nothing.
    is_worse : bool
        The law leaves more than a versed-sine does, chance apart.
    """
    crushed = CRUSHED if fits.restitution > 1.0 + 0.01 else ""
    if not fits.is_inside:
        return f"{LIKE_CONTACT}: no fit ends{crushed}"
    # What leaves more is another contact, an amplifier or an average with jitter; our choice.
    largest = 0.003
    largest += 2.0 * max((fits.fit.find_rest(change) for _, change in changes), default=0.0)
    if fits.slow > largest:
        return (
            f"{LIKE_CONTACT}: the best leaves {100.0 * fits.slow:.2g} % of the peak beyond the"
            f" noise, more slowly than a sensor rings, where {100.0 * largest:.2g} % may be left"
            f"{crushed}{help_needed}"
        )
    if is_worse:
        return f"{LIKE_CONTACT}: a versed-sine comes nearer to it than the best of them"
    return None


def _find_relaxing(fits: _LawFits) -> str | None:
    """Return that the contact relaxes more than the tables have it, if that comes much nearer."""
    (relaxing,) = (item.fit for item in fits.losses if item.form is LossForm.MEMORY)
    if relaxing.is_inside or MUCH_NEARER * relaxing.residual >= fits.fit.residual:
        return None
    return (
        f"{LIKE_CONTACT}: one that relaxes nearly altogether comes nearest, and of that the pulse"
        " does not tell e; state the impact speed"
    )


def _check_rest(fits: _LawFits, help_needed: str) -> tuple[Note, ...]:
    """Warn that the law leaves more than noise."""
    if not fits.unexplained > 0.0 < fits.noise.level:
        return ()
    warning = (
        f"the contact law leaves {100.0 * fits.residual:.2g} % of the peak, where noise is"
        f" {100.0 * fits.noise.level:.2g} %: the contact is not quite of this law, and every ± is"
        f" as wide as that makes it{help_needed}"
    )
    return (Note(Subject.CONTACT_LAW, warning),)


def look_at_law(mean: MeanHit, setup: RigSetup, sample: str) -> ContactLaw:
    """Return the law of a mean hit on `sample`; where it is not determined, its notes say why."""
    try:
        return estimate_contact_law(mean, setup, sample)
    except RigError as error:
        return replace(NO_LAW, notes=(Note(Subject.CONTACT_LAW, str(error)),))


def _change_sensor(
    mean: MeanHit, fits: _LawFits, sensor: Sensor, chain: Chain
) -> list[tuple[str, FloatArray]]:
    """Return the change of the fitted trace by a standard uncertainty of the hammer's sensor."""
    changes = []
    for name in ("resonance", "low_corner", "upper_corner"):
        stated, standard = getattr(chain.response, name), getattr(sensor, f"{name}_uncertainty")
        if stated and standard:
            response = replace(chain.response, **{name: stated + standard})
            other = replace(chain, response=response)
            window = cut_window(mean.traces[0], fits.pulse, other, MARGINS)
            residual, _ = evaluate_laws(
                window,
                window.measured,
                fits.fit.parameters[np.newaxis],
                find_places([fits.losses[fits.best].form]),
            )
            what = f"{name.replace('_', ' ')} of the hammer's sensor"
            changes.append((what, window.measured + residual[0] - fits.fit.fitted))
    return changes


def _find_resonance(mean: MeanHit, fits: _LawFits, chain: Chain) -> Iterator[SensorResponse]:
    """Yield the response with the resonance that rings behind the pulse, unless one is stated."""
    if chain.response.resonance or not (chain.cutoff_frequency and fits.unexplained):
        return
    tail = mean.traces[0, mean.origin + math.ceil(MARGINS[1] * fits.unit * mean.sampling_rate) :]
    # Hum and drift are slower.
    time = np.linspace(-1.0, 1.0, tail.size)
    tail = tail - np.polyval(np.polyfit(time, tail, 3), time)
    (decay, frequency), fit = fit_decay(tail, 0.0)
    natural = math.hypot(decay, frequency)
    seen = float(np.linalg.norm(fit.oscillation)) > SMALLEST_SIGNAL * mean.compute_raw_noise()[0]
    # Below half the low-pass it may be the hammer's own.
    if seen and decay > 0.0 and natural * chain.sampling_rate > math.pi * chain.cutoff_frequency:
        resonance = natural / (2.0 * math.pi) * chain.sampling_rate
        yield replace(chain.response, resonance=resonance, damping=decay / natural)


def _compare_with_versed_sine(mean: MeanHit, chain: Chain, fits: _LawFits) -> tuple[bool, bool]:
    """Return whether a versed-sine comes nearer than the law, and whether the data exclude it.

    On the pulse alone: ringing behind it belongs to neither.
    """
    window = cut_window(mean.traces[0], fits.pulse, chain)
    (versed,) = fit_shapes(window, [VERSED_SINE])
    part = slice(*np.searchsorted(fits.window.time, window.time[[0, -1]]))
    left = fits.fit.fitted[part] - fits.window.measured[part]
    ours = math.sqrt(left @ left / (left.size - COUNT))
    # A versed-sine leaves 0.006 of a Hertz contact.
    is_excluded = versed.residual > max(NEARER * ours, 0.003)
    return ours > NEARER * versed.residual, is_excluded


def _list_sources(
    mean: MeanHit, fits: _LawFits, changes: Sequence[tuple[str, FloatArray]]
) -> list[tuple[Source, FloatArray]]:
    """Return the fit's sources of error, and covariances of the parameters.

    Those of the hits' scatter are none: it is in what each hit gives.
    """
    fit, sources = fits.fit, list[tuple[Source, FloatArray]]()
    if len(mean.hits) < LEAST_HITS:
        unit = fit.compute_covariance(fits.noise.correlation)
        sources.append((Source("noise"), fits.noise.level**2 * unit))
    # Anything of that size, in the worst direction: no noise, so that it does not average out.
    left = (fits.unexplained**2 + NEAREST**2) * fit.fitted.size / 3.0
    sources.append(
        (Source("what the contact law leaves"), left * fit.compute_covariance(np.ones(1)))
    )
    if mean.zero_uncertainty[0]:
        moved = _move_step(mean, fits.pulse)[fits.window.points] / fits.pulse.peak
        changes = [(ZERO_AFTER, moved), *changes]
    for source, change in changes:
        moved = fit.project(change)
        sources.append((Source(source), np.outer(moved, moved)))
    return sources


def _move_step(mean: MeanHit, pulse: PulseWidth) -> FloatArray:
    """Return what changes if the step of the zero came at once, and not with the momentum.

    One standard uncertainty of the zero under the pulse, of 1 / sqrt(12) of the step, is between
    the two, evenly distributed [m/s^2].
    """
    at_once = np.arange(mean.traces.shape[1]) > pulse.middle
    standard = float(mean.zero_uncertainty[0])
    return 2.0 * standard * (compute_share(mean.traces[0], pulse) - at_once)


LOGARITHMIC = _QUANTITIES.index("stiffness")
"""Place of what is averaged by its logarithm: k, which goes by powers of ten with n."""


def _compute_quantities(
    fits: _LawFits,
    sources: Sequence[tuple[Source, FloatArray]],
    masses: RigNumbers,
    scatter: tuple[Source, int],
) -> tuple[dict[str, Quantity], tuple[tuple[Source, FloatArray], ...]]:
    """Return the law's quantities, with uncertainties to first order, and `own_covariances`.

    Parameters
    ----------
    sources : sequence of (Source, ndarray of shape (7, 7))
        What may be wrong with the parameters in the window's units: their covariances.
    scatter : (Source, int)
        Of the hits, and how many they stand for.
    """
    bodies = (masses.hammer_mass, masses.moving_mass)
    known = np.array([body.x for body in bodies])
    each = np.column_stack((fits.points * fits.scales, np.tile(known, (len(fits.points), 1))))
    middle = each.mean(axis=0)
    steps = STEP * np.where(np.isin(np.arange(middle.size), (EXPONENT, LOSS, PULL)), 1.0, middle)
    steps[[START, OFFSET]] = 1.0
    means = np.array([loss.fit.parameters for loss in fits.losses]) * fits.scales
    means = np.column_stack((means, np.tile(known, (len(means), 1))))
    ends = np.cumsum([len(each), 1, middle.size])
    hits, center, stepped, models = np.split(
        _describe_laws(
            np.concatenate((each, middle[np.newaxis], middle + np.diag(steps), means)),
            [fits.losses[fits.best]] * int(ends[-1]) + fits.losses,
        ),
        ends,
    )
    slopes = np.nan_to_num((stepped - center).T / steps)
    moves, chances = np.nan_to_num(models - models[fits.best]), fits.chances
    moved = chances @ moves
    values = hits.mean(axis=0) + moved
    effect = slopes[:, :COUNT] * fits.scales
    own = [(source, effect @ covariance @ effect.T) for source, covariance in sources]
    if len(hits) >= LEAST_HITS:
        own.append((scatter[0], np.cov(hits, rowvar=False) / scatter[1]))
    parts = [(source, np.diag(covariance)) for source, covariance in own]
    parts.append((Source("form of the loss"), chances @ (moves - moved) ** 2))
    inputs = [(TIME, middle[TIME], masses.clock), (HEIGHT, middle[HEIGHT], masses.gains[0])]
    inputs += [(place, 1.0, body) for place, body in enumerate(bodies, start=COUNT)]
    for place, factor, body in inputs:
        squares = (factor * slopes[:, place]) ** 2
        parts += [(source, share * squares) for source, share in list_variances(body).items()]
    # The logarithm's uncertainty is relative.
    unit = np.ones(values.size)
    values[LOGARITHMIC] = unit[LOGARITHMIC] = math.exp(values[LOGARITHMIC])
    quantities = {
        _QUANTITIES[row]: make_quantity(
            float(values[row]),
            {source: float(part[row] * unit[row] ** 2) for source, part in parts},
        )
        for row in np.flatnonzero(np.isfinite(values))
    }
    rows = [_QUANTITIES.index(name) for name in SCALED]
    size = np.outer(values[rows], values[rows])
    return quantities, tuple((source, part[np.ix_(rows, rows)] / size) for source, part in own)


def _describe_laws(points: FloatArray, losses: Sequence[FittedLoss]) -> FloatArray:
    """Return the law's quantities in their order, k by its logarithm, shape (k, 11).

    Parameters
    ----------
    points : ndarray, shape (k, 9)
        Parameters and masses of each law, in SI units.
    losses : sequence of FittedLoss
        The model of each.
    """
    _, time, height, _, loss, pull, exponent, hammer, sample = points.T
    pulses = compute_pulses(exponent, loss, pull, find_places(item.form for item in losses))
    is_proportional = [item.form is LossForm.PROPORTIONAL for item in losses]
    duration, restitution = time * pulses.duration, pulses.restitution
    both = hammer * sample / (hammer + sample)
    # A fit that ended without a pulse has no speed, and its k means nothing.
    speed = np.where(height > 0.0, height * time * hammer / both, math.nan)
    return np.stack(
        [
            exponent,
            np.log(both / (time ** (exponent + 1.0) * speed ** (exponent - 1.0))),
            np.where(is_proportional, pulses.losses.proportional / speed, math.nan),
            speed,
            duration,
            restitution,
            hammer * height * pulses.compute_peak_force(),
            speed * time * pulses.largest_compression,
            hammer * height * time * (1.0 + restitution),
            both * speed**2 * (1.0 - restitution**2) / 2.0,
            both * (math.pi / duration) ** 2,
        ],
        axis=1,
    )


def _list_notes(exponent: float | None, masses: RigNumbers, fits: _LawFits) -> tuple[Note, ...]:
    notes = []
    if exponent is not None:
        notes.append(f"n was given, {exponent:g}, not found")
    bodies = (("hammer", masses.hammer_mass), ("sample", masses.moving_mass))
    unknown = " and ".join(body for body, mass in bodies if math.isnan(mass.x))
    if unknown:
        notes.append(
            "stiffness, damping, impact speed, indentation and energy: the mass of"
            f" {unknown} is not known"
        )
    order = np.argsort(-fits.chances, kind="stable").tolist()
    possible = [fits.losses[place].name for place in order if fits.chances[place] > SMALL_PART]
    if len(possible) > 1:
        notes.append(f"the pulse does not distinguish the forms of loss {'; '.join(possible)}")
    best = fits.losses[fits.best]
    if best.form is LossForm.PLATE:
        notes.append(
            "what relaxes slowly has nearly the pulse of a plate, with a higher e than this: only"
            " a stated impact speed tells which it is"
        )
    if best.is_mixed:
        notes.append(
            f"no form of loss alone describes the pulse: two stand for it, {best.name}; if the"
            " contact loses energy by others, 1 - e may be off by a tenth, and noise hides that"
        )
    return tuple(Note(Subject.CONTACT_LAW, note) for note in notes)
