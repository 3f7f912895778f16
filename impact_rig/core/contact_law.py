"""The contact law of a sample, from the shape of the hammer's pulse."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache

import numpy as np

from impact_rig.core.errors import NotDeterminedError, RigError
from impact_rig.core.filtering import Chain
from impact_rig.core.hits import MeanHit
from impact_rig.core.identification import compute_raw_noise, find_largest_residual
from impact_rig.core.law_pulses import LIMITS as TABLES
from impact_rig.core.law_pulses import LOSSES, LossForm, compute_pulses
from impact_rig.core.momenta import find_odd_hits, name_hits
from impact_rig.core.pulse_shape import (
    Evaluation,
    PulseWindow,
    WindowFit,
    compute_unexplained,
    cut_window,
    fit_shapes,
    fit_window,
)
from impact_rig.core.pulse_width import PulseWidth, measure_pulse
from impact_rig.core.pulses import VERSED_SINE
from impact_rig.core.quantity import INTERNAL, UNKNOWN, Comparable, Quantity, describe
from impact_rig.core.records import FloatArray, make_read_only
from impact_rig.core.sensors import Sensor
from impact_rig.core.setup import RigSetup
from impact_rig.core.tail import ZERO_AFTER, compute_share
from impact_rig.core.trends import follow_series
from impact_rig.core.uncertainty import (
    LEAST_HITS,
    RigNumbers,
    Source,
    list_variances,
    make_quantity,
    make_rig_numbers,
)

COUNT = 6
START, TIME, HEIGHT, OFFSET, LOSS, EXPONENT = range(COUNT)
"""Places of the parameters; the last one is not varied where it is given."""


@dataclass(frozen=True)
class Limits:
    """Of the fit, and of what is said of it; all are our choices."""

    possible: float = 4.5  # [-] of what the best form leaves: a loss δ δ' leaves 4.3 times
    as_well: float = 1.1  # [-] the same: 10 in BIC of some 50 points, Kass and Raftery 1995
    step: float = 1e-4  # [-] of n and B, relative of what else there is, for derivatives
    finest: float = 1.0 / 64.0  # [w50] over which the force is averaged
    margins: tuple[float, float] = (1.0, 1.5)  # [w50] before and behind a tenth of the peak
    starting_exponents: tuple[float, ...] = (1.0, 1.5, 2.2, 2.8)  # n [-]
    starting_losses: tuple[float, ...] = (0.05, 0.2, 0.4, 0.6, 0.8, 0.95)  # [-] of the largest B
    points: float = 6.0  # [-] in w50: a dozen in the contact for six parameters


LIMITS = Limits()


_SHAPE_TIMES = np.linspace(-1.2, 1.5, 55)
"""Where starts are compared with a window [w50]."""


@lru_cache(maxsize=4)
def _tabulate_starts(exponents: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
    """Return parameters of pulses of all forms, and their shapes at `_SHAPE_TIMES`.

    Each is of the window's width, middle and peak; shapes (forms, starts, ...).
    """
    pairs = [(n, part) for n in exponents for part in LIMITS.starting_losses]
    exponent = np.array([[n for n, _ in pairs] for _ in LOSSES]).ravel()
    loss = np.array([[part * most for _, part in pairs] for _, most in LOSSES.values()]).ravel()
    pulses = compute_pulses(exponent, loss, *LOSSES)
    time = pulses.duration[:, np.newaxis] * np.linspace(0.0, 1.0, 257)
    force = pulses.compute_force(time)
    peak = force.max(axis=1)
    is_high = force > peak[:, np.newaxis] / 2.0
    first, last = (np.nanquantile(np.where(is_high, time, np.nan), end, axis=1) for end in (0, 1))
    width, middle = last - first, (first + last) / 2.0
    starts = np.stack(
        (-middle / width, 1.0 / width, 1.0 / peak, 0.0 * loss, loss, exponent), axis=1
    )
    shapes = pulses.compute_force(middle[:, np.newaxis] + width[:, np.newaxis] * _SHAPE_TIMES)
    shapes /= peak[:, np.newaxis]
    split = len(LOSSES), len(pairs), -1
    return make_read_only(starts.reshape(split)), make_read_only(shapes.reshape(split))


def _find_starts(window: PulseWindow, exponent: float | None) -> FloatArray:
    """Return where to begin with each form: at the nearest of some pulses, shape (forms, 6).

    From a loss that is far off, some searches end at a pulse without loss.
    """
    starts, shapes = _tabulate_starts(
        LIMITS.starting_exponents if exponent is None else (exponent,)
    )
    measured = np.interp(_SHAPE_TIMES, window.time, window.measured)
    nearest = np.argmin(np.sum((shapes - measured) ** 2, axis=-1), axis=1)
    return np.asarray(starts[np.arange(len(starts)), nearest])


def evaluate_laws(window: PulseWindow, parameters: FloatArray, *forms: LossForm) -> Evaluation:
    """Return fitted minus measured, and its derivatives in the parameters; as many of each form.

    The force is averaged over a point of the model's, from its impulse: it may jump, and what is
    fitted must not go in steps when the start moves from one point to the next.
    """
    start, time, height, offset, loss, exponent = parameters.T[..., np.newaxis]
    more = LIMITS.step
    pulses = compute_pulses(
        (exponent + np.array([0.0, 0.0, more])).ravel(),
        (loss + np.array([0.0, more, 0.0])).ravel(),
        *forms,
    )
    spacing = window.model_time[1] - window.model_time[0]
    reach = min(spacing, LIMITS.finest) / 2.0
    ends = start + time * pulses.duration.reshape(-1, 3)
    part = window.find_part(float(start.min()) - reach, float(ends.max()) + reach)
    shown_time = window.model_time[part]
    # Fine points have their edges in common.
    last = shown_time[-1:] if spacing <= LIMITS.finest else shown_time
    edges = np.concatenate((shown_time - reach, last + reach))
    impulse = pulses.compute_impulse(np.repeat((edges - start) / time, 3, axis=0))
    impulse = impulse.reshape(len(parameters), 3, -1)
    force = impulse[..., -shown_time.size :] - impulse[..., : shown_time.size]
    force *= (time / (2.0 * reach))[..., np.newaxis]
    rows = np.zeros((len(parameters), COUNT, shown_time.size))
    rows[:, START] = -height * np.gradient(force[:, 0], spacing, axis=1)
    rows[:, TIME] = rows[:, START] * (shown_time - start) / time
    rows[:, HEIGHT] = force[:, 0]
    rows[:, LOSS:] = (height / more)[..., np.newaxis] * (force[:, 1:] - force[:, :1])
    shown = window.show(rows, part)
    shown[:, OFFSET] = 1.0
    return height * shown[:, HEIGHT] + offset - window.measured, shown


def fit_forms(
    window: PulseWindow, exponent: float | None, noise: float
) -> dict[LossForm, WindowFit]:
    """Return the fits of all forms that are possible, the one that is taken first.

    A loss between two forms leaves some of the pulse in both, up to `LIMITS.possible` times as
    much in one as in the other: so far every form is possible, beside the best.

    Parameters
    ----------
    exponent : float or None
        n where it is given [-].
    noise : float
        Of the trace, over the peak [-].
    """
    forms = np.array(list(LOSSES))
    bounds = np.empty((2, len(LOSSES), COUNT))
    bounds[0], bounds[1] = -np.inf, np.inf
    # T over w50: no pulse of the family is so wide.
    bounds[0, :, TIME] = 0.05
    bounds[..., LOSS] = np.transpose(list(LOSSES.values()))
    bounds[..., EXPONENT] = (
        [[limit] for limit in TABLES.exponents] if exponent is None else exponent
    )
    each = fit_window(
        window,
        lambda parameters, which: evaluate_laws(window, parameters, *forms[which]),
        _find_starts(window, exponent),
        bounds,
        most=2.0 * LIMITS.possible,
    )
    exponents, losses = np.array([fit.parameters for fit in each]).T[[EXPONENT, LOSS]]
    restitutions = compute_pulses(exponents, losses, *LOSSES).restitution
    best = min(each, key=lambda fit: (not fit.is_inside, fit.residual))
    # The tables of pulses tell no difference below 1e-5 of the peak.
    as_well = LIMITS.as_well * max(best.residual, 1e-5)
    # Noise alone leaves half its own square and more.
    misfit = math.sqrt(max(best.residual**2 - noise**2 / 2.0, 0.0))
    limit = max(math.hypot(LIMITS.possible * misfit, noise), as_well)
    possible = {
        form: fit
        for form, fit in zip(LOSSES, each, strict=True)
        if fit is best or (fit.is_inside and fit.residual < limit)
    }
    taken = next(form for form, fit in possible.items() if fit.residual <= as_well)
    # Free bodies gain no energy; the fit itself may be wrong by 1e-3.
    gaining = {form for form, e in zip(LOSSES, restitutions, strict=True) if e > 1.0 + 1e-3}
    others = {form: fit for form, fit in possible.items() if form not in gaining | {taken}}
    return {taken: possible[taken], **others}


@dataclass(frozen=True)
class ContactLaw(Comparable):
    """The law of one contact and what follows from it; not known: see the notes."""

    # n [-]: 3/2 is Hertz, 1 a linear spring
    exponent: Quantity = field(default=UNKNOWN, metadata=describe("", "n", "exponent"))
    # N/m^n, the k of k δⁿ
    stiffness: Quantity = field(default=UNKNOWN, metadata=describe("N/m^n", "k", "stiffness"))
    # alpha [s/m] of a loss k alpha δⁿ δ'
    damping: Quantity = field(default=UNKNOWN, metadata=describe("s/m", "alpha", "damping"))
    # of the bodies towards each other at first touch, v [m/s]
    impact_speed: Quantity = field(
        default=UNKNOWN, metadata=describe("m/s", "v", "impact speed", shown="cm/s")
    )
    # from first touch to separation [s]
    duration: Quantity = field(
        default=UNKNOWN, metadata=describe("s", "τ", "contact duration", shown="µs")
    )
    # speed of separation over impact speed, e [-]
    restitution: Quantity = field(default=UNKNOWN, metadata=describe("", "e", "restitution"))
    # largest, N
    peak_force: Quantity = field(default=UNKNOWN, metadata=describe("N", "F", "peak force"))
    # largest approach of the bodies after first touch [m]
    peak_indentation: Quantity = field(
        default=UNKNOWN, metadata=describe("m", "δ", "peak indentation", shown="µm")
    )
    # [N s]
    impulse: Quantity = field(
        default=UNKNOWN, metadata=describe("N s", "J", "impulse", shown="mN s")
    )
    # in J
    energy_loss: Quantity = field(
        default=UNKNOWN, metadata=describe("J", "ΔE", "energy lost", shown="µJ")
    )
    # of the linear spring with this duration between these masses [N/m]
    equivalent_stiffness: Quantity = field(
        default=UNKNOWN, metadata=describe("N/m", "k_lin", "linear stiffness", shown="MN/m")
    )
    form: str = ""  # of the loss, of `LossForm`
    loss: float = math.nan  # B of `impact_rig.core.law_pulses` [-]
    residual_percent: float = math.nan  # RMS of what the best law leaves, over the peak [%]
    notes: tuple[str, ...] = ()  # what is not determined, and why; what is not told apart
    # Of the relative errors of `SCALED`, by sources that no other sample has: masses and clock,
    # which all share, change no exponent; pairs of a source and an array of shape (4, 4).
    own_covariances: tuple[tuple[Source, FloatArray], ...] = field(
        default=(), compare=False, repr=False, metadata=INTERNAL
    )
    warnings: tuple[str, ...] = field(default=(), metadata=INTERNAL)
    separation: float = field(default=0.0, metadata=INTERNAL)  # from the pulse's middle [s]
    excludes_versed_sine: bool = field(default=False, metadata=INTERNAL)  # the data allow none

    @property
    def is_known(self) -> bool:
        """Whether a law describes the contact."""
        return self.duration.is_known


NO_LAW = ContactLaw()
"""Where it is not determined."""
_QUANTITIES = tuple(item.name for item in fields(ContactLaw) if item.type is Quantity)
"""What follows from the hammer's trace alone, in the order of `_describe_law`."""

LIKE_CONTACT = "no law of contact describes the pulse"
CRUSHED = "; the pulse falls faster than it rises, as of a body that is crushed"
SCALED = ("impact_speed", "duration", "peak_force", "restitution")
"""What goes with the impact speed, itself first."""


def estimate_contact_law(mean: MeanHit, setup: RigSetup, sample: str) -> ContactLaw:
    """Estimate the contact law of one sample from its mean hit.

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
    pulse = measure_pulse(mean.traces[0])
    width, peak = pulse.half_amplitude_width, abs(pulse.peak)
    if width < LIMITS.points:
        raise NotDeterminedError(
            f"contact law: {width:.2g} points in the pulse's width at half amplitude do not tell"
            f" it, {LIMITS.points:g} may; sample faster"
        )
    chain = setup.find_chains(mean.sampling_rate)[0]
    window = cut_window(mean.traces[0], pulse, chain, LIMITS.margins)
    correlation = chain.correlate_noise(window.step)
    correlation = correlation[correlation.size // 2 :]
    noise = float(compute_raw_noise(mean)[0]) * math.sqrt(correlation[0]) / peak
    fits = fit_forms(window, exponent, noise)
    form, fit = next(iter(fits.items()))
    scatter, leaves = _compute_scatter(mean, fit, window, pulse.peak)
    without = ContactLaw(
        residual_percent=100.0 * fit.residual,
        warnings=_check_hits(mean, leaves),
    )
    is_worse, excludes_versed_sine = _compare_with_versed_sine(fit, window)
    changes = _change_sensor(mean, pulse, (form, fit), setup.find_sensor("hammer"), chain)
    largest = find_largest_residual(noise)
    largest += 2.0 * max((fit.find_rest(change) for _, change in changes), default=0.0)
    reason = _find_misfit(form, fit, largest, is_worse=is_worse)
    if reason is not None:
        return replace(without, notes=(reason,))
    scales = np.array([1.0, width / mean.sampling_rate, peak, 1.0, 1.0, 1.0])
    unit = fit.compute_covariance(correlation / correlation[0])
    # Anything of that size, in the worst direction: no noise, so that it does not average out.
    left = compute_unexplained(fit.residual, noise) ** 2 * fit.fitted.size / 3.0
    sources = [
        (f"scatter of the hits on {sample}", scatter / mean.count, len(mean.hits) - 1.0)
        if scatter is not None
        else ("noise", noise**2 * unit, math.inf),
        ("what the contact law leaves", left * fit.compute_covariance(np.ones(1)), math.inf),
    ]
    if mean.zero_uncertainty[0]:
        moved = _move_step(mean, pulse)[window.points] / pulse.peak
        change = fit.project(moved)
        sources.append((ZERO_AFTER, np.outer(change, change), math.inf))
    sources += [
        (source, np.outer(fit.project(change), fit.project(change)), math.inf)
        for source, change in changes
    ]
    points = [(one, each.parameters * scales) for one, each in fits.items()]
    quantities, own = _compute_quantities(points, np.diag(scales), sources, masses)
    restitution = quantities["restitution"]
    # The fit itself may be wrong by 1e-3.
    if restitution.value - 1.0 > max(restitution.expanded, 1e-3):
        reason = (
            f"{LIKE_CONTACT}: e would be {restitution.value:.3f} ± {restitution.expanded:.3f},"
            f" above 1, and free bodies gain no energy{CRUSHED}"
        )
        return replace(without, notes=(reason,))
    touch = pulse.middle + width * float(fit.parameters[START])
    return ContactLaw(
        **quantities,
        residual_percent=without.residual_percent,
        form=form.value,
        loss=float(fit.parameters[LOSS]),
        own_covariances=own,
        separation=(touch - pulse.middle) / mean.sampling_rate + quantities["duration"].value,
        notes=_list_notes(exponent, masses, fits),
        warnings=without.warnings + _check_rest(fit.residual, noise),
        excludes_versed_sine=excludes_versed_sine,
    )


def _find_misfit(form: LossForm, fit: WindowFit, largest: float, *, is_worse: bool) -> str | None:
    """Say why no law describes the pulse; None: one does.

    Parameters
    ----------
    largest : float
        What may be left of the pulse, over its peak [-].
    is_worse : bool
        The law leaves more than a versed-sine does, chance apart.
    """
    loss, exponent = fit.parameters[LOSS:, np.newaxis]
    e = compute_pulses(exponent, loss, form).restitution[0]
    crushed = CRUSHED if e > 1.0 + 0.01 else ""
    if not fit.is_inside:
        return f"{LIKE_CONTACT}: no fit ends{crushed}"
    if fit.residual > largest:
        return (
            f"{LIKE_CONTACT}: the best leaves {100.0 * fit.residual:.2g} % of the peak, where"
            f" noise and sensor explain {100.0 * largest:.2g} %{crushed}"
        )
    if is_worse:
        return f"{LIKE_CONTACT}: a versed-sine comes nearer to it than the best of them"
    return None


def _check_rest(residual: float, noise: float) -> tuple[str, ...]:
    """Warn that the law leaves more than noise, both over the peak [-]."""
    if not compute_unexplained(residual, noise) > 0.0 < noise:
        return ()
    warning = (
        f"the contact law leaves {100.0 * residual:.2g} % of the peak, where noise is"
        f" {100.0 * noise:.2g} %: the contact is not quite of this law, and duration, e, impact"
        " speed and energy may be farther off than their ±"
    )
    return (warning,)


def look_at_law(mean: MeanHit, setup: RigSetup, sample: str) -> ContactLaw:
    """Return the law of a mean hit on `sample`; where it is not determined, its notes say why."""
    try:
        return estimate_contact_law(mean, setup, sample)
    except RigError as error:
        return replace(NO_LAW, notes=(str(error),))


def _change_sensor(
    mean: MeanHit,
    pulse: PulseWidth,
    law: tuple[LossForm, WindowFit],
    sensor: Sensor,
    chain: Chain,
) -> list[tuple[str, FloatArray]]:
    """Return what a standard uncertainty of the hammer's sensor does to the fitted trace."""
    changes = []
    for name, standard in (
        ("resonance", sensor.resonance_uncertainty),
        ("low_corner", sensor.low_corner_uncertainty),
        ("upper_corner", sensor.upper_corner_uncertainty),
    ):
        stated = getattr(chain.response, name)
        if stated and standard:
            response = replace(chain.response, **{name: stated + standard})
            other = replace(chain, response=response)
            window = cut_window(mean.traces[0], pulse, other, LIMITS.margins)
            residual, _ = evaluate_laws(window, law[1].parameters[np.newaxis], law[0])
            what = f"{name.replace('_', ' ')} of the hammer's sensor"
            changes.append((what, window.measured + residual[0] - law[1].fitted))
    return changes


def _compare_with_versed_sine(law: WindowFit, window: PulseWindow) -> tuple[bool, bool]:
    """Return whether a versed-sine comes nearer than the law, and whether the data exclude it.

    On the pulse alone: ringing behind it belongs to neither.
    """
    part = window.find_pulse()
    (versed,) = fit_shapes(window.cut(part), [VERSED_SINE])
    left = law.fitted[part] - window.measured[part]
    ours = math.sqrt(left @ left / (left.size - COUNT))
    # A versed-sine leaves 0.006 of a Hertz contact.
    is_excluded = versed.residual > max(LIMITS.as_well * ours, 0.003)
    return ours > LIMITS.as_well * versed.residual, is_excluded


def _compute_scatter(
    mean: MeanHit, fit: WindowFit, window: PulseWindow, peak: float
) -> tuple[FloatArray | None, FloatArray]:
    """Return the parameters' covariance over the hits, and each hit's residual in peak.

    The covariance is linear about the mean's parameters, and None for a single hit.
    """
    if len(mean.hits) < LEAST_HITS:
        return None, np.zeros(1)
    cuts = [hit[0, window.points] / peak - window.measured for hit in mean.cut_hits()]
    changes = np.stack(cuts, axis=1)
    moved = fit.project(changes)
    left = changes - fit.jacobian.T @ moved
    return np.asarray(np.cov(moved)), np.asarray(left.std(axis=0))


def _check_hits(mean: MeanHit, leaves: FloatArray) -> tuple[str, ...]:
    """Warn of hits whose pulse is of another contact than the others'."""
    # A hundredth of the peak more than the others leave.
    odd = find_odd_hits(mean, leaves, 0.01)
    if not odd:
        return ()
    return (f"the pulse of {name_hits(odd)} is of another contact than the others': look at it",)


def _move_step(mean: MeanHit, pulse: PulseWidth) -> FloatArray:
    """Return what changes if the step of the zero came at once, and not with the momentum.

    One standard uncertainty of the zero under the pulse, of 1 / sqrt(12) of the step, is between
    the two, evenly distributed [m/s^2].
    """
    at_once = np.arange(mean.traces.shape[1]) > pulse.middle
    standard = float(mean.zero_uncertainty[0])
    return 2.0 * standard * (compute_share(mean.traces[0], pulse) - at_once)


def _compute_quantities(
    points: Sequence[tuple[LossForm, FloatArray]],
    scales: FloatArray,
    sources: Sequence[tuple[str, FloatArray, float]],
    masses: RigNumbers,
) -> tuple[dict[str, Quantity], tuple[tuple[Source, FloatArray], ...]]:
    """Return the law's quantities, with uncertainties to first order, and `own_covariances`.

    Parameters
    ----------
    points : sequence of (LossForm, ndarray of shape (6,))
        Forms that describe the pulse, and their parameters in SI units; the best first.
    scales : ndarray, shape (6, 6)
        Of the parameters in the window's units, diagonal.
    sources : sequence of tuple
        What may be wrong with those: its name, covariance of shape (6, 6), degrees of freedom.
    """
    bodies = (masses.hammer_mass, masses.moving_mass)
    known = [body.x for body in bodies]
    form, point = points[0][0], np.append(points[0][1], known)
    # Each of those that the quantities follow from moved a little, and none.
    steps = LIMITS.step * np.where(np.isin(np.arange(point.size), (EXPONENT, LOSS)), 1.0, point)
    steps[[START, OFFSET]] = 1.0
    found = _describe_laws(form, np.concatenate((point[np.newaxis], point + np.diag(steps))))
    values, slopes = found[0], np.nan_to_num((found[1:] - found[0]).T / steps)
    effect = slopes[:, :COUNT] @ scales
    parts = [
        (Source(source, freedom), np.sum((effect @ covariance) * effect, axis=1))
        for source, covariance, freedom in sources
    ]
    others = [_describe_laws(*one[:1], np.append(one[1], known)[None])[0] for one in points[1:]]
    if others:
        # Anywhere between the best and the farthest, evenly distributed.
        spread = np.abs(np.nan_to_num(np.array(others) - values)).max(axis=0)
        parts.append((Source("form of the loss"), spread**2 / 3.0))
    inputs = [(TIME, float(point[TIME]), masses.clock)]
    inputs += [(HEIGHT, float(point[HEIGHT]), masses.gains[0])]
    inputs += [
        (place, 1.0, body)
        for place, body in enumerate(bodies, start=COUNT)
        if math.isfinite(body.x)
    ]
    for place, factor, body in inputs:
        squares = (factor * slopes[:, place]) ** 2
        parts += [(source, share * squares) for source, share in list_variances(body).items()]
    quantities = {
        _QUANTITIES[row]: make_quantity(
            float(values[row]), {source: float(part[row]) for source, part in parts}
        )
        for row in np.flatnonzero(np.isfinite(values))
    }
    rows = [_QUANTITIES.index(name) for name in SCALED]
    relative = effect[rows] / values[rows, np.newaxis]
    own = tuple(
        (Source(source, freedom), relative @ covariance @ relative.T)
        for source, covariance, freedom in sources
    )
    return quantities, own


def _describe_laws(form: LossForm, points: FloatArray) -> FloatArray:
    """Return the law's quantities in their order, shape (k, 11).

    Parameters
    ----------
    points : ndarray, shape (k, 8)
        Parameters and masses of each law, in SI units.
    """
    _, time, height, _, loss, exponent, hammer, sample = points.T
    pulses = compute_pulses(exponent, loss, form)
    duration, restitution = time * pulses.duration, pulses.restitution
    both = hammer * sample / (hammer + sample)
    speed = height * time * hammer / both
    return np.stack(
        [
            exponent,
            both / (time ** (exponent + 1.0) * speed ** (exponent - 1.0)),
            loss / speed * (1.0 if form is LossForm.PROPORTIONAL else math.nan),
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


def _list_notes(
    exponent: float | None, masses: RigNumbers, forms: Iterable[LossForm]
) -> tuple[str, ...]:
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
    possible = ", ".join(form.value for form in forms)
    if ", " in possible:
        notes.append(f"the pulse does not tell apart the forms of loss {possible}")
    return tuple(notes)
