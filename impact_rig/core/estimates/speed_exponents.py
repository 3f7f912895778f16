"""Dependence of results on the impact speed."""

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from impact_rig.core.estimates.contact_law import SCALED
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.uncertainty import Source, make_quantity
from impact_rig.core.given.quantity import UNKNOWN, Comparable, Quantity, describe
from impact_rig.core.given.records import FloatArray
from impact_rig.core.given.setup import RigSetup

ALL_SAMPLES = "all"
"""Name of the fit to all samples together, each with its own constant."""
HERTZ_SPEED_EXPONENTS = {"duration": -1.0 / 5.0, "peak_force": 6.0 / 5.0}
SPRING_SPEED_EXPONENTS = {"duration": 0.0, "peak_force": 1.0}

Covariances = Sequence[tuple[Source, FloatArray]]
"""Covariances of the relative errors of speed and result, shape (2, 2), by source."""


@dataclass(frozen=True)
class SpeedExponents(Comparable):
    """Exponents of the impact speed over the release angles of one sample."""

    sample: str  # name, without the angle, or `ALL_SAMPLES`
    series: int  # release angles, or series of all samples [-]
    # p of tau_p [-].
    contact_time: Quantity = field(default=UNKNOWN, metadata=describe("", "τp", "contact time"))
    # p of what the contact law says [-].
    duration: Quantity = field(default=UNKNOWN, metadata=describe("", "τ", "contact duration"))
    peak_force: Quantity = field(default=UNKNOWN, metadata=describe("", "Fmax", "peak force"))
    restitution: Quantity = field(default=UNKNOWN, metadata=describe("", "e", "restitution"))


def estimate_speed_exponents(
    setup: RigSetup, samples: Sequence[SampleEstimate]
) -> tuple[SpeedExponents, ...]:
    """Estimate the exponents of every sample struck from several angles, and of all together.

    Parameters
    ----------
    setup : RigSetup
        With the release angles.
    samples : sequence of SampleEstimate
        Series whose contact law or impact speed is not known are left out.
    """
    series = [
        (setup.samples.find(sample.name), sample)
        for sample in samples
        if sample.contact_law.impact_speed.is_known
    ]
    counts = Counter(struck.body for struck, _ in series if struck.has_angle)
    bodies = [body for body, count in counts.items() if count > 1]
    groups = [(body, [body]) for body in bodies]
    if len(bodies) > 1:
        groups.append((ALL_SAMPLES, bodies))
    return tuple(
        _estimate_each(name, [(struck.body, it) for struck, it in series if struck.body in chosen])
        for name, chosen in groups
    )


def _estimate_each(name: str, series: Sequence[tuple[str, SampleEstimate]]) -> SpeedExponents:
    bodies = [body for body, _ in series]
    laws = [sample.contact_law for _, sample in series]
    speeds = [law.impact_speed.value for law in laws]
    found = {
        result: _fit_exponent(
            bodies,
            speeds,
            [getattr(law, result).value for law in laws],
            [
                [(source, own[np.ix_((0, row), (0, row))]) for source, own in law.own_covariances]
                for law in laws
            ],
        )
        for row, result in enumerate(SCALED)
        if row > 0
    }
    times = [sample.paper.contact_time.value for _, sample in series]
    covariances = [_find_covariances(sample) for _, sample in series]
    contact_time = _fit_exponent(bodies, speeds, times, covariances)
    return SpeedExponents(name, len(series), contact_time, **found)


def _find_covariances(sample: SampleEstimate) -> Covariances:
    """Return the errors of v and tau_p, taken as independent, from the scatter of a series."""
    found = [
        (source, own[0, 0] * np.diag([1.0, 0.0]))
        for source, own in sample.contact_law.own_covariances
    ]
    time = sample.paper.contact_time
    scatter = [line for line in time.budget if line.kind == "A"]
    freedom = sample.impacts_accepted - 1.0
    return found + [
        (Source(line.source, freedom), np.diag([0.0, (line.contribution / time.value) ** 2]))
        for line in scatter
    ]


def _fit_exponent(
    groups: Sequence[str],
    speeds: Sequence[float],
    values: Sequence[float],
    covariances: Sequence[Covariances],
) -> Quantity:
    """Fit ln(value) = constant of the group + p ln(v) by least squares.

    The uncertainty of p is that of the points, or what the line leaves of them if that is more.

    Parameters
    ----------
    groups, speeds, values, covariances : sequence, shape (series,)
        Sample, v [m/s], result [any unit] and their relative errors.
    """
    if not all(math.isfinite(value) and value > 0.0 for value in values):
        return UNKNOWN
    speed, value = _center_logarithms(groups, speeds), _center_logarithms(groups, values)
    spread = float(speed @ speed)
    if spread == 0.0:
        return UNKNOWN
    exponent = float(speed @ value) / spread
    left, freedom = value - exponent * speed, len(values) - len(set(groups)) - 1
    change = np.array([-exponent, 1.0])
    own = [
        [(source, float(change @ part @ change)) for source, part in each] for each in covariances
    ]
    variances: defaultdict[Source, float] = defaultdict(float)
    if all(own):
        for weight, each in zip((speed / spread).tolist(), own, strict=True):
            for source, variance in each:
                variances[source] += weight**2 * variance
    if freedom:
        excess = float(left @ left) / freedom / spread - math.fsum(variances.values())
        # An exponent is rounded to 1e-9.
        variances[Source("what the power law leaves", freedom)] = (
            excess if excess > 1e-9**2 else 0.0
        )
    return make_quantity(exponent, dict(variances)) if variances else Quantity(exponent)


def _center_logarithms(groups: Sequence[str], values: Sequence[float]) -> FloatArray:
    """Return the logarithms less their mean over the same group, shape (series,)."""
    logarithms = np.log(values)
    names = np.array(groups)
    means = {name: logarithms[names == name].mean() for name in set(groups)}
    return np.asarray(logarithms - [means[name] for name in groups])
