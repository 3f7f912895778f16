"""One list of checks of a whole rig file, before the first hit."""
# ruff: noqa: PLR2004 - each threshold stands in the sentence that tells it

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from impact_rig.configuration.rig_file import (
    RigFile,
    read_today,
    take_barrier_distance,
    take_trigger_level,
)
from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.estimates.checks import advise_check
from impact_rig.core.estimates.equations import estimate_equivalent_mass
from impact_rig.core.estimates.paper_method import check_control
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.filtering import HIGHEST_RELATIVE_CUTOFF
from impact_rig.core.given.sensors import CHANNELS, STANDARD_GRAVITY
from impact_rig.core.given.setup import RigSetup

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
        # The largest acceleration that the hammer's sensor takes [m/s^2]; 0: not known.
        self.full_scale = self.setup.find_sensor(HAMMER).compute_full_scale(rig.setup.hammer_mass)
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
        tables = self.rig.document.take_tables("sample")
        return next((table for table in tables if table.get("name") == name), TomlTable({}))


def fault(table: TomlTable, key: str, told: str) -> RigNote:
    """Return what cannot work because of a key, with its line."""
    return RigNote(str(table.make_error(key, f"{key} of {table.place} {told}")), is_fault=True)


def warning(table: TomlTable, key: str, told: str) -> RigNote:
    """Return a warning about a key, with its line."""
    return replace(fault(table, key, told), is_fault=False)


def remark(table: TomlTable, key: str, text: str, *, is_fault: bool = False) -> RigNote:
    """Return a whole sentence, with the line of a key."""
    return RigNote(str(table.make_error(key, text)), is_fault)


def _check_channels(reading: _Reading) -> Notes:
    if reading.is_virtual:
        return
    hammer, specimen = map(reading.find_channel, CHANNELS)
    if HAMMER in reading.source and SPECIMEN not in reading.source:
        text = "[source] has no [source.specimen]: only the hammer is measured, so no hit is"
        yield remark(reading.source, SPECIMEN, f"{text} checked by the sample's motion")
    name = str(specimen.get("channel", ""))
    if name and name == str(hammer.get("channel", "")):
        text = f"is {name!r}, the hammer's: the two sensors are at two channels"
        yield fault(specimen, "channel", text)
    serial = specimen.get("serial_number", "")
    if serial and serial == hammer.get("serial_number"):
        text = f"is {serial!r}, the hammer sensor's: they are two"
        yield warning(specimen, "serial_number", text)


def _check_drivers(reading: _Reading) -> Notes:
    holder = reading.rig.holder
    holds_virtually = holder.get("driver", VIRTUAL) == VIRTUAL
    if reading.is_virtual and not holds_virtually:
        text = "[holder] moves a real hammer, and the accelerations are of the virtual rig: name"
        yield remark(holder, "driver", f"{text} the digitizer in [source]")
    if holds_virtually and not reading.is_virtual:
        text = "[source] measures, and nothing lets a hammer go: add [holder], for example with"
        yield remark(reading.source, "driver", f'{text} driver = "manual"')


def _check_rate(reading: _Reading) -> Notes:
    source, analysis, rate = reading.source, reading.find_table("analysis"), reading.rate
    if math.isnan(rate):
        return
    cutoff, highest = reading.analysis.cutoff_frequency, HIGHEST_RELATIVE_CUTOFF * rate
    if cutoff > highest:
        is_stated = "cutoff_frequency" in analysis
        table, key = (analysis, "cutoff_frequency") if is_stated else (source, "sampling_rate")
        text = f"cutoff_frequency of [analysis] is {cutoff:g} Hz: at {rate:g} Hz it must be"
        yield remark(table, key, f"{text} {highest:g} Hz or less", is_fault=True)
    before = reading.analysis.pre_trigger * rate
    if before < 10.0:
        text = f"is {rate:g} Hz: the {before:.1f} points before the impact give no baseline"
        yield fault(source, "sampling_rate", f"{text}, it takes 10")
    points = min(reading.contact_times, default=math.nan) / reading.analysis.pulse_factor * rate
    text = f"is {rate:g} Hz: the shortest expected pulse has {points:.1f} points at half amplitude"
    if points < 3.0:
        yield fault(source, "sampling_rate", f"{text}, it takes 3")
    elif points < 10.0:
        yield warning(source, "sampling_rate", f"{text}: 10 or more resolve it")


def _check_record(reading: _Reading) -> Notes:
    source, analysis = reading.source, reading.analysis
    needed = analysis.record_duration - analysis.pre_trigger
    if reading.pre_trigger < analysis.pre_trigger:
        text = f"is {reading.pre_trigger * 1e6:g} µs: the analysis keeps"
        text = f"{text} {analysis.pre_trigger * 1e6:g} µs before the impact, record 1.5 times that"
        yield fault(source, "pre_trigger", text)
    after = reading.duration - max(reading.pre_trigger, 0.0)
    text = f"leaves {after * 1e3:g} ms after the trigger"
    if after < needed * (1.0 - 1e-9):
        text = f"{text}: the analysis looks at {needed * 1e3:g} ms"
        yield fault(source, "record_duration", text)
    elif after > 1.5 * needed:
        text = f"{text}, of which the analysis looks at {needed * 1e3:g} ms: leave record_duration"
        yield warning(source, "record_duration", f"{text} of [analysis] out, and it looks at all")
    longest = max(reading.contact_times, default=math.nan)
    if needed < 2.0 * longest:
        text = f"leaves {needed * 1e6:g} µs after the impact begins: a contact of"
        text = f"{text} {longest * 1e6:g} µs needs twice its time"
        yield fault(reading.find_table("analysis"), "record_duration", text)


def _check_trigger(reading: _Reading) -> Notes:
    source, analysis = reading.source, reading.analysis
    if analysis.detection_level >= analysis.minimum_peak > 0.0:
        text = f"is {analysis.detection_level:g}: hits begin there, it must be below minimum_peak"
        text = f"{text}, {analysis.minimum_peak:g}"
        yield fault(reading.find_table("analysis"), "detection_level", text)
    trigger = take_trigger_level(source, reading.setup.hammer_mass)
    if trigger is None or not reading.full_scale:
        return
    level = trigger / reading.full_scale
    text = f"is {level * 100:.3g} % of the hammer's full_scale"
    if level >= 1.0:
        yield fault(source, "trigger_level", f"{text}: no hit reaches it")
    elif level > analysis.minimum_peak > 0.0:
        text = f"{text}: weaker hits are not seen, and minimum_peak accepts them from"
        yield warning(source, "trigger_level", f"{text} {analysis.minimum_peak * 100:g} % on")
    elif level < 2e-3:
        yield warning(source, "trigger_level", f"{text}: noise may trigger, 1 % is usual")


def _check_settings(reading: _Reading) -> Notes:
    cutoff, shortest = reading.analysis.cutoff_frequency, min(reading.contact_times, default=0.0)
    if 0.0 < cutoff * shortest < 3.0:
        text = f"is {cutoff:g} Hz: it widens a contact of {shortest * 1e6:g} µs,"
        text = f"{text} {3.0 / shortest:.2g} Hz or more does not"
        yield warning(reading.find_table("analysis"), "cutoff_frequency", text)


def _check_masses(reading: _Reading) -> Notes:
    samples, hammer = reading.samples, reading.setup.hammer_mass
    for sample in samples.samples:
        table, ratio = reading.find_sample(sample.name), sample.mass / hammer
        if ratio > 50.0 or ratio < 0.02:
            text = f"is {sample.mass * 1e3:.4g} g beside a hammer of {hammer * 1e3:.4g} g: one"
            yield warning(table, "mass", f"{text} hardly moves the other, is the unit right?")
        if samples.accelerometer_mass > 0.3 * sample.mass:
            text = f"is {samples.accelerometer_mass * 1e3:.4g} g, beside sample {sample.name!r} of"
            text = f"{text} {sample.mass * 1e3:.4g} g: is the unit right?"
            yield warning(reading.find_table("samples"), "accelerometer_mass", text)
        share = sample.mass_uncertainty / sample.mass * 100.0
        if share > 5.0:
            text = f"is {share:.3g} % of the mass: a balance does better"
            yield warning(table, "mass_uncertainty", text)


def _check_samples(reading: _Reading) -> Notes:
    setup, samples, table = reading.setup, reading.samples, reading.find_table("samples")
    if note := check_control(setup):
        yield remark(table, "control", note.explanation)
    if not samples.control_sample and math.isnan(setup.hammer_stiffness):
        text = "[samples] names no control sample: contact times are measured, and neither k nor c"
        yield remark(table, "control", f"{text} of a sample; name one alike to the hammer")
    seen: dict[str, str] = {}
    for sample in samples.samples:
        table, time = reading.find_sample(sample.name), sample.reference_contact_time
        like = seen.setdefault("".join(sample.name.lower().split()), sample.name)
        if like != sample.name:
            text = f"samples {like!r} and {sample.name!r} differ in spaces or capitals only"
            yield remark(table, "name", text)
        if time > 0.02 or time < 2e-6:
            text = f"is {time * 1e6:.4g} µs: metal takes 50 µs to some ms, is the unit right?"
            yield warning(table, "reference_contact_time", text)


def _check_references(reading: _Reading) -> Notes:
    """Compare each sample's reference values with each other, by equations (5) to (6b)."""
    setup, samples = reading.setup, reading.samples
    masses = {item.name: samples.get_moving_mass(item.name) for item in samples.samples}
    hammer = setup.hammer_stiffness
    if math.isnan(hammer) and samples.control_sample:
        mass = estimate_equivalent_mass(setup.hammer_mass, masses[samples.control_sample])
        time = samples.find(samples.control_sample).reference_contact_time
        hammer = 2.0 * mass * (math.pi / time) ** 2
    for sample in samples.samples:
        stiffness, time = sample.reference_stiffness, sample.reference_contact_time
        mass = estimate_equivalent_mass(setup.hammer_mass, masses[sample.name])
        wanted = math.pi * math.sqrt(mass * (1.0 / hammer + 1.0 / stiffness))
        if abs(time / wanted - 1.0) > 0.01:
            text = f"is {time * 1e6:.4g} µs: by the masses, the hammer's stiffness and"
            text = f"{text} reference_stiffness it is {wanted * 1e6:.4g} µs, which one is right?"
            yield warning(reading.find_sample(sample.name), "reference_contact_time", text)


def _check_barrier(reading: _Reading) -> Notes:
    """Compare a light barrier with the swing, the rate, and the accelerometers' channels."""
    table, setup = reading.find_channel("impact_speed"), reading.setup
    if not table:
        return
    name = str(table.get("channel", ""))
    for channel in CHANNELS:
        if name and name == str(reading.find_channel(channel).get("channel", "")):
            text = f"is {name!r}, the {channel}'s: a barrier has its own"
            yield fault(table, "channel", text)
    distance = take_barrier_distance(table)
    way, step = setup.impact_speed / setup.pendulum_rate, setup.impact_speed / reading.rate
    text = f"is {distance * 1e3:.3g} mm: "
    if distance >= way:
        text = f"{text}the hammer swings only {way * 1e3:.3g} mm, from release to contact"
        yield fault(table, "distance", text)
    elif step > 0.01 * distance:
        text = f"{text}from point to point the hammer moves by {100.0 * step / distance:.2g} % of"
        yield warning(table, "distance", f"{text} it, sample faster or take longer")


def _check_check_mass(reading: _Reading) -> Notes:
    mass, hammer = reading.rig.check_mass, reading.setup.hammer_mass
    if mass is None:
        return
    ratio = mass.mass / hammer
    if ratio > 10.0 or ratio < 0.1:
        text = f"is {mass.mass * 1e3:.4g} g beside a hammer of {hammer * 1e3:.4g} g: take one"
        yield warning(reading.find_table("check_mass"), "mass", f"{text} between the samples'")
    if not reading.is_virtual and (advice := advise_check(reading.setup)):
        yield remark(reading.find_table("check_mass"), "mass", advice)
    if mass.name in reading.samples.names:
        text = f"a sample is called {mass.name!r}, as that of [check_mass]: give it another name"
        yield remark(reading.find_sample(mass.name), "name", text, is_fault=True)


def _check_peak(reading: _Reading) -> Notes:
    """Compare what the hammer will see of the weakest and strongest hit with its range."""
    setup, analysis, full_scale = reading.setup, reading.analysis, reading.full_scale
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
    least = max(analysis.minimum_peak, analysis.detection_level) * full_scale
    if peaks[weakest] < least:
        text = f"hits on {weakest!r} will reach about {peaks[weakest]:.3g} m/s², weaker than"
        text = f"{text} the least that counts, {least:.4g} m/s² by [analysis]: swing higher,"
        text = f"{text} use a more sensitive sensor or range, or set minimum_peak there"
        yield remark(channel, "full_scale", text)
    if peaks[strongest] > analysis.maximum_peak * full_scale:
        text = f"hits on {strongest!r} will reach about {peaks[strongest]:.3g} m/s², and the"
        text = f"{text} hammer's full_scale is {full_scale:.4g} m/s²: swing lower, or use a less"
        yield remark(channel, "full_scale", f"{text} sensitive sensor or range")


def _check_sensors(reading: _Reading) -> Notes:
    cutoff = reading.analysis.cutoff_frequency or math.inf
    longest = max(reading.contact_times, default=2e-4)
    contact = f"a contact of {longest * 1e6:g} µs"
    for sensor in reading.setup.sensors:
        table = reading.find_channel(sensor.channel)
        if 0.0 < sensor.resonance < cutoff < math.inf:
            text = f"is {sensor.resonance:g} Hz, below the low-pass of {cutoff:g} Hz: the sensor"
            yield warning(table, "resonance", f"{text} rings in the pulse")
        if 2.0 * math.pi * sensor.low_corner * longest > 0.05:
            text = f"is {sensor.low_corner:g} Hz: {contact} droops by more than 5 %"
            yield warning(table, "low_corner", text)
        if 0.0 < sensor.upper_corner * longest < 3.0:
            text = f"is {sensor.upper_corner:g} Hz: it widens {contact}"
            yield warning(table, "upper_corner", text)
        if sensor.sensitivity_uncertainty > 0.1:
            text = f"is {sensor.sensitivity_uncertainty:g} of the sensitivity: certificates say"
            yield warning(table, "sensitivity_uncertainty", f"{text} 0.005 to 0.05")
        largest = abs(sensor.sensitivity) * sensor.full_scale
        text = f"sensitivity times full_scale of {table.place} is {largest:.4g} V:"
        if largest > 25.0:
            text = f"{text} sensors give 10 V at most, is the unit right?"
            yield remark(table, "sensitivity", text)
        elif 0.0 < largest < 5e-3:
            text = f"{text} it drowns in noise, is the unit right?"
            yield remark(table, "sensitivity", text)


PLAUSIBLE: tuple[tuple[str, str, Callable[[RigSetup], float], str, float, float, str], ...] = (
    ("hammer", "mass", lambda rig: rig.hammer_mass, "{:.4g} kg", 1e-3, 20.0,
     "a pendulum hammer has 10 g to some kg, is the unit right?"),
    ("hammer", "mass_uncertainty",
     lambda rig: 100.0 * rig.hammer_mass_uncertainty / rig.hammer_mass,
     "{:.3g} % of the mass", 0.0, 5.0, "a balance does better"),
    ("hammer", "impact_speed", lambda rig: rig.impact_speed, "{:.4g} m/s", 1e-3, 10.0,
     "a pendulum reaches 1 cm/s to some m/s, is the unit right?"),
    ("hammer", "impact_speed_uncertainty",
     lambda rig: 100.0 * rig.impact_speed_uncertainty / rig.impact_speed,
     "{:.3g} % of the speed", 0.0, 10.0, "a light barrier does better"),
    ("hammer", "release_angle", lambda rig: STANDARD_GRAVITY / rig.pendulum_rate**2,
     "that of a pendulum {:.2g} m long", 0.02, 5.0, "it or impact_speed is wrong"),
    ("digitizer", "clock_uncertainty", lambda rig: rig.clock_uncertainty,
     "{:g}, part of the rate", 0.0, 0.01, "a crystal has 1e-4 or less"),
    ("analysis", "record_duration", lambda rig: rig.analysis.record_duration, "{:g} s",
     0.0, 1.0, "impacts take ms"),
    ("analysis", "double_hit_level", lambda rig: rig.analysis.double_hit_level, "{:g}",
     0.0, 0.2, "second contacts below it count as none, 0.02 is usual"),
    ("analysis", "maximum_peak", lambda rig: rig.analysis.maximum_peak, "{:g}",
     0.0, 0.99, "it leaves no room below the rail, 0.95 is usual"),
)  # fmt: skip
"""Of each number: table, key, how it is read and printed, usual range, advice outside it."""


def _check_plausible(reading: _Reading) -> Notes:
    for table, key, read, shown, low, high, advice in PLAUSIBLE:
        value = read(reading.setup)
        if value < low or value > high:
            yield warning(reading.find_table(table), key, f"is {shown.format(value)}: {advice}")


CHECKS: tuple[Callable[[_Reading], Notes], ...] = (
    _check_channels, _check_drivers, _check_rate, _check_record, _check_trigger, _check_settings,
    _check_masses, _check_samples, _check_references, _check_barrier, _check_check_mass,
    _check_peak, _check_sensors, _check_plausible,
)  # fmt: skip
