"""The rig file: a TOML file in which a laboratory describes its rig and its samples."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from datetime import datetime
from importlib import resources
from pathlib import Path
from typing import Any

from impact_rig.configuration.parameters import PARAMETERS
from impact_rig.configuration.particulars import (
    INSTRUMENT_KEYS,
    MEASURANDS,
    NOTHING_STATED,
    Particulars,
    parse_particulars,
)
from impact_rig.configuration.toml_table import (
    REQUIRED,
    TomlTable,
    make_values,
    parse_toml_table,
    read_toml_file,
)
from impact_rig.configuration.units import (
    parse_quantity,
    parse_reading,
    parse_sensitivity,
    read_given,
)
from impact_rig.core.given.errors import ParameterError, check_name
from impact_rig.core.given.sensors import (
    CHANNELS,
    QUANTITIES,
    Sensor,
    compute_scale,
    normalize_unit,
)
from impact_rig.core.given.setup import (
    DEFAULT_CLOCK_UNCERTAINTY,
    PAPER_SETUP,
    AnalysisSettings,
    RigSetup,
    Sample,
    SampleSet,
)

ANALYSIS_QUANTITIES = {
    "cutoff_frequency": ("Hz", "50 kHz"),
    "pre_trigger": ("s", "200 us"),
    "record_duration": ("s", "2 ms"),
}
"""Settings that have a unit; the others are plain numbers."""


def parse_settings(document: TomlTable) -> dict[str, float]:
    """Return the settings that the table [analysis] gives, in SI units, by their names.

    Parameters
    ----------
    document : TomlTable
        The whole file.

    Raises
    ------
    ParameterError
        If one is unknown, or is no number.
    """
    table = document.take_table("analysis")
    table.check_keys(*(item.name for item in fields(AnalysisSettings)))
    numbers = {key: table.take_number(key) for key in table if key not in ANALYSIS_QUANTITIES}
    stated = [(key, of) for key, of in ANALYSIS_QUANTITIES.items() if key in table]
    return numbers | {key: table.take_quantity(key, *of) for key, of in stated}


def read_settings(given: Mapping[str, Any]) -> dict[str, float]:
    """Return the settings that a program gives, in SI units, as `parse_settings` does.

    Programs and the command line call the cutoff frequency ``cutoff``.
    """
    known = {item.name.removesuffix("_frequency"): item.name for item in fields(AnalysisSettings)}
    settings = {}
    for name, value in given.items():
        check_name("setting", name, known)
        unit, example = ANALYSIS_QUANTITIES.get(known[name], ("", "2"))
        if isinstance(value, str) and not unit:
            raise ParameterError(f"{name} is {value!r}: it must be a number")
        number = read_given(name, value, unit or "1", example)
        if number is not None:
            settings[known[name]] = number
    return settings


FREQUENCIES = {
    "resonance": "70 kHz",
    "resonance_uncertainty": "1 kHz",
    "low_corner": "0.5 Hz",
    "low_corner_uncertainty": "0.1 Hz",
    "upper_corner": "50 kHz",
    "upper_corner_uncertainty": "2 kHz",
}
"""Frequencies of a sensor, with an example each."""
RESPONSE_KEYS = (*FREQUENCIES, "resonance_damping", "sensitivity_uncertainty")
"""Keys of a sensor in rig files and files of channels."""
SENSOR_KEYS = ("quantity", "sensitivity", "full_scale", *INSTRUMENT_KEYS, *RESPONSE_KEYS)
"""Keys of a calibration sheet; the other keys of the table are the driver's."""


def parse_sensors(source: TomlTable) -> tuple[Sensor, ...]:
    """Return the sensors of the channels that the table [source] has; raises `ParameterError`."""
    return tuple(
        _parse_sensor(channel, source.take_table(channel))
        for channel in CHANNELS
        if channel in source
    )


def _parse_sensor(channel: str, table: TomlTable) -> Sensor:
    quantity = table.take_choice("quantity", tuple(QUANTITIES), "acceleration")
    voltage, unit = math.nan, QUANTITIES[quantity][0]
    if "sensitivity" in table:
        with table.locating("sensitivity"):
            found = parse_sensitivity(f"sensitivity of {table.place}", table["sensitivity"])
        voltage, unit = found.voltage, _check_unit(table, "sensitivity", found.unit, quantity)
    if quantity == "force" and channel != "hammer":
        raise table.refuse("quantity", "acceleration: force is measured on the hammer only")
    return Sensor(
        channel=channel,
        quantity=quantity,
        unit=unit,
        sensitivity=voltage,
        full_scale=_take_full_scale(table, quantity, unit),
        serial_number=table.take_text("serial_number"),
        calibration_date=table.take_date("calibration_date"),
        **parse_response(table),
    )


def parse_response(table: TomlTable) -> dict[str, Any]:
    """Return a sensor's stated properties, by field of `Sensor`; raises `ParameterError`."""
    stated: dict[str, Any] = {
        key: table.take_quantity(key, "Hz", example, 0.0, low=0.0)
        for key, example in FREQUENCIES.items()
        if key in table
    }
    for key in ("resonance_damping", "sensitivity_uncertainty"):
        if key in table:
            stated[key] = table.take_number(key, 0.0, 1.0, 0.0)
    with table.locating():
        Sensor(CHANNELS[0], **stated)
    return stated


def take_trigger_level(source: TomlTable, moving_mass: float) -> float | None:
    """Return the acceleration of the hammer that triggers [m/s^2]; None: it is not stated.

    Parameters
    ----------
    moving_mass : float
        Of the hammer where its sensor measures a force [kg], else NaN.

    Raises
    ------
    ParameterError
        If it is no acceleration or, of a force sensor, force.
    """
    if "trigger_level" not in source:
        return None
    with source.locating("trigger_level"):
        value, unit = parse_reading("trigger_level of [source]", source["trigger_level"])
        return value * compute_scale(unit, moving_mass)


def take_barrier_distance(table: TomlTable) -> float:
    """Return the hammer's way between the edges of a light barrier [m]."""
    return table.take_quantity("distance", "m", "10 mm", low=1e-6)


def _take_full_scale(table: TomlTable, quantity: str, unit: str) -> float:
    """Return the largest value that the sensor takes [unit]; 0: not stated."""
    if "full_scale" not in table:
        return 0.0
    with table.locating("full_scale"):
        value, stated = parse_reading(f"full_scale of {table.place}", table["full_scale"])
    stated = _check_unit(table, "full_scale", stated, quantity)
    if not 0.0 < value < math.inf:
        raise table.refuse("full_scale", "above zero, and finite")
    # For a force, the mass that it acts on cancels.
    return value * compute_scale(stated, 1.0) / compute_scale(unit, 1.0)


def _check_unit(table: TomlTable, key: str, unit: str, quantity: str) -> str:
    name = normalize_unit(unit)
    if name not in QUANTITIES[quantity]:
        raise table.refuse(key, f"in {' or '.join(QUANTITIES[quantity])}: it is of a {quantity}")
    return name


def read_today() -> str:
    """Return the local date, year-month-day."""
    return datetime.now().astimezone().date().isoformat()


@dataclass(frozen=True)
class RigFile:
    """The content of a rig file."""

    setup: RigSetup
    path: Path | None = None  # None: the paper's rig
    particulars: Particulars = NOTHING_STATED  # for reports
    release_angles: tuple[float, ...] = ()  # [rad], for every sample; empty: the set-up's own
    check_mass: Sample | None = None  # struck once a day, before all else; None: it is not
    hammer: Mapping[str, Any] = field(default_factory=dict)  # parameters of the hammer node
    # For the drivers; empty: the virtual rig.
    source: TomlTable = field(default_factory=lambda: TomlTable({}, "[source]"))
    holder: TomlTable = field(default_factory=lambda: TomlTable({}, "[holder]"))
    document: TomlTable = field(default_factory=lambda: TomlTable({}))  # all of it, for the lines

    def list_topics(self) -> list[str]:
        """Return the topics of other nodes that the source reads, by the driver `topic`."""
        if self.source.get("driver") != "topic":
            return []
        tables = [item for item in self.source.values() if isinstance(item, Mapping)]
        topics = [str(item.get("channel", "")).partition(".")[0] for item in tables]
        return list(dict.fromkeys(topics))


def read_template() -> str:
    """Return the paper's rig as a rig file, to copy and change."""
    return resources.files("impact_rig.configuration").joinpath("paper.toml").read_text("utf-8")


def read_rig_file(path: Path) -> RigFile:
    """Read a rig file.

    Raises
    ------
    FileError
        If it does not exist, is not TOML, or has a wrong value; the message names file, line,
        place and value.
    """
    return replace(read_toml_file(path, "rig file", parse_rig_file), path=path.resolve())


def load_rig_file(path: Path | str | None) -> RigFile:
    """Read a rig file; without one, return the paper's rig."""
    return read_rig_file(Path(path)) if path else RigFile(PAPER_SETUP)


def parse_rig_file(text: str) -> RigFile:
    """Read the text of a rig file.

    Raises
    ------
    ParameterError
        If it is not TOML, has an unknown key, lacks a key, or has a wrong value.
    """
    document = parse_toml_table(text)
    particulars = parse_particulars(document)
    source, holder = document.take_table("source"), document.take_table("holder")
    setup = _parse_setup(document, parse_sensors(source))
    return RigFile(
        setup=setup,
        particulars=particulars,
        release_angles=_parse_angles(document.take_table("hammer"), setup),
        check_mass=_parse_check_mass(document),
        hammer=_parse_swing(document.take_table("hammer"), holder),
        source=source,
        holder=holder,
        document=document,
    )


SWING = {
    "hammer_mass": ("mass", "kg", "100 g", REQUIRED),
    "hammer_mass_uncertainty": ("mass_uncertainty", "kg", "0.29 g", 0.0),
    "impact_speed": ("impact_speed", "m/s", "8.19 cm/s", REQUIRED),
    "impact_speed_uncertainty": ("impact_speed_uncertainty", "m/s", "0.1 cm/s", 0.0),
    "release_angle": ("release_angle", "rad", "3.7 deg", math.nan),
}
"""Fields of the set-up in the table [hammer]: key, unit, example, default."""


def _parse_setup(document: TomlTable, sensors: tuple[Sensor, ...]) -> RigSetup:
    hammer, digitizer = document.take_table("hammer"), document.take_table("digitizer")
    hammer.check_keys(*(key for key, *_ in SWING.values()), "lead_time", "release_angles")
    samples, settings = _parse_samples(document), parse_settings(document)
    settings = _follow_record(settings, document.take_table("source"))
    with document.take_table("analysis").locating():
        analysis = AnalysisSettings(**settings)
    digitizer.check_keys("clock_uncertainty", *INSTRUMENT_KEYS)
    given: dict[str, Any] = {name: hammer.take_quantity(*of) for name, of in SWING.items()}
    given |= {key: document.take_text(key) for key in ("name", "description")}
    given["clock_uncertainty"] = digitizer.take_number(
        "clock_uncertainty", 0.0, 1.0, DEFAULT_CLOCK_UNCERTAINTY
    )
    with hammer.locating():
        return RigSetup(samples=samples, analysis=analysis, sensors=sensors, **given)


PRE_TRIGGER_MARGIN = 1.5
"""Time recorded before the trigger, over the time that the analysis keeps before the impact [-]:
a pulse begins before it reaches the trigger level."""


def _follow_record(settings: dict[str, float], source: TomlTable) -> dict[str, float]:
    """Return settings that analyse the whole record, unless they state a duration."""
    recorded = source.take_quantity("record_duration", "s", "2.2 ms", math.nan)
    if "record_duration" in settings or math.isnan(recorded):
        return settings
    kept = settings.get("pre_trigger", AnalysisSettings.pre_trigger)
    margin = PRE_TRIGGER_MARGIN if source.get("driver", "virtual") != "virtual" else 1.0
    before = source.take_quantity("pre_trigger", "s", "300 us", margin * kept)
    if before >= recorded:  # refused with the plan
        return settings
    return {**settings, "record_duration": recorded - before + kept}


def _parse_angles(hammer: TomlTable, setup: RigSetup) -> tuple[float, ...]:
    """Return the angles [rad] from which every sample is struck, if there are several."""
    given = hammer.get("release_angles", [])
    if not isinstance(given, list):
        raise hammer.refuse("release_angles", 'a list like ["5 deg", "10 deg"]')
    with hammer.locating("release_angles"):
        angles = tuple(
            parse_quantity("release_angles of [hammer]", item, "rad", "5 deg") for item in given
        )
        if angles:
            setup.at_angles(angles)
    return angles


CHECK_NAME = "check mass"


def make_check_mass(mass: float, mass_uncertainty: float) -> Sample:
    """Return the free rigid mass [kg] of the operational check (ISO 7626-1)."""
    return Sample(CHECK_NAME, mass, mass_uncertainty=mass_uncertainty)


def _parse_check_mass(document: TomlTable) -> Sample | None:
    if "check_mass" not in document:
        return None
    table = document.take_table("check_mass")
    table.check_keys("mass", "mass_uncertainty")
    mass = table.take_quantity("mass", "kg", "150.2 g")
    uncertainty = table.take_quantity("mass_uncertainty", "kg", "10 mg", 0.0, low=0.0)
    with table.locating():
        return make_check_mass(mass, uncertainty)


def _parse_swing(hammer: TomlTable, holder: TomlTable) -> dict[str, Any]:
    """Return the hammer node's parameters in the tables [hammer] and [holder]."""
    known = PARAMETERS["hammer"]
    parameters: dict[str, Any] = {
        key: table.take_quantity(key, "s", example, low=0.0, high=known[key].high)
        for table, key, example in (
            (holder, "swing_time", "207 ms"),
            (holder, "return_time", "207 ms"),
            (hammer, "lead_time", "3 s"),
        )
        if key in table
    }
    if "confirm_return" in holder:
        parameters["confirm_return"] = holder.take_boolean("confirm_return")
    return parameters


def _parse_samples(document: TomlTable) -> SampleSet:
    common = document.take_table("samples")
    examples = {"accelerometer_mass": "3 g", "accelerometer_mass_uncertainty": "0.29 g"}
    common.check_keys("control", *examples)
    samples: dict[str, Sample] = {}
    for table in document.take_tables("sample"):
        sample = _parse_sample(table)
        if sample.name in samples:
            raise table.make_error("name", f"{table.place} appears twice: names are unique")
        samples[sample.name] = sample
    if not samples:
        raise document.make_error(
            "sample",
            "the rig file has no [[sample]]: `impact-rig up --template` prints a whole one, into"
            " which tables of drivers are put",
        )
    control = common.take_text("control")
    masses: dict[str, Any] = {
        key: common.take_quantity(key, "kg", example, 0.0) for key, example in examples.items()
    }
    with common.locating():
        return SampleSet(tuple(samples.values()), control, **masses)


def add_samples(setup: RigSetup, given: Mapping[str, Mapping[str, Any]]) -> RigSetup:
    """Return a set-up with further samples that a program gives, or others of the same names.

    Parameters
    ----------
    given : mapping of str to mapping
        Keys of [[sample]], by name; numbers are in SI units.

    Raises
    ------
    ParameterError
        If a key is unknown, or a value cannot be meant.
    """
    units = {"mass": "kg", "mass_uncertainty": "kg"}
    units |= {f"reference_{name}": unit for name, (unit, _) in MEASURANDS.items()}
    samples = {sample.name: sample for sample in setup.samples.samples}
    for name, keys in given.items():
        if not isinstance(keys, Mapping):
            raise ParameterError(
                f'sample {name!r} is {keys!r}: give its keys, like {{"mass": "60 g"}}'
            )
        table = TomlTable({"name": name, **make_values(keys, units)}, f"sample {name!r}")
        table.check_keys("name", "material", *units)
        samples[name] = _parse_sample(table)
    kept = replace(setup.samples, samples=tuple(samples.values()))
    return replace(setup, samples=kept)


def _parse_sample(table: TomlTable) -> Sample:
    references = {f"reference_{name}": found for name, found in MEASURANDS.items()}
    name, material = table.take_text("name"), table.take_text("material")
    numbers = {
        key: table.take_quantity(key, *of) for key, of in references.items() if key in table
    }
    numbers["mass"] = table.take_quantity("mass", "kg", "21.31 g")
    numbers["mass_uncertainty"] = table.take_quantity("mass_uncertainty", "kg", "0.003 g", 0.0)
    with table.locating():
        return Sample(name=name, material=material, **numbers)
