"""The set-up of a run: rig, masses, references, calibration, settings, software."""

import math
from collections.abc import Sequence
from datetime import UTC, datetime

from impact_rig.core.quantity import list_stored
from impact_rig.core.sensors import Sensor
from impact_rig.core.setup import (
    DEFAULT_CLOCK_UNCERTAINTY,
    AnalysisSettings,
    RigSetup,
    format_angle,
)
from impact_rig.present.report.document import Facts, Folded, Listing, Paragraph, Part, Section
from impact_rig.results.hit_traces import Acquisition
from impact_rig.results.numbers import MEGA, MICRO, MISSING, format_count, format_number
from impact_rig.results.run import Provenance, Run
from impact_rig.results.tables import Table, make_column, make_table, make_text_column

GRAM = 1e3
"""Kilograms to grams."""
EARLIEST_TIME = 631_152_000_000_000_000
"""1990-01-01 [ns since the epoch]: files without a date are imported as of 1970."""
WITHOUT_TRACES = (
    "This run was read from its results alone. They hold no traces and say nothing of date,"
    " calibration and software: Fig. 5 and the traces of each sample are missing here. A report of"
    " the recording, session.mcap, has them."
)


SETTINGS = {
    "cutoff_frequency": ("low-pass, 0 for none", "kHz", 1e-3),
    "pulse_factor": ("F in τp = F w50", "", 1.0),
    "pre_trigger": ("record before the trigger", "ms", 1e3),
    "record_duration": ("length of a record", "ms", 1e3),
    "detection_level": ("pulse found from, of full scale", "%", 100.0),
    "minimum_peak": ("weak below, of full scale", "%", 100.0),
    "maximum_peak": ("overload above, of full scale", "%", 100.0),
    "overload_run": ("points at the rail that make an overload", "", 1.0),
    "double_hit_level": ("second pulse that makes a double hit, of the first", "%", 100.0),
    "double_hit_window": ("second pulse counts within, 0 for anywhere", "ms", 1e3),
    "turns_polarity": ("hits of the other sign are turned", "", 1.0),
    "contact_exponent": ("n of the contact law, 0 where it is fitted", "", 1.0),
    "keep_hits": ("hits of a sample averaged at most, 0 for all", "", 1.0),
}
"""Fields of `AnalysisSettings`: label, unit, and scale to it."""


def make_setup_section(run: Run) -> Section:
    """Return the sections on the set-up."""
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
    return Section("Set-up", tuple(parts))


def format_time(nanoseconds: int) -> str:
    """Return a moment in universal time, alike on every machine."""
    try:
        moment = datetime.fromtimestamp(nanoseconds // 1_000_000_000, tz=UTC)
    except (OverflowError, OSError, ValueError):
        return f"{nanoseconds} ns"
    return f"{moment:%Y-%m-%d %H:%M:%S} UTC"


def is_dated(provenance: Provenance) -> bool:
    """Return whether a recording has a date."""
    return provenance.start_time >= EARLIEST_TIME


def _format_period(provenance: Provenance) -> str:
    """Return start and duration of a recording; both are unknown for imported hits."""
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


def _format_value(value: float | str, scale: float = 1.0) -> str:
    """Return a value of the set-up; a dash where it is unknown."""
    if isinstance(value, str):
        return value or MISSING
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value * scale:.7g}" if math.isfinite(value) else MISSING


def _describe_speeds(setup: RigSetup) -> str:
    """Return the impact speed, of series from several release angles each with its angle."""
    series = {item.release_angle: item.name for item in setup.samples.samples if item.has_angle}
    if math.isnan(setup.impact_speed):
        return "not known"
    if not series:
        return f"{100.0 * setup.impact_speed:.7g} cm/s"
    return ", ".join(
        f"{100.0 * setup.for_series(name).impact_speed:.4g} cm/s from {format_angle(angle)}"
        for angle, name in series.items()
    )


def _describe_clock(uncertainty: float) -> str:
    if not uncertainty:
        return "uncertainty not stated"
    text = f"standard uncertainty {1e6 * uncertainty:.7g} ppm"
    is_default = uncertainty == DEFAULT_CLOCK_UNCERTAINTY
    return f"{text}, the default: a crystal good for 100 ppm" if is_default else text


def _describe_hammer_stiffness(setup: RigSetup) -> str:
    if math.isfinite(setup.hammer_stiffness):
        given = setup.hammer_stiffness * MEGA
        return f"{given:.7g} MN/m, from an earlier control experiment"
    if setup.samples.control_sample:
        return f"from the control experiment on {setup.samples.control_sample}"
    return "not known: the set has no control sample"


def _tabulate_bodies(setup: RigSetup) -> Table:
    carried = setup.samples
    # One line for a sample, from however many angles it is struck.
    samples = {item.body: item for item in carried.samples}.values()
    rows = [
        ("hammer", "", setup.hammer_mass, setup.hammer_mass_uncertainty),
        # A mass of zero was not stated.
        (
            "accelerometer",
            "",
            carried.accelerometer_mass or math.nan,
            carried.accelerometer_mass_uncertainty,
        ),
        *((item.body, item.material, item.mass, item.mass_uncertainty) for item in samples),
    ]

    def refer(field: str, digits: int, scale: float = 1.0) -> list[str]:
        values = (getattr(item, field) * scale for item in samples)
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
        make_column("Ref. τp [µs]", refer("reference_contact_time", 2, MICRO)),
        make_column("Ref. k2 [MN/m]", refer("reference_stiffness", 2, MEGA)),
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
    for name, header, make, scale in (
        ("quantity", "Quantity", make_text_column, 1.0),
        ("unit", "Unit", make_text_column, 1.0),
        ("sensitivity", "Sensitivity [mV per unit]", make_column, 1e3),
        ("full_scale", "Full scale [unit]", make_column, 1.0),
        ("serial_number", "Serial number", make_text_column, 1.0),
        ("calibration_date", "Calibrated", make_text_column, 1.0),
        ("resonance", "Resonance [kHz]", make_column, 1e-3),
        ("low_corner", "Low corner [Hz]", make_column, 1.0),
    ):
        values = [getattr(sensor, name) or "" for sensor in sensors]
        columns.append(make(header, [_format_value(value, scale) for value in values]))
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
    stored = list_stored(settings)
    fields = [SETTINGS[name] for name in stored]
    values = [
        _format_value(value, scale)
        for value, (_, _, scale) in zip(stored.values(), fields, strict=True)
    ]
    columns = [
        make_text_column("Setting", [label for label, _, _ in fields]),
        make_column("Value", values),
        make_text_column("Unit", [unit for _, unit, _ in fields]),
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
