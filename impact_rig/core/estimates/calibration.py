"""A sensor's sensitivity from hits."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impact_rig.core.estimates.equations import UncertainNumber
from impact_rig.core.estimates.uncertainty import (
    ASSUMED_GAIN,
    ASSUMED_MASS,
    compute_quantity,
    make_input,
    make_scatter,
    make_stated,
)
from impact_rig.core.given.errors import (
    NotDeterminedError,
    ParameterError,
    check_between,
    check_choice,
    check_mass_uncertainty,
    check_positive,
)
from impact_rig.core.given.findings import Reason
from impact_rig.core.given.quantity import Comparable, Quantity
from impact_rig.core.given.records import FloatArray, HitLabel
from impact_rig.core.given.sensors import CHANNELS, Sensor
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.judging import JudgedHit

LARGEST_MISFIT = 0.05
"""Misfit above which a hit is not used [-], our choice: what leaves as much, a delay between the
channels or noise, changes the ratio by the square of it at most, a quarter of a per cent."""
HARMLESS = frozenset({Reason.WEAK, Reason.DOUBLE_HIT, Reason.INCONSISTENT, Reason.POLARITY})
"""Reasons against a hit that do not count here: a ratio needs neither strength, nor one pulse, nor
hits that are alike."""
SHORTEST_CONTACT = 5
"""Points of the contact below which nothing is fitted [-], our choice."""


@dataclass(frozen=True)
class HitFit:
    """The least-squares line, with an offset, of one trace of a hit over the other."""

    label: HitLabel
    stamp: int  # of the hit's first point [ns since the epoch]
    ratio: float = math.nan  # its slope [-]
    # RMS of what it leaves, part of the RMS of the trace about its mean [-]: the square root of
    # 1 - r^2, r the correlation of both traces.
    misfit: float = math.nan
    flaw: str | None = None  # why the hit is not used, in words; None: it is


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
    found = HitFit(hit.label, hit.stamp)
    flaws = [item.explanation for item in hit.rejections if item.reason not in HARMLESS]
    if flaws or hit.filtered is None:
        return replace(found, flaw="; ".join(flaws) or "it has no pulse")
    if len(hit.filtered.traces) == 1:
        return replace(found, flaw="the second channel was not measured")
    # Of a versed-sine the contact is exactly two half-amplitude widths.
    pulse = hit.filtered.pulse
    begin = max(math.floor(pulse.middle - pulse.half_amplitude_width), 0)
    end = math.ceil(pulse.middle + pulse.half_amplitude_width) + 1
    hammer, specimen = hit.filtered.traces[:, begin:end]
    tested, other = (hammer, specimen) if channel == "hammer" else (specimen, hammer)
    if tested.size < SHORTEST_CONTACT:
        return replace(found, flaw=f"its contact has {tested.size} points only")
    expected = factor * other
    x, y = expected - expected.mean(), tested - tested.mean()
    size_x, size_y = float(x @ x), float(y @ y)
    if size_x and size_y:
        ratio = float(x @ y) / size_x
        left = y - ratio * x
        found = replace(found, ratio=ratio, misfit=math.sqrt(float(left @ left) / size_y))
    if found.misfit <= LARGEST_MISFIT:
        return found
    flaw = (
        f"misfit of {100 * found.misfit:.2g} %, above {100 * LARGEST_MISFIT:g} %: the channels"
        " do not show the same"
    )
    return replace(found, flaw=flaw)


FEWEST_HITS = 3
"""Fewest hits that give a sensitivity [-], our choice: the scatter of two says little."""
LARGEST_SCATTER = 0.05
"""Standard deviation of the ratios of hits that agree, over their mean [-], our choice: sensors
repeat within a per cent, and strikes beside the axis leave a few."""
LARGEST_CHANGE = 1.5
"""Factor by which a sensitivity may differ from that of the sheet [-], our choice: what is farther
off is another sensor, or two bodies that do not move alike."""


@dataclass(frozen=True)
class CalibrationMethod(Comparable):
    """The two sides of a comparison."""

    # Of the sensor under test, one of `CHANNELS`; that of the other one is the reference.
    channel: str
    # Of all that moves with the struck body [kg]: force is mass times acceleration; NaN: both
    # sensors are mounted back to back and see the same acceleration.
    known_mass: float = math.nan
    mass_uncertainty: float = 0.0  # standard uncertainty of that mass [kg]; 0: not stated
    # Relative standard uncertainty of the reference's sensitivity [-]; 0: not stated.
    reference_uncertainty: float = 0.0

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        check_choice("sensor under test", self.channel, CHANNELS)
        if self.has_known_mass:
            check_positive("known mass", self.known_mass, "kg")
            check_mass_uncertainty(
                "uncertainty of the known mass", self.mass_uncertainty, self.known_mass
            )
        # Above a half, per cent were meant.
        check_between("relative uncertainty of the reference", self.reference_uncertainty, 0, 0.5)

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
    """A new sensitivity."""

    sensor: Sensor  # under test, by its old sheet
    ratio: Quantity  # new sensitivity over the old one [-]
    hits: int  # those that were used [-]
    is_reversed: bool  # the traces have opposite signs: one of the sensors looks the other way
    remarks: tuple[str, ...]  # what is assumed, in words

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
    used = [item for item in fits if not item.flaw]
    if len(used) < FEWEST_HITS:
        flaws = dict.fromkeys(item.flaw for item in fits if item.flaw)
        reasons = f" ({'; '.join(flaws)})" if flaws else ""
        raise NotDeterminedError(
            f"{len(used)} of {len(fits)} hits can be used{reasons}: a sensitivity needs"
            f" {FEWEST_HITS} or more"
        )
    ratios = np.array([fit.ratio for fit in used])
    mean = float(ratios.mean())
    _check_agreement(ratios, sensor)
    scatter = make_scatter("scatter of the hits", abs(mean), ratios, len(used))
    # What the misfit may have changed: its square, taken as rectangular.
    misfit = float(np.mean([fit.misfit for fit in used]))
    distortion = make_input("misfit of the traces", 1.0, misfit**2 / math.sqrt(3.0))
    reference, assumed = _make_reference(method, setup, sensor)
    remark = f"assumed is {' and '.join(assumed)}, standard, since nothing states it"
    return Calibration(
        sensor=sensor,
        ratio=compute_quantity(abs(mean), scatter * distortion * reference),
        hits=len(used),
        is_reversed=mean < 0.0,
        remarks=(remark,) if assumed else (),
    )


def _check_agreement(ratios: FloatArray, sensor: Sensor) -> None:
    """Refuse ratios that are not of one sensor beside another; raises `NotDeterminedError`."""
    mean = float(ratios.mean())
    least, most = float(ratios.min()), float(ratios.max())
    if ratios.std(ddof=1) > LARGEST_SCATTER * abs(mean):
        raise NotDeterminedError(
            f"the hits do not agree: their ratios are {least:.3g} to {most:.3g}, and should differ"
            f" by a few per cent. Are they all of one body and one mounting (--sample)?"
        )
    if not 1.0 / LARGEST_CHANGE <= abs(mean) <= LARGEST_CHANGE:
        raise NotDeterminedError(
            f"the traces have a ratio of {mean:.3g}, where 1 is expected: both channels do not"
            " show what was named (back to back, or force on a known mass), or the sensitivity of"
            f" {1e3 * sensor.sensitivity:.6g} mV per {sensor.unit} in the rig file is another"
            f" sensor's; if it was a guess, begin with {1e3 * abs(mean) * sensor.sensitivity:.3g}"
        )


def _make_reference(
    method: CalibrationMethod, setup: RigSetup, sensor: Sensor
) -> tuple[UncertainNumber, list[str]]:
    """Return 1 as uncertain as what the sensor is compared with, and what of that is assumed."""
    gain, stated = method.reference_uncertainty, setup.hammer_mass_uncertainty
    number = make_stated("sensitivity of the reference", 1.0, gain, ASSUMED_GAIN)
    assumed = [f"the reference within {100.0 * ASSUMED_GAIN:g} %"] * (not gain)
    masses = []
    if method.has_known_mass:
        masses.append(("known mass", method.known_mass, method.mass_uncertainty, -1.0))
        measured = sensor if sensor.channel == "hammer" else setup.find_sensor("hammer")
        # Where the hammer's force is measured, its mass cancels out.
        if measured.quantity != "force":
            masses.append(("mass of the hammer", setup.hammer_mass, stated, 1.0))
    for name, mass, standard, power in masses:
        number = number * (make_stated(name, mass, standard, ASSUMED_MASS) / mass) ** power
        assumed += [f"the {name} within {100.0 * ASSUMED_MASS:g} %"] * (not standard)
    return number, assumed
