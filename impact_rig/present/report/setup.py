"""What was measured and with what: rig, masses, references, calibration, settings, software."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from impact_rig.core.quantity import list_stored
from impact_rig.core.setup.samples import DEFAULT_CLOCK_UNCERTAINTY, RigSetup, format_angle
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.present.report.document import Facts, Folded, Listing, Paragraph, Part, Section
from impact_rig.results.hit_traces import Acquisition
from impact_rig.results.numbers import MEGA, MICRO, MISSING, format_count, format_number
from impact_rig.results.run import Provenance, Run
from impact_rig.results.tables import Table, make_column, make_table, make_text_column

GRAM = 1e3
"""Kilograms to grams."""
EARLIEST_TIME = 631_152_000_000_000_000
"""1990-01-01 [ns since the epoch], our choice: files without a date are imported as of 1970."""
WITHOUT_TRACES = (
    "This run was read from its results alone. They hold no traces and say nothing of date,"
    " calibration and software: Fig. 5 and the traces of each sample are missing here. A report of"
    " the recording, session.mcap, has them."
)


@dataclass(frozen=True)
class SetupField:
    """How a field of the set-up is shown: its name in words, its unit, and the scale to it."""

    label: str
    unit: str = ""
    scale: float = 1.0

    def format(self, value: float | str | None) -> str:
        """Return a value in this unit; a dash for what is not known."""
        if isinstance(value, str):
            return value or MISSING
        if isinstance(value, bool):
            return "yes" if value else "no"
        if value is None or not math.isfinite(value):
            return MISSING
        return f"{value * self.scale:.7g}"


SETTINGS = {
    "cutoff_frequency": SetupField("low-pass, 0 for none", "kHz", 1e-3),
    "pulse_factor": SetupField("F in τp = F w50"),
    "pre_trigger": SetupField("record before the trigger", "ms", 1e3),
    "record_duration": SetupField("length of a record", "ms", 1e3),
    "detection_level": SetupField("pulse found from, of full scale", "%", 100.0),
    "minimum_peak": SetupField("weak below, of full scale", "%", 100.0),
    "maximum_peak": SetupField("overload above, of full scale", "%", 100.0),
    "overload_run": SetupField("points at the rail that make an overload"),
    "double_hit_level": SetupField("second pulse that makes a double hit, of the first", "%", 100),
    "double_hit_window": SetupField("second pulse counts within, 0 for anywhere", "ms", 1e3),
    "turns_polarity": SetupField("hits of the other sign are turned"),
    "contact_exponent": SetupField("n of the contact law, 0 where it is fitted"),
    "keep_hits": SetupField("hits of a sample averaged at most, 0 for all"),
}
"""Fields of `AnalysisSettings`."""
SETUP_FIELDS = {
    **SETTINGS,
    "hammer_mass": SetupField("mass of the hammer m1", "g", GRAM),
    "hammer_mass_uncertainty": SetupField("standard uncertainty of m1", "g", GRAM),
    "hammer_stiffness": SetupField("given stiffness of the hammer k1", "MN/m", MEGA),
    "accelerometer_mass": SetupField("mass of the accelerometer", "g", GRAM),
    "accelerometer_mass_uncertainty": SetupField("standard uncertainty of it", "g", GRAM),
    "clock_uncertainty": SetupField("standard uncertainty of the clock", "ppm", 1e6),
    "impact_speed": SetupField("impact speed v1", "cm/s", 100.0),
    "release_angle": SetupField("release angle", "°", math.degrees(1.0)),
    "control_sample": SetupField("control sample"),
    "material": SetupField("material"),
    "mass": SetupField("mass", "g", GRAM),
    "mass_uncertainty": SetupField("standard uncertainty of the mass", "g", GRAM),
    "reference_contact_time": SetupField("reference τp", "µs", MICRO),
    "reference_stiffness": SetupField("reference k2", "MN/m", MEGA),
    "reference_damping_coefficient": SetupField("reference c2", "N s/m"),
    "quantity": SetupField("quantity"),
    "unit": SetupField("unit"),
    "sensitivity": SetupField("sensitivity", "mV per unit", 1e3),
    "full_scale": SetupField("full scale", "unit"),
    "serial_number": SetupField("serial number"),
    "calibration_date": SetupField("calibrated"),
    "sensitivity_uncertainty": SetupField("standard uncertainty of the sensitivity", "%", 100.0),
    "resonance": SetupField("resonance", "kHz", 1e-3),
    "resonance_uncertainty": SetupField("standard uncertainty of the resonance", "kHz", 1e-3),
    "resonance_damping": SetupField("damping of the resonance"),
    "low_corner": SetupField("low corner", "Hz"),
    "low_corner_uncertainty": SetupField("standard uncertainty of the low corner", "Hz"),
}
"""Fields of the whole set-up."""


def make_setup_section(run: Run) -> Section:
    """Tell what was measured and with what."""
    setup = run.campaign.results.setup
    parts: list[Part] = [] if run.has_traces else [Paragraph(WITHOUT_TRACES)]
    parts += [
        Facts(_list_facts(run)),
        _tabulate_bodies(setup),
        *_tabulate_sensors(setup.sensors),
        *_tabulate_acquisitions(run.acquisitions),
        _fold_settings(setup.analysis),
        *_list_software(run.provenance),
    ]
    return Section("What was measured, and with what", tuple(parts))


def format_time(nanoseconds: int) -> str:
    """Return a moment in universal time, alike on every machine."""
    try:
        moment = datetime.fromtimestamp(nanoseconds // 1_000_000_000, tz=UTC)
    except (OverflowError, OSError, ValueError):
        return f"{nanoseconds} ns"
    return f"{moment:%Y-%m-%d %H:%M:%S} UTC"


def is_dated(provenance: Provenance) -> bool:
    """Return whether a recording says when it was made."""
    return provenance.start_time >= EARLIEST_TIME


def _format_period(provenance: Provenance) -> str:
    """Return when a recording began and how long it took; of imported hits neither is known."""
    if not is_dated(provenance):
        return "date not known"
    duration = (provenance.end_time - provenance.start_time) * 1e-9
    return f"{format_time(provenance.start_time)}, for {duration:.1f} s"


def _list_facts(run: Run) -> tuple[tuple[str, str], ...]:
    setup = run.campaign.results.setup
    facts = [
        ("Rig", ": ".join(text for text in (setup.name, setup.description) if text)),
        ("Origin", str(run.campaign.results.origin)),
        ("Impact speed v1", _describe_speeds(setup)),
        ("Clock", _describe_clock(setup.clock_uncertainty)),
        ("Hammer stiffness k1", _describe_hammer_stiffness(setup)),
        ("Read from", run.source),
    ]
    if run.provenance is not None:
        facts += _list_recording_facts(run.provenance)
    return tuple((name, text) for name, text in facts if text)


def _list_recording_facts(provenance: Provenance) -> list[tuple[str, str]]:
    facts = [("Recorded", _format_period(provenance))]
    facts += [
        ("File", f"{file.name}, {file.size / 1e6:.4g} MB, SHA-256 {file.sha256}")
        for file in provenance.files
    ]
    is_sound = "sound: every checksum is right and nothing is missing"
    facts += [
        ("Condition", "; ".join(provenance.problems) or is_sound),
        # Only a recorder that was there knows.
        ("Lost while recorded", provenance.losses or ("nothing" if provenance.ended else "")),
        ("Ended", provenance.ended),
    ]
    return facts + [
        (f"Note, {format_time(note.time)}" if note.time else "Notes", note.text)
        for note in provenance.notes
    ]


def _format_unit(value: float, field: str) -> str:
    shown = SETUP_FIELDS[field]
    text = shown.format(value)
    return text if text == MISSING else f"{text} {shown.unit}"


def _describe_speeds(setup: RigSetup) -> str:
    """Return the impact speed, of series from several release angles each with its angle."""
    series = {item.release_angle: item.name for item in setup.samples.samples if item.has_angle}
    if math.isnan(setup.impact_speed):
        return "not known"
    if not series:
        return _format_unit(setup.impact_speed, "impact_speed")
    return ", ".join(
        f"{100.0 * setup.for_series(name).impact_speed:.4g} cm/s from {format_angle(angle)}"
        for angle, name in series.items()
    )


def _describe_clock(uncertainty: float) -> str:
    if not uncertainty:
        return "uncertainty not stated"
    text = f"standard uncertainty {_format_unit(uncertainty, 'clock_uncertainty')}"
    is_default = uncertainty == DEFAULT_CLOCK_UNCERTAINTY
    return f"{text}, the default: a crystal good for 100 ppm" if is_default else text


def _describe_hammer_stiffness(setup: RigSetup) -> str:
    if math.isfinite(setup.hammer_stiffness):
        given = _format_unit(setup.hammer_stiffness, "hammer_stiffness")
        return f"{given}, from an earlier control experiment"
    if setup.samples.control_sample:
        return f"from the control experiment on {setup.samples.control_sample}"
    return "not known: the set has no control sample"


def _tabulate_bodies(setup: RigSetup) -> Table:
    carried = setup.samples
    # One line for a sample, from however many angles it is struck.
    samples = {item.body: item for item in carried.samples}.values()
    rows = [
        ("hammer", "", setup.hammer_mass, setup.hammer_mass_uncertainty),
        # Without one nobody has stated it.
        (
            "accelerometer",
            "",
            carried.accelerometer_mass or math.nan,
            carried.accelerometer_mass_uncertainty,
        ),
        *((item.body, item.material, item.mass, item.mass_uncertainty) for item in samples),
    ]

    def refer(field: str, digits: int) -> list[str]:
        shown = SETUP_FIELDS[field]
        values = (getattr(item, field) * shown.scale for item in samples)
        return ["", "", *(format_number(value, digits) for value in values)]

    roles = ["", "part of every m2"] + [
        "control sample" if item.name == carried.find_control(item.release_angle) else ""
        for item in samples
    ]
    columns = [
        make_text_column("Body", [name for name, *_ in rows]),
        make_text_column("Material", [material for _, material, *_ in rows]),
        make_column("Mass [g]", [format_number(mass * GRAM, 2) for *_, mass, _ in rows]),
        make_column("u [g]", [f"{wide * GRAM:.2g}" if wide else MISSING for *_, wide in rows]),
        make_column("Ref. τp [µs]", refer("reference_contact_time", 2)),
        make_column("Ref. k2 [MN/m]", refer("reference_stiffness", 2)),
        make_column("Ref. c2 [N s/m]", refer("reference_damping_coefficient", 0)),
        make_text_column("Role", roles),
    ]
    note = (
        "Masses of samples are without accelerometer. u: standard uncertainty. Ref.: what the"
        " sample is expected to show, published or from earlier work."
    )
    return make_table("Bodies", columns, [note])


def _tabulate_sensors(sensors: Sequence[Sensor]) -> list[Part]:
    if not sensors:
        return []
    columns = [make_text_column("Sensor", [sensor.channel for sensor in sensors])]
    for name, header, make in (
        ("quantity", "Quantity", make_text_column),
        ("unit", "Unit", make_text_column),
        ("sensitivity", "Sensitivity [mV per unit]", make_column),
        ("full_scale", "Full scale [unit]", make_column),
        ("serial_number", "Serial number", make_text_column),
        ("calibration_date", "Calibrated", make_text_column),
        ("resonance", "Resonance [kHz]", make_column),
        ("low_corner", "Low corner [Hz]", make_column),
    ):
        values = [getattr(sensor, name) or "" for sensor in sensors]
        columns.append(make(header, [SETUP_FIELDS[name].format(value) for value in values]))
    return [make_table("Sensors, by their calibration sheets", columns)]


def _tabulate_acquisitions(acquisitions: Sequence[Acquisition]) -> list[Part]:
    rows = [(item, channel) for item in acquisitions for channel in item.channels]
    if not rows:
        return []
    channels = [channel for _, channel in rows]
    columns = [
        make_text_column("Channel", [item.name for item in channels]),
        make_column("Rate [kHz]", [f"{item.sampling_rate * 1e-3:.7g}" for item, _ in rows]),
        make_text_column(
            "Output", ["counts" if item.is_counted else "numbers" for item in channels]
        ),
        make_column("Scale [m/s² per unit]", [f"{item.scale:.7g}" for item in channels]),
        make_column("Offset [m/s²]", [f"{item.offset:.7g}" for item in channels]),
        make_column(
            "Full scale [m/s²]",
            [f"{item.full_scale:.7g}" if item.full_scale else MISSING for item in channels],
        ),
    ]
    note = "Acceleration is scale times output plus offset, as every block of the recording says."
    return [make_table("Sampling and calibration", columns, [note])]


def _fold_settings(settings: AnalysisSettings) -> Folded:
    named = [(SETTINGS[name], value) for name, value in list_stored(settings).items()]
    rows = [(shown.label, shown.format(value), shown.unit) for shown, value in named]
    labels, values, units = zip(*rows, strict=True)
    columns = [
        make_text_column("Setting", labels),
        make_column("Value", values),
        make_text_column("Unit", units),
    ]
    title = "Settings of judgement and evaluation"
    return Folded(title, (make_table(title, columns),))


def _list_software(provenance: Provenance | None) -> list[Part]:
    if provenance is None:
        return []
    parts: list[Part] = []
    if provenance.versions:
        names, versions = zip(*provenance.versions, strict=True)
        columns = [make_text_column("Software", names), make_text_column("Version", versions)]
        parts.append(Folded("Software that recorded it", (make_table("Software", columns),)))
    if provenance.parameters:
        listings = tuple(Listing(node, text.rstrip()) for node, text in provenance.parameters)
        parts.append(Folded(f"Parameters of {format_count(len(listings), 'node')}", listings))
    return parts
