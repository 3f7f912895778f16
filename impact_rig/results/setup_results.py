"""With what a campaign was measured, flat: masses, samples with their references, settings."""

import math
from dataclasses import dataclass

from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.setup.settings import AnalysisSettings

NAN = math.nan


@dataclass(frozen=True)
class SampleSetupResults:
    """One sample of the set; NaN: not known.

    Attributes
    ----------
    name, material : str
        Of the sample.
    mass_kg, mass_u_kg : float
        Without accelerometer, and its standard uncertainty [kg].
    reference_contact_time_s, reference_stiffness_n_per_m, \
reference_damping_coefficient_n_s_per_m : float
        Published or expected tau_p [s], k2 [N/m] and c2 [N s/m].
    """

    name: str
    material: str = ""
    mass_kg: float = NAN
    mass_u_kg: float = 0.0
    reference_contact_time_s: float = NAN
    reference_stiffness_n_per_m: float = NAN
    reference_damping_coefficient_n_s_per_m: float = NAN


@dataclass(frozen=True)
class SensorResults:
    """One sensor, as its calibration sheet has it.

    Attributes
    ----------
    channel : str
        "hammer" or "specimen".
    quantity, unit : str
        What it measures: "acceleration" or "force", and in which unit.
    sensitivity_v_per_unit : float
        For one `unit` [V]; NaN: not known, or none is needed.
    full_scale : float
        Largest value that it takes, either sign [unit]; 0: not known.
    serial_number, calibration_date : str
        As on the sensor, and year-month-day; empty: not known.
    """

    channel: str
    quantity: str
    unit: str
    sensitivity_v_per_unit: float = NAN
    full_scale: float = 0.0
    serial_number: str = ""
    calibration_date: str = ""

    def to_sensor(self) -> Sensor:
        """Return the sensor; raises `ParameterError` if it cannot be meant."""
        return Sensor(
            channel=self.channel,
            quantity=self.quantity,
            unit=self.unit,
            sensitivity=self.sensitivity_v_per_unit,
            full_scale=self.full_scale,
            serial_number=self.serial_number,
            calibration_date=self.calibration_date,
        )


@dataclass(frozen=True)
class SettingsResults:
    """How hits were cut out, judged and evaluated: `AnalysisSettings`, with units.

    Attributes
    ----------
    cutoff_frequency_hz : float
        Of the low-pass [Hz]; 0: none.
    pulse_factor : float
        F in tau_p = F w50 [-].
    pre_trigger_s, record_duration_s : float
        Of a record [s].
    detection_level, minimum_peak, maximum_peak : float
        Parts of full scale [-].
    overload_run : int
        Points in a row at the rail that make an overload [-].
    double_hit_level : float
        Second pulse that makes a double hit, part of the first [-].
    keep_hits : int
        Accepted hits of a sample that are averaged at most [-]; 0: all.
    """

    cutoff_frequency_hz: float = 50e3
    pulse_factor: float = 2.0
    pre_trigger_s: float = 0.2e-3
    record_duration_s: float = 2e-3
    detection_level: float = 0.03
    minimum_peak: float = 0.15
    maximum_peak: float = 0.95
    overload_run: int = 3
    double_hit_level: float = 0.05
    keep_hits: int = 0


@dataclass(frozen=True)
class SetupResults:
    """The set-up of a rig; NaN: not known.

    Attributes
    ----------
    name, description : str
        Of the rig, in the operator's words.
    hammer_mass_kg, hammer_mass_u_kg : float
        m1 and its standard uncertainty [kg].
    hammer_stiffness_n_per_m : float
        k1 from an earlier control experiment [N/m]; NaN: from this one.
    accelerometer_mass_kg, accelerometer_mass_u_kg : float
        Carried by every sample, part of m2, and its standard uncertainty [kg].
    clock_u : float
        Relative standard uncertainty of the sampling rate [-].
    impact_speed_m_per_s : float
        v1 [m/s].
    control_sample : str
        Alike to the hammer; empty: the set has none.
    samples : tuple of SampleSetupResults
        In their order.
    analysis : SettingsResults
        How hits were judged and evaluated.
    sensors : tuple of SensorResults
        Of the channels, as far as they are known.
    """

    name: str = ""
    description: str = ""
    hammer_mass_kg: float = NAN
    hammer_mass_u_kg: float = 0.0
    hammer_stiffness_n_per_m: float = NAN
    accelerometer_mass_kg: float = 0.0
    accelerometer_mass_u_kg: float = 0.0
    clock_u: float = 0.0
    impact_speed_m_per_s: float = NAN
    control_sample: str = ""
    samples: tuple[SampleSetupResults, ...] = ()
    analysis: SettingsResults = SettingsResults()
    sensors: tuple[SensorResults, ...] = ()

    def to_samples(self) -> SampleSet:
        """Return the sample set, as the tables take it."""
        return SampleSet(
            samples=tuple(
                Sample(
                    name=sample.name,
                    mass=sample.mass_kg,
                    material=sample.material,
                    reference_contact_time=sample.reference_contact_time_s,
                    reference_stiffness=sample.reference_stiffness_n_per_m,
                    reference_damping_coefficient=sample.reference_damping_coefficient_n_s_per_m,
                    mass_uncertainty=sample.mass_u_kg,
                )
                for sample in self.samples
            ),
            control_sample=self.control_sample,
            accelerometer_mass=self.accelerometer_mass_kg,
            accelerometer_mass_uncertainty=self.accelerometer_mass_u_kg,
        )


def setup_results_from_setup(setup: RigSetup) -> SetupResults:
    """Flatten the set-up of a rig."""
    samples = setup.samples
    return SetupResults(
        name=setup.name,
        description=setup.description,
        hammer_mass_kg=float(setup.hammer_mass),
        hammer_mass_u_kg=float(setup.hammer_mass_uncertainty),
        hammer_stiffness_n_per_m=float(setup.hammer_stiffness),
        accelerometer_mass_kg=float(samples.accelerometer_mass),
        accelerometer_mass_u_kg=float(samples.accelerometer_mass_uncertainty),
        clock_u=float(setup.clock_uncertainty),
        impact_speed_m_per_s=float(setup.impact_speed),
        control_sample=samples.control_sample,
        samples=tuple(map(_flatten_sample, samples.samples)),
        analysis=_flatten_settings(setup.analysis),
        sensors=tuple(map(_flatten_sensor, setup.sensors)),
    )


def _flatten_sample(sample: Sample) -> SampleSetupResults:
    return SampleSetupResults(
        name=sample.name,
        material=sample.material,
        mass_kg=float(sample.mass),
        mass_u_kg=float(sample.mass_uncertainty),
        reference_contact_time_s=float(sample.reference_contact_time),
        reference_stiffness_n_per_m=float(sample.reference_stiffness),
        reference_damping_coefficient_n_s_per_m=float(sample.reference_damping_coefficient),
    )


def _flatten_sensor(sensor: Sensor) -> SensorResults:
    return SensorResults(
        channel=sensor.channel,
        quantity=sensor.quantity,
        unit=sensor.unit,
        sensitivity_v_per_unit=float(sensor.sensitivity),
        full_scale=float(sensor.full_scale),
        serial_number=sensor.serial_number,
        calibration_date=sensor.calibration_date,
    )


def _flatten_settings(settings: AnalysisSettings) -> SettingsResults:
    return SettingsResults(
        cutoff_frequency_hz=float(settings.cutoff_frequency),
        pulse_factor=float(settings.pulse_factor),
        pre_trigger_s=float(settings.pre_trigger),
        record_duration_s=float(settings.record_duration),
        detection_level=float(settings.detection_level),
        minimum_peak=float(settings.minimum_peak),
        maximum_peak=float(settings.maximum_peak),
        overload_run=int(settings.overload_run),
        double_hit_level=float(settings.double_hit_level),
        keep_hits=int(settings.keep_hits),
    )
