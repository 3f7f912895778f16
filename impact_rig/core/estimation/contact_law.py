"""The contact law F = k delta^n (1 + alpha delta') from the hammer's trace.

The law's pulse, sent through the low-pass of the trace, is fitted to the mean hammer pulse: its
start, its scale in time and in height, n, A = alpha v and an offset. With the masses, or without
them as far as that goes, everything else follows: see `impact_rig.core.model.contact_law`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from scipy.signal import find_peaks

from impact_rig.core.errors import NotDeterminedError, RigError
from impact_rig.core.estimation.law_fit import (
    COUNT,
    DAMPING,
    EXPONENT,
    HEIGHT,
    LARGEST_RESIDUAL,
    OFFSET,
    START,
    STEP,
    TIME,
    LawFit,
    fit_law,
)
from impact_rig.core.estimation.momenta import (
    check_hit_momenta,
    check_momenta,
    compare_momenta,
    compute_loop_energy,
    cut_contact,
    find_odd_hits,
    name_hits,
    restore_levels,
)
from impact_rig.core.estimation.pulse_shape import fit_pulse
from impact_rig.core.estimation.pulse_window import PulseWindow, cut_window
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.pulse_width import TENTH_LEVEL, PulseWidth, measure_pulse
from impact_rig.core.hits.zero import ZERO_AFTER, compute_share
from impact_rig.core.identification.fitting import compute_noise_correlation, compute_raw_noise
from impact_rig.core.model.contact_law import (
    compute_pulses,
)
from impact_rig.core.model.pulses import VERSED_SINE
from impact_rig.core.quantity import INTERNAL, UNKNOWN, Quantity, describe
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.signals.record import FloatArray
from impact_rig.core.uncertainty.propagation import RigNumbers, make_rig_numbers
from impact_rig.core.uncertainty.results import (
    list_variances,
    make_label,
    make_quantity,
)

MARGINS = (1.0, 1.5)
"""In the window before and behind where the pulse is at a tenth of its peak, in w50 [-], our
choice: without loss the foot behind takes 0.2 of it, at e = 0.5 all of it, and it tells duration
and e; baseline on both sides holds the offset, and a longer one would take in more of a hum."""
FEWEST_POINTS = 6
"""In the width at half amplitude [-], our choice: a dozen in the contact for six parameters."""
RESIDUAL_OVER_NOISE = 3.0
"""A fit that leaves more than `LARGEST_RESIDUAL` and so many times the noise [-] is no law of this
contact, our choice."""
LARGEST_VERSED_RESIDUAL = 0.003
"""What a versed-sine may leave of a pulse that a law describes better [-], our choice: of a Hertz
contact without loss it leaves 0.6 %."""
TELLING_CORRELATION = 0.95
"""Correlation of n and alpha from which it is mentioned [-], our choice: fixing one would make the
other three times as certain."""
LIKE_CONTACT = "no law k delta^n (1 + alpha delta') describes the contact"
SECOND_TOP = 0.05
"""Least height of a second top over the valley before it, over the peak [-], our choice."""
CRUSHED = 0.6
"""Fall over rise from which a pulse looks like a crush [-], our choice: losses make it longer than
1, and a low-pass nearer to it."""
LARGEST_RESTITUTION = 1.05
"""e from which a pulse is of no law [-], our choice: a crush that returns half of the energy makes
it 1.1, the asymmetry of the plant `published` 1.02."""
ELASTIC = 1e-3
"""What e may lie above 1 by the fit's own error [-], our choice: ten times that without noise."""
LEAST_HITS = 2
"""Hits that have a scatter [-]."""


@dataclass(frozen=True)
class ContactLaw:
    """The law of one contact and what follows from it; not known: see the notes.

    Attributes
    ----------
    exponent : Quantity
        n [-]: 3/2 is Hertz, 1 a linear spring.
    stiffness : Quantity
        k [N/m^n].
    damping : Quantity
        alpha [s/m].
    impact_speed : Quantity
        Of the bodies towards each other at first touch, v [m/s].
    duration : Quantity
        From first touch to separation [s].
    restitution : Quantity
        Speed of separation over impact speed e [-].
    peak_force : Quantity
        [N]
    peak_indentation : Quantity
        Largest approach of the bodies after first touch [m].
    impulse : Quantity
        [N s]
    energy_loss : Quantity
        [J]
    equivalent_stiffness : Quantity
        Of the linear spring with this duration between these masses [N/m].
    momentum_ratio : Quantity
        m2 dv2 / (m1 dv1) over the contact [-]: 1 for two free bodies and right gains.
    loop_energy : float
        Area of the loop of force over indentation, from both traces: the energy lost, found
        without the law but for its impact speed [J].
    residual_percent : float
        RMS of what the law leaves of the pulse, over the peak [%].
    correlation : float
        Of the errors of n and A = alpha v [-].
    notes : tuple of str
        What is not determined, and why; what the data do not tell apart.
    own_covariances : tuple of (str, ndarray of shape (4, 4))
        Of the relative errors of `SCALED`, by sources that no other sample has: masses and clock,
        which all share, change no exponent.
    warnings : tuple of str
        Which hits are not as the others, and momenta that do not balance.
    is_allowed : bool
        The data allow it: it leaves no more of the pulse than a versed-sine does, chance apart.
    excludes_versed_sine : bool
        The data allow it and no versed-sine.
    """

    exponent: Quantity = field(default=UNKNOWN, metadata=describe("", "n", "exponent"))
    stiffness: Quantity = field(default=UNKNOWN, metadata=describe("N/m^n", "k", "stiffness"))
    damping: Quantity = field(default=UNKNOWN, metadata=describe("s/m", "alpha", "damping"))
    impact_speed: Quantity = field(
        default=UNKNOWN, metadata=describe("m/s", "v", "impact speed", shown="cm/s")
    )
    duration: Quantity = field(
        default=UNKNOWN, metadata=describe("s", "τ", "contact duration", shown="µs")
    )
    restitution: Quantity = field(default=UNKNOWN, metadata=describe("", "e", "restitution"))
    peak_force: Quantity = field(default=UNKNOWN, metadata=describe("N", "F", "peak force"))
    peak_indentation: Quantity = field(
        default=UNKNOWN, metadata=describe("m", "δ", "peak indentation", shown="µm")
    )
    impulse: Quantity = field(
        default=UNKNOWN, metadata=describe("N s", "J", "impulse", shown="mN s")
    )
    energy_loss: Quantity = field(
        default=UNKNOWN, metadata=describe("J", "ΔE", "energy lost", shown="µJ")
    )
    equivalent_stiffness: Quantity = field(
        default=UNKNOWN, metadata=describe("N/m", "k_lin", "linear stiffness", shown="MN/m")
    )
    momentum_ratio: Quantity = field(
        default=UNKNOWN, metadata=describe("", "m2Δv2/m1Δv1", "momentum ratio")
    )
    loop_energy: float = field(default=math.nan, metadata=describe("J", shown="µJ"))
    residual_percent: float = math.nan
    correlation: float = math.nan
    notes: tuple[str, ...] = ()
    own_covariances: tuple[tuple[str, FloatArray], ...] = field(
        default=(), compare=False, repr=False, metadata=INTERNAL
    )
    warnings: tuple[str, ...] = field(default=(), metadata=INTERNAL)
    is_allowed: bool = field(default=False, metadata=INTERNAL)
    excludes_versed_sine: bool = field(default=False, metadata=INTERNAL)

    @property
    def is_known(self) -> bool:
        """Whether a law describes the contact."""
        return self.duration.is_known


NO_LAW = ContactLaw()
"""Where it is not determined."""
_QUANTITIES = tuple(item.name for item in fields(ContactLaw) if item.type is Quantity)[:-1]
"""What follows from the hammer's trace alone, in the order of `_describe_law`."""

SCALED = ("impact_speed", "duration", "peak_force", "restitution")
"""What goes with the impact speed, itself first."""


SENSORS = (Sensor("hammer"), Sensor("specimen"))
"""Of which nothing is known."""


def estimate_contact_law(
    mean: MeanHit,
    cutoff_frequency: float,
    masses: RigNumbers,
    sample: str,
    exponent: float | None = None,
    sensors: tuple[Sensor, Sensor] = SENSORS,
) -> ContactLaw:
    """Estimate the contact law of one sample from its mean hit.

    Parameters
    ----------
    mean : MeanHit
        Of one hit or more. Type A is the scatter of the hits, or of one hit its noise; what a law
        leaves beyond the noise adds to either.
    cutoff_frequency : float
        Of the low-pass that the traces went through [Hz]; 0: none.
    masses : RigNumbers
        NaN: not known. Without a mass duration, e and n are known, with the hammer's also force
        and impulse.
    sample : str
        Its name, for the budget.
    exponent : float, optional
        n where it is known [-]; otherwise it is fitted.
    sensors : tuple of Sensor
        Of hammer and sample.

    Raises
    ------
    NotDeterminedError
        If the pulse has too few points, or does not come down on both sides.
    SignalError
        If there is no pulse.
    """
    pulse = measure_pulse(mean.traces[0])
    width = pulse.half_amplitude_width
    if width < FEWEST_POINTS:
        raise NotDeterminedError(
            f"contact law: {width:.2g} points in the pulse's width at half amplitude do not tell"
            f" it, {FEWEST_POINTS} may; sample faster"
        )
    seen = (mean.sampling_rate, cutoff_frequency, sensors[0].response)
    window = cut_window(mean.traces[0], pulse, *seen, MARGINS)
    fit = fit_law(window, exponent, is_ringing=sensors[0].resonance > 0.0)
    correlation = compute_noise_correlation(cutoff_frequency, mean.sampling_rate, window.step)
    correlation = correlation[correlation.size // 2 :]
    noise = float(compute_raw_noise(mean)[0]) * math.sqrt(correlation[0]) / abs(pulse.peak)
    percent = 100.0 * fit.residual
    white = float(mean.raw_noise[0]) / abs(pulse.peak)
    is_allowed, excludes_versed_sine = _compare_with_versed_sine(
        fit, cut_window(mean.traces[0], pulse, *seen), white, noise
    )
    if not fit.is_inside or fit.residual > max(LARGEST_RESIDUAL, RESIDUAL_OVER_NOISE * noise):
        why = f"the best leaves {percent:.2g} % of the peak" if fit.is_inside else "no fit ends"
        why += _describe_pulse(window.measured, noise)
        return replace(NO_LAW, residual_percent=percent, notes=(f"{LIKE_CONTACT}: {why}",))
    scales = np.array([1.0, width / mean.sampling_rate, abs(pulse.peak), 1.0, 1.0, 1.0])
    scatter, leaves = _compute_scatter(mean, fit, window, pulse.peak)
    unit = fit.compute_covariance(correlation / correlation[0])
    excess = max(fit.residual**2 - noise**2, 0.0)
    sources = [
        (f"scatter of the hits on {sample}", scatter / mean.count, len(mean.hits) - 1.0)
        if scatter is not None
        else ("noise", noise**2 * unit, math.inf),
        ("what the contact law leaves", excess * unit, math.inf),
    ]
    if mean.zero_uncertainty:
        moved = _move_step(mean, pulse)[window.points] / pulse.peak
        change = fit.project(moved[:, np.newaxis])
        sources.append((ZERO_AFTER, change @ change.T, math.inf))
    total = sources[0][1] + sources[1][1]
    sources += [
        (source, np.outer(*2 * (fit.project(change[:, None])[:, 0],)), math.inf)
        for source, change in _change_sensor(mean, pulse, fit, sensors[0], seen[:2])
    ]
    spread = math.sqrt(total[EXPONENT, EXPONENT] * total[DAMPING, DAMPING])
    told = float(total[EXPONENT, DAMPING]) / spread if spread > 0.0 else math.nan
    quantities, own = _compute_quantities(
        fit.parameters * scales, np.diag(scales), sources, masses
    )
    restitution = quantities["restitution"]
    if restitution.value > LARGEST_RESTITUTION:
        why = (
            f"{LIKE_CONTACT} of free bodies: e would be {restitution.value:.2f}; the pulse falls"
            " faster than it rises, as of a body that is crushed"
        )
        return replace(NO_LAW, residual_percent=percent, notes=(why,))
    start = pulse.middle + width * float(fit.parameters[START])
    mean = restore_levels(mean, sensors)
    contact = cut_contact(mean, start, quantities["duration"].value, cutoff_frequency)
    ratio = compare_momenta(mean, contact, masses, sample)
    return ContactLaw(
        **quantities,
        momentum_ratio=ratio,
        loop_energy=compute_loop_energy(mean, contact, quantities.get("impact_speed"), masses),
        residual_percent=percent,
        correlation=told,
        own_covariances=own,
        notes=_list_notes(told, exponent, masses)
        + _judge_fit(fit.residual, noise, quantities["restitution"])
        # Of a contact of free bodies it is a warning.
        + (() if is_allowed else check_momenta(ratio)),
        warnings=(check_momenta(ratio) if is_allowed else ())
        + check_hit_momenta(mean, contact)
        + _check_hits(mean, leaves),
        is_allowed=is_allowed,
        excludes_versed_sine=excludes_versed_sine,
    )


def compute_shape_error(law: ContactLaw, contact_time: float) -> tuple[float, float]:
    """Return what the shapes that the data allow make of tau_p: spread and what is unsure of it.

    The contact's duration lies anywhere between tau_p and that of the law, as far as is known:
    rectangular, signed like the law's from tau_p. Nothing where the data do not allow the law.

    Parameters
    ----------
    contact_time : float
        tau_p [s].

    Returns
    -------
    spread, standard : float
        Standard uncertainty by the shape, alike on all samples, and of the law's duration [s].
    """
    if not (law.is_known and law.is_allowed):
        return 0.0, 0.0
    spread = (law.duration.value - contact_time) / math.sqrt(3.0)
    return spread, float(np.nan_to_num(law.duration.standard))


def describe_contradiction(law: ContactLaw, contact_time: float, factor: float) -> str:
    """Say what the law makes of a tau_p = factor * w50 [s]; empty: it does not contradict."""
    if not (law.is_known and law.is_allowed and law.excludes_versed_sine):
        return ""
    duration, exponent, restitution = (
        f"{quantity.value * scale:.{digits}f} ± {quantity.expanded * scale:.{digits}f}"
        for quantity, scale, digits in (
            (law.duration, 1e6, 1),
            (law.exponent, 1.0, 3),
            (law.restitution, 1.0, 3),
        )
    )
    return (
        "the contact is no versed-sine between linear springs, as k and c take it: by its law it"
        f" lasts {duration} µs (n = {exponent}, e = {restitution}), where the width times"
        f" {factor:g} gives {contact_time * 1e6:.1f} µs"
    )


def look_at_law(mean: MeanHit, setup: RigSetup, sample: str) -> ContactLaw:
    """Return the law of a mean hit on `sample`; where it is not determined, its notes say why."""
    numbers = make_rig_numbers(setup, sample)
    settings = setup.analysis
    exponent = settings.contact_exponent or None
    sensors = setup.find_sensor("hammer"), setup.find_sensor("specimen")
    try:
        return estimate_contact_law(
            mean, settings.cutoff_frequency, numbers, sample, exponent, sensors
        )
    except RigError as error:
        return replace(NO_LAW, notes=(str(error),))


def _change_sensor(
    mean: MeanHit, pulse: PulseWidth, fit: LawFit, sensor: Sensor, seen: tuple[float, float]
) -> list[tuple[str, FloatArray]]:
    """Return what a standard uncertainty of the hammer's sensor does to the fitted trace."""
    response = sensor.response
    changes = []
    for name, standard in (
        ("resonance", sensor.resonance_uncertainty),
        ("low_corner", sensor.low_corner_uncertainty),
    ):
        stated = getattr(response, name)
        if stated and standard:
            other = replace(response, **{name: stated + standard})
            moved = fit.move_to(cut_window(mean.traces[0], pulse, *seen, other, MARGINS))
            what = f"{name.replace('_', ' ')} of the hammer's sensor"
            changes.append((what, moved.fitted - fit.fitted))
    return changes


def _compare_with_versed_sine(
    law: LawFit, window: PulseWindow, white: float, noise: float
) -> tuple[bool, bool]:
    """Tell whether the pulse allows the law, and whether it excludes a versed-sine.

    Compared on the pulse alone: ringing behind it belongs to neither.

    Parameters
    ----------
    law : LawFit
        As it was fitted to pulse and tail.
    white, noise : float
        Of the trace before and behind the low-pass, over the peak [-].
    """
    ours, versed = law.move_to(window), fit_pulse(window, VERSED_SINE)
    least = min(ours.residual, versed.residual)
    level = white / math.sqrt(window.step) * max(1.0, least / noise) if noise > 0.0 else least
    return (
        not ours.is_worse(versed, level),
        versed.is_worse(ours, level) and versed.residual > LARGEST_VERSED_RESIDUAL,
    )


def _describe_pulse(measured: FloatArray, noise: float) -> str:
    """Say what a pulse that is of no law looks like; empty: nothing can be told."""
    tops, _ = find_peaks(measured, prominence=max(SECOND_TOP, RESIDUAL_OVER_NOISE * noise))
    if len(tops) > 1:
        return f"; the pulse has {len(tops)} tops, as of so many contacts or of a body that rings"
    top = int(np.argmax(measured))
    sides = measured[:top], measured[top:]
    rise, fall = (int(np.count_nonzero(side > TENTH_LEVEL)) for side in sides)
    if fall < CRUSHED * rise:
        return "; it falls much faster than it rises, as of a body that is crushed"
    return ""


def _compute_scatter(
    mean: MeanHit, fit: LawFit, window: PulseWindow, peak: float
) -> tuple[FloatArray | None, FloatArray]:
    """Return the covariance of the parameters over the hits, linear about their mean's.

    None: one hit shows none. And what each hit leaves of the peak beside the law of its own.
    """
    if len(mean.hits) < LEAST_HITS:
        return None, np.zeros(1)
    cuts = [hit[0, window.points] / peak - window.measured for hit in mean.cut_hits()]
    changes = np.stack(cuts, axis=1)
    moved = fit.project(changes)
    left = changes - fit.jacobian.T @ moved[fit.varied]
    return np.asarray(np.cov(moved)), np.asarray(left.std(axis=0))


def _check_hits(mean: MeanHit, leaves: FloatArray) -> tuple[str, ...]:
    """Warn of hits whose pulse is of another contact than the others'."""
    odd = find_odd_hits(mean, leaves, LARGEST_RESIDUAL)
    if not odd:
        return ()
    return (f"the pulse of {name_hits(odd)} is of another contact than the others': look at it",)


def _move_step(mean: MeanHit, pulse: PulseWidth) -> FloatArray:
    """Return what changes if the step of the zero came at once, and not with the momentum.

    One standard uncertainty of the zero under the pulse, of 1 / sqrt(12) of the step, is between
    the two, evenly distributed [m/s^2].
    """
    at_once = np.arange(mean.traces.shape[1]) > pulse.middle
    return 2.0 * mean.zero_uncertainty * (compute_share(mean.traces[0], pulse) - at_once)


def _compute_quantities(
    parameters: FloatArray,
    scales: FloatArray,
    sources: Sequence[tuple[str, FloatArray, float]],
    masses: RigNumbers,
) -> tuple[dict[str, Quantity], tuple[tuple[str, FloatArray], ...]]:
    """Return the law's quantities, with uncertainties to first order, and `own_covariances`.

    Parameters
    ----------
    parameters : ndarray, shape (6,)
        In SI units.
    scales : ndarray, shape (6, 6)
        Of the parameters in the window's units, diagonal.
    sources : sequence of tuple
        What may be wrong with those: its name, covariance of shape (6, 6), degrees of freedom.
    """
    bodies = (masses.hammer_mass, masses.moving_mass)
    point = np.append(parameters, [body.x for body in bodies])
    # Each of those that the quantities follow from moved a little, and none.
    steps = STEP * np.where(np.isin(np.arange(point.size), (EXPONENT, DAMPING)), 1.0, point)
    steps[[START, OFFSET]] = 1.0
    found = _describe_laws(np.concatenate((point[np.newaxis], point + np.diag(steps))))
    values, slopes = found[0], np.nan_to_num((found[1:] - found[0]).T / steps)
    effect = slopes[:, :COUNT] @ scales
    parts = [
        (make_label(source, freedom), np.sum((effect @ covariance) * effect, axis=1))
        for source, covariance, freedom in sources
    ]
    inputs = [(TIME, float(point[TIME]), masses.clock)]
    inputs += [(HEIGHT, float(point[HEIGHT]), masses.gains[0])]
    inputs += [
        (place, 1.0, body)
        for place, body in enumerate(bodies, start=COUNT)
        if math.isfinite(body.x)
    ]
    for place, factor, body in inputs:
        squares = (factor * slopes[:, place]) ** 2
        parts += [(label, share * squares) for label, share in list_variances(body).items()]
    known = {
        _QUANTITIES[row]: make_quantity(
            float(values[row]), {label: float(part[row]) for label, part in parts}
        )
        for row in np.flatnonzero(np.isfinite(values))
    }
    rows = [_QUANTITIES.index(name) for name in SCALED]
    relative = effect[rows] / values[rows, np.newaxis]
    own = tuple(
        (make_label(source, freedom), relative @ covariance @ relative.T)
        for source, covariance, freedom in sources
    )
    return known, own


def _describe_laws(points: FloatArray) -> FloatArray:
    """Return the law's quantities in their order, shape (k, 11).

    Parameters
    ----------
    points : ndarray, shape (k, 8)
        Parameters and masses of each law, in SI units.
    """
    _, time, height, _, damping, exponent, hammer, sample = points.T
    pulses = compute_pulses(exponent, damping)
    duration, restitution = time * pulses.duration, pulses.restitution
    both = hammer * sample / (hammer + sample)
    speed = height * time * hammer / both
    return np.stack(
        [
            exponent,
            both / (time ** (exponent + 1.0) * speed ** (exponent - 1.0)),
            damping / speed,
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


def _judge_fit(residual: float, noise: float, restitution: Quantity) -> tuple[str, ...]:
    notes = []
    if residual > RESIDUAL_OVER_NOISE * noise > 0.0:
        notes.append(
            "the law leaves more than the noise, which is in the uncertainties: the pulse is not"
            " quite that of such a contact"
        )
    if restitution.value - 1.0 > max(restitution.expanded, ELASTIC):
        notes.append(
            "e is above 1, which no contact of free bodies gives: n and e describe the pulse and"
            " not a material"
        )
    return tuple(notes)


def _list_notes(correlation: float, exponent: float | None, masses: RigNumbers) -> tuple[str, ...]:
    notes = []
    if exponent is not None:
        notes.append(f"n was given, {exponent:g}, not found")
    if abs(correlation) > TELLING_CORRELATION:
        notes.append(
            f"n and alpha are hardly told apart: their errors' correlation is {correlation:.3f}"
        )
    bodies = (("hammer", masses.hammer_mass), ("sample", masses.moving_mass))
    unknown = [body for body, mass in bodies if math.isnan(mass.x)]
    if unknown:
        notes.append(
            "stiffness, damping, impact speed, indentation and energy: the mass of"
            f" {' and '.join(unknown)} is not known"
        )
    return tuple(notes)
