"""A sensor's sensitivity from hits."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impact_rig.core.arithmetic import UncertainNumber
from impact_rig.core.errors import (
    NotDeterminedError,
    ParameterError,
    check_between,
    check_mass_uncertainty,
    check_positive,
)
from impact_rig.core.hits import FilteredHit, JudgedHit
from impact_rig.core.quantity import Comparable, Quantity
from impact_rig.core.records import FloatArray, HitLabel
from impact_rig.core.sensors import CHANNELS, Sensor
from impact_rig.core.setup import RigSetup
from impact_rig.core.uncertainty import compute_quantity, make_ensemble, make_input
from impact_rig.core.verdict import Reason

LARGEST_MISFIT = 0.05
"""Misfit above which a hit is not used [-], our choice: what leaves as much, a delay between the
channels or noise, changes the ratio by the square of it at most, a quarter of a per cent."""
HARMLESS = frozenset(
    {Reason.WEAK, Reason.DOUBLE_HIT, Reason.INCONSISTENT, Reason.POLARITY, Reason.SURPLUS}
)
"""Reasons against a hit that do not count here: a ratio needs neither strength, nor one pulse, nor
hits that are alike."""
CONTACT_WIDTHS = 1.0
"""Half of the contact in half-amplitude widths of the pulse [-]: of a versed-sine exactly."""
SHORTEST_CONTACT = 5
"""Points of the contact below which nothing is fitted [-], our choice."""


@dataclass(frozen=True)
class TraceFit:
    """The least-squares line of one trace over another.

    Attributes
    ----------
    ratio : float
        Its slope [-].
    misfit : float
        RMS of what it leaves, part of the RMS of the trace about its mean [-]: the square root of
        1 - r^2, r the correlation of both traces.
    linearity : float
        Largest |deviation| from it, part of the trace's largest value [-].
    """

    ratio: float
    misfit: float
    linearity: float


@dataclass(frozen=True)
class HitFit:
    """What one hit says of the ratio.

    Attributes
    ----------
    label : HitLabel
        Which hit.
    stamp : int
        Of its first point, nanoseconds since the epoch.
    fit : TraceFit or None
        None: the hit has no pulse to be fitted.
    flaw : str
        Why the hit is not used, in words; empty: it is.
    """

    label: HitLabel
    stamp: int
    fit: TraceFit | None
    flaw: str = ""


def fit_hit(hit: JudgedHit, channel: str, factor: float) -> HitFit:
    """Fit the trace of one channel over what the other one says that it should be.

    Parameters
    ----------
    hit : JudgedHit
        With both channels.
    channel : {"hammer", "specimen"}
        Of the sensor under test.
    factor : float
        Acceleration that the tested channel should show, over that of the other one [-].
    """
    flaws = [item.explanation for item in hit.rejections if item.reason not in HARMLESS]
    if flaws or hit.filtered is None:
        return HitFit(hit.label, hit.stamp, None, "; ".join(flaws) or "it has no pulse")
    if len(hit.filtered.traces) == 1:
        return HitFit(hit.label, hit.stamp, None, "the second channel was not measured")
    hammer, specimen = _cut_contact(hit.filtered)
    tested, other = (hammer, specimen) if channel == "hammer" else (specimen, hammer)
    if tested.size < SHORTEST_CONTACT:
        return HitFit(hit.label, hit.stamp, None, f"its contact has {tested.size} points only")
    fit = fit_traces(tested, factor * other)
    if not fit.misfit <= LARGEST_MISFIT:
        flaw = (
            f"misfit of {100 * fit.misfit:.2g} %, above {100 * LARGEST_MISFIT:g} %: the channels"
            " do not show the same"
        )
        return HitFit(hit.label, hit.stamp, fit, flaw)
    return HitFit(hit.label, hit.stamp, fit)


def fit_traces(tested: FloatArray, expected: FloatArray) -> TraceFit:
    """Fit a line, with an offset, of one trace over another.

    Parameters
    ----------
    tested, expected : ndarray, shape (n,)
        Of the same points.
    """
    x, y = expected - expected.mean(), tested - tested.mean()
    size_x, size_y = float(x @ x), float(y @ y)
    if size_x == 0.0 or size_y == 0.0:
        return TraceFit(math.nan, math.nan, math.nan)
    ratio = float(x @ y) / size_x
    left = y - ratio * x
    return TraceFit(
        ratio=ratio,
        misfit=math.sqrt(float(left @ left) / size_y),
        linearity=float(np.abs(left).max() / np.abs(tested).max()),
    )


def _cut_contact(hit: FilteredHit) -> FloatArray:
    """Return both traces over the contact, shape (2, n)."""
    half = CONTACT_WIDTHS * hit.pulse.half_amplitude_width
    begin = max(math.floor(hit.pulse.middle - half), 0)
    return hit.traces[:, begin : math.ceil(hit.pulse.middle + half) + 1]


FEWEST_HITS = 3
"""Hits below which no sensitivity is told [-], our choice: of two, the scatter says little."""
LARGEST_REFERENCE_UNCERTAINTY = 0.5
"""Of a reference [-], our choice: above it, per cent were meant."""


@dataclass(frozen=True)
class CalibrationMethod(Comparable):
    """What is compared with what.

    Attributes
    ----------
    channel : str
        Of the sensor under test, one of `CHANNELS`; that of the other one is the reference.
    known_mass : float
        Of all that moves with the struck body [kg]: force is mass times acceleration; NaN: both
        sensors are mounted back to back and see the same acceleration.
    mass_uncertainty : float
        Standard uncertainty of that mass [kg]; 0: not stated.
    reference_uncertainty : float
        Relative standard uncertainty of the reference's sensitivity [-]; 0: not stated.
    """

    channel: str
    known_mass: float = math.nan
    mass_uncertainty: float = 0.0
    reference_uncertainty: float = 0.0

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        if self.channel not in CHANNELS:
            raise ParameterError(
                f"sensor under test is {self.channel!r}: it must be one of {', '.join(CHANNELS)}"
            )
        if self.has_known_mass:
            check_positive("known mass", self.known_mass, "kg")
            check_mass_uncertainty(
                "uncertainty of the known mass", self.mass_uncertainty, self.known_mass
            )
        check_between(
            "relative uncertainty of the reference", self.reference_uncertainty,
            0.0, LARGEST_REFERENCE_UNCERTAINTY,
        )  # fmt: skip

    @property
    def has_known_mass(self) -> bool:
        """Whether a body of known mass is struck; else the sensors are back to back."""
        return not math.isnan(self.known_mass)

    def compute_factor(self, setup: RigSetup) -> float:
        """Return the tested channel's acceleration over that of the reference [-].

        Parameters
        ----------
        setup : RigSetup
            With the hammer's mass, by which its force was made an acceleration.

        Raises
        ------
        ParameterError
            If that is not known.
        """
        if not self.has_known_mass:
            return 1.0
        if math.isnan(setup.hammer_mass):
            raise ParameterError("the mass of the hammer is not known: its force cannot be told")
        factor = self.known_mass / setup.hammer_mass
        return factor if self.channel == "hammer" else 1.0 / factor


@dataclass(frozen=True)
class Calibration:
    """A new sensitivity.

    Attributes
    ----------
    sensor : Sensor
        Under test, by its old sheet.
    ratio : Quantity
        New sensitivity over the old one [-].
    hits : int
        Those that were used [-].
    is_reversed : bool
        The traces have opposite signs: one of the sensors looks the other way.
    remarks : tuple of str
        What the uncertainty leaves out, in words.
    """

    sensor: Sensor
    ratio: Quantity
    hits: int
    is_reversed: bool
    remarks: tuple[str, ...]

    @property
    def sensitivity(self) -> float:
        """For one unit of the sensor [V]; signed as the old one."""
        return self.sensor.sensitivity * self.ratio.value


def estimate_sensitivity(
    fits: Sequence[HitFit], method: CalibrationMethod, setup: RigSetup, sensor: Sensor
) -> Calibration:
    """Estimate the sensitivity of the sensor under test.

    Parameters
    ----------
    fits : sequence of HitFit
        Of all hits.
    method : CalibrationMethod
        What was compared with what.
    setup : RigSetup
        With which the hits were measured: the hammer's mass is used.
    sensor : Sensor
        Under test, with the sensitivity by which its trace was made an acceleration.

    Raises
    ------
    NotDeterminedError
        If there are too few hits that can be used.
    """
    used = [item.fit for item in fits if item.fit is not None and not item.flaw]
    if len(used) < FEWEST_HITS:
        raise NotDeterminedError(_describe_shortage(fits, len(used)))
    ratios = np.array([fit.ratio for fit in used])
    mean, variance = float(ratios.mean()), float(ratios.var(ddof=1)) / len(used)
    (scatter,) = make_ensemble(
        "scatter of the hits", [abs(mean)], np.array([[variance]]), len(used) - 1
    )
    number = scatter * _make_distortion(used) * _make_reference(method, setup, sensor)
    return Calibration(
        sensor=sensor,
        ratio=compute_quantity(abs(mean), number),
        hits=len(used),
        is_reversed=mean < 0.0,
        remarks=_list_unstated(method, setup, sensor),
    )


def _make_distortion(used: Sequence[TraceFit]) -> UncertainNumber:
    """Return 1 with what the misfit may have changed: its square, taken as rectangular."""
    misfit = float(np.mean([fit.misfit for fit in used]))
    return make_input("misfit of the traces", 1.0, misfit**2 / math.sqrt(3.0))


def _make_reference(method: CalibrationMethod, setup: RigSetup, sensor: Sensor) -> UncertainNumber:
    """Return 1 with the uncertainty of what the sensor is compared with."""
    number = make_input("sensitivity of the reference", 1.0, method.reference_uncertainty)
    if method.has_known_mass:
        mass = make_input("known mass", method.known_mass, method.mass_uncertainty)
        number = number / (mass * (1.0 / method.known_mass))
        if _needs_hammer_mass(sensor, setup):
            hammer = make_input(
                "mass of the hammer", setup.hammer_mass, setup.hammer_mass_uncertainty
            )
            number = number * (hammer * (1.0 / setup.hammer_mass))
    return number


def _needs_hammer_mass(sensor: Sensor, setup: RigSetup) -> bool:
    """Return whether the hammer's mass counts: where its force is measured, it cancels out."""
    hammer = next((item for item in setup.sensors if item.channel == "hammer"), None)
    measured = sensor if sensor.channel == "hammer" else hammer
    return measured is None or measured.quantity != "force"


def _list_unstated(method: CalibrationMethod, setup: RigSetup, sensor: Sensor) -> tuple[str, ...]:
    unstated = []
    if method.reference_uncertainty == 0.0:
        unstated.append("the reference")
    if method.has_known_mass and method.mass_uncertainty == 0.0:
        unstated.append("the known mass")
    if (
        method.has_known_mass
        and _needs_hammer_mass(sensor, setup)
        and setup.hammer_mass_uncertainty == 0.0
    ):
        unstated.append("the mass of the hammer")
    if not unstated:
        return ()
    return (f"the uncertainty of {' and of '.join(unstated)} is not stated, and not in it",)


def _describe_shortage(fits: Sequence[HitFit], used: int) -> str:
    flaws = dict.fromkeys(item.flaw for item in fits if item.flaw)
    reasons = f" ({'; '.join(flaws)})" if flaws else ""
    return (
        f"{used} of {len(fits)} hits can be used{reasons}: a sensitivity needs {FEWEST_HITS} or"
        " more"
    )
