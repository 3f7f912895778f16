"""Items, instruments, settings, recording and software of a test."""

import math
from collections.abc import Iterator, Sequence

from impact_rig.configuration.particulars import (
    INSTRUMENT,
    INSTRUMENTS,
    OF_SAMPLE,
    SAMPLE,
    Particulars,
)
from impact_rig.core.given.sensors import CHANNELS, Sensor, describe_calibration_age
from impact_rig.core.given.setup import (
    DEFAULT_CLOCK_UNCERTAINTY,
    AnalysisSettings,
    RigSetup,
    Sample,
    format_angle,
)
from impact_rig.present.report.page import Facts, Folded, Paragraph, Part, Section
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import MEGA, MISSING, format_time, is_dated
from impact_rig.results.table import (
    Column,
    Table,
    list_table,
    make_table,
    make_text_column,
    read_column,
)
from impact_rig.results.traces import Provenance, ReportedCampaign, TracedCampaign

GRAM = 1e3
"""Kilograms to grams."""
WITHOUT_TRACES = (
    "This report was made from results alone: traces, Fig. 5, date, calibration and software are"
    " missing. Make it from the recording, session.mcap, to see them."
)


SETTINGS = {
    "cutoff_frequency": ("low-pass, 0 for none", "kHz", 1e-3),
    "pulse_factor": ("F in τp = F w50", "", 1.0),
    "pre_trigger": ("record before the trigger", "ms", 1e3),
    "record_duration": ("length of a record", "ms", 1e3),
    "detection_level": ("pulse found from, of full scale", "%", 100.0),
    "minimum_peak": ("weak below, of full scale", "%", 100.0),
    "maximum_peak": ("overload above, of full scale", "%", 100.0),
    "double_hit_level": ("second pulse that makes a double hit, of the first", "%", 100.0),
    "contact_exponent": ("n of the contact law, 0 where it is fitted", "", 1.0),
}
"""Fields of `AnalysisSettings`: label, unit, and scale to it."""


def make_items_section(run: ReportedCampaign, stated: Particulars) -> Section:
    """Return the section on what was tested, and with which instruments."""
    results = run.campaign.results
    instruments = _tabulate_instruments(results.setup, stated, _list_measured(run))
    parts: list[Part] = [_tabulate_bodies(results, stated), *instruments]
    if not stated.get("report", "traceability"):
        parts.append(Paragraph(_trace_to_si(results.setup, stated)))
    return Section("Items and instruments", tuple(parts))


def _list_measured(run: ReportedCampaign) -> list[str]:
    """Return the sensors that measured, by their tables in the rig file."""
    channels = max((len(hit.recorded.calibrations) for hit in run.campaign.hits), default=0)
    return [f"source.{channel}" for channel in CHANNELS[:channels]]


def _trace_to_si(setup: RigSetup, stated: Particulars) -> str:
    """Return by which calibrations the results are traceable."""
    by = [
        f"{called} by certificate {certificate}"
        for table, called in INSTRUMENTS.items()
        if (certificate := _state_fact(setup, stated, table, "certificate"))
    ]
    if not by:
        return "Traceability to the SI is not stated: no instrument has a certificate here."
    return f"The results are traceable to the SI by calibrations: {'; '.join(by)}."


def make_setup_section(run: ReportedCampaign) -> Section:
    """Return the section on settings, recording and software."""
    parts: list[Part] = [] if run.campaign.hits else [Paragraph(WITHOUT_TRACES)]
    return Section("Set-up and recording", (*parts, Facts(_list_facts(run))))


def make_sampling_section(run: ReportedCampaign) -> Section:
    """Return the section on the channels' scales and the analysis, for the annex."""
    settings = _list_settings(run.campaign.results.setup.analysis)
    folded = Folded("Settings of judgement and evaluation", (settings,))
    recorder = () if run.provenance is None else (Facts(_list_recorder_facts(run.provenance)),)
    parts = (*recorder, *_tabulate_calibrations(run.campaign), folded)
    return Section("Sampling and settings", parts)


def find_test_days(provenance: Provenance | None) -> tuple[str, str]:
    """Return the first and the last day of a run in universal time, empty if it has no date."""
    if provenance is None or not is_dated(provenance.start_time):
        return "", ""
    ends = provenance.start_time, provenance.end_time
    first, last = (format_time(end).partition(" ")[0] for end in ends)
    return first, last


def _list_facts(run: ReportedCampaign) -> tuple[tuple[str, str], ...]:
    setup = run.campaign.results.setup
    return (
        ("Impact speed v1", _describe_speeds(setup)),
        ("Clock", _describe_clock(setup.clock_uncertainty)),
        ("Hammer stiffness k1", _describe_hammer_stiffness(setup)),
        *(_list_recording_facts(run.provenance) if run.provenance is not None else ()),
    )


def _list_recording_facts(provenance: Provenance) -> Iterator[tuple[str, str]]:
    for file in provenance.files:
        yield "File", f"{file.name}, {file.size / 1e6:.4g} MB, SHA-256 {file.sha256}"
    is_sound = "sound: every checksum is right and nothing is missing"
    yield "Condition", "; ".join(provenance.problems) or is_sound
    for time, text in provenance.notes:
        yield f"Note, {format_time(time)}" if time else "Notes", text


def _list_recorder_facts(provenance: Provenance) -> tuple[tuple[str, str], ...]:
    duration = (provenance.end_time - provenance.start_time) * 1e-9
    return (
        ("Duration", f"{duration:.1f} s" if is_dated(provenance.start_time) else ""),
        # Only a recorder that was there knows.
        ("Lost while recorded", provenance.losses or ("nothing" if provenance.ended else "")),
        ("Ended", provenance.ended or ""),
        ("Recorded by", ", ".join(f"{name} {number}" for name, number in provenance.versions)),
    )


def _format_value(value: float, scale: float = 1.0) -> str:
    """Return a value of the set-up; a dash where it is unknown."""
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


def _tabulate_bodies(results: Results, stated: Particulars) -> Table:
    """Return hammer, accelerometer and the samples that were struck."""
    setup, carried = results.setup, results.setup.samples
    # One line for a sample, from however many angles it is struck.
    struck = [carried.find(sample.name) for sample in results.samples]
    samples = {item.body: item for item in struck}.values()
    # A mass of zero was not stated.
    mass, uncertainty = carried.accelerometer_mass, carried.accelerometer_mass_uncertainty
    bodies = [
        Sample("hammer", setup.hammer_mass, mass_uncertainty=setup.hammer_mass_uncertainty),
        Sample("accelerometer", mass or math.nan, mass_uncertainty=uncertainty),
        *samples,
    ]
    roles = ["", "part of every m2"] + [
        "control sample" if item.name == carried.find_control(item.release_angle) else ""
        for item in samples
    ]
    expected = "Ref.: expected of the sample, as published or from earlier work."
    wide = [body.mass_uncertainty * GRAM for body in bodies]
    columns = [
        make_text_column("Item", [body.body for body in bodies]),
        make_text_column("Material", [body.material for body in bodies]),
        *(
            make_text_column(
                entry.label, [stated.get(OF_SAMPLE + body.body, entry.key) for body in bodies]
            )
            for entry in SAMPLE
        ),
        read_column("Mass [g]", bodies, "mass", 2),
        Column(
            "u [g]",
            [f"{value:.2g}" if value else MISSING for value in wide],
            note="u: standard uncertainty.",
        ),
        read_column("Ref. τp [µs]", bodies, "reference_contact_time", 2, expected),
        read_column("Ref. k2 [MN/m]", bodies, "reference_stiffness", 2, expected),
        read_column("Ref. c2 [N s/m]", bodies, "reference_damping_coefficient", 0, expected),
        make_text_column("Role", roles),
    ]
    return make_table("Items", columns, ["Masses of samples are without accelerometer."])


def list_calibration_warnings(
    setup: RigSetup, stated: Particulars, provenance: Provenance | None
) -> list[str]:
    """Return in one sentence each which instruments were calibrated too long before the tests."""
    warnings = []
    day = find_test_days(provenance)[0] or stated.get("report", "tested")
    for table, called in INSTRUMENTS.items():
        name = f"{called} {_state_fact(setup, stated, table, 'serial_number')}".rstrip()
        calibrated = _state_fact(setup, stated, table, "calibration_date")
        due = _state_fact(setup, stated, table, "calibration_due")
        if text := describe_calibration_age(name, calibrated, day, due):
            warnings.append(text)
    return warnings


def _find_sensors(setup: RigSetup) -> dict[str, Sensor]:
    """Return the sensors by their tables in the rig file."""
    return {f"source.{sensor.channel}": sensor for sensor in setup.sensors}


def _state_fact(setup: RigSetup, stated: Particulars, table: str, key: str) -> str:
    """Return an instrument's properties: as a person states them, else as recorded."""
    sensor = _find_sensors(setup).get(table)
    serial = stated.get(table, "serial_number")
    # What was recorded of another sensor is not true of this one.
    if sensor is None or (serial and sensor.serial_number not in ("", serial)):
        return stated.get(table, key)
    return stated.get(table, key) or getattr(sensor, key, "")


def _tabulate_instruments(
    setup: RigSetup, stated: Particulars, measured: Sequence[str]
) -> list[Table]:
    """Return sensors, digitizer and balance: who made them, their certificates, their sheets."""
    sensors = _find_sensors(setup)
    rows = [
        name
        for name in INSTRUMENTS
        if name in sensors or name in measured or stated.list_facts(name)
    ]
    columns = [make_text_column("Instrument", [INSTRUMENTS[name] for name in rows])]
    columns += [
        make_text_column(
            entry.label, [_state_fact(setup, stated, name, entry.key) for name in rows]
        )
        for entry in INSTRUMENT
    ]
    columns.append(
        make_text_column(
            "Measures",
            [
                f"{it.quantity} [{it.unit}]"
                if (it := sensors.get(name))
                else "not stated" * (name in measured)
                for name in rows
            ],
        )
    )
    for field, header, scale in (
        ("sensitivity", "Sensitivity [mV per unit]", 1e3),
        ("full_scale", "Full scale [unit]", 1.0),
        ("resonance", "Resonance [kHz]", 1e-3),
        ("low_corner", "Low corner [Hz]", 1.0),
        ("upper_corner", "Upper corner [kHz]", 1e-3),
    ):
        values = [getattr(sensors.get(name), field, 0.0) or math.nan for name in rows]
        columns.append(Column(header, [_format_value(value, scale) for value in values]))
    return list_table("Instruments, by their calibration sheets", columns)


def _tabulate_calibrations(campaign: TracedCampaign) -> Sequence[Table]:
    found = [*dict.fromkeys(it for hit in campaign.hits for it in hit.recorded.calibrations)]
    columns = [
        make_text_column("Channel", [item.name for item in found]),
        Column("Rate [kHz]", [f"{item.sampling_rate * 1e-3:.7g}" for item in found]),
        make_text_column("Output", ["counts" if item.is_counted else "numbers" for item in found]),
        Column("Scale [m/s² per unit]", [f"{item.scale:.7g}" for item in found]),
        Column("Offset [m/s²]", [f"{item.offset:.7g}" for item in found]),
        Column(
            "Full scale [m/s²]", [_format_value(item.full_scale or math.nan) for item in found]
        ),
    ]
    note = "Acceleration is scale times output plus offset, as every block of the recording says."
    return list_table("Sampling and calibration", columns, [note])


def _list_settings(settings: AnalysisSettings) -> Facts:
    rows = []
    for name, value in vars(settings).items():
        label, unit, scale = SETTINGS[name]
        rows.append((label, f"{_format_value(value, scale)} {unit}".rstrip()))
    return Facts(tuple(rows))
