"""One list of checks of a whole rig file, before the first hit."""
# ruff: noqa: PLR2004 - each threshold stands in the sentence that tells it

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from impact_rig.configuration.rig_file import (
    RigFile,
    read_today,
    take_barrier_distance,
    take_trigger_level,
)
from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import ParameterError
from impact_rig.core.filtering import HIGHEST_RELATIVE_CUTOFF
from impact_rig.core.paper_estimate import check_control
from impact_rig.core.sensors import CHANNELS, STANDARD_GRAVITY, Sensor
from impact_rig.core.setup import RigSetup

HAMMER, SPECIMEN = CHANNELS
VIRTUAL = "virtual"
VIRTUAL_RATE = 2.5e6
"""Sampling rate of the virtual rig where [source] states none [Hz]: the paper's."""


@dataclass(frozen=True)
class RigNote:
    """A fault of a rig file, or something unwise in it."""

    text: str  # with the line, and what to do
    is_fault: bool = False  # it cannot work


Notes = Iterator[RigNote]


def check_rig(rig: RigFile) -> tuple[RigNote, ...]:
    """Return everything that can be known of a rig file before the first hit."""
    old = (RigNote(text) for text in rig.setup.list_calibration_warnings(read_today()))
    return (*itertools.chain.from_iterable(check(_Reading(rig)) for check in CHECKS), *old)


def require_rig(rig: RigFile) -> tuple[str, ...]:
    """Return the warnings of a rig file; raises `ParameterError` if it cannot work."""
    notes = check_rig(rig)
    faults = [note.text for note in notes if note.is_fault]
    if faults:
        path = f"rig file {rig.path}: " if rig.path else ""
        raise ParameterError(path + "; ".join(faults))
    return tuple(note.text for note in notes)


class _Reading:
    """A rig file as the checks read it."""

    def __init__(self, rig: RigFile) -> None:
        self.rig, self.setup, self.analysis = rig, rig.setup, rig.setup.analysis
        self.source, self.samples = rig.source, rig.setup.samples
        self.is_virtual = self.source.get("driver", VIRTUAL) == VIRTUAL
        # Of the record [Hz, s]; NaN: the driver chooses.
        default = VIRTUAL_RATE if self.is_virtual else math.nan
        self.rate = self.source.take_quantity("sampling_rate", "Hz", "2.5 MHz", default, low=1.0)
        self.duration = self.source.take_quantity("record_duration", "s", "2.2 ms", math.nan)
        self.pre_trigger = self.source.take_quantity("pre_trigger", "s", "300 us", math.nan)
        self.contact_times = [
            sample.reference_contact_time
            for sample in self.samples.samples
            if not math.isnan(sample.reference_contact_time)
        ]

    def find_table(self, name: str) -> TomlTable:
        """Return a table of the file, empty where it has none."""
        return self.rig.document.take_table(name)

    def find_channel(self, name: str) -> TomlTable:
        """Return the table of a sensor."""
        return self.source.take_table(name)

    def find_sample(self, name: str) -> TomlTable:
        """Return the table of a sample."""
        tables = self.rig.document.take_tables("sample") if "sample" in self.rig.document else ()
        found = [table for table in tables if table.get("name") == name]
        return found[0] if found else TomlTable({})

    def find_full_scale(self, sensor: Sensor) -> float:
        """Return the largest acceleration that a sensor takes [m/s^2]; 0: not known."""
        return sensor.compute_full_scale(self.setup.hammer_mass)


def fault(table: TomlTable, key: str, text: str) -> RigNote:
    """Return a fault with its line."""
    return RigNote(str(table.make_error(key, text)), is_fault=True)


def warning(table: TomlTable, key: str, text: str) -> RigNote:
    """Return a warning with its line."""
    return RigNote(str(table.make_error(key, text)))


def _check_channels(reading: _Reading) -> Notes:
    if reading.is_virtual:
        return
    hammer, specimen = map(reading.find_channel, CHANNELS)
    if HAMMER in reading.source and SPECIMEN not in reading.source:
        text = "[source] has no [source.specimen]: only the hammer is measured, so no hit is"
        yield warning(reading.source, SPECIMEN, f"{text} checked by the sample's motion")
    name = str(specimen.get("channel", ""))
    if name and name == str(hammer.get("channel", "")):
        text = f"channel of {specimen.place} is {name!r}, the hammer's: the two sensors are at two"
        yield fault(specimen, "channel", f"{text} channels")
    serial = specimen.get("serial_number", "")
    if serial and serial == hammer.get("serial_number"):
        text = (
            f"serial_number of {specimen.place} is {serial!r}, the hammer sensor's: they are two"
        )
        yield warning(specimen, "serial_number", text)


def _check_drivers(reading: _Reading) -> Notes:
    holder = reading.rig.holder
    holds_virtually = holder.get("driver", VIRTUAL) == VIRTUAL
    if reading.is_virtual and not holds_virtually:
        text = "[holder] moves a real hammer, and the accelerations are of the virtual rig: name"
        yield warning(holder, "driver", f"{text} the digitizer in [source]")
    if holds_virtually and not reading.is_virtual:
        text = "[source] measures, and nothing lets a hammer go: add [holder], for example with"
        yield warning(reading.source, "driver", f'{text} driver = "manual"')


def _check_rate(reading: _Reading) -> Notes:
    source, analysis, rate = reading.source, reading.find_table("analysis"), reading.rate
    if math.isnan(rate):
        return
    cutoff, highest = reading.analysis.cutoff_frequency, HIGHEST_RELATIVE_CUTOFF * rate
    if cutoff > highest:
        text = f"cutoff_frequency of [analysis] is {cutoff:g} Hz: at {rate:g} Hz it must be"
        table = analysis if "cutoff_frequency" in analysis else source
        key = "cutoff_frequency" if "cutoff_frequency" in analysis else "sampling_rate"
        yield fault(table, key, f"{text} {highest:g} Hz or less")
    before = reading.analysis.pre_trigger * rate
    if before < 10.0:
        text = f"sampling_rate of [source] is {rate:g} Hz: the {before:.1f} points before the"
        yield fault(source, "sampling_rate", f"{text} impact give no baseline, it takes 10")
    width = min(reading.contact_times, default=math.nan) / reading.analysis.pulse_factor
    text = f"sampling_rate of [source] is {rate:g} Hz: the shortest expected pulse has"
    text = f"{text} {width * rate:.1f} points at half amplitude"
    if width * rate < 3.0:
        yield fault(source, "sampling_rate", f"{text}, it takes 3")
    elif width * rate < 10.0:
        yield warning(source, "sampling_rate", f"{text}: 10 or more resolve it")


def _check_record(reading: _Reading) -> Notes:
    source, analysis = reading.source, reading.analysis
    needed = analysis.record_duration - analysis.pre_trigger
    if reading.pre_trigger < analysis.pre_trigger:
        text = f"pre_trigger of [source] is {reading.pre_trigger * 1e6:g} µs: the analysis keeps"
        text = f"{text} {analysis.pre_trigger * 1e6:g} µs before the impact, record 1.5 times that"
        yield fault(source, "pre_trigger", text)
    after = reading.duration - max(reading.pre_trigger, 0.0)
    if after < needed * (1.0 - 1e-9):
        text = f"record_duration of [source] leaves {after * 1e3:g} ms after the trigger: the"
        yield fault(source, "record_duration", f"{text} analysis looks at {needed * 1e3:g} ms")
    elif after > 1.5 * needed:
        text = f"record_duration of [source] leaves {after * 1e3:g} ms after the trigger, of which"
        text = f"{text} the analysis looks at {needed * 1e3:g} ms: leave record_duration of"
        yield warning(source, "record_duration", f"{text} [analysis] out, and it looks at all")
    table = reading.find_table("analysis")
    longest = max(reading.contact_times, default=math.nan)
    if needed < 2.0 * longest:
        text = f"record_duration of [analysis] leaves {needed * 1e6:g} µs after the impact begins:"
        text = f"{text} a contact of {longest * 1e6:g} µs needs twice its time"
        yield fault(table, "record_duration", text)


def _check_trigger(reading: _Reading) -> Notes:
    source, analysis = reading.source, reading.analysis
    table = reading.find_table("analysis")
    if analysis.detection_level >= analysis.minimum_peak > 0.0:
        text = f"detection_level of [analysis] is {analysis.detection_level:g}: hits begin there,"
        text = f"{text} it must be below minimum_peak, {analysis.minimum_peak:g}"
        yield fault(table, "detection_level", text)
    full_scale = reading.find_full_scale(reading.setup.find_sensor(HAMMER))
    trigger = take_trigger_level(source, reading.setup.hammer_mass)
    if trigger is None or not full_scale:
        return
    level = trigger / full_scale
    text = f"trigger_level of [source] is {level * 100:.3g} % of the hammer's full_scale"
    if level >= 1.0:
        yield fault(source, "trigger_level", f"{text}: no hit reaches it")
    elif level > analysis.minimum_peak:
        text = f"{text}: hits from minimum_peak, {analysis.minimum_peak * 100:g} %, on are wanted"
        yield warning(source, "trigger_level", f"{text}, and those below the level are not seen")
    elif level < 2e-3:
        yield warning(source, "trigger_level", f"{text}: noise may trigger, 1 % is usual")


def _check_settings(reading: _Reading) -> Notes:
    analysis, table = reading.analysis, reading.find_table("analysis")
    shortest = min(reading.contact_times, default=math.nan)
    if 0.0 < analysis.cutoff_frequency * shortest < 3.0:
        text = f"cutoff_frequency of [analysis] is {analysis.cutoff_frequency:g} Hz: it widens a"
        text = f"{text} contact of {shortest * 1e6:g} µs, {3.0 / shortest:.2g} Hz or more does not"
        yield warning(table, "cutoff_frequency", text)


def _check_masses(reading: _Reading) -> Notes:
    setup, samples = reading.setup, reading.samples
    mass = setup.hammer_mass
    for sample in samples.samples:
        table, ratio = reading.find_sample(sample.name), sample.mass / mass
        if ratio > 50.0 or ratio < 0.02:
            text = (
                f"mass of sample {sample.name!r} is {sample.mass * 1e3:.4g} g beside a hammer of"
            )
            text = f"{text} {mass * 1e3:.4g} g: one hardly moves the other, is the unit right?"
            yield warning(table, "mass", text)
        if samples.accelerometer_mass > 0.3 * sample.mass:
            text = f"accelerometer_mass of [samples] is {samples.accelerometer_mass * 1e3:.4g} g,"
            text = f"{text} beside sample {sample.name!r} of {sample.mass * 1e3:.4g} g"
            text = f"{text}: is the unit right?"
            yield warning(reading.find_table("samples"), "accelerometer_mass", text)
        if sample.mass_uncertainty > 0.05 * sample.mass:
            share = sample.mass_uncertainty / sample.mass * 100.0
            text = f"mass_uncertainty of sample {sample.name!r} is {share:.3g} % of the mass"
            yield warning(table, "mass_uncertainty", f"{text}: a balance does better")


def _check_samples(reading: _Reading) -> Notes:
    setup, samples, table = reading.setup, reading.samples, reading.find_table("samples")
    if note := check_control(setup):
        yield warning(table, "control", note.explanation)
    if not samples.control_sample and math.isnan(setup.hammer_stiffness):
        text = "[samples] names no control sample: contact times are measured, and neither k nor c"
        yield warning(table, "control", f"{text} of a sample; name one alike to the hammer")
    seen: dict[str, str] = {}
    for sample in samples.samples:
        key = "".join(sample.name.lower().split())
        if key in seen:
            text = f"samples {seen[key]!r} and {sample.name!r} differ in spaces or capitals only"
            yield warning(reading.find_sample(sample.name), "name", text)
        seen[key] = sample.name
        time = sample.reference_contact_time
        if time > 0.02 or time < 2e-6:
            text = (
                f"reference_contact_time of sample {sample.name!r} is {time * 1e6:.4g} µs: metal"
            )
            text = f"{text} takes 50 µs to some ms, is the unit right?"
            yield warning(reading.find_sample(sample.name), "reference_contact_time", text)


def _check_swing(reading: _Reading) -> Notes:
    length = STANDARD_GRAVITY / reading.setup.pendulum_rate**2
    if length > 5.0 or length < 0.02:
        text = f"release_angle and impact_speed of [hammer] are of a pendulum {length:.2g} m long"
        table = reading.find_table("hammer")
        yield warning(table, "release_angle", f"{text}: one of them is wrong")


def _check_barrier(reading: _Reading) -> Notes:
    """Compare a light barrier with the swing, the rate, and the accelerometers' channels."""
    table, setup = reading.find_channel("impact_speed"), reading.setup
    if not table:
        return
    name = str(table.get("channel", ""))
    for channel in CHANNELS:
        if name and name == str(reading.find_channel(channel).get("channel", "")):
            text = f"channel of {table.place} is {name!r}, the {channel}'s: a barrier has its own"
            yield fault(table, "channel", text)
    distance = take_barrier_distance(table)
    way = setup.impact_speed / setup.pendulum_rate
    if distance >= way:
        text = f"distance of {table.place} is {distance * 1e3:.3g} mm: the hammer swings only"
        yield fault(table, "distance", f"{text} {way * 1e3:.3g} mm, from release to contact")
    step = setup.impact_speed / reading.rate / distance
    if step > 0.01:
        text = f"distance of {table.place} is {distance * 1e3:.3g} mm: from point to point the"
        text = f"{text} hammer moves by {100.0 * step:.2g} % of it, sample faster or take longer"
        yield warning(table, "distance", text)


def _check_check_mass(reading: _Reading) -> Notes:
    mass, table = reading.rig.check_mass, reading.find_table("check_mass")
    if mass is None:
        return
    ratio = mass.mass / reading.setup.hammer_mass
    if ratio > 10.0 or ratio < 0.1:
        text = f"mass of [check_mass] is {mass.mass * 1e3:.4g} g beside a hammer of"
        text = f"{text} {reading.setup.hammer_mass * 1e3:.4g} g: take one between the samples'"
        yield warning(table, "mass", text)
    if mass.name in reading.samples.names:
        text = f"a sample is called {mass.name!r}, as that of [check_mass]: give it another name"
        yield fault(reading.find_sample(mass.name), "name", text)


def _check_peak(reading: _Reading) -> Notes:
    """Compare what the hammer will see of the weakest and strongest hit with its range."""
    setup, analysis = reading.setup, reading.analysis
    full_scale = reading.find_full_scale(setup.find_sensor(HAMMER))
    channel = reading.find_channel(HAMMER)
    series = setup.at_angles(reading.rig.release_angles) if reading.rig.release_angles else setup
    peaks = {}
    for sample in series.samples.samples:
        mass, time = series.samples.get_moving_mass(sample.name), sample.reference_contact_time
        speed = series.for_series(sample.name).impact_speed
        # The force is half of its peak in the mean, and stops the hammer in the sample's frame.
        peak = 2.0 * speed * mass / (mass + setup.hammer_mass) / time
        if math.isfinite(peak):
            peaks[sample.name] = peak * 1.5  # at a restitution of 0.5
    if not full_scale or not peaks:
        return
    weakest, strongest = min(peaks, key=peaks.__getitem__), max(peaks, key=peaks.__getitem__)
    if peaks[weakest] < analysis.minimum_peak * full_scale:
        text = f"hits on {weakest!r} will reach about {peaks[weakest]:.3g} m/s², weaker than"
        text = (
            f"{text} minimum_peak, {analysis.minimum_peak * full_scale:.4g} m/s² of the hammer's"
        )
        text = f"{text} full_scale: swing higher, use a more sensitive sensor or range, or set"
        yield warning(channel, "full_scale", f"{text} minimum_peak in [analysis]")
    if peaks[strongest] > analysis.maximum_peak * full_scale:
        text = f"hits on {strongest!r} will reach about {peaks[strongest]:.3g} m/s², and the"
        text = f"{text} hammer's full_scale is {full_scale:.4g} m/s²: swing lower, or use a less"
        yield warning(channel, "full_scale", f"{text} sensitive sensor or range")


def _check_sensors(reading: _Reading) -> Notes:
    cutoff = reading.analysis.cutoff_frequency or math.inf
    longest = max(reading.contact_times, default=2e-4)
    for sensor in reading.setup.sensors:
        table = reading.find_channel(sensor.channel)
        if 0.0 < sensor.resonance < cutoff < math.inf:
            text = f"resonance of {table.place} is {sensor.resonance:g} Hz, below the low-pass of"
            text = f"{text} {cutoff:g} Hz: the sensor rings in the pulse"
            yield warning(table, "resonance", text)
        if 2.0 * math.pi * sensor.low_corner * longest > 0.05:
            text = f"low_corner of {table.place} is {sensor.low_corner:g} Hz: a contact of"
            text = f"{text} {longest * 1e6:g} µs droops by more than 5 %"
            yield warning(table, "low_corner", text)
        if 0.0 < sensor.upper_corner * longest < 3.0:
            text = f"upper_corner of {table.place} is {sensor.upper_corner:g} Hz: it widens a"
            yield warning(table, "upper_corner", f"{text} contact of {longest * 1e6:g} µs")
        if sensor.sensitivity_uncertainty > 0.1:
            text = (
                f"sensitivity_uncertainty of {table.place} is {sensor.sensitivity_uncertainty:g}"
            )
            text = f"{text}, part of the sensitivity: sheets say 0.005 to 0.05"
            yield warning(table, "sensitivity_uncertainty", text)
        largest = abs(sensor.sensitivity) * sensor.full_scale
        if largest > 25.0:
            text = (
                f"sensitivity times full_scale of {table.place} is {largest:.4g} V: sensors give"
            )
            yield warning(table, "sensitivity", f"{text} 10 V at most, is the unit right?")
        elif 0.0 < largest < 5e-3:
            text = f"sensitivity times full_scale of {table.place} is {largest * 1e3:.3g} mV"
            yield warning(table, "sensitivity", f"{text}: it drowns in noise, is the unit right?")


class Plausible(NamedTuple):
    """The usual range of a number of a rig file, and the warning outside it."""

    table: str
    key: str
    read: Callable[[RigSetup], float]
    shown: str  # how the value is written
    low: float
    high: float
    advice: str


PLAUSIBLE = (
    Plausible("hammer", "mass", lambda rig: rig.hammer_mass, "{:.4g} kg", 1e-3, 20.0,
              "a pendulum hammer has 10 g to some kg, is the unit right?"),
    Plausible("hammer", "mass_uncertainty",
              lambda rig: 100.0 * rig.hammer_mass_uncertainty / rig.hammer_mass,
              "{:.3g} % of the mass", 0.0, 5.0, "a balance does better"),
    Plausible("hammer", "impact_speed", lambda rig: rig.impact_speed, "{:.4g} m/s", 1e-3, 10.0,
              "a pendulum reaches 1 cm/s to some m/s, is the unit right?"),
    Plausible("hammer", "impact_speed_uncertainty",
              lambda rig: 100.0 * rig.impact_speed_uncertainty / rig.impact_speed,
              "{:.3g} % of the speed", 0.0, 10.0, "a light barrier does better"),
    Plausible("digitizer", "clock_uncertainty", lambda rig: rig.clock_uncertainty,
              "{:g}, part of the rate", 0.0, 0.01, "a crystal has 1e-4 or less"),
    Plausible("analysis", "record_duration", lambda rig: rig.analysis.record_duration, "{:g} s",
              0.0, 1.0, "impacts take ms"),
    Plausible("analysis", "double_hit_level", lambda rig: rig.analysis.double_hit_level, "{:g}",
              0.0, 0.2, "second contacts below it count as none, 0.02 is usual"),
    Plausible("analysis", "maximum_peak", lambda rig: rig.analysis.maximum_peak, "{:g}",
              0.0, 0.99, "it leaves no room below the rail, 0.95 is usual"),
)  # fmt: skip


def _check_plausible(reading: _Reading) -> Notes:
    for item in PLAUSIBLE:
        value, table = item.read(reading.setup), reading.find_table(item.table)
        if value < item.low or value > item.high:
            shown = item.shown.format(value)
            text = f"{item.key} of [{item.table}] is {shown}: {item.advice}"
            yield warning(table, item.key, text)


CHECKS: tuple[Callable[[_Reading], Notes], ...] = (
    _check_channels, _check_drivers, _check_rate, _check_record, _check_trigger, _check_settings,
    _check_masses, _check_samples, _check_swing, _check_barrier, _check_check_mass, _check_peak,
    _check_sensors, _check_plausible,
)  # fmt: skip
