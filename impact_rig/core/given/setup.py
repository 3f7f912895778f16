"""Set-up of a rig and its analysis: samples, hammer, settings, the published samples."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

from impact_rig.core.given.errors import (
    ParameterError,
    check_between,
    check_if_known,
    check_mass_uncertainty,
    check_name,
    check_not_negative,
    check_positive,
)
from impact_rig.core.given.filtering import Chain
from impact_rig.core.given.quantity import INLINE, Comparable, describe, stated_field
from impact_rig.core.given.sensors import CHANNELS, STANDARD_GRAVITY, Sensor, SensorResponse


@dataclass(frozen=True)
class AnalysisSettings:
    """Settings of detection, verdict and estimation."""

    # -3 dB frequency of the zero-phase low-pass [Hz]; 0 switches it off. 50 kHz as published.
    cutoff_frequency: float = field(default=50e3, metadata=describe("Hz"))
    pulse_factor: float = 2.0  # F in tau_p = F * w50 [-]; the published 2 belongs to a versed-sine
    # Kept before the impact, and the source of the baseline [s]. Our choice: a tenth of the
    # record.
    pre_trigger: float = field(default=0.2e-3, metadata=describe("s"))
    # Length of a hit's record [s]; 2 ms as published.
    record_duration: float = field(default=2e-3, metadata=describe("s"))
    # Hammer acceleration that starts a hit, part of full scale [-]. Our choice: well above 12-bit
    # noise, well below the weakest acceptable hit.
    detection_level: float = 0.03
    # Weakest hammer peak that is wanted, part of full scale [-]; 0: what noise and steps allow.
    minimum_peak: float = 0.0
    # Strongest acceptable peak of either channel, part of full scale [-]. Our choice: room for
    # offset and noise below the rail.
    maximum_peak: float = 0.95
    # Second pulse that makes a double hit, part of the first [-]. Our choice: noise and what
    # sensors leave behind are less.
    double_hit_level: float = 0.02
    contact_exponent: float = 0.0  # n of the contact law where it is known [-]; 0: it is fitted

    def __post_init__(self) -> None:
        """Refuse values that cannot be meant."""
        check_not_negative("cutoff_frequency", self.cutoff_frequency, "Hz")
        check_positive("record_duration", self.record_duration, "s")
        check_positive("pre_trigger", self.pre_trigger, "s")
        if self.pre_trigger >= self.record_duration:
            raise ParameterError(
                f"pre_trigger is {self.pre_trigger} s: it must be shorter than record_duration,"
                f" which is {self.record_duration} s",
                "pre_trigger",
            )
        # A slower low-pass makes every pulse as long as the record.
        slowest = 2.0 / self.record_duration
        if 0.0 < self.cutoff_frequency < slowest:
            raise ParameterError(
                f"cutoff_frequency is {self.cutoff_frequency} Hz: in a record of"
                f" {self.record_duration} s it must be {slowest:g} Hz or more",
                "cutoff_frequency",
            )
        for name, low, high in (
            ("pulse_factor", 1.0, 4.0),
            ("detection_level", 1e-6, 1.0),
            ("minimum_peak", 0.0, 1.0),
            ("maximum_peak", 0.0, 1.0),
            ("double_hit_level", 1e-3, 1.0),
        ):
            check_between(name, getattr(self, name), low, high)
        if self.maximum_peak <= self.minimum_peak:
            raise ParameterError(
                f"maximum_peak is {self.maximum_peak!r}: it must lie above the minimum_peak of"
                f" {self.minimum_peak!r}",
                "maximum_peak",
            )
        if self.contact_exponent:
            # 1 is a linear spring, 3/2 Hertz; the family of laws ends a little beyond.
            check_between("contact_exponent", self.contact_exponent, 0.6, 3.9)


DEFAULT_CLOCK_UNCERTAINTY = 5.8e-5
"""Relative standard uncertainty of the sampling rate [-]: a crystal good for 100 ppm, taken as
rectangular, 1e-4 / sqrt(3)."""


def format_angle(angle: float) -> str:
    """Return an angle [rad] as a person writes it: 10°."""
    return f"{math.degrees(angle):g}°"


def check_release_angles(angles: Sequence[float]) -> None:
    """Raise `ParameterError` unless a hammer can swing down from these angles [rad]."""
    names = [format_angle(angle) for angle in angles]
    for angle, name in zip(angles, names, strict=True):
        if not 0.0 < angle <= math.pi / 2.0:
            raise ParameterError(
                f"release angle is {name}: it must be above 0° and 90° at most", "release angle"
            )
        if names.count(name) > 1:
            raise ParameterError(
                f"release angle {name} is given twice: once is enough", "release angle"
            )


@dataclass(frozen=True)
class Sample(Comparable):
    """One sample of the set."""

    name: str  # unique in the set
    # Without accelerometer [kg]; NaN: not known, and then neither k2 nor c2 is.
    mass: float = field(metadata=describe("kg"))
    material: str = ""  # in words; may be empty
    # Published or expected tau_p [s], k2 [N/m] and c2 [N s/m]; NaN: none. The virtual rig strikes
    # a sample that behaves like this, tables show them beside the measured values.
    reference_contact_time: float = field(default=math.nan, metadata=describe("s"))
    reference_stiffness: float = field(default=math.nan, metadata=describe("N/m"))
    reference_damping_coefficient: float = field(default=math.nan, metadata=describe("N s/m"))
    # Standard uncertainty of the mass [kg]; 0: not stated.
    mass_uncertainty: float = stated_field("kg", "mass_u")
    # Of the hammer in this series of hits [rad]; NaN: the rig's. A sample that is struck from
    # several angles is in the set once for each, "steel small 5°" beside "steel small 10°".
    release_angle: float = field(default=math.nan, metadata=describe("rad"))

    def __post_init__(self) -> None:
        """Refuse a nameless sample and impossible numbers."""
        if not self.name.strip():
            raise ParameterError("a sample has an empty name: every sample needs its own name")
        for what, text in (("name", self.name), ("material", self.material)):
            # Progress and logs show it as it is: it must not steer a terminal.
            if not text.isprintable():
                raise ParameterError(
                    f"the {what} of a sample is {text!r}: it must be of letters that can be shown",
                    what,
                )
        check_if_known(f"mass of sample {self.name!r}", self.mass, "kg")
        check_mass_uncertainty(
            f"mass uncertainty of sample {self.name!r}", self.mass_uncertainty, self.mass
        )
        for quantity, value, unit in (
            ("reference contact time", self.reference_contact_time, "s"),
            ("reference stiffness", self.reference_stiffness, "N/m"),
            ("reference damping coefficient", self.reference_damping_coefficient, "N s/m"),
        ):
            check_if_known(f"{quantity} of sample {self.name!r}", value, unit)
        if self.has_angle:
            check_release_angles([self.release_angle])

    @property
    def has_angle(self) -> bool:
        """Whether this is the series of one release angle."""
        return not math.isnan(self.release_angle)

    @property
    def body(self) -> str:
        """Name of what is struck, without the release angle."""
        angle = f" {format_angle(self.release_angle)}" if self.has_angle else ""
        return self.name.removesuffix(angle)

    def at_angle(self, angle: float) -> Self:
        """Return the series of hits on this sample from one release angle [rad]."""
        return replace(self, name=f"{self.name} {format_angle(angle)}", release_angle=angle)


@dataclass(frozen=True)
class SampleSet:
    """The samples of a campaign and the one of them that calibrates the hammer."""

    samples: tuple[Sample, ...]  # in the order of the table
    # The sample alike to the hammer, for which k1 = k2 is assumed; empty: none, and then neither
    # k1 nor any k2 can be determined.
    control_sample: str
    # Carried by every sample, part of m2 [kg].
    accelerometer_mass: float = field(default=0.0, metadata=describe("kg"))
    # Standard uncertainty of that mass [kg]; 0: not stated.
    accelerometer_mass_uncertainty: float = stated_field("kg", "accelerometer_mass_u")
    check_sample: str = ""  # the free rigid mass of the operational check; empty: none

    def __post_init__(self) -> None:
        """Refuse an empty set, double names and a control sample that is not in the set."""
        check_not_negative("accelerometer mass", self.accelerometer_mass, "kg")
        check_mass_uncertainty(
            "accelerometer mass uncertainty",
            self.accelerometer_mass_uncertainty,
            self.accelerometer_mass,
        )
        if not self.samples:
            raise ParameterError("the sample set is empty: it needs at least one sample")
        names = [sample.name for sample in self.samples]
        for name in names:
            if names.count(name) > 1:
                raise ParameterError(f"sample {name!r} appears twice in the set: names are unique")
        if self.control_sample and self.control_sample not in names:
            raise ParameterError(
                f"control sample {self.control_sample!r} is missing from the set, which has "
                + ", ".join(map(repr, names)),
                "control sample",
            )
        if self.check_sample and self.check_sample not in names:
            raise ParameterError(f"check sample {self.check_sample!r} is missing from the set")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the samples in the order of the set."""
        return tuple(sample.name for sample in self.samples)

    def with_check(self, mass: Sample) -> Self:
        """Return the set with the free rigid mass of the operational check at its beginning."""
        return replace(self, samples=(mass, *self.samples), check_sample=mass.name)

    def find(self, name: str) -> Sample:
        """Return the sample called `name`.

        Raises
        ------
        UnknownNameError
            If the set has no such sample.
        """
        check_name("sample", name, self.names)
        return self.samples[self.names.index(name)]

    def find_series(self, bodies: Sequence[str]) -> tuple[str, ...]:
        """Return the names of all series on some bodies, in the order of the bodies."""
        return tuple(item.name for body in bodies for item in self.samples if item.body == body)

    def find_control(self, angle: float) -> str:
        """Return the control sample's series of a release angle [rad]; NaN: its only one."""
        for item in self.samples:
            if item.release_angle == angle and item.body == self.find(self.control_sample).body:
                return item.name
        return self.control_sample

    def get_moving_mass(self, name: str) -> float:
        """Return m2 of the sample called `name`, accelerometer included [kg]."""
        return self.find(name).mass + self.accelerometer_mass


UNKNOWN_SENSORS = {channel: Sensor(channel) for channel in CHANNELS}
"""Sensors of channels that no set-up describes."""
ACCELERATION = 1.0, "m/s^2"
"""An accelerometer's reading at 1 m/s^2, and its unit."""


@dataclass(frozen=True)
class RigSetup(Comparable):
    """Everything that turns records into numbers, and lets a recording explain itself."""

    samples: SampleSet = field(metadata=INLINE)  # what is struck
    # Effective seismic mass m1 [kg]; NaN: not known, and then neither k nor c is.
    hammer_mass: float = field(metadata=describe("kg"))
    # Hammer speed at contact v1 [m/s]; NaN: not known, and the printed model is left out.
    impact_speed: float = field(metadata=describe("m/s"))
    # How hits are judged and evaluated.
    analysis: AnalysisSettings = field(default_factory=AnalysisSettings)
    name: str = ""  # of the rig, in the operator's words
    description: str = ""
    # Standard uncertainty of m1 [kg]; 0: not stated.
    hammer_mass_uncertainty: float = stated_field("kg", "hammer_mass_u")
    # Relative standard uncertainty of the sampling rate [-]; 0: not stated.
    clock_uncertainty: float = stated_field("", "clock_u", DEFAULT_CLOCK_UNCERTAINTY)
    # k1 from an earlier control experiment [N/m]; NaN: from the control sample of this set.
    hammer_stiffness: float = field(default=math.nan, metadata=describe("N/m"))
    sensors: tuple[Sensor, ...] = ()  # of the channels, as far as they are known; one each at most
    # From which the hammer reaches it [rad]; NaN: not known.
    release_angle: float = field(default=math.nan, metadata=describe("rad"))
    # Standard uncertainty of the impact speed [m/s]; 0: not stated.
    impact_speed_uncertainty: float = stated_field("m/s", "impact_speed_u")

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        channels = [sensor.channel for sensor in self.sensors]
        if len(set(channels)) < len(channels):
            raise ParameterError(f"sensors are of {', '.join(channels)}: a channel has one")
        check_if_known("hammer mass", self.hammer_mass, "kg")
        check_if_known("hammer stiffness", self.hammer_stiffness, "N/m")
        check_if_known("impact speed", self.impact_speed, "m/s")
        if not math.isnan(self.release_angle):
            check_release_angles([self.release_angle])
        check_mass_uncertainty(
            "hammer mass uncertainty", self.hammer_mass_uncertainty, self.hammer_mass
        )
        check_not_negative("impact speed uncertainty", self.impact_speed_uncertainty, "m/s")
        if self.impact_speed_uncertainty > self.impact_speed:
            raise ParameterError(
                f"impact speed uncertainty is {self.impact_speed_uncertainty:g} m/s: it must be"
                f" less than the speed, which is {self.impact_speed:g} m/s",
                "impact speed uncertainty",
            )
        check_not_negative("clock uncertainty", self.clock_uncertainty, "of the sampling rate")

    def find_sensor(self, channel: str) -> Sensor:
        """Return the sensor of a channel."""
        known = (sensor for sensor in self.sensors if sensor.channel == channel)
        return next(known, UNKNOWN_SENSORS[channel])

    def list_calibration_warnings(self, today: str) -> tuple[str, ...]:
        """Return in one sentence each which sensors were calibrated too long ago, on a day."""
        return tuple(filter(None, (sensor.describe_age(today) for sensor in self.sensors)))

    @property
    def responses(self) -> tuple[SensorResponse, SensorResponse]:
        """Responses of both channels' sensors."""
        return self.find_sensor("hammer").response, self.find_sensor("specimen").response

    def find_chains(self, sampling_rate: float) -> tuple[Chain, Chain]:
        """Return both channels' responses to a motion that is sampled at a rate [Hz]."""
        cutoff = self.analysis.cutoff_frequency
        hammer, sample = self.responses
        return Chain(sampling_rate, cutoff, hammer), Chain(sampling_rate, cutoff, sample)

    @property
    def hammer_reading(self) -> tuple[float, str]:
        """Reading of the hammer's sensor at 1 m/s^2, with its unit: N of a force hammer."""
        return (self.hammer_load, "N") if self.measures_force else ACCELERATION

    @property
    def measures_force(self) -> bool:
        """Whether the hammer's sensor is one of force."""
        return self.find_sensor("hammer").quantity == "force"

    @property
    def hammer_load(self) -> float:
        """Force on the hammer over what its trace shows as acceleration [kg].

        m1, or 1 of a force whose mass is not known, which stays in N.
        """
        return 1.0 if self.measures_force and math.isnan(self.hammer_mass) else self.hammer_mass

    def find_unknown_masses(self, name: str) -> tuple[str, ...]:
        """Return whose mass, of hammer and sample called `name`, is not known."""
        masses = (("hammer", self.hammer_mass), (name, self.samples.find(name).mass))
        return tuple(body for body, mass in masses if math.isnan(mass))

    @property
    def pendulum_rate(self) -> float:
        """Rate w of the swing [rad/s] by impact speed and release angle; NaN: not known.

        Of v = 2 sqrt(g l) sin(theta / 2) and w = sqrt(g / l).
        """
        return 2.0 * STANDARD_GRAVITY * math.sin(self.release_angle / 2.0) / self.impact_speed

    def at_angles(self, angles: Sequence[float]) -> Self:
        """Return the set-up with every sample once for each release angle [rad].

        Raises
        ------
        ParameterError
            If an angle cannot be meant, or no speed can be told from it.
        """
        check_release_angles(angles)
        if math.isnan(self.release_angle):
            raise ParameterError(
                "release_angle of the hammer is not known: give in the rig file's [hammer] the"
                " one from which it reaches its impact_speed, so that others tell theirs"
            )
        samples = tuple(item.at_angle(angle) for item in self.samples.samples for angle in angles)
        control = self.samples.control_sample
        if control:
            control = self.samples.find(control).at_angle(angles[0]).name
        return replace(
            self, samples=replace(self.samples, samples=samples, control_sample=control)
        )

    def for_series(self, name: str) -> Self:
        """Return the set-up as it is for one sample: speed and control sample of its angle.

        A pendulum of length l that falls from the angle theta is at the bottom as fast as
        v = sqrt(2 g l (1 - cos theta)) = 2 sqrt(g l) sin(theta / 2).
        """
        sample = self.samples.find(name)
        if not sample.has_angle:
            return self
        angle = sample.release_angle
        factor = math.sin(angle / 2.0) / math.sin(self.release_angle / 2.0)
        return replace(
            self,
            impact_speed=self.impact_speed * factor,
            impact_speed_uncertainty=self.impact_speed_uncertainty * factor,
            release_angle=angle,
            samples=replace(self.samples, control_sample=self.samples.find_control(angle)),
        )


GRAM_UNCERTAINTY = 0.29e-3
"""Standard uncertainty of a mass printed as 100 g or 3 g, by its rounding alone [kg]: half a unit
of the last digit, rectangular, so over sqrt(3)."""
HAMMER_STIFFNESS = 22.54e6
"""k1, Table 3 [N/m]."""
HAMMER_DAMPING_COEFFICIENT = 1909.0
"""c1, Table 4 [N s/m]."""
CONTROL_SAMPLE = "aluminium large"
MISPRINTS = {"brass medium": 288.1e-6}
"""Contact times of Table 2 that contradict Table 3 [s]: this one would give 11.7 MN/m."""

PAPER_SETUP = RigSetup(
    samples=SampleSet(
        samples=tuple(
            Sample(
                name=f"{material} {size}",
                mass=mass / 1e3,
                material=material,
                reference_contact_time=time / 1e6,
                reference_stiffness=stiffness * 1e6,
                reference_damping_coefficient=damping,
                # As that of a gram, for 21.31 g.
                mass_uncertainty=0.0029e-3,
            )
            for material, size, mass, time, stiffness, damping in (
                # [g], [us], [MN/m], [N s/m]; Tables 1 to 4.
                ("aluminium", "small", 21.31, 144.8, 15.56, 206),
                ("aluminium", "medium", 61.62, 196.8, 17.99, 531),
                ("aluminium", "large", 102.38, 212.0, 22.54, 802),
                ("steel", "small", 56.32, 170.0, 29.18, 483),
                ("steel", "medium", 166.91, 203.2, 45.29, 1170),
                ("steel", "large", 277.10, 219.2, 46.11, 1670),
                ("bronze", "small", 70.48, 188.0, 24.89, 848),
                ("bronze", "medium", 209.53, 226.4, 31.26, 2028),
                ("bronze", "large", 348.13, 239.2, 33.22, 2423),
                ("brass", "small", 60.86, 189.0, 20.71, 667),
                # By Table 3; Table 2 is misprinted.
                ("brass", "medium", 180.14, 228.0, 26.99, 1070),
                ("brass", "large", 299.60, 244.0, 27.87, 2768),
            )
        ),
        control_sample=CONTROL_SAMPLE,
        # Table 1. It belongs to m2: only so do equations (5) and (6) turn Table 2 into Table 3.
        accelerometer_mass=3e-3,
        accelerometer_mass_uncertainty=GRAM_UNCERTAINTY,
    ),
    hammer_mass=0.100,
    hammer_mass_uncertainty=GRAM_UNCERTAINTY,
    # As printed; 0.312 rad/s times 265 mm would be 0.0827 m/s.
    impact_speed=0.0819,
    # Section 3: the hammer swings from here.
    release_angle=math.radians(3.7),
    name="paper",
    description="twelve metal cylinders struck by a pendulum hammer",
)
