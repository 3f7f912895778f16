"""What was measured and with what: rig, masses, references, calibration, settings, software."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime

from impact_rig.reporting.report.document import (
    Facts,
    Folded,
    Listing,
    Paragraph,
    Part,
    Section,
    Table,
    make_column,
    make_table,
    make_text_column,
)
from impact_rig.results.numbers import MEGA, MICRO, MISSING, format_number
from impact_rig.results.run import Acquisition, Note, Provenance, Run
from impact_rig.results.setup_results import SensorResults, SettingsResults, SetupResults

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
        if value is None or not math.isfinite(value):
            return MISSING
        return f"{value * self.scale:.7g}"


SETTINGS = {
    "cutoff_frequency_hz": SetupField("low-pass, 0 for none", "kHz", 1e-3),
    "pulse_factor": SetupField("F in τp = F w50"),
    "pre_trigger_s": SetupField("record before the trigger", "ms", 1e3),
    "record_duration_s": SetupField("length of a record", "ms", 1e3),
    "detection_level": SetupField("pulse found from, of full scale", "%", 100.0),
    "minimum_peak": SetupField("weak below, of full scale", "%", 100.0),
    "maximum_peak": SetupField("overload above, of full scale", "%", 100.0),
    "overload_run": SetupField("points at the rail that make an overload"),
    "double_hit_level": SetupField("second pulse that makes a double hit, of the first", "%", 100),
    "keep_hits": SetupField("hits of a sample averaged at most, 0 for all"),
}
"""Fields of `SettingsResults`."""
SETUP_FIELDS = {
    **SETTINGS,
    "hammer_mass_kg": SetupField("mass of the hammer m1", "g", GRAM),
    "hammer_mass_u_kg": SetupField("standard uncertainty of m1", "g", GRAM),
    "hammer_stiffness_n_per_m": SetupField("given stiffness of the hammer k1", "MN/m", MEGA),
    "accelerometer_mass_kg": SetupField("mass of the accelerometer", "g", GRAM),
    "accelerometer_mass_u_kg": SetupField("standard uncertainty of it", "g", GRAM),
    "clock_u": SetupField("standard uncertainty of the clock", "ppm", 1e6),
    "impact_speed_m_per_s": SetupField("impact speed v1", "cm/s", 100.0),
    "control_sample": SetupField("control sample"),
    "material": SetupField("material"),
    "mass_kg": SetupField("mass", "g", GRAM),
    "mass_u_kg": SetupField("standard uncertainty of the mass", "g", GRAM),
    "reference_contact_time_s": SetupField("reference τp", "µs", MICRO),
    "reference_stiffness_n_per_m": SetupField("reference k2", "MN/m", MEGA),
    "reference_damping_coefficient_n_s_per_m": SetupField("reference c2", "N s/m"),
    "quantity": SetupField("quantity"),
    "unit": SetupField("unit"),
    "sensitivity_v_per_unit": SetupField("sensitivity", "mV per unit", 1e3),
    "full_scale": SetupField("full scale", "unit"),
    "serial_number": SetupField("serial number"),
    "calibration_date": SetupField("calibrated"),
}
"""Fields of the whole set-up, by the names that results.json gives them."""


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


def format_period(provenance: Provenance) -> str:
    """Return when a recording began and how long it took."""
    duration = (provenance.end_time - provenance.start_time) * 1e-9
    moment = format_time(provenance.start_time) if is_dated(provenance) else "date not known"
    return f"{moment}, for {duration:.1f} s"


def _list_facts(run: Run) -> tuple[tuple[str, str], ...]:
    setup = run.campaign.results.setup
    facts = [("Rig", ": ".join(text for text in (setup.name, setup.description) if text))]
    facts += [
        ("Impact speed v1", _format_unit(setup.impact_speed_m_per_s, "impact_speed_m_per_s")),
        ("Clock", f"standard uncertainty {_format_unit(setup.clock_u, 'clock_u')}"),
        ("Hammer stiffness k1", _describe_hammer_stiffness(setup)),
        ("Read from", run.source),
    ]
    if run.provenance is not None:
        facts += _list_recording_facts(run.provenance)
    return tuple((name, text) for name, text in facts if text)


def _list_recording_facts(provenance: Provenance) -> list[tuple[str, str]]:
    facts = [("Measured", format_period(provenance))]
    facts += [
        ("File", f"{file.name}, {file.size / 1e6:.4g} MB, SHA-256 {file.sha256}")
        for file in provenance.files
    ]
    is_sound = "sound: every checksum is right and nothing is missing"
    facts += [
        ("Condition", "; ".join(provenance.problems) or is_sound),
        ("Lost while recorded", provenance.losses or "nothing"),
        ("Ended", provenance.ended),
    ]
    return facts + [(_name_note(note), note.text) for note in provenance.notes]


def _name_note(note: Note) -> str:
    return f"Note, {format_time(note.time)}" if note.time else "Notes"


def _format_unit(value: float, field: str) -> str:
    shown = SETUP_FIELDS[field]
    text = shown.format(value)
    return text if text == MISSING else f"{text} {shown.unit}"


def _describe_hammer_stiffness(setup: SetupResults) -> str:
    if math.isfinite(setup.hammer_stiffness_n_per_m):
        given = _format_unit(setup.hammer_stiffness_n_per_m, "hammer_stiffness_n_per_m")
        return f"{given}, from an earlier control experiment"
    if setup.control_sample:
        return f"from the control experiment on {setup.control_sample}"
    return "not known: the set has no control sample"


def _tabulate_bodies(setup: SetupResults) -> Table:
    rows = [
        ("hammer", "", setup.hammer_mass_kg, setup.hammer_mass_u_kg),
        ("accelerometer", "", setup.accelerometer_mass_kg, setup.accelerometer_mass_u_kg),
        *((item.name, item.material, item.mass_kg, item.mass_u_kg) for item in setup.samples),
    ]

    def refer(field: str, digits: int) -> list[str]:
        shown = SETUP_FIELDS[field]
        values = (getattr(item, field) * shown.scale for item in setup.samples)
        return ["", "", *(format_number(value, digits) for value in values)]

    roles = ["", "part of every m2"] + [
        "control sample" if item.name == setup.control_sample else "" for item in setup.samples
    ]
    columns = [
        make_text_column("Body", [name for name, *_ in rows]),
        make_text_column("Material", [material for _, material, *_ in rows]),
        make_column("Mass [g]", [format_number(mass * GRAM, 2) for *_, mass, _ in rows]),
        make_column("u [g]", [f"{wide * GRAM:.2g}" if wide else MISSING for *_, wide in rows]),
        make_column("Ref. τp [µs]", refer("reference_contact_time_s", 2)),
        make_column("Ref. k2 [MN/m]", refer("reference_stiffness_n_per_m", 2)),
        make_column("Ref. c2 [N s/m]", refer("reference_damping_coefficient_n_s_per_m", 0)),
        make_text_column("Role", roles),
    ]
    note = (
        "Masses of samples are without accelerometer. u: standard uncertainty. Ref.: what the"
        " sample is expected to show, published or from earlier work."
    )
    return make_table("Bodies", columns, [note])


def _tabulate_sensors(sensors: Sequence[SensorResults]) -> list[Part]:
    if not sensors:
        return []
    names = ("quantity", "unit", "sensitivity_v_per_unit", "full_scale", "serial_number",
             "calibration_date")  # fmt: skip
    cells = {
        name: [SETUP_FIELDS[name].format(getattr(sensor, name) or "") for sensor in sensors]
        for name in names
    }
    columns = [
        make_text_column("Sensor", [sensor.channel for sensor in sensors]),
        make_text_column("Quantity", cells["quantity"]),
        make_text_column("Unit", cells["unit"]),
        make_column("Sensitivity [mV per unit]", cells["sensitivity_v_per_unit"]),
        make_column("Full scale [unit]", cells["full_scale"]),
        make_text_column("Serial number", cells["serial_number"]),
        make_text_column("Calibrated", cells["calibration_date"]),
    ]
    return [make_table("Sensors, by their calibration sheets", columns)]


def _tabulate_acquisitions(acquisitions: Sequence[Acquisition]) -> list[Part]:
    rows = [(item, channel) for item in acquisitions for channel in item.channels]
    if not rows:
        return []
    columns = [
        make_text_column("Channel", [channel.name for _, channel in rows]),
        make_column("Rate [kHz]", [f"{item.sampling_rate * 1e-3:.7g}" for item, _ in rows]),
        make_text_column(
            "Output", ["counts" if channel.is_counted else "numbers" for _, channel in rows]
        ),
        make_column("Scale [m/s² per unit]", [f"{channel.scale:.7g}" for _, channel in rows]),
        make_column("Offset [m/s²]", [f"{channel.offset:.7g}" for _, channel in rows]),
        make_column(
            "Full scale [m/s²]",
            [
                f"{channel.full_scale:.7g}" if channel.full_scale else MISSING
                for _, channel in rows
            ],
        ),
    ]
    note = "Acceleration is scale times output plus offset, as every block of the recording says."
    return [make_table("Sampling and calibration", columns, [note])]


def _fold_settings(settings: SettingsResults) -> Folded:
    names = [field.name for field in fields(settings)]
    shown = [SETTINGS[name] for name in names]
    columns = [
        make_text_column("Setting", [item.label for item in shown]),
        make_column(
            "Value",
            [
                item.format(getattr(settings, name))
                for name, item in zip(names, shown, strict=True)
            ],
        ),
        make_text_column("Unit", [item.unit for item in shown]),
    ]
    title = "Settings of judgement and evaluation"
    return Folded(title, (make_table(title, columns),))


def _list_software(provenance: Provenance | None) -> list[Part]:
    if provenance is None:
        return []
    parts: list[Part] = []
    if provenance.versions:
        columns = [
            make_text_column("Software", [name for name, _ in provenance.versions]),
            make_text_column("Version", [text for _, text in provenance.versions]),
        ]
        parts.append(Folded("Software that recorded it", (make_table("Software", columns),)))
    if provenance.parameters:
        listings = tuple(Listing(node, text.rstrip()) for node, text in provenance.parameters)
        parts.append(Folded(f"Parameters of {len(listings)} nodes", listings))
    return parts
